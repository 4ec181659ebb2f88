#include "beyond_regressor.hpp"

#include "heft/model/without_effects.hpp"

namespace heft::payload {

void LateMotion::take(double time, Eigen::VectorXd& q, Eigen::VectorXd& qd) {
  if (!(delay_ > 0)) return;
  rows_.push_back({time, q, qd});
  const double wanted = time - delay_;
  while (rows_.size() > 1 && rows_[1].time <= wanted) rows_.pop_front();
  const Row& at = rows_.front();
  const bool between = wanted > at.time && rows_.size() > 1;
  const Row& next = between ? rows_[1] : at;
  const double share = between ? (wanted - at.time) / (next.time - at.time) : 0.0;
  q = at.q + share * (next.q - at.q);
  qd = at.qd + share * (next.qd - at.qd);
}

data::Log with_late_motion(data::Log log, double delay) {
  LateMotion late(delay);
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    Eigen::VectorXd q = log.q.row(k), qd = Eigen::VectorXd(log.qd.cols());
    if (qd.size() > 0) qd = log.qd.row(k);
    late.take(log.time[k], q, qd);
    log.q.row(k) = q;
    if (qd.size() > 0) log.qd.row(k) = qd;
  }
  return log;
}

BeyondRegressor::BeyondRegressor(const model::Robot& robot) {
  if (robot.couplings.empty() && robot.cables.empty() && robot.effects.empty() && robot.elasticities.empty()) return;
  elastic_ = !robot.elasticities.empty();
  model::Robot prompt = robot;
  prompt.torque_delay = 0.0;
  whole_ = std::make_unique<model::MotionTorque>(prompt);
  linear_ = std::make_unique<model::Dynamics>(model::without_effects(robot));
}

Eigen::VectorXd BeyondRegressor::torque(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                        const Eigen::VectorXd& qdd, double sign_width) {
  const Eigen::MatrixXd whole = whole_->torque(Eigen::VectorXd::Constant(1, time), q.transpose(),
                                               qd.transpose(), qdd.transpose(), sign_width);
  Eigen::VectorXd linear = linear_->joint_torque(q, qd, qdd, sign_width);
  if (elastic_) {
    linear +=
        linear_->inverse_dynamics(link_q(), link_qd(), link_qdd()) - linear_->inverse_dynamics(q, qd, qdd);
  }
  return whole.row(0).transpose() - linear;
}

}  // namespace heft::payload
