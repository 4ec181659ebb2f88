/// @file
/// Any controller of core in the simulator.
#pragma once

#include <Eigen/Core>

#include "heft/core/control/arm_controller.hpp"
#include "heft/sim/controller.hpp"

namespace heft::sim {

/// Takes a sample's measurement to one of core's controllers, and its torque back, whatever its status: a refused sample gets the
/// torque that the controller holds the arm with.
template <ArmController C>
class CoreController : public Controller {
 public:
  C& core() { return core_; }
  const C& core() const { return core_; }

  void control(double, const Measurement& m, Eigen::Ref<Eigen::VectorXd> torque) override {
    typename C::Reference reference;
    reference.q = m.q_ref;
    reference.qd = m.qd_ref;
    reference.qdd = m.qdd_ref;
    typename C::Measurement measured;
    measured.q = m.q;
    measured.qd = m.qd;
    measured.tau = m.tau;
    measured.dt = m.sample_time;
    torque = core_.step(reference, measured).torque;
  }

 private:
  C core_;
};

}  // namespace heft::sim
