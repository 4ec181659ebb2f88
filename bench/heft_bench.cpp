// Times of the real-time code and of KDL (and Pinocchio where CMake found it) in one run. Compare ratios, not
// nanoseconds: `heft_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true`.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <random>
#include <vector>

#include <fmt/format.h>
#include <kdl/chain.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <kdl/jntarray.hpp>
#include <nlohmann/json.hpp>

#ifdef HEFT_WITH_PINOCCHIO
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody/model.hpp>
#endif

#include "heft/core/control/joint_controller.hpp"
#include "heft/core/control/terminal_link_cycle.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/model/named_arms.hpp"

namespace {

using namespace heft;
using Description = model::Ur5Arm;

/// A few hundred random states, so that nothing is predicted.
template <typename Scalar>
struct States {
  static constexpr std::size_t kCount = 256;
  using Vector = JointVector<Scalar, 6>;
  std::array<Vector, kCount> q, qd, qdd, tau;

  States() {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const DynamicArm<double, 6> arm(Description::kModel);
    for (std::size_t s = 0; s < kCount; ++s) {
      JointVector<double, 6> a, b, c;
      for (int i = 0; i < 6; ++i) {
        a[i] = 3 * uniform(random);
        b[i] = 2 * uniform(random);
        c[i] = 10 * uniform(random);
      }
      q[s] = a.cast<Scalar>();
      qd[s] = b.cast<Scalar>();
      qdd[s] = c.cast<Scalar>();
      tau[s] = inverse_dynamics(arm, a, b, c).cast<Scalar>();
    }
  }
};

template <typename Scalar>
const States<Scalar>& states() {
  static const States<Scalar> all;
  return all;
}

template <typename Scalar>
ReducedParameters<Scalar, Description> reduced_parameters() {
  ReducedParameters<Scalar, Description> out;
  const auto links = reduced_links(Description::kModel);
  for (std::size_t j = 0; j < 6; ++j) {
    for (std::size_t i = 0; i < 10; ++i) {
      out.links[j][i] = static_cast<Scalar>(links[j][i]);
    }
  }
  return out;
}

/// The UR5 as KDL has it, from the same numbers.
KDL::Chain kdl_chain() {
  KDL::Chain chain;
  const auto& arm = Description::kModel;
  const auto frame_of = [](const Joint<double>& joint) {
    const auto& R = joint.rotation;
    const auto& p = joint.position;
    return KDL::Frame(KDL::Rotation(R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]),
                      KDL::Vector(p[0], p[1], p[2]));
  };
  // A KDL segment is a joint followed by the link up to the next joint; its frame sits at the far end.
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), frame_of(arm.joints[0])));
  for (std::size_t j = 0; j < 6; ++j) {
    const auto& joint = arm.joints[j];
    const KDL::Frame tip = j + 1 < 6 ? frame_of(arm.joints[j + 1]) : KDL::Frame::Identity();
    const auto& p = arm.links[j];
    const KDL::Vector com(p[kMcx] / p[kMass], p[kMcy] / p[kMass], p[kMcz] / p[kMass]);
    // About the centre of mass, then expressed for the tip frame, where KDL wants it.
    const double m = p[kMass];
    const KDL::RotationalInertia about_com(p[kIxx] - m * (com.y() * com.y() + com.z() * com.z()),
                                           p[kIyy] - m * (com.x() * com.x() + com.z() * com.z()),
                                           p[kIzz] - m * (com.x() * com.x() + com.y() * com.y()),
                                           p[kIxy] + m * com.x() * com.y(), p[kIxz] + m * com.x() * com.z(),
                                           p[kIyz] + m * com.y() * com.z());
    const KDL::RigidBodyInertia at_joint(m, com, about_com);
    chain.addSegment(
        KDL::Segment(KDL::Joint(KDL::Vector::Zero(), KDL::Vector(joint.axis[0], joint.axis[1], joint.axis[2]),
                                KDL::Joint::RotAxis),
                     tip, tip.Inverse() * at_joint));
  }
  return chain;
}

