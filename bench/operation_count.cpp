// What one sample of the terminal-link problem costs, counted by running the production templates with a scalar that
// counts. `operation_count [--json FILE]`
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "counting_scalar.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/control/terminal_link_cycle.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/covariance_recursion.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::bench {
namespace {

constexpr int kN = 6;
constexpr int kSamples = 2000;
constexpr int kSolveEvery = 50;
using Description = model::KawasakiArm;

template <typename Scalar>
using ArmOf = StaticArm<Scalar, Description>;

/// One sample of Kawasaki and Nishimura's experiment: exciting motion, noisy acceleration, clean instrument.
struct Sample {
  std::array<double, kN> q, qd, measured, instrument, tau;
};

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

template <typename Scalar>
JointVector<Scalar, kN> vector_of(const std::array<double, kN>& values) {
  JointVector<Scalar, kN> v;
  for (int i = 0; i < kN; ++i) {
    v[i] = Scalar(values[static_cast<std::size_t>(i)]);
  }
  return v;
}

template <typename Scalar>
ReducedParameters<Scalar, Description> nominal() {
  ReducedParameters<Scalar, Description> out;
  const auto links = reduced_links(Description::kModel);
  for (std::size_t j = 0; j < kN; ++j) {
    for (std::size_t i = 0; i < 10; ++i) {
      out.links[j][i] = Scalar(links[j][i]);
    }
  }
  return out;
}

double number(double v) { return v; }
double number(const Counted& v) { return v.value(); }

/// Operations of a piece of work.
OperationCount counted(const std::function<void()>& work) {
  const OperationCount before = counter();
  work();
  return counter() - before;
}

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

/// What one form of the estimator costs.
struct Result {
  std::string form;
  bool shared{false};
  bool least_squares{false};
  OperationCount total;  ///< over the samples after start-up
  long count{0};
  OperationCount worst;  ///< largest number of multiplications (and, separately, additions) of any sample
  std::vector<std::pair<std::string, OperationCount>> stages;
  bool same_numbers{true};     ///< the counting run and the double run gave the same bits
  double batch_difference{0};  ///< largest difference to the batch estimate, relative to its largest entry
};

void note_worst(OperationCount& worst, const OperationCount& sample) {
  worst.mul = std::max(worst.mul, sample.mul);
  worst.add = std::max(worst.add, sample.add);
  worst.div = std::max(worst.div, sample.div);
  worst.sqrt = std::max(worst.sqrt, sample.sqrt);
  worst.trig = std::max(worst.trig, sample.trig);
}

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
  std::vector<double> counting, plain;
  drive(Counted{}, counting);
  drive(double{}, plain);
  result.same_numbers = std::memcmp(counting.data(), plain.data(), plain.size() * sizeof(double)) == 0;
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

OperationCount computed_torque_cost() {
  using Arm = ArmOf<Counted>;
  const Sample& s = samples()[100];
  const auto q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd), a = vector_of<Counted>(s.instrument);
  const auto parameters = nominal<Counted>();
  typename Arm::Vector tau;
  return counted([&] { inverse_dynamics<Arm>(parameters, joint_trigonometry<Arm>(q), q, qd, a, tau); });
}

