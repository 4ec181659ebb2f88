// What the forms of the terminal-link estimator cost a sample.
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Dense>

#include "heft/core/control/terminal_link_cycle.hpp"
#include "heft/core/estimate/covariance_recursion.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/host/error.hpp"
#include "operation_count.hpp"

namespace heft::bench {
namespace {

/// A sink that hands on to the production sink and notes what the rows alone cost.
template <typename Inner>
struct MeasuringSink {
  const Inner& inner;
  OperationCount& rows;
  template <int J, typename U, typename Acc, typename... Probes>
  void link(const U& u, const Acc& acc, const Probes&... probes) const {
    const OperationCount before = counter();
    inner.template link<J>(u, acc, probes...);
    rows += counter() - before;
  }
};

/// Cost of kinematics, measured rows and instrument rows of terminal_rows on its own.
template <int First>
std::vector<std::pair<std::string, OperationCount>> row_stages() {
  using Arm = ArmOf<Counted>;
  using Layout = TerminalLayout<Arm, First>;
  const Sample& s = samples()[100];
  const auto q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd), a = vector_of<Counted>(s.measured),
             b = vector_of<Counted>(s.instrument);
  const auto trig = terminal_trigonometry<Arm, First>(q);
  std::vector<std::pair<std::string, OperationCount>> out;
  OperationCount rows_one;
  std::array<TerminalRows<Counted, Layout>, 1> one{};
  std::array<TerminalRows<Counted, Layout>, 2> two{};
  const structural::TerminalRowSink<Counted, Layout, 1> sink{one};
  const OperationCount pass = counted([&] {
    structural::pass_links<Arm, First, 1>(trig, q, qd, std::array{a},
                                          MeasuringSink<decltype(sink)>{sink, rows_one});
  });
  const OperationCount trigonometry = counted([&] { (void)terminal_trigonometry<Arm, First>(q); });
  const OperationCount both = counted([&] {
    terminal_rows<Arm, First, 2>(trig, q, qd, {a, b}, Counted(0.0), two);
  });
  OperationCount kinematics = pass - rows_one;
  kinematics += trigonometry;
  out.emplace_back("kinematics", kinematics);
  out.emplace_back("rows", rows_one);
  out.emplace_back("instrument_rows", both - pass);
  return out;
}

/// Batch instrumental variables (least squares) of the same rows, by a general solver.
template <int First>
Eigen::VectorXd batch(int count, bool least_squares) {
  using Arm = ArmOf<double>;
  using Layout = TerminalLayout<Arm, First>;
  constexpr int kP = Layout::kParameters;
  Eigen::MatrixXd phi = Eigen::MatrixXd::Zero(kP, kP);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kP);
  for (int j = 0; j < count; ++j) {
    const Sample& s = samples()[static_cast<std::size_t>(j)];
    const auto q = vector_of<double>(s.q);
    std::array<TerminalRows<double, Layout>, 2> rows{};
    terminal_rows<Arm, First, 2>(terminal_trigonometry<Arm, First>(q), q, vector_of<double>(s.qd),
                                 {vector_of<double>(s.measured), vector_of<double>(s.instrument)}, 0.0, rows);
    for (std::size_t r = 0; r < static_cast<std::size_t>(Layout::kRows); ++r) {
      const Eigen::Map<const Eigen::VectorXd> w(rows[0][r].data(), kP),
          z(rows[least_squares ? 0 : 1][r].data(), kP);
      phi += z * w.transpose();
      right += z * s.tau[static_cast<std::size_t>(First) + r];
    }
  }
  return phi.fullPivLu().solve(right);
}