void kdl_inverse_dynamics(benchmark::State& state) {
  const KDL::Chain chain = kdl_chain();
  KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(0, 0, -9.81));
  const auto& s = states<double>();
  std::array<KDL::JntArray, States<double>::kCount> q, qd, qdd;
  for (std::size_t i = 0; i < s.kCount; ++i) {
    q[i].data = s.q[i];
    qd[i].data = s.qd[i];
    qdd[i].data = s.qdd[i];
  }
  const KDL::Wrenches none(chain.getNrOfSegments());
  KDL::JntArray tau(6);
  // The two must be the same arm.
  solver.CartToJnt(q[0], qd[0], qdd[0], none, tau);
  if ((tau.data - Eigen::VectorXd(s.tau[0])).norm() > 1e-9 * s.tau[0].norm()) {
    state.SkipWithError("KDL's torques differ from heft's");
    return;
  }
  std::size_t i = 0;
  for (auto _ : state) {
    solver.CartToJnt(q[i], qd[i], qdd[i], none, tau);
    benchmark::DoNotOptimize(tau.data.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(kdl_inverse_dynamics)->Name("inverse_dynamics/kdl");

#ifdef HEFT_WITH_PINOCCHIO
pinocchio::Model pinocchio_model() {
  pinocchio::Model model;
  const auto& arm = Description::kModel;
  pinocchio::JointIndex parent = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    const auto& joint = arm.joints[j];
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(joint.rotation.data());
    const pinocchio::SE3 placement(R, Eigen::Map<const Eigen::Vector3d>(joint.position.data()));
    parent = model.addJoint(
        parent, pinocchio::JointModelRevoluteUnaligned(Eigen::Map<const Eigen::Vector3d>(joint.axis.data())),
        placement, "joint" + std::to_string(j));
    const auto& p = arm.links[j];
    Eigen::Matrix<double, 10, 1> v;
    v << p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9];
    model.appendBodyToJoint(parent, pinocchio::Inertia::FromDynamicParameters(v));
  }
  return model;
}