/// Contact monitor with what it needs of the arm: worst sample, with a contact whose weight is looked into.
OperationCount monitor_cost() {
  using Arm = ArmOf<Counted>;
  using Vector = typename Arm::Vector;
  ContactMonitor<Counted, kN> monitor;
  typename ContactMonitor<Counted, kN>::Config config;
  for (JointThreshold<Counted>& joint : config.thresholds.joints) joint.constant = Counted(1e-3);
  const auto parameters = nominal<Counted>();
  OperationCount worst;
  if (monitor.configure(config) != Status::kOk) return worst;
  for (const Sample& s : samples()) {
    const Vector q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd), tau = vector_of<Counted>(s.tau);
    const OperationCount now = counted([&] {
      const auto trig = joint_trigonometry<Arm>(q);
      LagrangianTerms<Counted, kN> terms;
      LoadColumns<Counted, kN> columns = LoadColumns<Counted, kN>::Zero();
      typename ContactMonitor<Counted, kN>::Record record;
      lagrangian_terms<Arm>(parameters, trig, q, qd, terms);
      if (monitor.wants_load_columns()) load_columns<Arm>(trig, q, columns);
      static_cast<void>(monitor.update(terms, columns, qd, tau, Vector::Zero(), Counted(0.005), record));
    });
    if (now.mul + now.add > worst.mul + worst.add) worst = now;
  }
  return worst;
}

/// A loop that follows its load: LoadObserver, one row a sample, an update every ten; ArmTorque at a commanded acceleration.
Result control_sample() {
  Result result{"control sample", false, false, {}, 0, {}, {}, true, 0};
  OperationCount observing, torque_cost;
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    LoadObserver<Description, Scalar> observer;
    ArmTorque<Description, Scalar> arm;
    JointFeedback<Scalar, kN> feedback;
    typename LoadObserver<Description, Scalar>::Config config;
    config.rows_per_sample = 1;
    config.update_rate = Scalar(20.0);  // of 200 Hz
    if (observer.configure(config) != Status::kOk || arm.configure() != Status::kOk ||
        feedback.configure({vector_of<Scalar>({400, 400, 400, 400, 400, 400}),
                            vector_of<Scalar>({40, 40, 40, 40, 40, 40})}) != Status::kOk) {
      throw Error("operation count: the loop refused its settings");
    }
    JointVector<Scalar, kN> tau;
    bool new_load = false;
    for (const Sample& s : samples()) {
      typename LoadObserver<Description, Scalar>::Record record;
      const auto q = vector_of<Scalar>(s.q), qd = vector_of<Scalar>(s.qd);
      Status status = Status::kOk;
      const OperationCount observer_cost =
          counted([&] { status = observer.update(q, qd, vector_of<Scalar>(s.tau), Scalar(0.005), record); });
      const OperationCount own = counted([&] {
        if (new_load) {
          status = status == Status::kOk ? arm.set_payload(observer.load()) : status;
        }
        new_load = record.estimated;
        const JointReference<Scalar, kN> reference{q, qd, vector_of<Scalar>(s.instrument)};
        status = status == Status::kOk
                     ? arm.update(Scalar(0.005), q, qd,
                                  commanded_acceleration<Scalar, kN>(feedback, reference, q, qd), tau)
                     : status;
      });
      if (status != Status::kOk) {
        throw Error("operation count: a sample of the loop was refused");
      }
      if constexpr (std::is_same_v<Scalar, Counted>) {
        OperationCount sample = observer_cost;
        sample += own;
        note_worst(result.worst, sample);
        result.total += sample;
        observing += observer_cost;
        torque_cost += own;
        ++result.count;
      }
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(tau[i]));
    last.push_back(number(observer.load()[kMass]));
  };
  std::vector<double> counting, plain;
  drive(Counted{}, counting);
  drive(double{}, plain);
  result.same_numbers = std::memcmp(counting.data(), plain.data(), plain.size() * sizeof(double)) == 0;
  result.stages = {{"load_observer", observing}, {"arm_torque", torque_cost}};
  return result;
}