/// Runs one estimator over the log, counting, and the same in double.
template <int First, EstimatorForm Form>
Result run(const std::string& name, bool shared, bool least_squares) {
  Result result{name, shared, least_squares, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    using Arm = ArmOf<Scalar>;
    using Estimator = TerminalLinkEstimator<Arm, First, Form>;
    using Rows = typename Estimator::Rows;
    constexpr bool kCounting = std::is_same_v<Scalar, Counted>;
    Estimator estimator;
    typename Estimator::Config config;
    config.solve_every = kSolveEvery;
    config.use_instruments = !least_squares;
    // The checks are about data, not about cost: every k is to be counted in its steady state, with the gate working
    // but never refusing, so that the batch sees the same rows.
    config.gate = Scalar(1e6);
    config.standstill_speed = Scalar(0);
    config.max_amplification = Scalar(1e6);
    config.max_amplification_least_squares = Scalar(1e6);
    typename Arm::Vector coulomb, viscous;
    for (int i = 0; i < kN; ++i) {
      coulomb[i] = Scalar(Description::kModel.actuation[static_cast<std::size_t>(i)].coulomb_friction);
      viscous[i] = Scalar(0.0);
    }
    if (estimator.configure(config, nominal<Scalar>(), coulomb, viscous) != Status::kOk) {
      throw Error("operation count: the estimator refused its settings");
    }
    const auto parameters = nominal<Scalar>();
    OperationCount row_cost, update_cost;
    const EstimateSource steady =
        least_squares ? EstimateSource::kLeastSquares : EstimateSource::kInstrumental;
    for (int j = 0; j < kSamples; ++j) {
      const Sample& s = samples()[static_cast<std::size_t>(j)];
      const auto q = vector_of<Scalar>(s.q), qd = vector_of<Scalar>(s.qd), a = vector_of<Scalar>(s.measured),
                 b = vector_of<Scalar>(s.instrument), tau = vector_of<Scalar>(s.tau);
      const bool warm = estimator.source() == steady && j >= kSamples / 2;
      typename Estimator::Record record;
      std::array<Rows, 2> rows{};
      OperationCount for_rows;
      if (shared) {
        const auto trig = joint_trigonometry<Arm>(q);
        typename Arm::Vector command;
        const OperationCount alone =
            counted([&] { inverse_dynamics<Arm>(parameters, trig, q, qd, b, command); });
        const OperationCount with = counted([&] {
          inverse_dynamics_with_rows<Arm, First>(parameters, trig, q, qd, b, a, Scalar(0.0), command, rows);
        });
        for_rows = with - alone;
      } else {
        for_rows = counted([&] {
          if (least_squares) {
            std::array<Rows, 1> single{};
            terminal_rows<Arm, First, 1>(terminal_trigonometry<Arm, First>(q), q, qd, {a}, Scalar(0.0),
                                         single);
            rows[0] = rows[1] = single[0];
          } else {
            terminal_rows<Arm, First, 2>(terminal_trigonometry<Arm, First>(q), q, qd, {a, b}, Scalar(0.0),
                                         rows);
          }
        });
      }
      const OperationCount for_update = counted([&] {
        if (estimator.update_rows(rows[0], rows[1], qd, tau, record) != Status::kOk) {
          throw Error("operation count: a sample was refused");
        }
      });
      if constexpr (kCounting) {
        OperationCount sample = for_rows;
        sample += for_update;
        note_worst(result.worst, sample);
        if (warm) {
          result.total += sample;
          row_cost += for_rows;
          update_cost += for_update;
          ++result.count;
        }
      }
    }
    (void)estimator.solve_now();
    for (const Scalar& v : estimator.estimate()) {
      last.push_back(number(v));
    }
    if constexpr (kCounting) {
      if (shared) {
        result.stages.emplace_back("rows_beside_computed_torque", row_cost);
      } else {
        for (auto& [stage, cost] : row_stages<First>()) {
          if (least_squares && stage == "instrument_rows") {
            continue;
          }
          OperationCount all;
          for (long n = 0; n < result.count; ++n) {
            all += cost;
          }
          result.stages.emplace_back(stage, all);
        }
      }
      result.stages.emplace_back("update", update_cost);
    }
  };
  const std::vector<double> plain = run_in_both(result, drive);
  const Eigen::VectorXd reference = batch<First>(kSamples, least_squares);
  for (Eigen::Index i = 0; i < reference.size(); ++i) {
    result.batch_difference =
        std::max(result.batch_difference, std::abs(plain[static_cast<std::size_t>(i)] - reference[i]) /
                                              reference.cwiseAbs().maxCoeff());
  }
  return result;
}

/// Kawasaki and Nishimura's covariance recursion on the same rows.
template <int First>
Result run_covariance() {
  Result result{"covariance", false, false, {}, 0, {}, {}, true, 0};
  using Arm = ArmOf<Counted>;
  using Layout = TerminalLayout<Arm, First>;
  CovarianceRecursion<Counted, Layout> recursion;
  typename CovarianceRecursion<Counted, Layout>::Row prior{}, variance{};
  for (auto& v : variance) {
    v = Counted(1e6);
  }
  recursion.reset(prior, variance);
  OperationCount update_cost;
  for (int j = 0; j < kSamples; ++j) {
    const Sample& s = samples()[static_cast<std::size_t>(j)];
    const auto q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd);
    std::array<TerminalRows<Counted, Layout>, 2> rows{};
    OperationCount sample = counted([&] {
      terminal_rows<Arm, First, 2>(terminal_trigonometry<Arm, First>(q), q, qd,
                                   {vector_of<Counted>(s.measured), vector_of<Counted>(s.instrument)},
                                   Counted(0.0), rows);
    });
    const OperationCount update = counted([&] {
      for (int r = 0; r < Layout::kRows; ++r) {
        const std::size_t i = static_cast<std::size_t>(r);
        (void)recursion.add(r, rows[1][i], rows[0][i], Counted(s.tau[static_cast<std::size_t>(First + r)]));
      }
    });
    sample += update;
    note_worst(result.worst, sample);
    result.total += sample;
    update_cost += update;
    ++result.count;
  }
  for (auto& [stage, cost] : row_stages<First>()) {
    OperationCount all;
    for (long n = 0; n < result.count; ++n) {
      all += cost;
    }
    result.stages.emplace_back(stage, all);
  }
  result.stages.emplace_back("update", update_cost);
  const Eigen::VectorXd reference = batch<First>(kSamples, false);
  for (Eigen::Index i = 0; i < reference.size(); ++i) {
    result.batch_difference =
        std::max(result.batch_difference,
                 std::abs(recursion.solution()[static_cast<std::size_t>(i)].value() - reference[i]) /
                     reference.cwiseAbs().maxCoeff());
  }
  return result;
}

