#include "terminal_link_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "study_report.hpp"
#include "terminal_link_claims.hpp"

namespace heft::studies {

using page::Hue;
using page::PlotSpec;
using page::Series;
using page::Style;
using page::Table;

namespace {

/// A mean over the seeds, and the range that holds all of them.
struct Curve {
  Series mean, range;
  std::vector<double> smallest, largest;
};

/// One base parameter of one estimator against the number of samples.
Curve parameter_curve(const Study& study, bool b, double period, ProtocolMethod method, std::size_t parameter,
                      double unit) {
  const bool lsm = method == ProtocolMethod::kLeastSquares;
  const Hue hue = lsm ? Hue::kVermillion : Hue::kBlue;
  Curve curve;
  curve.mean = {lsm ? "LSM, mean" : "IVM with (35), mean", {}, {}, {}, Style::kLine, hue};
  curve.range = {lsm ? "LSM, all seeds" : "IVM, all seeds", {}, {}, {}, Style::kBand, hue};
  for (const int n : samples_of(study)) {
    const Spread s = spread(values_of(study.runs, b, period, method, n, [&](const ProtocolPoint& p) {
      return unit * p.base_parameters[parameter];
    }));
    curve.mean.x.push_back(n);
    curve.mean.y.push_back(s.mean);
    curve.smallest.push_back(s.smallest);
    curve.largest.push_back(s.largest);
    curve.range.x.push_back(n);
    curve.range.y.push_back(s.smallest);
    curve.range.y_high.push_back(s.largest);
  }
  return curve;
}

/// Values to draw: the truth and all seeds, but early ones, which would flatten everything else.
std::pair<double, double> range_of(const std::vector<Curve>& curves, double truth, double period) {
  double lowest = truth, highest = truth;
  for (const Curve& curve : curves) {
    for (std::size_t k = 0; k < curve.mean.x.size(); ++k) {
      if (curve.mean.x[k] * period < (period < 0.003 ? 2.9 : 4.9)) continue;
      lowest = std::min(lowest, curve.smallest[k]);
      highest = std::max(highest, curve.largest[k]);
    }
  }
  const double margin = 0.25 * std::max(highest - lowest, 1e-6 + 0.02 * std::abs(truth));
  return {lowest - margin, highest + margin};
}

/// Keeps a curve inside a range. The mean begins where all seeds are inside; before, single wild values decide it.
void clip(Curve& curve, const std::pair<double, double>& range) {
  for (auto* values : {&curve.range.y, &curve.range.y_high}) {
    for (double& v : *values) v = std::clamp(v, range.first, range.second);
  }
  for (std::size_t k = 0; k < curve.mean.y.size(); ++k) {
    if (curve.smallest[k] < range.first || curve.largest[k] > range.second) {
      curve.mean.y[k] = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

}  // namespace

const std::vector<ProtocolMethod>& protocol_methods() {
  static const std::vector<ProtocolMethod> methods = {
      ProtocolMethod::kLeastSquares,      ProtocolMethod::kLiteralQuasiDiagonal,
      ProtocolMethod::kInstrumentModel,   ProtocolMethod::kInstrumentDelayed,
      ProtocolMethod::kInstrumentDesired, ProtocolMethod::kInstrumentForward};
  return methods;
}

std::vector<int> samples_of(const Study& study) {
  std::vector<int> samples;
  for (const ProtocolPoint& p : study.runs.front().points) {
    if (samples.empty() || samples.back() != p.samples) samples.push_back(p.samples);
  }
  return samples;
}

Table claim_table(const std::vector<Claim>& claims) {
  Table table({"", "claim", "scenario", "stated", "found"});
  for (const Claim& c : claims)
    table.add_row({c.holds ? "holds" : "DOES NOT HOLD", c.text, c.scenario, c.expected, c.found});
  return table;
}

PlotSpec parameter_plot(const Study& study, bool b, double period, std::size_t parameter, double unit,
                        const char* unit_name) {
  PlotSpec spec;
  spec.title = base_parameter_names()[parameter];
  spec.x_label = "number of samples";
  spec.y_label = fmt::format("[{}]", unit_name);
  spec.log_x = true;
  spec.width = 460;
  spec.height = 230;
  const double truth = unit * true_base_parameters()[parameter];
  std::vector<Curve> curves;
  for (const ProtocolMethod method : {ProtocolMethod::kLeastSquares, ProtocolMethod::kInstrumentModel}) {
    curves.push_back(parameter_curve(study, b, period, method, parameter, unit));
  }
  spec.y_range = range_of(curves, truth, period);
  for (Curve& c : curves) {
    clip(c, *spec.y_range);
    spec.series.push_back(std::move(c.range));
  }
  for (Curve& c : curves) spec.series.push_back(std::move(c.mean));
  spec.marks = {{page::Mark::Direction::kHorizontal, truth, "true"}};
  return spec;
}

PlotSpec error_plot(const Study& study, bool b, double period) {
  PlotSpec spec;
  spec.title = fmt::format("Error e against the number of samples, scenario {}, {:.0f} ms", scenario_name(b),
                           1e3 * period);
  spec.x_label = "number of samples";
  spec.y_label = "e (rms over seeds)";
  spec.log_x = true;
  spec.log_y = true;
  spec.y_range = std::pair<double, double>(0.002, 2.0);
  const std::map<ProtocolMethod, Hue> hues = {{ProtocolMethod::kLeastSquares, Hue::kVermillion},
                                              {ProtocolMethod::kLiteralQuasiDiagonal, Hue::kOrange},
                                              {ProtocolMethod::kInstrumentModel, Hue::kBlue},
                                              {ProtocolMethod::kInstrumentDelayed, Hue::kGreen},
                                              {ProtocolMethod::kInstrumentDesired, Hue::kPurple},
                                              {ProtocolMethod::kInstrumentForward, Hue::kSky}};
  for (const ProtocolMethod method : protocol_methods()) {
    Series s{to_string(method),
             {},
             {},
             {},
             method == ProtocolMethod::kInstrumentModel ? Style::kLine : Style::kDashed,
             hues.at(method)};
    if (method == ProtocolMethod::kLeastSquares) s.style = Style::kLine;
    for (const int n : samples_of(study)) {
      const Spread e = errors_of(study.runs, b, period, method, n);
      if (e.count == 0) continue;
      const double rms = e.rms;
      s.x.push_back(n);
      s.y.push_back(rms > 2.0 ? std::numeric_limits<double>::quiet_NaN() : rms);
    }
    spec.series.push_back(std::move(s));
  }
  return spec;
}

Table instrument_table(const Study& study) {
  Table table({"estimator", "A, 5 ms, 2000", "A, 5 ms, 20000", "A, 1 ms, 20000", "B, 5 ms, 2000",
               "B, 5 ms, 20000", "B, 1 ms, 20000"});
  for (const ProtocolMethod method : protocol_methods()) {
    std::vector<std::string> row{to_string(method)};
    for (const bool b : {false, true}) {
      for (const auto& [period, n] :
           {std::pair{0.005, 2000}, std::pair{0.005, 20000}, std::pair{0.001, 20000}}) {
        row.push_back(fmt::format("{:.4f}", errors_of(study.runs, b, period, method, n).rms));
      }
    }
    table.add_row(row);
  }
  return table;
}

Table base_table(const Study& study) {
  Table table({"parameter", "true", "nominal (seed 1)", "LSM", "IVM with (35)"});
  const std::vector<double> truth = true_base_parameters(), nominal = nominal_base_parameters(1);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    std::vector<std::string> row{base_parameter_names()[i], fixed(1e3 * truth[i], 3),
                                 fixed(1e3 * nominal[i], 3)};
    for (const ProtocolMethod method : {ProtocolMethod::kLeastSquares, ProtocolMethod::kInstrumentModel}) {
      const Spread s = spread(values_of(study.runs, true, 0.005, method, 20000,
                                        [&](const ProtocolPoint& p) { return 1e3 * p.base_parameters[i]; }));
      row.push_back(fmt::format("{} ± {:.3f}", fixed(s.mean, 3), s.deviation));
    }
    table.add_row(row);
  }
  return table;
}

Table startup_table(const Study& study, bool b, bool fast) {
  Table table({"samples", "seconds", "prior / LSM / IVM handed out", "e handed out (median)",
               "e handed out (largest)", "e of IVM unchecked (median)", "e of IVM unchecked (largest)"});
  const auto& seeds = study.startup[b ? 1 : 0][fast ? 1 : 0];
  const auto median = [](std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v.empty() ? 0.0 : v[v.size() / 2];
  };
  const auto print = [](double v) {
    return std::isfinite(v) ? page::number(v, 2) : std::string("no solution");
  };
  for (std::size_t k = 0; k < seeds.front().size(); ++k) {
    std::array<int, 3> sources{};
    std::vector<double> out, raw;
    for (const auto& points : seeds) {
      ++sources[static_cast<std::size_t>(points[k].source)];
      out.push_back(points[k].handed_out);
      raw.push_back(points[k].unchecked);
    }
    const int n = seeds.front()[k].samples;
    table.add_row({fmt::format("{}", n), fmt::format("{:.1f}", n * (fast ? 0.001 : 0.005)),
                   fmt::format("{} / {} / {}", sources[0], sources[1], sources[2]), print(median(out)),
                   print(*std::max_element(out.begin(), out.end())), print(median(raw)),
                   print(*std::max_element(raw.begin(), raw.end()))});
  }
  return table;
}

Table mass_column_table(const MassColumnCheck& check) {
  Table table({"parameter", "true", "(39), six rows", "(39') with the mass"});
  for (std::size_t i = 0; i < check.truth.size(); ++i) {
    table.add_row({terminal_parameter_names()[i], fixed(check.truth[i], 3),
                   i < check.without_mass.size() ? fixed(check.without_mass[i], 3) : "–",
                   fixed(check.with_mass[i], 3)});
  }
  return table;
}

Table uncorrected_rows_table(const UncorrectedRows& residual) {
  Table rows({"torque error, rms [mN m]", "joint 1", "joint 2", "joint 3", "joint 4"});
  const auto add_row = [&](const char* name, const std::array<double, 4>& v) {
    rows.add_row({name, fmt::format("{:.1f}", v[0]), fmt::format("{:.1f}", v[1]), fmt::format("{:.1f}", v[2]),
                  fmt::format("{:.1f}", v[3])});
  };
  add_row("no correction", residual.uncorrected);
  add_row("perfect k = 5 estimate added to the raw coefficients", residual.k5);
  add_row("the same as base values and zeros", residual.k5_base_values);
  add_row("perfect k = 5 estimate in heft's reduced parameters", residual.reduced);
  add_row("payload's mass carried into every row", residual.with_mass);
  return rows;
}

Table rank_table(const std::vector<RankCheck>& checks) {
  Table ranks({"k", "parameters", "identifiable", "gap of singular values [decades]"});
  for (const RankCheck& r : checks)
    ranks.add_row({fmt::format("{}", r.k), fmt::format("{}", r.columns), fmt::format("{}", r.rank),
                   fmt::format("{:.1f}", r.gap)});
  return ranks;
}

Table points_table(const Study& study) {
  std::vector<std::string> headers{"scenario",           "period",       "trajectory", "seed",
                                   "estimator",          "samples",      "e",          "torque_error_5_mNm",
                                   "torque_error_6_mNm", "amplification"};
  for (int i = 1; i <= 18; ++i) headers.push_back(fmt::format("x{}", i));
  Table table(headers);
  const auto add = [&](const std::vector<ProtocolRun>& runs) {
    for (const ProtocolRun& run : runs) {
      for (const ProtocolPoint& p : run.points) {
        std::vector<std::string> row{scenario_name(run.rotor_inertia),
                                     fmt::format("{}", run.period),
                                     fmt::format("{}", run.trajectory),
                                     fmt::format("{}", run.seed),
                                     to_string(p.method),
                                     fmt::format("{}", p.samples),
                                     fmt::format("{:.6g}", p.error),
                                     fmt::format("{:.6g}", p.torque_error_5),
                                     fmt::format("{:.6g}", p.torque_error_6),
                                     fmt::format("{:.6g}", p.amplification)};
        for (const double v : p.base_parameters) row.push_back(fmt::format("{:.9g}", v));
        table.add_row(row);
      }
    }
  };
  add(study.runs);
  add(study.other_runs);
  return table;
}

}  // namespace heft::studies