/// TerminalLinkController at k = 5, a sample of the estimator every five cycles.
Result controller_sample() {
  Result result{"controller", false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    TerminalLinkController<Description, Scalar, 4> controller;
    typename TerminalLinkController<Description, Scalar, 4>::Config config;
    config.update_rate = Scalar(40.0);  // of 200 Hz
    if (controller.configure(config) != Status::kOk) {
      throw Error("operation count: the controller refused its settings");
    }
    JointVector<Scalar, kN> tau;
    for (const Sample& s : samples()) {
      typename TerminalLinkController<Description, Scalar, 4>::Record record;
      const auto q = vector_of<Scalar>(s.q);
      const JointReference<Scalar, kN> reference{q, vector_of<Scalar>(s.qd), vector_of<Scalar>(s.instrument)};
      Status status = Status::kOk;
      const OperationCount sample = counted([&] {
        status = controller.update(reference, q, vector_of<Scalar>(s.tau), Scalar(0.005), tau, record);
      });
      if (status != Status::kOk) {
        throw Error("operation count: a cycle of the controller was refused");
      }
      if constexpr (std::is_same_v<Scalar, Counted>) {
        note_worst(result.worst, sample);
        result.total += sample;
        ++result.count;
      }
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(tau[i]));
  };
  std::vector<double> counting, plain;
  drive(Counted{}, counting);
  drive(double{}, plain);
  result.same_numbers = std::memcmp(counting.data(), plain.data(), plain.size() * sizeof(double)) == 0;
  return result;
}