template <int First>
std::vector<Result> all_forms() {
  std::vector<Result> out;
  out.push_back(run_covariance<First>());
  out.push_back(run<First, EstimatorForm::kFactored>("factored", false, false));
  out.push_back(run<First, EstimatorForm::kInformation>("information", false, false));
  out.push_back(run<First, EstimatorForm::kFactored>("factored", true, false));
  out.push_back(run<First, EstimatorForm::kInformation>("information", true, false));
  out.push_back(run<First, EstimatorForm::kFactored>("factored", false, true));
  out.push_back(run<First, EstimatorForm::kInformation>("information", false, true));
  return out;
}

/// f(std::integral_constant<int, First>{}) for the first row k − 1 of 0 to 5.
template <typename F>
auto with_first_row(int k, F&& f) {
  switch (k) {
    case 1: return f(std::integral_constant<int, 0>{});
    case 2: return f(std::integral_constant<int, 1>{});
    case 3: return f(std::integral_constant<int, 2>{});
    case 4: return f(std::integral_constant<int, 3>{});
    case 5: return f(std::integral_constant<int, 4>{});
    default: return f(std::integral_constant<int, 5>{});
  }
}

}  // namespace

const std::vector<Sample>& samples() {
  static const std::vector<Sample> all = [] {
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0.0, 10.0);
    std::vector<Sample> out;
    const ReducedParameters<double, model::KawasakiArmWithPayload> parameters{
        reduced_links(model::KawasakiArmWithPayload::kModel)};
    constexpr std::array<double, kN> kAcceleration = {3, 4, 5, 12, 9, 14};
    for (int j = 0; j < kSamples; ++j) {
      const double t = 0.005 * j;
      Sample s{};
      JointVector<double, kN> q, qd, qdd;
      for (int i = 0; i < kN; ++i) {
        const std::size_t n = static_cast<std::size_t>(i);
        for (int k = 0; k < 6; ++k) {
          const double w = 2 * std::numbers::pi * (0.27 + 0.23 * k + 0.031 * i);
          const double a = kAcceleration[n] / std::sqrt(3.0) / (w * w);
          const double angle = w * t + 1.7 * k + 0.9 * i * k + i;
          s.q[n] += a * std::sin(angle);
          s.qd[n] += a * w * std::cos(angle);
          s.instrument[n] -= a * w * w * std::sin(angle);
        }
        q[i] = s.q[n];
        qd[i] = s.qd[n];
        qdd[i] = s.instrument[n];
        s.measured[n] = s.instrument[n] + noise(random);
      }
      const auto tau =
          inverse_dynamics<StaticArm<double, model::KawasakiArmWithPayload>>(parameters, q, qd, qdd);
      for (int i = 0; i < kN; ++i) {
        const std::size_t n = static_cast<std::size_t>(i);
        s.tau[n] = tau[i] + friction_torque(model::KawasakiArmWithPayload::kModel.actuation[n], qd[i], 0.0);
      }
      out.push_back(s);
    }
    return out;
  }();
  return all;
}

void note_worst(OperationCount& worst, const OperationCount& sample) {
  worst.mul = std::max(worst.mul, sample.mul);
  worst.add = std::max(worst.add, sample.add);
  worst.div = std::max(worst.div, sample.div);
  worst.sqrt = std::max(worst.sqrt, sample.sqrt);
  worst.trig = std::max(worst.trig, sample.trig);
}

void note_sample(Result& result, const OperationCount& sample) {
  note_worst(result.worst, sample);
  result.total += sample;
  ++result.count;
}

nlohmann::ordered_json as_json(const OperationCount& c, double divisor) {
  const auto mean = [&](std::int64_t v) {
    return std::round(100.0 * static_cast<double>(v) / divisor) / 100.0;
  };
  return {{"mul", mean(c.mul)},
          {"add", mean(c.add)},
          {"div", mean(c.div)},
          {"sqrt", mean(c.sqrt)},
          {"trig", mean(c.trig)}};
}

std::vector<Result> estimator_forms(int k) {
  return with_first_row(k, [](auto first) { return all_forms<decltype(first)::value>(); });
}

int estimator_parameters(int k) {
  return with_first_row(
      k, [](auto first) { return TerminalLayout<ArmOf<double>, decltype(first)::value>::kParameters; });
}

}  // namespace heft::bench
