#include "heft/sim/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace heft::sim {

const char* to_string(SimulationEvent::Kind kind) {
  switch (kind) {
    case SimulationEvent::Kind::kGrasp: return "grasp";
    case SimulationEvent::Kind::kRelease: return "release";
    case SimulationEvent::Kind::kStick: return "stick";
    case SimulationEvent::Kind::kSlip: return "slip";
  }
  return "event";
}

double Simulation::duration() const {
  const data::Log& log = result.log;
  return log.time[log.num_samples() - 1] - log.time[0];
}

std::vector<SimulationEvent> Simulation::payload_events() const {
  std::vector<SimulationEvent> events;
  std::copy_if(result.events.begin(), result.events.end(), std::back_inserter(events),
               [](const SimulationEvent& event) { return event.joint < 0; });
  return events;
}

int Simulation::times_stuck() const {
  return static_cast<int>(
      std::count_if(result.events.begin(), result.events.end(), [](const SimulationEvent& event) {
        return event.joint >= 0 && event.kind == SimulationEvent::Kind::kStick;
      }));
}

Eigen::VectorXd Simulation::tracking_error() const {
  const data::Log& log = result.log;
  if (log.qref.cols() != log.q.cols()) return {};
  return (log.qref - log.q).colwise().squaredNorm().cwiseSqrt() /
         std::sqrt(static_cast<double>(log.num_samples()));
}

Eigen::VectorXd Simulation::largest_torque() const {
  if (result.log.tau.cols() == 0) return {};
  return result.log.tau.cwiseAbs().colwise().maxCoeff();
}

}  // namespace heft::sim
