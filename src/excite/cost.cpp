/// What a motion reveals, as a number to make small, with its exact gradient (excitation.md).
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "design_impl.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Distance from the limits that the search keeps for the motion between its samples. At 30 samples of the
// fastest harmonic a sine passes its highest sample by 1 − cos(π/30) = 0.55 %.
constexpr double kReserve = 0.006;
constexpr double kTorqueReserve = 0.01;
constexpr double kWallReserve = 0.002;  // [m]

/// Eigenvalues of F with columns of W scaled to norm 1, ascending; empty when a column is 0.
VectorXd scaled_eigenvalues(const MatrixXd& F, MatrixXd* vectors = nullptr) {
  if (!(F.diagonal().minCoeff() > 0.0)) return {};
  const VectorXd d = F.diagonal().cwiseSqrt().cwiseInverse();
  Eigensystem eigen = eigensystem_of(d.asDiagonal() * F * d.asDiagonal());
  if (vectors != nullptr) *vectors = std::move(eigen.vectors);
  return eigen.values;
}

double condition_of(const VectorXd& lambda) {
  if (lambda.size() == 0 || !(lambda[0] > 0.0)) return kInfinity;
  return std::sqrt(lambda[lambda.size() - 1] / lambda[0]);
}

}  // namespace

bool ExcitationDesign::Impl::objective(const MatrixXd& F, double& value, MatrixXd* S) const {
  // C = D F D with D = diag(F)^(-1/2): columns of W at norm 1. log det F = log det C − 2 log det D.
  const Index size = F.rows();
  if (!(F.diagonal().minCoeff() > 0.0) || !F.allFinite()) return false;
  const VectorXd d = F.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd C = d.asDiagonal() * F * d.asDiagonal();
  if (options.cost == ExcitationCost::kDOptimal) {
    MatrixXd L;
    if (!cholesky(C, L)) return false;
    const double log_det = 2.0 * L.diagonal().array().log().sum() - 2.0 * d.array().log().sum();
    if (!std::isfinite(log_det)) return false;
    value = -log_det / (2.0 * static_cast<double>(size));
    if (S != nullptr) {
      // ∂ log det F / ∂F = F⁻¹
      *S = MatrixXd::Identity(size, size);
      if (!solve_positive(C, *S)) return false;
      *S = d.asDiagonal() * *S * d.asDiagonal() * (-1.0 / (2.0 * static_cast<double>(size)));
    }
    return true;
  }
  // log κ = ½ (log λ_max − log λ_min) of C, smooth: log λ_max ≈ log tr(C^p) / p, log λ_min ≈ −log tr(C^−p) / p.
  constexpr double kPower = 8.0;
  const Eigensystem eigen = eigensystem_of(C);
  const VectorXd& lambda = eigen.values;
  if (!eigen.converged || !(lambda[0] > 1e-14)) return false;
  // Powers relative to the extreme eigenvalues, so that nothing overflows.
  const double largest = lambda[size - 1], smallest = lambda[0];
  const VectorXd up_power = (lambda / largest).array().pow(kPower),
                 down_power = (smallest / lambda.array()).pow(kPower);
  const double up_sum = up_power.sum(), down_sum = down_power.sum();
  value = 0.5 *
          (std::log(largest) + std::log(up_sum) / kPower - std::log(smallest) + std::log(down_sum) / kPower);
  if (S != nullptr) {
    // A = ∂value/∂C = ½ (C^(p−1) / tr C^p − C^(−p−1) / tr C^−p)
    const VectorXd f =
        0.5 * (up_power.cwiseQuotient(lambda) / up_sum - down_power.cwiseQuotient(lambda) / down_sum);
    const MatrixXd A = eigen.vectors * f.asDiagonal() * eigen.vectors.transpose();
    // dC_ij = d_i d_j dF_ij − ½ C_ij (dF_ii / F_ii + dF_jj / F_jj)
    *S = d.asDiagonal() * A * d.asDiagonal();
    S->diagonal() -= (A * C).diagonal().cwiseQuotient(F.diagonal());
  }
  return true;
}

