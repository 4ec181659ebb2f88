/// Random motions inside the limits, how near a motion comes to them, and motions drawn together until they are kept.
#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

#include "design_impl.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

}  // namespace

Samples ExcitationDesign::Impl::samples_of(const ExcitationTrajectory& motion,
                                           const FourierBasis& basis) const {
  const MatrixXd c = coefficients(motion);
  Samples samples{basis.q * c, basis.qd * c, basis.qdd * c};
  samples.q.rowwise() += motion.start.transpose();
  return samples;
}

ExcitationTrajectory ExcitationDesign::Impl::scaled(const ExcitationTrajectory& motion, double factor) const {
  ExcitationTrajectory result = motion;
  result.sine *= factor;
  result.cosine *= factor;
  if (free_start()) {
    // About the mean position: q = mean + factor (q − mean).
    const VectorXd mean_offset = (coarse.q * coefficients(motion)).colwise().mean();
    result.start = motion.start + (1.0 - factor) * mean_offset;
  }
  return result;
}

double ExcitationDesign::Impl::drawn_together(const ExcitationTrajectory& motion, const FourierBasis& basis,
                                              double step, ExcitationTrajectory& result) const {
  for (double factor = 1.0; factor > 1e-3; factor *= step) {
    result = scaled(motion, factor);
    if (bounds.closest(samples_of(result, basis), 0.0).slack > 0.0) return factor;
  }
  return 0.0;
}

VectorXd ExcitationDesign::Impl::fastest_alone() const {
  VectorXd fastest = bounds.velocity;
  if (!std::isfinite(bounds.tool_speed)) return fastest;
  double reach = vector_of(bounds.robot.tip_position).norm() + bounds.limits.tool.norm();
  for (Index j = n() - 1; j >= 0; --j) {
    if (joint_of(bounds.robot, j).joint.type == JointType::kPrismatic) {
      fastest[j] = std::min(fastest[j], bounds.tool_speed);
    } else if (reach > 0.0) {
      fastest[j] = std::min(fastest[j], bounds.tool_speed / reach);
    }
    reach += vector_of(joint_of(bounds.robot, j).joint.position).norm();
  }
  return fastest;
}

ExcitationTrajectory ExcitationDesign::Impl::random_motion(std::uint64_t seed) const {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  constexpr int kPositions = 1000;
  constexpr int kMotions = 20;
  constexpr double kGood = 0.5;
  Closest nearest{-kInfinity, "", 0};
  const VectorXd fastest = fastest_alone();
  ExcitationTrajectory best;
  std::string last_stop;
  double best_factor = 0.0;
  int motions = 0;
  for (int attempt = 0; attempt < kPositions && motions < kMotions; ++attempt) {
    const VectorXd centre =
        free_start() ? random_position(random, bounds.middle, bounds.half, 0.9) : options.start;
    const Closest found = bounds.closest_at_rest(centre);
    if (!(found.slack > kRoom)) {
      if (found.slack > nearest.slack) nearest = found;
      continue;
    }
    ++motions;
    MatrixXd c(at_rest.cols(), n());
    for (Index i = 0; i < c.size(); ++i) c.data()[i] = normal(random);
    c = at_rest * c;
    const MatrixXd travel = coarse.q * c, qd = coarse.qd * c;
    VectorXd start = centre;
    for (int j = 0; j < n(); ++j) {
      const double offset = free_start() ? travel.col(j).mean() : 0.0;
      // Room on the nearer side of the centre.
      const double room = bounds.half[j] - std::abs(centre[j] - bounds.middle[j]);
      const double factor = 0.98 * std::min(fastest[j] / qd.col(j).cwiseAbs().maxCoeff(),
                                            room / (travel.col(j).array() - offset).abs().maxCoeff());
      c.col(j) *= factor;
      start[j] -= factor * offset;
    }
    ExcitationTrajectory together;
    const double factor = drawn_together(make(start, c), coarse, 0.95, together);
    if (factor == 0.0) last_stop = bounds.closest(samples_of(together, coarse), 0.0).what;
    if (factor <= best_factor) continue;
    best_factor = factor;
    best = together;
    if (factor >= kGood) break;
  }
  ExcitationTrajectory result;
  if (best_factor > 0.0 && drawn_together(best, fine, 0.98, result) > 0.0) return result;
  if (motions == 0) {
    throw NotIdentifiableError(fmt::format(
        "robot \"{}\": limits: no position found in {} tries at which the arm is inside all of them "
        "with room to move, so there is no safe motion; nearest missed: {}; widen that limit",
        columns.robot().name, kPositions, nearest.what));
  }
  throw NotIdentifiableError(
      fmt::format("robot \"{}\": limits: {} random motions were tried and none is safe however small; the "
                  "limit that stops the last: {}; widen it",
                  columns.robot().name, motions, last_stop));
}

LimitUse ExcitationDesign::use_of(const ExcitationTrajectory& motion) const {
  return impl_->bounds.use_of(impl_->samples_of(motion, impl_->fine));
}

}  // namespace heft::excite
