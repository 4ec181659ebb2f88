#include "heft/excite/fourier_motion.hpp"

#include <cmath>
#include <numbers>

namespace heft::excite {

using Eigen::Index;
using Eigen::VectorXd;

void ExcitationTrajectory::evaluate(double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) const {
  const double omega = 2.0 * std::numbers::pi / period;
  q = start;
  qd.setZero(num_joints());
  qdd.setZero(num_joints());
  VectorXd terms = VectorXd::Zero(num_joints());
  for (int k = 0; k < num_harmonics(); ++k) {
    const double w = omega * (k + 1), c = std::cos(w * t), s = std::sin(w * t);
    q += sine.col(k) * ((1.0 - c) / w) + cosine.col(k) * (s / w);
    qd += sine.col(k) * s + cosine.col(k) * c;
    qdd += sine.col(k) * (w * c) - cosine.col(k) * (w * s);
    terms += sine.col(k).cwiseAbs() + cosine.col(k).cwiseAbs();
  }
  // Rounding at rest is no velocity: friction would take its sign.
  for (Index j = 0; j < qd.size(); ++j) {
    if (std::abs(qd[j]) < 1e-14 * terms[j]) qd[j] = 0.0;
    if (std::abs(qdd[j]) < 1e-14 * terms[j] * omega * num_harmonics()) qdd[j] = 0.0;
  }
}

}  // namespace heft::excite