namespace {

/// log(a · b · ...) without a logarithm for every factor: they are slacks, each far above the smallest number.
class LogOfProduct {
 public:
  void add(double factor) {
    product_ *= factor;
    if (product_ > kSmall && product_ < 1.0 / kSmall) return;
    sum_ += std::log(product_);
    product_ = 1.0;
  }
  double value() const { return sum_ + std::log(product_); }

 private:
  static constexpr double kSmall = 1e-200;
  double product_{1.0};
  double sum_{0.0};
};

/// Forces on the links in place of derivatives by their points: ∂/∂q_i is the moment about joint i of what acts from link i on.
struct Forces {
  std::array<Vector3d, model::kMaxJoints> force, moment;  ///< on a link; about the base's origin

  explicit Forces(int n) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(n); ++k) force[k] = moment[k] = Vector3d::Zero();
  }
  void add(int link, const Vector3d& P, const Vector3d& f) {
    if (link < 0) return;
    force[static_cast<std::size_t>(link)] += f;
    moment[static_cast<std::size_t>(link)] += P.cross(f);
  }
  /// What acts from each link on.
  void sum_outward(int n) {
    for (int j = n - 1; j > 0; --j) {
      const auto k = static_cast<std::size_t>(j);
      force[k - 1] += force[k];
      moment[k - 1] += moment[k];
    }
  }
  Vector3d moment_about(std::size_t joint, const Vector3d& origin) const {
    return moment[joint] - origin.cross(force[joint]);
  }
};

/// Velocities of the link origins and angular velocities of the links.
struct LinkVelocities {
  std::array<Vector3d, model::kMaxJoints> linear, angular;

  template <typename Row>
  LinkVelocities(const collision::LinkFrames& at, const Row& qd) {
    Vector3d v = Vector3d::Zero(), w = Vector3d::Zero(), origin = Vector3d::Zero();
    for (int j = 0; j < at.num_joints; ++j) {
      const auto k = static_cast<std::size_t>(j);
      v += w.cross(at.origin[k] - origin);
      origin = at.origin[k];
      (at.revolute[k] ? w : v) += qd[j] * at.axis[k];
      linear[k] = v;
      angular[k] = w;
    }
  }
};

}  // namespace

/// One instant of the barrier in space.
class ExcitationDesign::Impl::SpaceBarrier {
 public:
  explicit SpaceBarrier(const LimitCheck& limits) : bounds_(limits) {
    const auto& capsules = limits.limits.arm.capsules;
    from_.resize(capsules.size());
    to_.resize(capsules.size());
  }

  /// False outside. Gradients: of −Σ log slack.
  template <typename Row>
  bool evaluate(const Row& q, const Row& qd, bool with_gradient, double& logs, VectorXd& by_q,
                VectorXd& by_qd) {
    const collision::LinkFrames frames(bounds_.robot, q.transpose());
    LogOfProduct product;
    Forces still(bounds_.n()), moving(bounds_.n());
    if (!add_walls(frames, product, still) || !add_distances(frames, product, still)) return false;
    if (bounds_.points.empty()) {
      logs += product.value();
      if (with_gradient) take(frames, still, by_q);
      return true;
    }
    const LinkVelocities velocities(frames, qd);
    if (!add_speeds(frames, velocities, product, moving)) return false;
    logs += product.value();
    if (!with_gradient) return true;
    take(frames, still, by_q);
    take_speeds(frames, velocities, moving, by_q, by_qd);
    return true;
  }

 private:
  bool add_walls(const collision::LinkFrames& frames, LogOfProduct& product, Forces& forces) const {
    for (const Wall& wall : bounds_.walls) {
      const Vector3d P = frames.at(wall.link, wall.point);
      const double slack = wall.normal.dot(P) - wall.bound - kWallReserve;
      if (!(slack > 0.0)) return false;
      product.add(slack);
      forces.add(wall.link, P, -1.0 / slack * wall.normal);
    }
    return true;
  }

