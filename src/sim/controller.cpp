#include "heft/sim/controller.hpp"

#include <utility>

namespace heft::sim {

PdController::PdController(Eigen::VectorXd kp, Eigen::VectorXd kd,
                           std::shared_ptr<const ForwardDynamics> gravity_model)
    : kp_(std::move(kp)), kd_(std::move(kd)), gravity_model_(std::move(gravity_model)) {}

void PdController::control(double, const Measurement& m, Eigen::Ref<Eigen::VectorXd> torque) {
  torque = kp_.cwiseProduct(m.q_ref - m.q) + kd_.cwiseProduct(m.qd_ref - m.qd);
  if (gravity_model_ != nullptr) torque += gravity_model_->gravity_torque(m.q);
}

}  // namespace heft::sim
