#include "heft/sim/following.hpp"

#include <utility>

#include "heft/model/dynamics.hpp"

namespace heft::sim {
namespace {

using Eigen::VectorXd;

constexpr double kSampleRate = 500.0, kLogRate = 100.0;  // [Hz]
constexpr double kNatural = 50.0;                        // of the closed loop [rad/s]
// What friction brakes fast takes two and a half times the steps for two digits more, which encoders do not show.
constexpr double kRelative = 1e-6, kAbsolute = 1e-8;     // [rad, rad/s; m, m/s]
constexpr double kSignWidth = 2e-3;                      // of the friction fed forward [rad/s, m/s]

/// Computed torque from the arm's own model.
class ComputedTorque final : public Controller {
 public:
  explicit ComputedTorque(const model::Robot& robot) : dynamics_(robot) {}
  void control(double, const Measurement& now, Eigen::Ref<VectorXd> torque) override {
    const VectorXd wanted =
        now.qdd_ref + kNatural * kNatural * (now.q_ref - now.q) + 2.0 * kNatural * (now.qd_ref - now.qd);
    torque = dynamics_.inverse_dynamics(now.q, now.qd, wanted);
    // Friction, rotors, couplings and effects as the reference moves.
    torque += dynamics_.joint_torque(now.q_ref, now.qd_ref, now.qdd_ref, kSignWidth) -
              dynamics_.inverse_dynamics(now.q_ref, now.qd_ref, now.qdd_ref);
  }

 private:
  model::Dynamics dynamics_;
};

}  // namespace

SimulationSettings following(const model::Robot& robot, std::shared_ptr<const Reference> reference,
                             double duration) {
  const int n = robot.num_joints();
  SimulationSettings settings;
  settings.robot = robot;
  settings.loads = friction_of(robot);
  settings.duration = duration;
  settings.sample_rate = kSampleRate;
  settings.log_rate = kLogRate;
  settings.initial_position.resize(n);
  VectorXd qd(n), qdd(n);
  reference->evaluate(0.0, settings.initial_position, qd, qdd);
  settings.initial_velocity = qd;
  settings.solver.relative_tolerance = kRelative;
  settings.solver.absolute_tolerance = kAbsolute;
  settings.reference = std::move(reference);
  settings.controller = std::make_shared<ComputedTorque>(robot);
  settings.sensors.encoder_quantum = VectorXd::Constant(n, 2e-5);
  return settings;
}

}  // namespace heft::sim