  bool add_distances(const collision::LinkFrames& frames, LogOfProduct& product, Forces& forces) {
    const auto& arm = bounds_.limits.arm;
    for (std::size_t k = 0; k < arm.capsules.size(); ++k) {
      const collision::Capsule& capsule = arm.capsules[k];
      from_[k] = frames.at(capsule.link, capsule.a);
      to_[k] = frames.at(capsule.link, capsule.b);
    }
    const auto keep_apart = [&](const collision::Nearest& found, double radii, double clearance, int first,
                                int second) {
      const double slack = found.distance - clearance - std::min(kWallReserve, 0.1 * clearance);
      if (!(slack > 0.0)) return false;
      product.add(slack);
      const Vector3d apart = -1.0 / (slack * (found.distance + radii)) * (found.on_first - found.on_second);
      forces.add(first, found.on_first, apart);
      forces.add(second, found.on_second, -apart);
      return true;
    };
    for (const collision::CapsulePair& pair : arm.pairs) {
      const auto i = static_cast<std::size_t>(pair.first), k = static_cast<std::size_t>(pair.second);
      const collision::Capsule &first = arm.capsules[i], &second = arm.capsules[k];
      const auto found =
          collision::distance(from_[i], to_[i], first.radius, from_[k], to_[k], second.radius);
      if (!keep_apart(found, first.radius + second.radius, pair.clearance, first.link, second.link))
        return false;
    }
    for (const collision::GuardedObstacle& guarded : arm.guarded) {
      const auto& capsule = arm.capsules[static_cast<std::size_t>(guarded.capsule)];
      const auto& box = bounds_.limits.obstacles[static_cast<std::size_t>(guarded.obstacle)];
      const auto found = collision::distance(frames, capsule, box);
      if (!keep_apart(found, capsule.radius, bounds_.limits.clearance, capsule.link, -1)) return false;
    }
    return true;
  }

  bool add_speeds(const collision::LinkFrames& frames, const LinkVelocities& velocities,
                  LogOfProduct& product, Forces& forces) const {
    const double fastest = (1.0 - kReserve) * bounds_.tool_speed;
    for (const SpeedPoint& point : bounds_.points) {
      const auto k = static_cast<std::size_t>(point.link);
      const Vector3d P = frames.at(point.link, point.point);
      const Vector3d v = velocities.linear[k] + velocities.angular[k].cross(P - frames.origin[k]);
      const double ratio = v.squaredNorm() / (fastest * fastest);
      if (!(ratio < 1.0)) return false;
      product.add(1.0 - ratio);
      // −log(1 − v²/l²): derivative 2/(l² (1 − v²/l²)) of ½ v²
      forces.add(point.link, P, 2.0 / (fastest * fastest * (1.0 - ratio)) * v);
    }
    return true;
  }

  void take(const collision::LinkFrames& frames, Forces& forces, VectorXd& by_q) const {
    forces.sum_outward(bounds_.n());
    for (int j = 0; j < bounds_.n(); ++j) {
      const auto k = static_cast<std::size_t>(j);
      by_q[j] = frames.axis[k].dot(frames.revolute[k] ? forces.moment_about(k, frames.origin[k])
                                                      : forces.force[k]);
    }
  }

  /// Forces u parallel to the velocities of their points P: with r = P − o_i, ∂(u·v)/∂q_i = a_i · (u × v_i − ω_i × (r × u)),
  /// the part v × u being zero; for a joint that slides a_i · (u × ω_i).
  void take_speeds(const collision::LinkFrames& frames, const LinkVelocities& velocities, Forces& forces,
                   VectorXd& by_q, VectorXd& by_qd) const {
    forces.sum_outward(bounds_.n());
    for (int j = 0; j < bounds_.n(); ++j) {
      const auto k = static_cast<std::size_t>(j);
      const Vector3d& axis = frames.axis[k];
      if (frames.revolute[k]) {
        const Vector3d moment = forces.moment_about(k, frames.origin[k]);
        by_qd[j] = axis.dot(moment);
        by_q[j] += axis.dot(forces.force[k].cross(velocities.linear[k]) - velocities.angular[k].cross(moment));
      } else {
        by_qd[j] = axis.dot(forces.force[k]);
        by_q[j] += axis.dot(forces.force[k].cross(velocities.angular[k]));
      }
    }
  }

