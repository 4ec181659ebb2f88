/// What a motion reveals, as a number to make small, with its exact gradient (excitation.md).
#include <cmath>

#include <fmt/format.h>

#include "design_impl.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/numbers.hpp"

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

bool ExcitationDesign::Impl::space_barrier(const Samples& at, double barrier, bool with_gradient, double& sum,
                                           MatrixXd& by_q, MatrixXd& by_qd) const {
  using collision::LinkFrames;
  const Index rows = at.q.rows();
  const double share = 1.0 / static_cast<double>(rows);
  const double fastest = (1.0 - kReserve) * bounds.tool_speed;
  const auto& arm = bounds.limits.arm;
  by_q = by_qd = MatrixXd::Zero(rows, n());
  VectorXd gradient_q(n()), gradient_qd(n()), qd(n());
  for (Index i = 0; i < rows; ++i) {
    const LinkFrames frames(bounds.robot, at.q.row(i).transpose());
    gradient_q.setZero();
    gradient_qd.setZero();
    double logs = 0.0;
    for (const Wall& wall : bounds.walls) {
      const double slack = wall.slack(frames) - kWallReserve;
      if (!(slack > 0.0)) return false;
      logs += std::log(slack);
      if (!with_gradient) continue;
      frames.add_gradient(wall.link, frames.at(wall.link, wall.point), wall.normal, 1.0 / slack, gradient_q);
    }
    const auto keep_apart = [&](const collision::Nearest& found, double clearance, int first, int second) {
      const double slack = found.distance - clearance - std::min(kWallReserve, 0.1 * clearance);
      if (!(slack > 0.0)) return false;
      logs += std::log(slack);
      if (!with_gradient) return true;
      const Vector3d away = (found.on_first - found.on_second).normalized();
      frames.add_gradient(first, found.on_first, away, 1.0 / slack, gradient_q);
      frames.add_gradient(second, found.on_second, away, -1.0 / slack, gradient_q);
      return true;
    };
    for (const collision::CapsulePair& pair : arm.pairs) {
      const auto &first = arm.capsules[static_cast<std::size_t>(pair.first)],
                 &second = arm.capsules[static_cast<std::size_t>(pair.second)];
      if (!keep_apart(collision::distance(frames, first, second), pair.clearance, first.link, second.link))
        return false;
    }
    for (const collision::GuardedObstacle& guarded : arm.guarded) {
      const auto& capsule = arm.capsules[static_cast<std::size_t>(guarded.capsule)];
      const auto& box = bounds.limits.obstacles[static_cast<std::size_t>(guarded.obstacle)];
      const auto found = collision::distance(frames, capsule, box);
      if (!keep_apart(found, bounds.limits.clearance, capsule.link, -1)) return false;
    }
    qd = at.qd.row(i);
    for (const SpeedPoint& point : bounds.points) {
      const Vector3d P = frames.at(point.link, point.point);
      const double ratio = frames.velocity(point.link, P, qd).squaredNorm() / (fastest * fastest);
      if (!(ratio < 1.0)) return false;
      logs += std::log(1.0 - ratio);
      if (!with_gradient) continue;
      // log(1 − v²/l²): derivative −2/(l² (1 − v²/l²)) of ½ v²
      frames.add_speed_gradient(point.link, P, qd, -2.0 / (fastest * fastest * (1.0 - ratio)), gradient_q,
                                gradient_qd);
    }
    sum += share * logs;
    by_q.row(i) = -barrier * share * gradient_q;
    by_qd.row(i) = -barrier * share * gradient_qd;
  }
  return true;
}

/// The barrier over the coarse samples: Σ log slack, and the derivative of −weight times it by what is limited, samples × n.
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
    sum += std::log(slack) / count;
    by += share * 2.0 * value / (limit * limit * slack);
    return true;
  }

  double count;
  double share;
  double sum{0.0};
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

bool ExcitationDesign::Impl::torque_barrier(const Samples& motion, Barrier& barrier, MatrixXd& W) const {
  const Index samples = motion.q.rows(), joints = n(), size = b();
  W.resize(samples * joints, size);
  MatrixXd Y(joints, size);
  VectorXd tau(joints);
  constexpr double kTorqueUse = 1.0 - kTorqueReserve;
  for (Index i = 0; i < samples; ++i) {
    regressor->evaluate(motion.q.row(i), motion.qd.row(i), motion.qdd.row(i), Y, tau);
    W.middleRows(i * joints, joints) = weights.asDiagonal() * Y;
    for (Index j = 0; j < joints; ++j) {
      if (!std::isfinite(bounds.torque[j])) continue;
      if (!barrier.bound(tau[j], kTorqueUse * bounds.torque[j] - bounds.coulomb[j], barrier.by_tau(i, j)))
        return false;
    }
  }
  return true;
}

MatrixXd ExcitationDesign::Impl::searched_information(const MatrixXd& W, double dt) const {
  MatrixXd F = MatrixXd::Zero(b(), b());
  F.selfadjointView<Eigen::Lower>().rankUpdate(W.transpose(), dt);
  F.triangularView<Eigen::StrictlyUpper>() = F.transpose();
  if (has_given) {
    const double unit = weights[0] * noise[0];  // weights are 1/noise times this
    F += options.weights == RowWeights::kUnit ? given_unit : MatrixXd(given_noise * (unit * unit));
  }
  return F;
}

void ExcitationDesign::Impl::add_objective_slope(const Samples& motion, const MatrixXd& WS,
                                                 Barrier& barrier) const {
  const Index joints = n();
  VectorXd g_q, g_qd, g_qdd;
  for (Index i = 0; i < motion.q.rows(); ++i) {
    const MatrixXd G = weights.asDiagonal() * WS.middleRows(i * joints, joints);
    regressor->gradient(motion.q.row(i), motion.qd.row(i), motion.qdd.row(i), G, barrier.by_tau.row(i), g_q,
                        g_qd, g_qdd);
    barrier.by_q.row(i) += g_q;
    barrier.by_qd.row(i) += g_qd;
    barrier.by_qdd.row(i) += g_qdd;
  }
}

bool ExcitationDesign::Impl::evaluate(const VectorXd& x, double barrier, double& cost, VectorXd* gradient,
                                      double* pure) const {
  const Index joints = n();
  const ExcitationTrajectory motion = decode(x);
  const Samples samples = samples_of(motion, coarse);

  // The cheap tests first.
  Barrier walls(times.size(), joints, barrier);
  if (!motion_barrier(samples, walls)) return false;
  MatrixXd by_q_space, by_qd_space;
  if (bounds.has_space && !space_barrier(samples_of(motion, dense), barrier, gradient != nullptr, walls.sum,
                                         by_q_space, by_qd_space))
    return false;
  MatrixXd W;
  if (!torque_barrier(samples, walls, W)) return false;

  const double dt = span / static_cast<double>(times.size()) * repeats;
  double value = 0.0;
  MatrixXd S;
  if (!objective(searched_information(W, dt), value, gradient != nullptr ? &S : nullptr)) return false;
  cost = value - barrier * walls.sum;
  if (pure != nullptr) *pure = value;
  if (gradient == nullptr) return true;

  // d cost = Σ_t 2 dt tr(S Y_tᵀ Λ² dY_t): G_t = 2 dt Λ² Y_t S.
  add_objective_slope(samples, W * S * (2.0 * dt), walls);
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
