// Time of a diagnosis: all candidates on all joints, against samples and joints.
#include <benchmark/benchmark.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace {

using namespace heft;

constexpr double kSampleRate = 500.0;  // [Hz]

/// The first `joints` joints of the seven-joint arm, with friction.
model::Robot arm_with(int joints) {
  model::Robot robot = urdf::load_urdf(HEFT_BENCH_URDF);
  robot.joints.resize(static_cast<std::size_t>(joints));
  for (model::RobotJoint& joint : robot.joints) {
    joint.actuation.coulomb_friction = 2.0;
    joint.actuation.viscous_friction = 1.5;
  }
  return robot;
}

/// Sums of sines with encoder steps and noisy torque; a spring that the model lacks on the second joint.
data::Log make_log(const model::Robot& robot, double seconds, unsigned seed) {
  const int n = robot.num_joints();
  const auto m = static_cast<Eigen::Index>(seconds * kSampleRate);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  std::normal_distribution<double> noise(0.0, 0.3);
  Eigen::MatrixXd phases(n, 5);
  for (auto& p : phases.reshaped()) p = phase(random);
  const model::Dynamics dynamics(robot);
  data::Log log;
  log.path = "bench";
  log.time.resize(m);
  log.q.resize(m, n);
  log.tau.resize(m, n);
  for (Eigen::Index i = 0; i < m; ++i) {
    const double t = static_cast<double>(i) / kSampleRate;
    Eigen::VectorXd q = Eigen::VectorXd::Zero(n), qd = q, qdd = q;
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < 5; ++k) {
        const double w = 2.0 * std::numbers::pi * (k + 1) / 10.0, a = 0.5 / (k + 1);
        q[j] += a * std::sin(w * t + phases(j, k));
        qd[j] += a * w * std::cos(w * t + phases(j, k));
        qdd[j] -= a * w * w * std::sin(w * t + phases(j, k));
      }
    }
    log.time[i] = t;
    Eigen::VectorXd tau = dynamics.joint_torque(q, qd, qdd, 1e-3);
    if (n > 1) tau[1] += 12.0 * q[1];
    for (int j = 0; j < n; ++j) {
      log.q(i, j) = std::round(q[j] / 2e-5) * 2e-5;
      log.tau(i, j) = tau[j] + noise(random);
    }
  }
  return log;
}

/// Argument 0: seconds of log; argument 1: joints.
void Diagnose(benchmark::State& state) {
  const model::Robot robot = arm_with(static_cast<int>(state.range(1)));
  const data::Log train = make_log(robot, static_cast<double>(state.range(0)), 1);
  const data::Log judged = make_log(robot, 20.0, 2);
  std::size_t found = 0;
  int candidates = 0;
  for (auto _ : state) {
    const diagnose::Diagnosis diagnosis = diagnose::diagnose(robot, {train}, {judged});
    found = diagnosis.findings.size();
    candidates = diagnosis.candidates;
  }
  state.counters["samples"] = static_cast<double>(train.num_samples());
  state.counters["candidates"] = candidates;
  state.counters["effects"] = static_cast<double>(found);
}
BENCHMARK(Diagnose)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->ArgNames({"seconds", "joints"})
    ->Args({40, 7})
    ->Args({10, 7})
    ->Args({20, 7})
    ->Args({80, 7})
    ->Args({40, 2})
    ->Args({40, 4});

/// Four measured logs of a UR10e: three to learn from, one to judge on. Processor time of all threads beside the time it
/// takes.
void DiagnoseMeasured(benchmark::State& state) {
  const std::filesystem::path folder = std::filesystem::path(HEFT_DATA_DIR) / "ur10e-dynamic-calibration";
  if (!std::filesystem::exists(folder)) {
    state.SkipWithError("the measured logs are not part of the sources: -DHEFT_DATA_DIR=FOLDER");
    return;
  }
  const model::Robot robot = urdf::load_urdf((folder / "robot.urdf").string());
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.torque = true;
  const auto log = [&](const char* name) { return data::read_log((folder / name).string(), needs); };
  const std::vector<data::Log> train{log("exc-12h-30s.csv"), log("exc-12h-40s.csv"), log("exc-10h-20s.csv")};
  const std::vector<data::Log> judged{log("exc-8h-20s.csv")};
  std::size_t found = 0;
  for (auto _ : state) found = diagnose::diagnose(robot, train, judged).findings.size();
  state.counters["effects"] = static_cast<double>(found);
}
BENCHMARK(DiagnoseMeasured)->Unit(benchmark::kSecond)->Iterations(1)->MeasureProcessCPUTime();

}  // namespace

BENCHMARK_MAIN();