  const LimitCheck& bounds_;
  std::vector<Vector3d> from_, to_;  ///< ends of the capsules' axes
};

bool ExcitationDesign::Impl::space_barrier(const Samples& at, double barrier, bool with_gradient, double& sum,
                                           MatrixXd& by_q, MatrixXd& by_qd) const {
  const Index rows = at.q.rows();
  const double share = 1.0 / static_cast<double>(rows);
  by_q = by_qd = MatrixXd::Zero(rows, n());
  VectorXd log_slack = VectorXd::Zero(rows);
  std::atomic<bool> inside{true};
  constexpr Index kPiece = 32;  // rows of a job
  host::for_each_parallel(static_cast<std::size_t>((rows + kPiece - 1) / kPiece), [&](std::size_t piece) {
    VectorXd gradient_q = VectorXd::Zero(n()), gradient_qd = VectorXd::Zero(n());
    SpaceBarrier instant(bounds);
    const Index from = static_cast<Index>(piece) * kPiece;
    for (Index i = from; i < std::min(rows, from + kPiece) && inside; ++i) {
      if (!instant.evaluate(at.q.row(i), at.qd.row(i), with_gradient, log_slack[i], gradient_q, gradient_qd)) {
        inside = false;
        return;
      }
      if (!with_gradient) continue;
      by_q.row(i) = barrier * share * gradient_q;
      by_qd.row(i) = barrier * share * gradient_qd;
    }
  });
  if (!inside) return false;
  double logs = 0.0;  // row by row, so that the sum is the same on any number of threads
  for (Index i = 0; i < rows; ++i) logs += log_slack[i];
  sum += share * logs;
  return true;
}

/// The barrier over the coarse samples: log of the slacks, and the derivative of −weight times it by what is limited, samples × n.
struct ExcitationDesign::Impl::Barrier {
  Barrier(Index samples, Index joints, double weight)
      : count(static_cast<double>(samples)),
        share(weight / count),
        by_q(MatrixXd::Zero(samples, joints)),
        by_qd(by_q),
        by_qdd(by_q),
        by_tau(by_q) {}

  /// log(1 − (v/l)²) bounds both sides; its derivative is −2 v / (l² − v²). False outside.
  bool bound(double value, double limit, double& by) {
    const double slack = 1.0 - (value / limit) * (value / limit);
    if (!(slack > 0.0)) return false;
    logs.add(slack);
    by += share * 2.0 * value / (limit * limit * slack);
    return true;
  }

  double count;
  double share;
  LogOfProduct logs;  ///< of the slacks of the coarse samples
  MatrixXd by_q, by_qd, by_qdd, by_tau;
};

bool ExcitationDesign::Impl::motion_barrier(const Samples& motion, Barrier& barrier) const {
  constexpr double kUse = 1.0 - kReserve;
  for (Index j = 0; j < motion.q.cols(); ++j) {
    const bool bounded = std::isfinite(bounds.acceleration[j]);
    for (Index i = 0; i < motion.q.rows(); ++i) {
      if (!barrier.bound(motion.q(i, j) - bounds.middle[j], kUse * bounds.half[j], barrier.by_q(i, j)))
        return false;
      if (!barrier.bound(motion.qd(i, j), kUse * bounds.velocity[j], barrier.by_qd(i, j))) return false;
      if (bounded && !barrier.bound(motion.qdd(i, j), kUse * bounds.acceleration[j], barrier.by_qdd(i, j)))
        return false;
    }
  }
  return true;
}

bool ExcitationDesign::Impl::torque_barrier(const Samples& motion, Barrier& barrier,
                                            std::vector<MatrixXd>& rows) const {
  MatrixXd tau;
  regressor->evaluate(motion.q, motion.qd, motion.qdd, rows, tau);
  constexpr double kTorqueUse = 1.0 - kTorqueReserve;
  for (Index j = 0; j < n(); ++j) {
    if (!std::isfinite(bounds.torque[j])) continue;
    for (Index i = 0; i < tau.rows(); ++i) {
      if (!barrier.bound(tau(i, j), kTorqueUse * bounds.torque[j] - bounds.coulomb[j], barrier.by_tau(i, j)))
        return false;
    }
  }
  return true;
}