void pinocchio_inverse_dynamics(benchmark::State& state) {
  const pinocchio::Model model = pinocchio_model();
  pinocchio::Data data(model);
  const auto& s = states<double>();
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(pinocchio::rnea(model, data, s.q[i], s.qd[i], s.qdd[i]).data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(pinocchio_inverse_dynamics)->Name("inverse_dynamics/pinocchio");

void pinocchio_regressor(benchmark::State& state) {
  const pinocchio::Model model = pinocchio_model();
  pinocchio::Data data(model);
  const auto& s = states<double>();
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        pinocchio::computeJointTorqueRegressor(model, data, s.q[i], s.qd[i], s.qdd[i]).data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(pinocchio_regressor)->Name("regressor_6x60/pinocchio");
#endif

template <typename Scalar>
void runtime_inverse_dynamics(benchmark::State& state) {
  ArmModel<Scalar, 6> arm;
  for (std::size_t j = 0; j < 6; ++j) {
    arm.joints[j].type = Description::kModel.joints[j].type;
    for (std::size_t k = 0; k < 9; ++k)
      arm.joints[j].rotation[k] = static_cast<Scalar>(Description::kModel.joints[j].rotation[k]);
    for (std::size_t k = 0; k < 3; ++k) {
      arm.joints[j].position[k] = static_cast<Scalar>(Description::kModel.joints[j].position[k]);
      arm.joints[j].axis[k] = static_cast<Scalar>(Description::kModel.joints[j].axis[k]);
    }
    for (std::size_t k = 0; k < 10; ++k)
      arm.links[j][k] = static_cast<Scalar>(Description::kModel.links[j][k]);
  }
  const DynamicArm<Scalar, 6> dynamic(arm);
  const auto& s = states<Scalar>();
  std::size_t i = 0;
  for (auto _ : state) {
    auto tau = inverse_dynamics(dynamic, s.q[i], s.qd[i], s.qdd[i]);
    benchmark::DoNotOptimize(tau.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(runtime_inverse_dynamics<double>)->Name("inverse_dynamics/heft_run_time/double");
BENCHMARK(runtime_inverse_dynamics<float>)->Name("inverse_dynamics/heft_run_time/float");

/// Compile-time geometry and parameters, as exported for firmware.
template <typename Scalar>
void constant_inverse_dynamics(benchmark::State& state) {
  using Arm = StaticArm<Scalar, Description>;
  const auto& s = states<Scalar>();
  std::size_t i = 0;
  for (auto _ : state) {
    auto tau = inverse_dynamics<Arm>(ConstantParameters<Scalar, Description>{}, s.q[i], s.qd[i], s.qdd[i]);
    benchmark::DoNotOptimize(tau.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(constant_inverse_dynamics<double>)->Name("inverse_dynamics/heft_compile_time/double");
BENCHMARK(constant_inverse_dynamics<float>)->Name("inverse_dynamics/heft_compile_time/float");

/// Compile-time geometry, parameters that the estimator may change.
template <typename Scalar>
void reduced_inverse_dynamics(benchmark::State& state) {
  using Arm = StaticArm<Scalar, Description>;
  const auto parameters = reduced_parameters<Scalar>();
  const auto& s = states<Scalar>();
  std::size_t i = 0;
  for (auto _ : state) {
    auto tau = inverse_dynamics<Arm>(parameters, s.q[i], s.qd[i], s.qdd[i]);
    benchmark::DoNotOptimize(tau.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(reduced_inverse_dynamics<double>)
    ->Name("inverse_dynamics/heft_compile_time_live_parameters/double");
BENCHMARK(reduced_inverse_dynamics<float>)->Name("inverse_dynamics/heft_compile_time_live_parameters/float");

template <typename Scalar>
void constant_regressor(benchmark::State& state) {
  using Arm = StaticArm<Scalar, Description>;
  const auto& s = states<Scalar>();
  LinkRegressor<Scalar, 6> Y;
  std::size_t i = 0;
  for (auto _ : state) {
    link_regressor<Arm>(joint_trigonometry<Arm>(s.q[i]), s.q[i], s.qd[i], s.qdd[i], Y);
    benchmark::DoNotOptimize(Y.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(constant_regressor<double>)->Name("regressor_6x60/heft_compile_time/double");
BENCHMARK(constant_regressor<float>)->Name("regressor_6x60/heft_compile_time/float");

void runtime_regressor(benchmark::State& state) {
  const DynamicArm<double, 6> arm(Description::kModel);
  const auto& s = states<double>();
  LinkRegressor<double, 6> Y;
  std::size_t i = 0;
  for (auto _ : state) {
    link_regressor(arm, joint_trigonometry<DynamicArm<double, 6>>(s.q[i]), s.q[i], s.qd[i], s.qdd[i], Y);
    benchmark::DoNotOptimize(Y.data());
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(runtime_regressor)->Name("regressor_6x60/heft_run_time/double");

/// Rows of joints 5 and 6 for the measured acceleration and the instrument.
template <typename Scalar>
void rows_k5(benchmark::State& state) {
  using Arm = StaticArm<Scalar, Description>;
  const auto& s = states<Scalar>();
  std::array<TerminalRows<Scalar, TerminalLayout<Arm, 4>>, 2> rows{};
  std::size_t i = 0;
  for (auto _ : state) {
    const std::size_t other = (i + 1) % s.kCount;
    terminal_rows<Arm, 4, 2>(terminal_trigonometry<Arm, 4>(s.q[i]), s.q[i], s.qd[i], {s.qdd[i], s.qdd[other]},
                             Scalar(0), rows);
    benchmark::DoNotOptimize(&rows);
    i = other;
  }
}
BENCHMARK(rows_k5<double>)->Name("rows_k5_and_instruments/double");
BENCHMARK(rows_k5<float>)->Name("rows_k5_and_instruments/float");

/// The whole sample of a controller: computed torque with the running estimate, rows of joints 5 and 6 and their
/// instruments from the same forward pass, estimator update.
template <typename Scalar, EstimatorForm Form>
void whole_cycle(benchmark::State& state) {
  using Arm = StaticArm<Scalar, Description>;
  using Estimator = TerminalLinkEstimator<Arm, 4, Form>;
  using Vector = typename Arm::Vector;
  const auto& s = states<Scalar>();
  auto parameters = reduced_parameters<Scalar>();
  static Estimator estimator;
  typename Estimator::Config config;
  config.max_amplification = Scalar(1e6);
  if (estimator.configure(config, parameters, Vector::Zero(), Vector::Zero()) != Status::kOk) {
    state.SkipWithError("estimator refused its settings");
    return;
  }
  JointFeedback<Scalar, 6> feedback;
  typename JointFeedback<Scalar, 6>::Config gains;
  gains.stiffness.setConstant(Scalar(400));
  gains.damping.setConstant(Scalar(40));
  gains.torque_limit.setConstant(Scalar(1e6));
  if (feedback.configure(gains) != Status::kOk) {
    state.SkipWithError("feedback refused its settings");
    return;
  }
  FrictionFeedForward<Scalar, 6> friction;
  JointReference<Scalar, 6> reference;
  typename Estimator::Record record;
  std::array<typename Estimator::Rows, 2> rows{};
  std::size_t i = 0;
  const auto cycle = [&] {
    reference.q = s.q[i];
    reference.qd = s.qd[i];
    reference.qdd = s.qdd[i];
    const Vector commanded = commanded_acceleration<Scalar, 6>(feedback, reference, s.q[i], s.qd[i]);
    Vector wanted, command;
    ControlRecord control;
    inverse_dynamics_with_rows<Arm, 4>(parameters, joint_trigonometry<Arm>(s.q[i]), s.q[i], s.qd[i],
                                       commanded, s.qdd[i], Scalar(0), wanted, rows);
    wanted += friction.torque(reference.qd);
    bool ok = feedback.limit(wanted, command, control) == Status::kOk;
    ok = estimator.update_rows(rows[0], rows[1], s.qd[i], s.tau[i], record) == Status::kOk && ok;
    if (record.new_estimate) {
      parameters = estimator.reduced();
    }
    benchmark::DoNotOptimize(command.data());
    i = (i + 1) % s.kCount;
    return ok;
  };
  for (int warm = 0; warm < 2000; ++warm) {
    if (!cycle()) {
      state.SkipWithError("a cycle failed");
      return;
    }
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(cycle());
  }
  state.counters["estimator_bytes"] = static_cast<double>(sizeof(Estimator));
  state.SetLabel(to_string(estimator.source()));
}
BENCHMARK(whole_cycle<double, EstimatorForm::kInformation>)->Name("whole_cycle/information/double");
BENCHMARK(whole_cycle<float, EstimatorForm::kInformation>)->Name("whole_cycle/information/float");
BENCHMARK(whole_cycle<double, EstimatorForm::kFactored>)->Name("whole_cycle/factored/double");
BENCHMARK(whole_cycle<float, EstimatorForm::kFactored>)->Name("whole_cycle/factored/float");

/// Payload with its mass on a run-time arm, rows 1..6.
void payload_update(benchmark::State& state) {
  const DynamicArm<double, 6> arm(Description::kModel);
  const auto& s = states<double>();
  PayloadEstimator<double, 6> estimator;
  if (estimator.configure({}) != Status::kOk) {
    state.SkipWithError("estimator refused its settings");
    return;
  }
  LinkRegressor<double, 6> Y;
  PayloadEstimator<double, 6>::Record record;
  const JointVector<double, 6> nothing = JointVector<double, 6>::Zero();
  std::size_t i = 0;
  for (auto _ : state) {
    link_regressor(arm, joint_trigonometry<DynamicArm<double, 6>>(s.q[i]), s.q[i], s.qd[i], s.qdd[i], Y);
    benchmark::DoNotOptimize(estimator.update(Y, s.qd[i], nothing, record));
    i = (i + 1) % s.kCount;
  }
}
BENCHMARK(payload_update)->Name("payload_update/run_time/double");

/// A sample of the loop that runs on firmware: load observer, contact monitor on the torque that it explains, computed torque of
/// the model with the observed load. A smooth motion at 1 kHz, over and over; where it starts again, the observer sees a jump.
template <typename Scalar>
void control_sample(benchmark::State& state) {
  using Vector = JointVector<Scalar, 6>;
  constexpr std::size_t kSamples = 8000;
  struct Sample {
    Vector q, qd, qdd, tau;
  };
  std::vector<Sample> log(kSamples);
  const DynamicArm<double, 6> arm(Description::kModel);
  for (std::size_t k = 0; k < kSamples; ++k) {
    JointVector<double, 6> q, qd, qdd;
    for (int i = 0; i < 6; ++i) {
      const double w = 0.25 * (5 + i) * std::numbers::pi, angle = w * 1e-3 * static_cast<double>(k) + i;
      q[i] = 0.5 * std::sin(angle), qd[i] = 0.5 * w * std::cos(angle),
      qdd[i] = -0.5 * w * w * std::sin(angle);
    }
    JointVector<double, 6> tau = inverse_dynamics(arm, q, qd, qdd);
    for (int i = 0; i < 6; ++i)
      tau[i] += friction_torque(Description::kModel.actuation[static_cast<std::size_t>(i)], qd[i], 0.0);
    log[k] = {q.cast<Scalar>(), qd.cast<Scalar>(), qdd.cast<Scalar>(), tau.cast<Scalar>()};
  }
  LoadObserver<Description, Scalar> observer;
  ContactMonitor<Scalar, 6> monitor;
  ArmTorque<Description, Scalar> torque;
  typename LoadObserver<Description, Scalar>::Config observed;
  observed.rows_per_sample = 1;
  observed.explains = true;
  typename ContactMonitor<Scalar, 6>::Config watched;
  watched.thresholds.joints.fill(JointThreshold<Scalar>::uniform(Scalar(10), Scalar(0)));
  if (observer.configure(observed) != Status::kOk || monitor.configure(watched) != Status::kOk ||
      torque.configure() != Status::kOk) {
    state.SkipWithError("the loop refused its settings");
    return;
  }
  const Scalar period = static_cast<Scalar>(1e-3);
  typename LoadObserver<Description, Scalar>::Record seen;
  typename ContactMonitor<Scalar, 6>::Record contact;
  Vector tau = Vector::Zero();
  bool ok = true;
  std::size_t k = 0;
  for (auto _ : state) {
    const Sample& s = log[k];
    ok = observer.update(s.q, s.qd, s.tau, period, seen) == Status::kOk && ok;
    if (observer.explained().valid) {
      ok = monitor.update(observer.explained(), s.tau, contact) == Status::kOk && ok;
    }
    if (seen.estimated) ok = torque.set_payload(observer.load()) == Status::kOk && ok;
    ok = torque.update(period, s.q, s.qd, s.qdd, tau) == Status::kOk && ok;
    benchmark::DoNotOptimize(tau.data());
    k = (k + 1) % kSamples;
  }
  if (!ok) state.SkipWithError("a sample was refused");
  state.counters["loop_bytes"] = static_cast<double>(sizeof observer + sizeof monitor + sizeof torque);
}
BENCHMARK(control_sample<double>)->Name("control_sample/observer_monitor_torque/double");
BENCHMARK(control_sample<float>)->Name("control_sample/observer_monitor_torque/float");

/// The firmware image's figures, as its tests left them.
void print_firmware_figures() {
  std::ifstream in(HEFT_FIRMWARE_FIGURES);
  if (!in) {
    fmt::print(
        stderr,
        "\nfirmware image: no figures yet; `ctest -L firmware` makes them (needs arm-none-eabi-g++ and "
        "qemu-system-arm)\n");
    return;
  }
  const nlohmann::json figures = nlohmann::json::parse(in, nullptr, false);
  if (figures.is_discarded()) {
    fmt::print(stderr, "\nfirmware image: {} is not JSON; run `ctest -L firmware` again\n",
               HEFT_FIRMWARE_FIGURES);
    return;
  }
  fmt::print(stderr,
             "\nfirmware image: regressor rows, estimator and computed torque, replaying a log under QEMU\n"
             "{:<18} {:>9} {:>9} {:>14} {:>20} {:>8}\n",
             "image", "flash [B]", "RAM [B]", "deepest stack", "instructions/sample", "worst");
  for (const auto& image : figures.value("images", nlohmann::json::array())) {
    fmt::print(stderr, "{:<18} {:>9} {:>9} {:>14} {:>20.0f} {:>8.0f}\n", image.value("image", "?"),
               image.value("flash_bytes", 0L), image.value("ram_bytes", 0L),
               image.value("deepest_stack_bytes", 0L), image.value("instructions_mean", 0.0),
               image.value("instructions_worst", 0.0));
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
    return 2;
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  print_firmware_figures();
  return 0;
}
