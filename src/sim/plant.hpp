/// @file
/// The arm as a System: rigid bodies, elastic joints, joint effects, sticking joints, held torque, payload
/// trigger.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "heft/sim/simulator.hpp"
#include "integrator.hpp"

namespace heft::sim {

/// Positions are those of the joints, motor side, n; behind them the link's positions of the elastic
/// joints. All vectors of positions, velocities and accelerations here have that order.
class Plant : public System {
 public:
  explicit Plant(const SimulationSettings& settings);

  int num_positions() const override { return n_ + static_cast<int>(elastic_.size()); }
  int num_extra() const override { return num_extra_; }
  int num_roots() const override { return static_cast<int>(dry_.size()) + 1; }
  /// Joint whose friction mode an event function is about; of the last one, the payload's, the first joint.
  int joint_of_root(int root) const {
    return root < static_cast<int>(dry_.size()) ? dry_[static_cast<std::size_t>(root)] : 0;
  }
  int joint_of(int position) const override {
    return position < n_ ? position : elastic_[static_cast<std::size_t>(position - n_)].joint;
  }
  void evaluate(double t, const double* q, const double* qd, const double* z, double* qdd,
                double* zd) override;
  void roots(double t, const double* q, const double* qd, const double* z, double* g) override;
  void roots_there(double t, const double* q, const double* qd, const double* z, double* g) override;

  /// Torque that is held until the next call.
  void hold_torque(const Eigen::VectorXd& torque) { held_ = torque; }
  /// Motor torque at a time: the held one, or the function's within the limits.
  const Eigen::VectorXd& motor_torque(double t);

  void attach(const Body& body) { dynamics_.attach(body); }
  void detach() { dynamics_.detach(); }

  /// Puts the links of elastic joints where their springs hold them against gravity, moving with their
  /// motors.
  void settle_links(double t, double* q, double* qd);

  /// Root function that falls through zero when joint passes position, coming from where it is at q.
  void arm_trigger(int joint, double position, double q);
  void disarm_trigger() { trigger_joint_ = -1; }
  bool trigger_armed() const { return trigger_joint_ >= 0; }

  /// Decides for every joint at rest whether it sticks or starts, together, so that no stuck joint holds more
  /// than its break-away level. Velocities of joints whose slipping ended (their event function is not
  /// positive) are set to zero.
  /// @return whether a mode changed
  bool resolve_modes(double t, const double* q, double* qd, const double* z);

  /// −1, 0, 1 per joint: slips backward, sticks, slips forward; joints without dry friction slip always.
  const std::vector<int>& modes() const { return mode_; }
  bool is_dry(int joint) const { return is_dry_[static_cast<std::size_t>(joint)]; }

  /// Torque of everything that acts at a joint other than rigid bodies and rotors, after evaluate(): friction
  /// and the torque that holds a stuck joint.
  double effect_torque(int joint) const;

  void initial_extra(double t, const double* q, const double* qd, double* z) const;

  /// Motors of elastic joints and their springs included [J].
  double kinetic_energy(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const;
  double potential_energy(const Eigen::VectorXd& q) const;
  /// The links' part of positions, velocities or accelerations, n.
  Eigen::VectorXd link_side(const Eigen::VectorXd& values) const;

 private:
  struct Load {
    JointLoad load;
    std::vector<int> state_offset;  ///< of each effect's states within z
    double load_share{0.0};         ///< sum over the effects
    double load_gain{0.0};          ///< the same of the shares with the load's own sign
    int elastic{-1};                ///< place in elastic_ of an elastic joint
  };
  /// A joint with a torque that grows with its load, and without a spring.
  struct LoadedJoint {
    int joint;
    double rotor;  ///< inertia
    double along;  ///< μ times the direction
    double gain;   ///< share with the load's own sign
    double side;   ///< sign of the load
  };

  /// @param robot  with every rotor where it belongs
  Plant(const SimulationSettings& settings, const model::Robot& robot);
  /// Locks as the modes say.
  void relock();
  /// Of a joint [°C]; not a number: not simulated.
  double temperature(std::size_t joint, double t) const;
  JointPoint point(std::size_t joint, double t, const double* q, const double* qd) const;
  /// Break-away level of a joint at rest that passes `load` on to the bodies.
  double level(std::size_t joint, int direction, double load, double t, const double* q,
               const double* z) const;
  /// Torque that a joint at rest passes on to the bodies, after accelerations().
  double load_at_rest(std::size_t joint) const { return net_[joint] - excess_[joint]; }
  void accelerations(double t, const double* q, const double* qd, const double* z);
  /// Accelerations and excess for the torque net_.
  void solve_bodies(double t, const double* q, const double* qd);
  /// The same with the rotors of gear couplings.
  void solve(double t, const double* q, const double* qd);
  /// The same with load friction.
  void solve_with_load_friction(double t, const double* q, const double* qd, const double* torque);
  double spring_torque(int k, const double* q, const double* qd) const;
  void add_coupling_rotors(double t, const double* q, const double* qd);

  int n_;
  int num_extra_{0};
  ForwardDynamics dynamics_;
  std::vector<Load> loads_;
  std::vector<int> dry_;  ///< joints that can stick
  std::vector<bool> is_dry_;
  std::vector<int> mode_;
  std::unique_ptr<bool[]> locked_;         ///< per joint
  std::unique_ptr<bool[]> locked_bodies_;  ///< the same without elastic joints: there the motor is locked
  int num_stuck_{0};
  std::vector<Elasticity<double>> elastic_;
  std::vector<GearCoupling<double>> couplings_;
  std::vector<JointCable<double>> cables_;
  bool coupled_rotors_{false};
  std::vector<LoadedJoint> loaded_;
  double coupling_smooth_speed_;
  Eigen::VectorXd limit_;  ///< torque limits, size 0 for none
  Eigen::VectorXd held_;
  Eigen::VectorXd motor_;
  std::function<void(double, Eigen::Ref<Eigen::VectorXd>)> torque_function_;
  std::function<Wrench(double)> wrench_;
  std::function<Eigen::Vector3d(double)> gravity_;
  std::function<void(double, const Eigen::Ref<const Eigen::VectorXd>&,
                     const Eigen::Ref<const Eigen::VectorXd>&, Eigen::Ref<Eigen::VectorXd>)>
      disturbance_;
  Eigen::VectorXd disturbance_torque_;
  std::vector<double> net_, qdd_, excess_, friction_;
  std::vector<double> link_q_, link_qd_, link_torque_;  ///< of the rigid bodies, n
  int trigger_joint_{-1};
  double trigger_position_{0.0};
  double trigger_side_{1.0};
};

}  // namespace heft::sim
