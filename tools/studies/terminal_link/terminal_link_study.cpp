#include "terminal_link_study.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heft/host/parallel.hpp"

#include "terminal_link_claims.hpp"

namespace heft::studies {
namespace {

constexpr double kSlow = 0.005, kFast = 0.001;
constexpr double kSigma = 10.0;
const std::vector<int> kProtocolSamples = {300,  500,  700,  1000,  1500,  2000,
                                           3000, 5000, 7000, 10000, 14000, 20000};
const std::vector<int> kStartupSamples = {100,  200,  300,  400,  500,  600, 800,
                                          1000, 1500, 2000, 3000, 4000, 6000};

}  // namespace

Spread spread(const std::vector<double>& values) {
  Spread s;
  s.count = static_cast<int>(values.size());
  if (values.empty()) {
    s.mean = s.rms = s.smallest = s.largest = std::numeric_limits<double>::quiet_NaN();
    return s;
  }
  double squares = 0;
  for (const double v : values) {
    s.mean += v;
    squares += v * v;
  }
  s.mean /= s.count;
  s.rms = std::sqrt(squares / s.count);
  s.deviation =
      s.count > 1 ? std::sqrt(std::max(0.0, (squares - s.count * s.mean * s.mean) / (s.count - 1))) : 0.0;
  s.smallest = *std::min_element(values.begin(), values.end());
  s.largest = *std::max_element(values.begin(), values.end());
  return s;
}

std::vector<double> values_of(const std::vector<ProtocolRun>& runs, bool rotor_inertia, double period,
                              ProtocolMethod method, int samples,
                              const std::function<double(const ProtocolPoint&)>& quantity) {
  std::vector<double> values;
  for (const ProtocolRun& run : runs) {
    if (run.rotor_inertia != rotor_inertia || run.period != period) continue;
    for (const ProtocolPoint& p : run.points) {
      if (p.method == method && p.samples == samples) values.push_back(quantity(p));
    }
  }
  return values;
}

Spread errors_of(const std::vector<ProtocolRun>& runs, bool rotor_inertia, double period,
                 ProtocolMethod method, int samples) {
  return spread(values_of(runs, rotor_inertia, period, method, samples,
                          [](const ProtocolPoint& p) { return p.error; }));
}

bool Study::holds() const {
  const auto good = [](const Claim& c) { return c.holds; };
  return std::all_of(table.begin(), table.end(), good) &&
         std::all_of(requirements.begin(), requirements.end(), good);
}

Study run_study(const StudyOptions& options) {
  Study study;
  study.options = options;
  for (const bool b : {false, true}) {
    for (const double period : options.periods) {
      for (int seed = 1; seed <= options.seeds; ++seed) study.runs.push_back({b, period, 0, seed, {}});
    }
    for (int t = 1; t <= options.other_trajectories; ++t) {
      for (int seed = 1; seed <= options.other_seeds; ++seed)
        study.other_runs.push_back({b, kSlow, t, seed, {}});
    }
    for (int seed = 1; seed <= options.seeds; ++seed) study.quiet_runs.push_back({b, kSlow, 0, seed, {}});
  }
  study.noise_free.push_back({false, kSlow, 0, 1, {}});
  study.masses.resize(static_cast<std::size_t>(options.seeds));
  for (auto& by_period : study.startup) {
    for (auto& seeds : by_period) seeds.resize(static_cast<std::size_t>(options.seeds));
  }

  std::vector<std::function<void()>> jobs;
  const auto protocol = [&](ProtocolRun& run, double sigma, bool all) {
    jobs.push_back([&run, sigma, all] {
      ProtocolSettings settings;
      settings.rotor_inertia = run.rotor_inertia;
      settings.period = run.period;
      settings.acceleration_noise = sigma;
      settings.seed = run.seed;
      settings.exciting =
          run.trajectory == 0 ? exciting_trajectory() : random_exciting_trajectory(run.trajectory);
      settings.all_methods = all;
      settings.sample_counts = all ? kProtocolSamples : std::vector<int>{20000};
      run.points = run_protocol(settings);
    });
  };
  for (ProtocolRun& run : study.runs) protocol(run, kSigma, true);
  for (ProtocolRun& run : study.other_runs) protocol(run, kSigma, false);
  for (ProtocolRun& run : study.quiet_runs) protocol(run, 0.3, false);
  for (ProtocolRun& run : study.noise_free) protocol(run, 0.0, false);
  for (std::size_t s = 0; s < study.masses.size(); ++s) {
    jobs.push_back([&study, s] { study.masses[s] = mass_from_difference(static_cast<int>(s) + 1); });
    for (const bool b : {false, true}) {
      for (std::size_t fast = 0; fast < 2; ++fast) {
        jobs.push_back([&study, s, b, fast] {
          study.startup[b ? 1 : 0][fast][s] =
              startup(b, fast ? kFast : kSlow, static_cast<int>(s) + 1, kStartupSamples);
        });
      }
    }
  }
  jobs.push_back([&study] { study.mass_column = check_mass_column(); });
  jobs.push_back([&study] { study.uncorrected_rows = check_uncorrected_rows(); });
  jobs.push_back([&study] { study.ranks = check_ranks(); });
  jobs.push_back([&study] { study.forms = check_forms(1, 4000); });
  host::for_each_parallel(
      jobs.size(), [&](std::size_t i) { jobs[i](); }, options.progress);

  make_claims(study);
  return study;
}

}  // namespace heft::studies