/// Prints what a facade costs.
nlohmann::ordered_json facade(const char* words, const Result& result) {
  const double n = static_cast<double>(result.count);
  const auto mean = [&](std::int64_t v) { return static_cast<double>(v) / n; };
  fmt::print("{}, {} joints: {:.0f} mul, {:.0f} add, {:.1f} div, {:.1f} trig; worst {} mul, {} add{}\n",
             words, kN, mean(result.total.mul), mean(result.total.add), mean(result.total.div),
             mean(result.total.trig), result.worst.mul, result.worst.add,
             result.same_numbers ? "" : "   NOT THE SAME NUMBERS AS DOUBLE");
  nlohmann::ordered_json stages;
  for (const auto& [stage, cost] : result.stages) {
    stages[stage] = as_json(cost, n);
  }
  return {{"mean", as_json(result.total, n)},
          {"worst_sample", as_json(result.worst, 1)},
          {"stages", stages},
          {"same_numbers_as_double", result.same_numbers}};
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

nlohmann::ordered_json document(int k, int parameters, const std::vector<Result>& results) {
  nlohmann::ordered_json forms = nlohmann::ordered_json::array();
  for (const Result& r : results) {
    const double n = static_cast<double>(r.count);
    nlohmann::ordered_json stages;
    for (const auto& [stage, cost] : r.stages) {
      stages[stage] = as_json(cost, n);
    }
    forms.push_back({{"form", r.form},
                     {"method", r.least_squares ? "least squares" : "instrumental variables"},
                     {"shared_forward_pass", r.shared},
                     {"solve_every", r.form == "information" ? kSolveEvery : 1},
                     {"mean", as_json(r.total, n)},
                     {"worst_sample", as_json(r.worst, 1)},
                     {"stages", stages},
                     {"difference_to_batch", r.batch_difference},
                     {"same_numbers_as_double", r.same_numbers}});
  }
  return {{"arm", "terminal-link-6r"},
          {"k", k},
          {"parameters", parameters},
          {"publication", {{"mul", 1800}, {"add", 1500}}},
          {"forms", forms}};
}

void print(int k, int parameters, const std::vector<Result>& results) {
  fmt::print("\nk = {}, {} parameters{}\n", k, parameters,
             k == 5 ? "   (Kawasaki and Nishimura, 1984: about 1800 multiplications, 1500 additions)" : "");
  fmt::print("  {:<12} {:<6} {:<8} {:>8} {:>8} {:>6} {:>6} {:>6}   {:>10} {:>10}   {}\n", "form", "method",
             "forward", "mul", "add", "div", "sqrt", "trig", "worst mul", "worst add", "against batch");
  for (const Result& r : results) {
    const double n = static_cast<double>(r.count);
    const auto mean = [&](std::int64_t v) { return static_cast<double>(v) / n; };
    fmt::print(
        "  {:<12} {:<6} {:<8} {:>8.1f} {:>8.1f} {:>6.1f} {:>6.2f} {:>6.1f}   {:>10} {:>10}   {:.1e}{}\n",
        r.form, r.least_squares ? "LS" : "IV", r.shared ? "shared" : "own", mean(r.total.mul),
        mean(r.total.add), mean(r.total.div), mean(r.total.sqrt), mean(r.total.trig), r.worst.mul,
        r.worst.add, r.batch_difference, r.same_numbers ? "" : "   NOT THE SAME NUMBERS AS DOUBLE");
  }
  if (k == 5) {
    for (const Result& r : results) {
      const double n = static_cast<double>(r.count);
      std::string line;
      for (const auto& [stage, cost] : r.stages) {
        line += fmt::format("  {} {:.0f}/{:.0f}", stage, static_cast<double>(cost.mul) / n,
                            static_cast<double>(cost.add) / n);
      }
      fmt::print("    {} {}{}:{}\n", r.form, r.least_squares ? "LS" : "IV", r.shared ? " shared" : "", line);
    }
  }
}

int main_with(const std::string& json_path) {
  fmt::print(
      "Operations a sample, arm of Kawasaki and Nishimura (1984), counted by running the production code.\n"
      "Information form: solve every {} samples, its cost included. Means are over steady state, worst "
      "samples\n"
      "over the whole run, start-up and hand-over included. Outlier gate on. A sine or cosine counts as one "
      "trig\n"
      "call; core's own polynomials need 10 multiplications and 9 additions for each.\n",
      kSolveEvery);
  nlohmann::ordered_json by_k = nlohmann::ordered_json::array();
  nlohmann::ordered_json main_document;
  const auto one = [&]<int K>(std::integral_constant<int, K>) {
    constexpr int kParameters = TerminalLayout<ArmOf<double>, K - 1>::kParameters;
    const std::vector<Result> results = all_forms<K - 1>();
    print(K, kParameters, results);
    nlohmann::ordered_json d = document(K, kParameters, results);
    if (K == 5) {
      main_document = d;
    }
    by_k.push_back(d);
  };
  one(std::integral_constant<int, 5>{});
  one(std::integral_constant<int, 6>{});
  one(std::integral_constant<int, 4>{});
  one(std::integral_constant<int, 3>{});
  one(std::integral_constant<int, 2>{});
  one(std::integral_constant<int, 1>{});
  const OperationCount torque = computed_torque_cost();
  fmt::print(
      "\ncomputed torque of the controller (nominal torque, all six joints): {} mul, {} add, {} trig\n",
      torque.mul, torque.add, torque.trig);
  main_document["control_sample"] =
      facade("\none sample of a loop that follows its load (LoadObserver, a row a sample, and ArmTorque)",
             control_sample());
  main_document["terminal_link_controller"] =
      facade("one cycle of TerminalLinkController, k = 5, a sample of its estimator every five",
             controller_sample());
  main_document["nominal_torque"] = as_json(torque, 1);
  const OperationCount contacts = monitor_cost();
  fmt::print("contact monitor, worst sample (all six joints): {} mul, {} add, {} trig\n", contacts.mul,
             contacts.add, contacts.trig);
  main_document["contact_monitor"] = as_json(contacts, 1);
  main_document["all_k"] = by_k;
  if (!json_path.empty()) {
    host::write_file_atomically(json_path, main_document.dump(2) + "\n");
  }
  return 0;
}

}  // namespace
}  // namespace heft::bench

int main(int argc, char** argv) {
  std::string json;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc) {
      json = argv[++i];
    } else {
      fmt::print(stderr, "usage: operation_count [--json FILE]\n");
      return 2;
    }
  }
  try {
    return heft::bench::main_with(json);
  } catch (const std::exception& error) {
    fmt::print(stderr, "operation_count: {}\n", error.what());
    return 1;
  }
}