MatrixXd ExcitationDesign::Impl::searched_information(const std::vector<MatrixXd>& rows, double dt) const {
  // A joint feels no column before its first: sorted, each adds to the lower right corner only.
  MatrixXd sorted = MatrixXd::Zero(b(), b());
  for (Index j = 0; j < n(); ++j) {
    const MatrixXd& row = rows[static_cast<std::size_t>(j)];
    sorted.bottomRightCorner(row.cols(), row.cols())
        .selfadjointView<Eigen::Lower>()
        .rankUpdate(row.transpose(), dt * weights[j] * weights[j]);
  }
  sorted.triangularView<Eigen::StrictlyUpper>() = sorted.transpose();
  MatrixXd F(b(), b());
  F(regressor->order(), regressor->order()) = sorted;
  if (has_given) {
    const double unit = weights[0] * noise[0];  // weights are 1/noise times this
    F += options.weights == RowWeights::kUnit ? given_unit : MatrixXd(given_noise * (unit * unit));
  }
  return F;
}

void ExcitationDesign::Impl::add_objective_slope(const Samples& motion, const std::vector<MatrixXd>& rows,
                                                 const MatrixXd& S, double dt, Barrier& barrier) const {
  // d cost = Σ_t 2 dt tr(S Y_tᵀ Λ² dY_t): G_t = 2 dt Λ² Y_t S.
  const MatrixXd sorted = S(regressor->order(), regressor->order());
  std::vector<MatrixXd> G(rows.size());
  for (Index j = 0; j < n(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Index count = rows[at].cols();
    G[at].noalias() =
        (2.0 * dt * weights[j] * weights[j]) * rows[at] * sorted.bottomRightCorner(count, count);
  }
  regressor->add_gradient(motion.q, motion.qd, motion.qdd, G, barrier.by_tau, barrier.by_q, barrier.by_qd,
                          barrier.by_qdd);
}

bool ExcitationDesign::Impl::evaluate(const VectorXd& x, double barrier, double& cost, VectorXd* gradient,
                                      double* pure) const {
  const Index joints = n();
  const ExcitationTrajectory motion = decode(x);
  const Samples samples = samples_of(motion, coarse);

  // The cheap tests first.
  Barrier walls(times.size(), joints, barrier);
  if (!motion_barrier(samples, walls)) return false;
  double log_slack = 0.0;
  MatrixXd by_q_space, by_qd_space;
  if (bounds.has_space && !space_barrier(samples_of(motion, dense), barrier, gradient != nullptr, log_slack,
                                         by_q_space, by_qd_space))
    return false;
  std::vector<MatrixXd> rows;
  if (!torque_barrier(samples, walls, rows)) return false;

  const double dt = span / static_cast<double>(times.size()) * repeats;
  double value = 0.0;
  MatrixXd S;
  if (!objective(searched_information(rows, dt), value, gradient != nullptr ? &S : nullptr)) return false;
  log_slack += walls.logs.value() / walls.count;
  cost = value - barrier * log_slack;
  if (pure != nullptr) *pure = value;
  if (gradient == nullptr) return true;

  add_objective_slope(samples, rows, S, dt, walls);
  gradient->resize(x.size());
  VectorXd by_start = walls.by_q.colwise().sum().transpose();
  MatrixXd by_c = coarse.q.transpose() * walls.by_q + coarse.qd.transpose() * walls.by_qd +
                  coarse.qdd.transpose() * walls.by_qdd;
  if (bounds.has_space) {
    by_start += by_q_space.colwise().sum().transpose();
    by_c += dense.q.transpose() * by_q_space + dense.qd.transpose() * by_qd_space;
  }
  if (free_start()) gradient->head(joints) = bounds.half.cwiseProduct(by_start);
  gradient->tail(at_rest.cols() * joints) =
      (at_rest.transpose() * by_c * bounds.velocity.asDiagonal()).reshaped();
  return true;
}

void ExcitationDesign::Impl::information(const ExcitationTrajectory& motion, MatrixXd& by_noise,
                                         MatrixXd& by_unit) const {
  // The rows of the log that will be taken, in pieces.
  const Index rows =
      std::max<Index>(2, static_cast<Index>(std::llround(motion.duration * options.sample_rate)));
  const double dt = motion.duration / static_cast<double>(rows);
  by_noise = by_unit = MatrixXd::Zero(b(), b());
  VectorXd q, qd, qdd;
  const Index piece = 100;
  MatrixXd W(piece * n(), b());
  const VectorXd inverse = noise.cwiseInverse();
  for (Index begin = 0; begin < rows; begin += piece) {
    const Index count = std::min(piece, rows - begin);
    MatrixXd U(count * n(), b());
    for (Index i = 0; i < count; ++i) {
      motion.evaluate((static_cast<double>(begin + i) + 0.5) * dt, q, qd, qdd);
      U.middleRows(i * n(), n()) = columns.regressor(q, qd, qdd)(Eigen::all, kept);
    }
    W = inverse.replicate(count, 1).asDiagonal() * U;
    by_unit.selfadjointView<Eigen::Lower>().rankUpdate(U.transpose(), dt);
    by_noise.selfadjointView<Eigen::Lower>().rankUpdate(W.transpose(), dt);
  }
  by_unit.triangularView<Eigen::StrictlyUpper>() = by_unit.transpose();
  by_noise.triangularView<Eigen::StrictlyUpper>() = by_noise.transpose();
}

ExcitationScore ExcitationDesign::Impl::score_of(const MatrixXd& by_noise, const MatrixXd& by_unit) const {
  ExcitationScore score;
  const MatrixXd F = by_noise * options.sample_rate;
  MatrixXd V;
  const VectorXd lambda = scaled_eigenvalues(F, &V), lambda_unit = scaled_eigenvalues(by_unit);
  score.condition_unit_rows = condition_of(lambda_unit);
  score.condition = options.weights == RowWeights::kUnit ? score.condition_unit_rows : condition_of(lambda);
  const auto size = static_cast<double>(b());
  if (lambda.size() == 0 || !(lambda[0] > 0.0)) {
    score.log_det = -kInfinity;
    score.std = VectorXd::Constant(b(), kInfinity);
    score.mean_std = score.volume_std = kInfinity;
    return score;
  }
  const VectorXd d = F.diagonal().cwiseSqrt().cwiseInverse();
  score.log_det = lambda.array().log().sum() - 2.0 * d.array().log().sum();
  // F⁻¹ = D V Λ⁻¹ Vᵀ D
  score.std = ((V * lambda.cwiseSqrt().cwiseInverse().asDiagonal()).rowwise().norm()).cwiseProduct(d);
  score.mean_std = std::exp(score.std.array().log().mean());
  score.volume_std = std::exp(-score.log_det / (2.0 * size));
  return score;
}

std::string ExcitationDesign::Impl::weakest(const MatrixXd& F) const {
  std::string text;
  const auto list = [&](Index i) { text += (text.empty() ? "" : ", ") + names[static_cast<std::size_t>(i)]; };
  for (Index i = 0; i < F.rows(); ++i) {
    if (!(F(i, i) > 0.0)) list(i);
  }
  if (!text.empty()) return text;
  // Share of each parameter in the directions that nothing is known of: condition above 1e5, or the worst one.
  MatrixXd V;
  const VectorXd lambda = scaled_eigenvalues(F, &V);
  VectorXd share = VectorXd::Zero(F.rows());
  for (Index k = 0; k < lambda.size(); ++k) {
    if (k == 0 || lambda[k] < 1e-10 * lambda[lambda.size() - 1]) share += V.col(k).cwiseAbs2();
  }
  for (Index i = 0; i < share.size(); ++i) {
    if (share[i] > 0.25 * share.maxCoeff()) list(i);
  }
  return text;
}

}  // namespace heft::excite
