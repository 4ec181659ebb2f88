#include "support/null_log.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/validate/predict.hpp"

namespace heft::test {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;
using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

bool is_uneven(MeasurementFault fault) {
  return fault == MeasurementFault::kUnevenSamples || fault == MeasurementFault::kUnevenStamps || fault == MeasurementFault::kLateStamps;
}
bool is_sampled_evenly(MeasurementFault fault) {
  return fault == MeasurementFault::kUnevenStamps || fault == MeasurementFault::kLateStamps;
}

/// Of the stamp of a sample, in periods.
double jitter(MeasurementFault fault, Random& random) {
  constexpr double kMost = 0.2, kLate = 0.2, kInterrupted = 1.0 / 300.0;
  if (!is_uneven(fault)) return 0.0;
  if (fault != MeasurementFault::kLateStamps) return between(random, -kMost, kMost);
  const double late = kLate * std::abs(std::normal_distribution<double>()(random));
  return between(random, 0.0, 1.0) < kInterrupted ? between(random, 1.0, 4.0) : late;
}

/// When samples are taken, and what their stamps say.
struct Clock {
  VectorXd taken, stamps;  ///< [s]
};

Clock clock_of(const NullSpec& spec, double end, Random& random) {
  constexpr double kLeastStep = 0.02;  // of a period: what waited is stamped together
  const double period = 1.0 / spec.rate;
  const auto rows = static_cast<Index>((end - 3.0 * period) * spec.rate);
  Clock clock{VectorXd(rows), VectorXd(rows)};
  for (Index i = 0; i < rows; ++i) {
    const double even = period * static_cast<double>(i + 2);
    const double off = period * jitter(spec.fault, random);
    clock.stamps[i] = even + off;
    if (i > 0) clock.stamps[i] = std::max(clock.stamps[i], clock.stamps[i - 1] + kLeastStep * period);
    clock.taken[i] = is_sampled_evenly(spec.fault) ? even : even + off;
  }
  return clock;
}

/// What a drive makes of its positions: differences, twice through a first-order low-pass of 40 Hz.
MatrixXd velocities_of(const VectorXd& time, const MatrixXd& q) {
  constexpr double kCutoff = 40.0;
  MatrixXd qd = MatrixXd::Zero(q.rows(), q.cols());
  RowVectorXd first = RowVectorXd::Zero(q.cols()), second = first;
  for (Index i = 1; i < q.rows(); ++i) {
    const double step = time[i] - time[i - 1];
    const double share = 1.0 - std::exp(-2.0 * std::numbers::pi * kCutoff * step);
    first += share * ((q.row(i) - q.row(i - 1)) / step - first);
    second += share * (first - second);
    qd.row(i) = second;
  }
  return qd;
}

/// The rows that are not lost.
data::Log with_losses(const data::Log& log, Random& random) {
  constexpr double kLost = 0.01;
  std::vector<Index> kept;
  for (Index i = 0; i < log.time.size(); ++i) {
    if (i == 0 || i + 1 == log.time.size() || between(random, 0.0, 1.0) > kLost) kept.push_back(i);
  }
  data::Log left;
  left.path = log.path;
  left.time = log.time(kept);
  left.q = log.q(kept, Eigen::all);
  left.tau = log.tau(kept, Eigen::all);
  if (log.qd.cols() > 0) left.qd = log.qd(kept, Eigen::all);
  return left;
}

}  // namespace

std::string name_of(const NullSpec& spec) {
  constexpr const char* kNames[]{"white", "correlated_noise", "coarse_encoder", "uneven_samples",
                                 "uneven_stamps", "late_stamps"};
  return fmt::format("{}_{:.0f}{}", kNames[static_cast<std::size_t>(spec.fault)], spec.rate,
                     spec.velocities ? "_qd" : "");
}

