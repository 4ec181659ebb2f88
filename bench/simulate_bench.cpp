/// Ten seconds of closed loop at 1 kHz on a simulated UR10e, nothing written: least processor time of some runs, evaluations of the equations of
/// motion and error of every integrator. The error is the largest of a joint position against CVODE restarted at every sample with a
/// tolerance of 1e-12.
///
///   simulate_bench [--repeats N] [--motion FILE]     FILE: the referee's run without friction, for bench/simulate_peers.py
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heft/sim/simulator.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace {

using Eigen::VectorXd;
using namespace heft;

constexpr double kDuration = 10.0;

/// [s]
double processor_time() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  return static_cast<double>(use.ru_utime.tv_sec) + 1e-6 * static_cast<double>(use.ru_utime.tv_usec);
}

sim::FourierMotion motion() {
  sim::FourierMotion motion;
  motion.q0.resize(6);
  motion.q0 << 0.1, -1.3, 1.2, -0.6, 0.8, 0.2;
  motion.amplitude.resize(6, 2);
  motion.frequency_hz.resize(6, 2);
  motion.phase.resize(6, 2);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 2; ++k) {
      motion.amplitude(i, k) = 0.3 - 0.1 * k;
      motion.frequency_hz(i, k) = 0.2 + 0.04 * i + 0.3 * k;
      motion.phase(i, k) = i + 2.0 * k;
    }
  }
  return motion;
}

/// Position-velocity feedback with gravity torque, drives and friction of a UR10e's size.
sim::SimulationSettings closed_loop(bool friction, bool encoders) {
  sim::SimulationSettings s;
  s.robot = urdf::load_urdf(HEFT_BENCH_URDF);
  s.duration = kDuration;
  const double rotor[] = {2.0, 2.0, 1.2, 0.3, 0.3, 0.3};
  for (std::size_t j = 0; j < 6; ++j) {
    auto& drive = s.robot.joints[j].actuation;
    const double torque = s.robot.joints[j].effort_limit;
    drive = {rotor[j], friction ? 0.05 * torque : 0.0, friction ? 0.05 * torque : 0.0, 0.0};
  }
  const sim::FourierMotion wanted = motion();
  s.initial_position = wanted.q0;
  s.reference = sim::ramp_in(sim::make_fourier(wanted), wanted.q0, 1.0);
  s.loads = sim::friction_of(s.robot);
  s.torque_limit = sim::effort_limits_of(s.robot);
  VectorXd kp(6), kd(6);
  kp << 12000, 12000, 6000, 600, 600, 600;
  kd << 600, 600, 300, 30, 30, 30;
  s.controller = std::make_shared<sim::PdController>(kp, kd, std::make_shared<sim::ForwardDynamics>(s.robot));
  if (encoders) s.sensors.encoder_quantum = VectorXd::Constant(6, 2e-5);
  return s;
}

struct Case {
  std::string name;
  sim::SimulationSettings settings;
};

struct Solver {
  std::string name;
  sim::SolverMethod method;
  double tolerance;
};

void write_motion(const std::string& path, const data::Log& log) {
  std::string text = "time";
  for (const char* name : {"q", "qd", "tau", "qref", "qdref"}) {
    for (int j = 1; j <= 6; ++j) text += fmt::format(",{}{}", name, j);
  }
  text += '\n';
  for (Eigen::Index i = 0; i < log.num_samples(); ++i) {
    text += fmt::format("{}", log.time[i]);
    for (const auto* values : {&log.q, &log.qd, &log.tau, &log.qref, &log.qdref}) {
      for (int j = 0; j < 6; ++j) text += fmt::format(",{}", (*values)(i, j));
    }
    text += '\n';
  }
  std::ofstream(path) << text;
}

}  // namespace

int main(int argc, char** argv) {
  int repeats = 5;
  std::string path;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::string(argv[i]) == "--repeats") repeats = std::max(1, std::atoi(argv[i + 1]));
    if (std::string(argv[i]) == "--motion") path = argv[i + 1];
  }
  const std::vector<Case> cases{{"no friction", closed_loop(false, false)},
                                {"friction, stick and slip", closed_loop(true, false)},
                                {"friction, encoders of 2e-5 rad", closed_loop(true, true)}};
  const std::vector<Solver> solvers{{"Runge-Kutta", sim::SolverMethod::kRungeKutta, 1e-6},
                                    {"Runge-Kutta", sim::SolverMethod::kRungeKutta, 1e-8},
                                    {"CVODE, Adams", sim::SolverMethod::kAdams, 1e-8},
                                    {"CVODE, BDF", sim::SolverMethod::kBdf, 1e-8}};
  for (const Case& c : cases) {
    sim::SimulationSettings s = c.settings;
    s.solver = {sim::SolverMethod::kAdams, 1e-12, 1e-14};
    s.solver.restart_at_samples = true;
    const data::Log referee = sim::simulate(s).log;
    if (!path.empty() && &c == &cases.front()) write_motion(path, referee);
    fmt::print("{}\n  {:<18} {:>9} {:>8} {:>12} {:>10} {:>10}\n", c.name, "integrator", "tolerance", "time [ms]",
               "evaluations", "steps", "error [rad]");
    for (const Solver& solver : solvers) {
      s.solver = {solver.method, solver.tolerance, 0.01 * solver.tolerance};
      std::vector<double> times;
      sim::SimulationResult result;
      for (int k = 0; k < repeats; ++k) {
        const double begin = processor_time();
        result = sim::simulate(s);
        times.push_back(processor_time() - begin);
      }
      const double least = *std::min_element(times.begin(), times.end());
      fmt::print("  {:<18} {:>9.0e} {:>8.1f} {:>12} {:>10} {:>10.1e}\n", solver.name, solver.tolerance,
                 1e3 * least, result.counts.evaluations, result.counts.steps,
                 (result.log.q - referee.q).cwiseAbs().maxCoeff());
    }
  }
  return 0;
}
