/// @file
/// The arm as a System: rigid bodies, joint effects, sticking joints, held torque, payload trigger.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "heft/sim/simulator.hpp"
#include "integrator.hpp"

namespace heft::sim {

class Plant : public System {
 public:
  explicit Plant(const SimulationSettings& settings);

  int num_positions() const override { return n_; }
  int num_extra() const override { return num_extra_; }
  int num_roots() const override { return static_cast<int>(dry_.size()) + 1; }
  void evaluate(double t, const double* q, const double* qd, const double* z, double* qdd,
                double* zd) override;
  void roots(double t, const double* q, const double* qd, const double* z, double* g) override;

  /// Torque that is held until the next call.
  void hold_torque(const Eigen::VectorXd& torque) { held_ = torque; }
  /// Motor torque at a time: the held one, or the function's within the limits.
  const Eigen::VectorXd& motor_torque(double t);

  void attach(const Body& body) { dynamics_.attach(body); }
  void detach() { dynamics_.detach(); }

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

  /// Torque of all effects of a joint after evaluate(): friction and what holds a stuck joint.
  double effect_torque(int joint) const;

  void initial_extra(double t, const double* q, const double* qd, double* z) const;
  const ForwardDynamics& dynamics() const { return dynamics_; }

 private:
  struct Load {
    JointLoad load;
    std::vector<int> state_offset;  ///< of each effect's states within z
  };

  JointPoint point(std::size_t joint, double t, const double* q, const double* qd) const;
  double level(std::size_t joint, int direction, double t, const double* q, const double* z) const;
  void accelerations(double t, const double* q, const double* qd, const double* z);

  int n_;
  int num_extra_{0};
  ForwardDynamics dynamics_;
  std::vector<Load> loads_;
  std::vector<int> dry_;  ///< joints that can stick
  std::vector<bool> is_dry_;
  std::vector<int> mode_;
  std::unique_ptr<bool[]> locked_;  ///< per joint
  int num_stuck_{0};
  Eigen::VectorXd limit_;  ///< torque limits, size 0 for none
  Eigen::VectorXd held_;
  Eigen::VectorXd motor_;
  std::function<void(double, Eigen::Ref<Eigen::VectorXd>)> torque_function_;
  std::function<Wrench(double)> wrench_;
  std::vector<double> net_, qdd_, excess_, friction_;
  int trigger_joint_{-1};
  double trigger_position_{0.0};
  double trigger_side_{1.0};
};

}  // namespace heft::sim
