#include "heft/excite/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heft/model/dynamics.hpp"

namespace heft::excite {

using Eigen::Index;
using Eigen::VectorXd;

void PiecewiseMotion::add(Piece piece) {
  begins_.push_back(duration_);
  duration_ += piece.duration;
  pieces_.push_back(std::move(piece));
}

void PiecewiseMotion::evaluate(double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) const {
  const auto next = std::upper_bound(begins_.begin(), begins_.end(), t);
  const auto k = static_cast<std::size_t>(std::max<std::ptrdiff_t>(next - begins_.begin(), 1) - 1);
  pieces_[k].at(std::clamp(t - begins_[k], 0.0, pieces_[k].duration), q, qd, qdd);
}

Piece fourier_piece(const std::string& name, const ExcitationTrajectory& motion) {
  return {name, motion.duration,
          [motion](double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) { motion.evaluate(t, q, qd, qdd); }};
}

Piece line_piece(const std::string& name, const VectorXd& from, const VectorXd& to, double duration) {
  return {name, duration, [=](double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) {
            // s = 10x³ − 15x⁴ + 6x⁵
            const double x = duration > 0.0 ? std::clamp(t / duration, 0.0, 1.0) : 1.0;
            const VectorXd way = to - from;
            q = from + x * x * x * (10.0 + x * (6.0 * x - 15.0)) * way;
            qd = 30.0 * x * x * (1.0 - x) * (1.0 - x) / std::max(duration, 1e-9) * way;
            qdd = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / std::max(duration * duration, 1e-18) * way;
          }};
}

data::Log log_of(const model::Robot& robot, const PiecewiseMotion& motion, double rate) {
  const model::Dynamics dynamics(robot);
  const auto rows = static_cast<Index>(std::floor(motion.duration() * rate + 1e-9)) + 1;
  const Index n = robot.num_joints();
  data::Log log;
  log.time.resize(rows);
  log.q.resize(rows, n);
  log.qd = log.qdd = log.tau = log.q;
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    log.time[i] = static_cast<double>(i) / rate;
    motion.evaluate(log.time[i], q, qd, qdd);
    log.q.row(i) = q;
    log.qd.row(i) = qd;
    log.qdd.row(i) = qdd;
    log.tau.row(i) = dynamics.joint_torque(q, qd, qdd);
  }
  return log;
}

}  // namespace heft::excite