NullLogs::NullLogs(const std::string& arm, unsigned seed)
    : arm_(make_undeclared_case("none", arm, seed)), seed_(seed) {
  constexpr double kSmooth = 30.0;  // [Hz]: only the simulated encoder's noise is above
  for (const data::Log* log : {&arm_.train, &arm_.validate}) {
    const Index last = log->time.size() - 1;
    Motion motion{(log->time[last] - log->time[0]) / static_cast<double>(last), {}, {}, {}};
    motion.q = data::low_pass_zero_phase(log->q, 1.0 / motion.period, kSmooth);
    motion.qd = data::differentiate(log->time, motion.q, 5);
    motion.qdd = data::differentiate(log->time, motion.qd, 5);
    motions_.push_back(std::move(motion));
  }
}

UndeclaredCase NullLogs::measured(const NullSpec& spec) const {
  constexpr double kSignWidth = 1e-3;  // of the simulated friction [rad/s, m/s]
  Random random(seed_ * 1000003ULL + static_cast<unsigned>(spec.fault) * 131U +
                static_cast<unsigned>(spec.rate) + (spec.velocities ? 7U : 0U));
  const double coarse = 2e-4 * std::pow(10.0, between(random, 0.0, 1.0));      // [rad]
  const double remembered = 5e-3 * std::pow(10.0, between(random, 0.0, 1.0));  // [s]
  std::normal_distribution<double> normal;
  const auto log_of = [&](const Motion& motion, const std::string& path) {
    const Clock clock = clock_of(spec, motion.period * static_cast<double>(motion.q.rows() - 2), random);
    const Index rows = clock.taken.size(), n = motion.q.cols();
    MatrixXd q(rows, n), qd(rows, n), qdd(rows, n);
    for (Index i = 0; i < rows; ++i) {  // a cubic between two points of the grid
      const auto k = static_cast<Index>(clock.taken[i] / motion.period);
      const double u = clock.taken[i] / motion.period - static_cast<double>(k), v = 1.0 - u;
      const RowVectorXd from = motion.period * motion.qd.row(k), to = motion.period * motion.qd.row(k + 1);
      const RowVectorXd way = motion.q.row(k + 1) - motion.q.row(k);
      q.row(i) = motion.q.row(k) + u * u * (3.0 - 2.0 * u) * way + u * v * (v * from - u * to);
      qd.row(i) = (6.0 * u * v * way + v * (1.0 - 3.0 * u) * from + u * (3.0 * u - 2.0) * to) / motion.period;
      qdd.row(i) = v * motion.qdd.row(k) + u * motion.qdd.row(k + 1);
    }
    data::Log log;
    log.path = path;
    log.time = clock.stamps;
    log.tau = validate::Predictor(arm_.truth, 0.0, {.sign_width = kSignWidth})
                  .rows(validate::MotionRows{clock.taken, q, qd, qdd, {}, {}});
    const double memory = std::exp(-1.0 / (remembered * spec.rate));
    for (Index j = 0; j < n; ++j) {
      const bool prismatic =
          arm_.truth.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
      const double fine = prismatic ? 5e-6 : 2e-5;
      const double step = spec.fault != MeasurementFault::kCoarseEncoder ? fine
                          : prismatic                                    ? 0.2 * coarse
                                                                         : coarse;
      double correlated = 0.0;
      for (Index i = 0; i < rows; ++i) {
        q(i, j) = std::round((q(i, j) + 0.3 * fine * normal(random)) / step) * step;
        log.tau(i, j) += arm_.noise[j] * normal(random);
        if (spec.fault != MeasurementFault::kCorrelatedNoise) continue;
        correlated =
            memory * correlated + std::sqrt(1.0 - memory * memory) * 2.0 * arm_.noise[j] * normal(random);
        log.tau(i, j) += correlated;
      }
    }
    if (spec.velocities) log.qd = velocities_of(clock.taken, q);
    log.q = std::move(q);
    return is_uneven(spec.fault) ? with_losses(log, random) : log;
  };
  UndeclaredCase c = arm_;
  c.name = fmt::format("{}_{}", name_of(spec), seed_);
  c.rate = spec.rate;
  c.has_qd = spec.velocities;
  c.train = log_of(motions_[0], arm_.train.path);
  c.validate = log_of(motions_[1], arm_.validate.path);
  return c;
}

}  // namespace heft::test
