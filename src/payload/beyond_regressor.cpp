#include "beyond_regressor.hpp"

#include "heft/model/without_effects.hpp"

namespace heft::payload {

data::Log with_late_motion(data::Log log, double delay) {
  if (!(delay > 0)) return log;
  const Eigen::MatrixXd q = log.q, qd = log.qd;
  Eigen::Index at = 0;  // the last row that is not later than the moment wanted
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    const double wanted = log.time[k] - delay;
    while (at + 1 < log.time.size() && log.time[at + 1] <= wanted) ++at;
    const bool between = wanted > log.time[at] && at + 1 < log.time.size();
    const double share = between ? (wanted - log.time[at]) / (log.time[at + 1] - log.time[at]) : 0.0;
    const Eigen::Index next = between ? at + 1 : at;
    log.q.row(k) = q.row(at) + share * (q.row(next) - q.row(at));
    if (qd.cols() > 0) log.qd.row(k) = qd.row(at) + share * (qd.row(next) - qd.row(at));
  }
  return log;
}

BeyondRegressor::BeyondRegressor(const model::Robot& robot) {
  if (robot.couplings.empty() && robot.effects.empty() && robot.elasticities.empty()) return;
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
