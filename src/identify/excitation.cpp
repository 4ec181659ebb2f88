#include "heft/identify/excitation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "excitation_impl.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/identify/base_parameters.hpp"

namespace heft::identify {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = std::numbers::pi;
// What the search keeps off the limits for the sake of what happens between its samples. At 30 samples of the
// fastest harmonic a sine passes its highest sample by 1 − cos(π/30) = 0.55 %.
constexpr double kReserve = 0.006;
constexpr double kTorqueReserve = 0.01;
constexpr double kWallReserve = 0.002;  // [m]
// A position to start from stands at least so far inside (share of a limit, metres).
constexpr double kRoom = 0.01;

const model::RobotJoint& joint_of(const model::Robot& robot, Index j) {
  return robot.joints[static_cast<std::size_t>(j)];
}

std::string joint_name(const model::Robot& robot, Index j) {
  return fmt::format("joint {} ({})", j + 1, joint_of(robot, j).name);
}

Eigen::Matrix3d matrix_of(const std::array<double, 9>& m) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

/// Link frames and joint axes in the base frame.
struct Placement {
  std::array<Eigen::Matrix3d, model::kMaxJoints> rotation;
  std::array<Vector3d, model::kMaxJoints> origin, axis;
  Placement(const model::Robot& robot, const VectorXd& q) {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Vector3d p = Vector3d::Zero();
    for (Index j = 0; j < q.size(); ++j) {
      const auto k = static_cast<std::size_t>(j);
      const Joint<double>& joint = joint_of(robot, j).joint;
      const Vector3d own_axis = vector_of(joint.axis);
      const Eigen::Matrix3d placed = matrix_of(joint.rotation);
      Vector3d offset = vector_of(joint.position);
      if (joint.type == JointType::kPrismatic) offset += placed * own_axis * q[j];
      p += R * offset;
      R = R * placed;
      if (joint.type == JointType::kRevolute) R = R * Eigen::AngleAxisd(q[j], own_axis).toRotationMatrix();
      rotation[k] = R;
      origin[k] = p;
      axis[k] = R * own_axis;
    }
  }
  Vector3d point(const Wall& wall) const {
    const auto j = static_cast<std::size_t>(wall.link);
    return origin[j] + rotation[j] * wall.point;
  }
  double slack(const Wall& wall) const { return wall.normal.dot(point(wall)) - wall.bound; }
  /// Derivative of normal · P by the joints, added times `factor`.
  void add_gradient(const model::Robot& robot, const Wall& wall, double factor,
                    Eigen::Ref<VectorXd> by_q) const {
    const Vector3d P = point(wall);
    for (int i = 0; i <= wall.link; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const bool revolute = joint_of(robot, i).joint.type == JointType::kRevolute;
      by_q[i] += factor * wall.normal.dot(revolute ? axis[k].cross(P - origin[k]) : axis[k]);
    }
  }
};

/// A random position in the range, or over a share of it.
VectorXd random_position(std::mt19937_64& random, const VectorXd& middle, const VectorXd& half,
                         double share) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  VectorXd q(middle.size());
  for (Index j = 0; j < q.size(); ++j) q[j] = middle[j] + share * half[j] * unit(random);
  return q;
}

void check(const model::Robot& robot, const MotionLimits& limits, const ExcitationOptions& options) {
  const Index n = robot.num_joints();
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  const auto sized = [&](const VectorXd& v, const char* what) {
    if (v.size() != n)
      refuse(fmt::format("{}: found {} numbers, expected {}, one a joint", what, v.size(), n));
  };
  sized(limits.lower, "lower position limits");
  sized(limits.upper, "upper position limits");
  sized(limits.velocity, "velocity limits");
  sized(limits.acceleration, "acceleration limits");
  sized(limits.torque, "torque limits");
  if (options.start.size() > 0) sized(options.start, "start");
  if (options.torque_noise.size() > 0) sized(options.torque_noise, "torque noise");
  if (!(limits.margin >= 0.0 && limits.margin < 1.0)) {
    refuse(fmt::format("margin: found {}, expected 0 to below 1", limits.margin));
  }
  for (Index j = 0; j < n; ++j) {
    const std::string name = joint_name(robot, j);
    if (!std::isfinite(limits.lower[j]) || !std::isfinite(limits.upper[j])) {
      refuse(fmt::format("{}: position limits: found {} to {}, expected finite ones; state them", name,
                         limits.lower[j], limits.upper[j]));
    }
    if (!(limits.lower[j] < limits.upper[j])) {
      refuse(fmt::format("{}: position limits: found lower {} and upper {}, expected lower < upper", name,
                         limits.lower[j], limits.upper[j]));
    }
    if (!(limits.velocity[j] > 0.0) || !std::isfinite(limits.velocity[j])) {
      refuse(
          fmt::format("{}: velocity limit: found {}, expected a finite one above 0; a joint that must stand "
                      "still cannot be excited",
                      name, limits.velocity[j]));
    }
    if (!(limits.acceleration[j] > 0.0)) {
      refuse(fmt::format("{}: acceleration limit: found {}, expected more than 0", name,
                         limits.acceleration[j]));
    }
    if (!(limits.torque[j] > 0.0)) {
      refuse(fmt::format("{}: torque limit: found {}, expected more than 0", name, limits.torque[j]));
    }
    const double coulomb = joint_of(robot, j).actuation.coulomb_friction;
    if (!(limits.torque[j] * (1.0 - limits.margin) > coulomb)) {
      refuse(
          fmt::format("{}: torque limit: found {} with margin {}, expected more than the {} that Coulomb "
                      "friction alone takes",
                      name, limits.torque[j], limits.margin, coulomb));
    }
    if (options.torque_noise.size() > 0 && !(options.torque_noise[j] > 0.0)) {
      refuse(fmt::format("{}: torque noise: found {}, expected more than 0", name, options.torque_noise[j]));
    }
    if (options.start.size() > 0 &&
        !(options.start[j] > limits.lower[j] && options.start[j] < limits.upper[j])) {
      refuse(fmt::format("{}: start: found {}, expected a position inside the limits {} to {}", name,
                         options.start[j], limits.lower[j], limits.upper[j]));
    }
  }
  if (!(limits.clearance >= 0.0)) {
    refuse(fmt::format("clearance: found {}, expected at least 0", limits.clearance));
  }
  if (limits.box) {
    for (Index a = 0; a < 3; ++a) {
      if (!((*limits.box)[0][a] + limits.clearance < (*limits.box)[1][a] - limits.clearance)) {
        refuse(fmt::format("box: found {} to {} along {} with clearance {}, expected room between",
                           (*limits.box)[0][a], (*limits.box)[1][a], "xyz"[a], limits.clearance));
      }
    }
  }
  if (!(options.duration > 0.0) || !(options.period >= 0.0) || !std::isfinite(options.duration)) {
    refuse(
        fmt::format("duration {} s and period {} s: expected more than 0", options.duration, options.period));
  }
  if (options.period > options.duration) {
    refuse(fmt::format("period: found {} s, expected at most the duration of {} s", options.period,
                       options.duration));
  }
  if (options.harmonics < 2) {
    refuse(
        fmt::format("harmonics: found {}, expected at least 2: start and end at rest take two coefficients a "
                    "joint, so one harmonic leaves no motion",
                    options.harmonics));
  }
  if (!(options.sample_rate > 0.0)) {
    refuse(fmt::format("sample rate: found {}, expected more than 0", options.sample_rate));
  }
  if (options.starts < 1 || options.iterations < 1) {
    refuse(
        fmt::format("starts {} and iterations {}: expected at least 1", options.starts, options.iterations));
  }
}

}  // namespace

MotionLimits limits_of(const model::Robot& robot) {
  const Index n = robot.num_joints();
  MotionLimits limits;
  limits.lower.resize(n);
  limits.upper.resize(n);
  limits.velocity.resize(n);
  limits.torque.resize(n);
  limits.acceleration = VectorXd::Constant(n, kInfinity);
  for (Index j = 0; j < n; ++j) {
    const model::RobotJoint& joint = joint_of(robot, j);
    limits.lower[j] = joint.lower;
    limits.upper[j] = joint.upper;
    const bool bounded = std::isfinite(joint.lower) && std::isfinite(joint.upper);
    if (!bounded && joint.joint.type == JointType::kRevolute) {
      limits.lower[j] = std::isfinite(joint.lower)   ? joint.lower
                        : std::isfinite(joint.upper) ? joint.upper - 2 * kPi
                                                     : -kPi;
      limits.upper[j] = std::isfinite(joint.upper) ? joint.upper : limits.lower[j] + 2 * kPi;
    }
    limits.velocity[j] = joint.velocity_limit;
    limits.torque[j] = joint.effort_limit;
  }
  // Up in the base frame; the base stands upright when its z leans less than 45° from it.
  const Vector3d up = -vector_of(robot.gravity).normalized();
  if (up.z() > std::sqrt(0.5)) limits.floor = 0.0;
  double length = vector_of(robot.tip_position).norm();
  for (const model::RobotJoint& joint : robot.joints) length += vector_of(joint.joint.position).norm();
  limits.clearance = 0.05 * length;
  return limits;
}

void ExcitationTrajectory::evaluate(double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) const {
  const double omega = 2.0 * kPi / period;
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
  // What rounding leaves at rest is no velocity: friction would take its sign.
  for (Index j = 0; j < qd.size(); ++j) {
    if (std::abs(qd[j]) < 1e-14 * terms[j]) qd[j] = 0.0;
    if (std::abs(qdd[j]) < 1e-14 * terms[j] * omega * num_harmonics()) qdd[j] = 0.0;
  }
}

// ------------------------------------------------------------------------------------------------------------

ExcitationDesign::Impl::Impl(const model::Robot& robot, MotionLimits given_limits,
                             ExcitationOptions given_options)
    : limits(std::move(given_limits)),
      options(std::move(given_options)),
      columns(robot, options.structure),
      dynamics(robot) {
  check(robot, limits, options);
  if (options.period == 0.0) options.period = options.duration;

  // Which columns.
  if (options.payload_only) {
    const int last = n() - 1;
    // Of the ten those that some motion of this arm shows apart from the ones before.
    std::mt19937_64 random(1);
    const int rows = 20 * n();
    MatrixXd W(rows, 10);
    for (int s = 0; s < 20; ++s) {
      const VectorXd q = random_position(random, VectorXd::Zero(n()), VectorXd::Constant(n(), kPi), 1.0);
      const VectorXd qd = random_position(random, VectorXd::Zero(n()), VectorXd::Ones(n()), 1.0);
      const VectorXd qdd = random_position(random, VectorXd::Zero(n()), VectorXd::Ones(n()), 1.0);
      W.middleRows(s * n(), n()) = columns.regressor(q, qd, qdd).middleCols(10 * last, 10);
    }
    MatrixXd Q(rows, 0);
    for (int k = 0; k < 10; ++k) {
      VectorXd left = W.col(k);
      for (int pass = 0; pass < 2; ++pass) left -= Q * (Q.transpose() * left);
      if (left.norm() <= 1e-9 * (1.0 + W.col(k).norm())) continue;
      Q.conservativeResize(rows, Q.cols() + 1);
      Q.col(Q.cols() - 1) = left.normalized();
      kept.push_back(10 * last + k);
      names.push_back(columns[10 * last + k].name);
      expressions.push_back(names.back());
    }
  } else {
    const BaseParameters base = find_base_parameters(columns);
    kept = base.kept;
    expressions = base.expressions;
    regrouping = base.regrouping;
    for (int i = 0; i < base.count(); ++i) names.push_back(base.name(columns, i));
  }
  if (options.payload_only) {
    regrouping = MatrixXd::Zero(b(), columns.count());
    for (int i = 0; i < b(); ++i) regrouping(i, kept[static_cast<std::size_t>(i)]) = 1.0;
  }
  for (const int c : kept) units.push_back(columns[c].unit);

  noise = options.torque_noise;
  if (noise.size() == 0) {
    noise = 0.01 * limits.torque;
    if (!noise.allFinite()) noise.setOnes();
  }
  weights = options.weights == RowWeights::kUnit ? VectorXd::Ones(n()) : VectorXd(noise.cwiseInverse());
  // The search minds ratios only; a largest weight of 1 keeps its numbers near 1.
  weights /= weights.maxCoeff();

  const double use = 1.0 - limits.margin;
  middle = 0.5 * (limits.lower + limits.upper);
  half = 0.5 * use * (limits.upper - limits.lower);
  velocity = use * limits.velocity;
  acceleration = use * limits.acceleration;
  torque = use * limits.torque;
  coulomb.resize(n());
  for (int j = 0; j < n(); ++j) coulomb[j] = joint_of(robot, j).actuation.coulomb_friction;
  for (const GearCoupling<double>& coupling : robot.couplings) {
    coulomb[coupling.driven] += coupling.coulomb_friction;
    coulomb[coupling.driving] += std::abs(coupling.ratio) * coupling.coulomb_friction;
  }
  regressor = make_differentiable_regressor(columns, kept, 0.02 * velocity);

  // Walls that the motion can do something about.
  const Vector3d gravity = vector_of(robot.gravity);
  if (gravity.norm() > 0.0) up = -gravity.normalized();
  if (limits.floor && gravity.norm() == 0.0) {
    throw ModelError(
        fmt::format("robot \"{}\": floor: found {} m without gravity, which says what is up; leave "
                    "the floor out or use a box",
                    robot.name, *limits.floor));
  }
  std::vector<Wall> all;
  const auto add_walls = [&](int link, const Vector3d& point, const std::string& name) {
    if (limits.floor) {
      all.push_back({link, point, up, *limits.floor + limits.clearance, "height of " + name, true});
    }
    if (!limits.box) return;
    for (Index a = 0; a < 3; ++a) {
      const double low = (*limits.box)[0][a], high = (*limits.box)[1][a];
      if (std::isfinite(low)) {
        all.push_back({link, point, Vector3d::Unit(a), low + limits.clearance,
                       fmt::format("{} of {} in the box", "xyz"[a], name), false});
      }
      if (std::isfinite(high)) {
        all.push_back({link, point, -Vector3d::Unit(a), limits.clearance - high,
                       fmt::format("{} of {} in the box", "xyz"[a], name), false});
      }
    }
  };
  for (int j = 0; j < n(); ++j) add_walls(j, Vector3d::Zero(), joint_of(robot, j).link_name);
  const Vector3d tool = vector_of(robot.tip_position) + matrix_of(robot.tip_rotation) * limits.tool;
  if (tool.norm() > 0.0) add_walls(n() - 1, tool, limits.tool.norm() > 0.0 ? "the tool" : robot.tip_link);
  std::mt19937_64 random(1);
  std::vector<double> low(all.size(), kInfinity), high(all.size(), -kInfinity);
  for (int s = 0; s < 20; ++s) {
    const Placement placement(robot, random_position(random, middle, half, 1.0));
    for (std::size_t w = 0; w < all.size(); ++w) {
      low[w] = std::min(low[w], placement.slack(all[w]));
      high[w] = std::max(high[w], placement.slack(all[w]));
    }
  }
  for (std::size_t w = 0; w < all.size(); ++w) {
    if (high[w] - low[w] > 1e-9) walls.push_back(all[w]);
  }

  // Whole periods look all alike: the search looks at one.
  const double periods = options.duration / options.period;
  if (std::abs(periods - std::round(periods)) < 1e-9) {
    repeats = static_cast<int>(std::round(periods));
    span = options.period;
  } else {
    span = options.duration;
  }

  // Velocity and acceleration at both ends are C c = 0 for the coefficients c = [a; b].
  const int K = options.harmonics;
  const FourierBasis ends = basis_at(Eigen::Vector2d(0.0, options.duration));
  MatrixXd C(4, 2 * K);
  C << ends.qd, ends.qdd / (omega() * K);
  at_rest = complement_of(C.transpose(), 1e-9);
  if (at_rest.cols() == 0) {
    throw ModelError(
        fmt::format("robot \"{}\": harmonics: found {} over {:.4g} periods, expected more: start and "
                    "end at rest take {} coefficients a joint and leave no motion",
                    robot.name, K, periods, 2 * K - at_rest.cols()));
  }

  const auto even = [](double length, Index count, bool with_ends) {
    VectorXd t(count);
    for (Index i = 0; i < count; ++i) {
      t[i] = with_ends ? length * static_cast<double>(i) / static_cast<double>(count - 1)
                       : length * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    }
    return t;
  };
  // 30 samples of the fastest harmonic: torque and height, which are not band-limited, are then sampled well
  // enough for a search; what they do between samples the final check sees.
  const Index samples = std::max<Index>(60, static_cast<Index>(std::ceil(30.0 * K * span / options.period)));
  times = even(span, samples, false);
  coarse = basis_at(times);
  dense = basis_at(even(span, 5 * samples, false));
  fine = basis_at(even(span, 10 * samples + 1, true));
  given_noise = given_unit = MatrixXd::Zero(b(), b());

  if (!free_start()) {
    const Closest found = closest_at_rest(options.start);
    if (!(found.slack > kRoom)) {
      throw ModelError(
          fmt::format("robot \"{}\": start: standing there the arm passes a limit ({}); expected a "
                      "position that can be held inside all limits with their margin of {} %",
                      robot.name, found.what, 100.0 * limits.margin));
    }
  }
}

double ExcitationDesign::Impl::omega() const { return 2.0 * kPi / options.period; }

FourierBasis ExcitationDesign::Impl::basis_at(const VectorXd& at) const {
  const int K = options.harmonics;
  FourierBasis basis;
  basis.q.resize(at.size(), 2 * K);
  basis.qd.resize(at.size(), 2 * K);
  basis.qdd.resize(at.size(), 2 * K);
  for (Index i = 0; i < at.size(); ++i) {
    for (int k = 0; k < K; ++k) {
      const double w = omega() * (k + 1), c = std::cos(w * at[i]), s = std::sin(w * at[i]);
      basis.q(i, k) = (1.0 - c) / w;
      basis.q(i, K + k) = s / w;
      basis.qd(i, k) = s;
      basis.qd(i, K + k) = c;
      basis.qdd(i, k) = w * c;
      basis.qdd(i, K + k) = -w * s;
    }
  }
  return basis;
}

MatrixXd ExcitationDesign::Impl::coefficients(const ExcitationTrajectory& motion) {
  MatrixXd c(2 * motion.num_harmonics(), motion.num_joints());
  c << motion.sine.transpose(), motion.cosine.transpose();
  return c;
}

ExcitationTrajectory ExcitationDesign::Impl::make(const VectorXd& start, const MatrixXd& c) const {
  const int K = options.harmonics;
  ExcitationTrajectory motion;
  motion.period = options.period;
  motion.duration = options.duration;
  motion.start = start;
  motion.sine = c.topRows(K).transpose();
  motion.cosine = c.bottomRows(K).transpose();
  return motion;
}

ExcitationTrajectory ExcitationDesign::Impl::decode(const VectorXd& x) const {
  const Index m = at_rest.cols(), first = free_start() ? n() : 0;
  const VectorXd start = free_start() ? VectorXd(middle + half.cwiseProduct(x.head(n()))) : options.start;
  const MatrixXd c = at_rest * x.tail(x.size() - first).reshaped(m, n()) * velocity.asDiagonal();
  return make(start, c);
}

VectorXd ExcitationDesign::Impl::encode(const ExcitationTrajectory& motion) const {
  const Index m = at_rest.cols(), first = free_start() ? n() : 0;
  VectorXd x(first + m * n());
  if (free_start()) x.head(n()) = (motion.start - middle).cwiseQuotient(half);
  x.tail(m * n()) =
      (at_rest.transpose() * coefficients(motion) * velocity.cwiseInverse().asDiagonal()).reshaped();
  return x;
}

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

bool ExcitationDesign::Impl::evaluate(const VectorXd& x, double barrier, double& cost, VectorXd* gradient,
                                      double* pure) const {
  const Index samples = times.size(), joints = n(), size = b();
  const ExcitationTrajectory motion = decode(x);
  const MatrixXd c = coefficients(motion);
  MatrixXd q = coarse.q * c, qd = coarse.qd * c, qdd = coarse.qdd * c;
  q.rowwise() += motion.start.transpose();

  // First what is cheap.
  const double share = barrier / static_cast<double>(samples);
  double sum = 0.0;  // of logarithms of slacks, over samples
  MatrixXd by_q = MatrixXd::Zero(samples, joints), by_qd = by_q, by_qdd = by_q;
  // −log(1 − (v/l)²) bounds both sides; derivative 2 v / (l² − v²).
  const auto bound = [&](double value, double limit, double& by) {
    const double slack = 1.0 - (value / limit) * (value / limit);
    if (!(slack > 0.0)) return false;
    sum += std::log(slack) / static_cast<double>(samples);
    by += share * 2.0 * value / (limit * limit * slack);
    return true;
  };
  constexpr double kUse = 1.0 - kReserve;
  for (Index j = 0; j < joints; ++j) {
    const bool bounded = std::isfinite(acceleration[j]);
    for (Index i = 0; i < samples; ++i) {
      if (!bound(q(i, j) - middle[j], kUse * half[j], by_q(i, j))) return false;
      if (!bound(qd(i, j), kUse * velocity[j], by_qd(i, j))) return false;
      if (bounded && !bound(qdd(i, j), kUse * acceleration[j], by_qdd(i, j))) return false;
    }
  }
  MatrixXd by_q_walls;
  if (!walls.empty()) {
    MatrixXd at = dense.q * c;
    at.rowwise() += motion.start.transpose();
    by_q_walls = MatrixXd::Zero(at.rows(), joints);
    const double share_walls = 1.0 / static_cast<double>(at.rows());
    VectorXd gradient_q(joints);
    for (Index i = 0; i < at.rows(); ++i) {
      const Placement placement(columns.robot(), at.row(i));
      gradient_q.setZero();
      for (const Wall& wall : walls) {
        const double slack = placement.slack(wall) - kWallReserve;
        if (!(slack > 0.0)) return false;
        sum += share_walls * std::log(slack);
        if (gradient != nullptr) {
          placement.add_gradient(columns.robot(), wall, -barrier * share_walls / slack, gradient_q);
        }
      }
      by_q_walls.row(i) = gradient_q;
    }
  }

  // Regressors, rows times weight, and torques with friction of either sign.
  MatrixXd W(samples * joints, size), by_tau = MatrixXd::Zero(samples, joints);
  MatrixXd Y(joints, size);
  VectorXd tau(joints);
  constexpr double kTorqueUse = 1.0 - kTorqueReserve;
  for (Index i = 0; i < samples; ++i) {
    regressor->evaluate(q.row(i), qd.row(i), qdd.row(i), Y, tau);
    W.middleRows(i * joints, joints) = weights.asDiagonal() * Y;
    for (Index j = 0; j < joints; ++j) {
      if (!std::isfinite(torque[j])) continue;
      if (!bound(tau[j], kTorqueUse * torque[j] - coulomb[j], by_tau(i, j))) return false;
    }
  }
  // F = ∫ Yᵀ Λ² Y dt over the duration.
  const double dt = span / static_cast<double>(samples) * repeats;
  MatrixXd F = MatrixXd::Zero(size, size);
  F.selfadjointView<Eigen::Lower>().rankUpdate(W.transpose(), dt);
  F.triangularView<Eigen::StrictlyUpper>() = F.transpose();
  if (has_given) {
    const double unit = weights[0] * noise[0];  // weights are 1/noise times this
    F += options.weights == RowWeights::kUnit ? given_unit : MatrixXd(given_noise * (unit * unit));
  }
  double value = 0.0;
  MatrixXd S;
  if (!objective(F, value, gradient != nullptr ? &S : nullptr)) return false;
  cost = value - barrier * sum;
  if (pure != nullptr) *pure = value;
  if (gradient == nullptr) return true;

  // d cost = Σ_t 2 dt tr(S Y_tᵀ Λ² dY_t): G_t = 2 dt Λ² Y_t S.
  const MatrixXd WS = W * S * (2.0 * dt);
  VectorXd g_q, g_qd, g_qdd;
  for (Index i = 0; i < samples; ++i) {
    const MatrixXd G = weights.asDiagonal() * WS.middleRows(i * joints, joints);
    regressor->gradient(q.row(i), qd.row(i), qdd.row(i), G, by_tau.row(i), g_q, g_qd, g_qdd);
    by_q.row(i) += g_q;
    by_qd.row(i) += g_qd;
    by_qdd.row(i) += g_qdd;
  }
  const Index m = at_rest.cols();
  gradient->resize(x.size());
  VectorXd by_start = by_q.colwise().sum().transpose();
  MatrixXd by_c =
      coarse.q.transpose() * by_q + coarse.qd.transpose() * by_qd + coarse.qdd.transpose() * by_qdd;
  if (!walls.empty()) {
    by_start += by_q_walls.colwise().sum().transpose();
    by_c += dense.q.transpose() * by_q_walls;
  }
  if (free_start()) gradient->head(joints) = half.cwiseProduct(by_start);
  gradient->tail(m * joints) = (at_rest.transpose() * by_c * velocity.asDiagonal()).reshaped();
  return true;
}

Closest ExcitationDesign::Impl::closest(const ExcitationTrajectory& motion, const FourierBasis& basis,
                                        double enough) const {
  const MatrixXd c = coefficients(motion);
  const MatrixXd qd = basis.qd * c, qdd = basis.qdd * c;
  MatrixXd q = basis.q * c;
  q.rowwise() += motion.start.transpose();
  Closest result{kInfinity, ""};
  const auto meet = [&](double slack, const auto& name) {
    if (slack < result.slack) result = {slack, name()};
  };
  const model::Robot& robot = columns.robot();
  MatrixXd Y(n(), b());
  VectorXd tau(n());
  for (Index i = 0; i < q.rows(); ++i) {
    for (int j = 0; j < n(); ++j) {
      meet(1.0 - std::abs(q(i, j) - middle[j]) / half[j],
           [&] { return "position of " + joint_name(robot, j); });
      meet(1.0 - std::abs(qd(i, j)) / velocity[j], [&] { return "velocity of " + joint_name(robot, j); });
      meet(1.0 - std::abs(qdd(i, j)) / acceleration[j],
           [&] { return "acceleration of " + joint_name(robot, j); });
    }
    if (!walls.empty()) {
      const Placement placement(robot, q.row(i));
      for (const Wall& wall : walls) {
        meet(placement.slack(wall), [&] { return wall.name; });
      }
    }
    if (result.slack < enough) return result;
    regressor->evaluate(q.row(i), qd.row(i), qdd.row(i), Y, tau);
    for (int j = 0; j < n(); ++j) {
      meet(1.0 - (std::abs(tau[j]) + coulomb[j]) / torque[j],
           [&] { return "torque of " + joint_name(robot, j); });
    }
    if (result.slack < enough) return result;
  }
  return result;
}

Closest ExcitationDesign::Impl::closest_at_rest(const VectorXd& q) const {
  const int K = options.harmonics;
  const FourierBasis once{MatrixXd::Zero(1, 2 * K), MatrixXd::Zero(1, 2 * K), MatrixXd::Zero(1, 2 * K)};
  return closest(make(q, MatrixXd::Zero(2 * K, n())), once, -kInfinity);
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
    if (closest(result, basis, 0.0).slack > 0.0) return factor;
  }
  return 0.0;
}

ExcitationTrajectory ExcitationDesign::Impl::random_motion(std::uint64_t seed) const {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  constexpr int kPositions = 1000;
  constexpr int kMotions = 20;
  constexpr double kGood = 0.5;
  Closest nearest{-kInfinity, ""};
  ExcitationTrajectory best;
  double best_factor = 0.0;
  int motions = 0;
  for (int attempt = 0; attempt < kPositions && motions < kMotions; ++attempt) {
    const VectorXd centre = free_start() ? random_position(random, middle, half, 0.9) : options.start;
    const Closest found = closest_at_rest(centre);
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
      const double room = half[j] - std::abs(centre[j] - middle[j]);
      const double factor = 0.98 * std::min(velocity[j] / qd.col(j).cwiseAbs().maxCoeff(),
                                            room / (travel.col(j).array() - offset).abs().maxCoeff());
      c.col(j) *= factor;
      start[j] -= factor * offset;
    }
    ExcitationTrajectory together;
    const double factor = drawn_together(make(start, c), coarse, 0.95, together);
    if (factor <= best_factor) continue;
    best_factor = factor;
    best = together;
    if (factor >= kGood) break;
  }
  ExcitationTrajectory result;
  if (best_factor > 0.0 && drawn_together(best, fine, 0.98, result) > 0.0) return result;
  throw ModelError(fmt::format(
      "robot \"{}\": limits: no position found in {} tries at which the arm stands inside all of them "
      "with room to move; nearest missed: {}; widen that limit",
      columns.robot().name, kPositions, nearest.what.empty() ? "none, but no motion fits" : nearest.what));
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

namespace {

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

// ------------------------------------------------------------------------------------------------------------

ExcitationDesign::ExcitationDesign(const model::Robot& robot, MotionLimits limits, ExcitationOptions options)
    : impl_(std::make_unique<Impl>(robot, std::move(limits), std::move(options))) {}
ExcitationDesign::~ExcitationDesign() = default;
ExcitationDesign::ExcitationDesign(ExcitationDesign&&) noexcept = default;
ExcitationDesign& ExcitationDesign::operator=(ExcitationDesign&&) noexcept = default;

const MotionLimits& ExcitationDesign::limits() const { return impl_->limits; }
const ExcitationOptions& ExcitationDesign::options() const { return impl_->options; }
int ExcitationDesign::num_parameters() const { return impl_->b(); }
const std::vector<std::string>& ExcitationDesign::names() const { return impl_->names; }
const std::vector<std::string>& ExcitationDesign::units() const { return impl_->units; }
const std::vector<std::string>& ExcitationDesign::expressions() const { return impl_->expressions; }
const VectorXd& ExcitationDesign::torque_noise() const { return impl_->noise; }
VectorXd ExcitationDesign::values() const {
  return impl_->regrouping * impl_->columns.values(impl_->columns.robot());
}
const RegressionColumns& ExcitationDesign::columns() const { return impl_->columns; }
const std::vector<int>& ExcitationDesign::kept() const { return impl_->kept; }

void ExcitationDesign::add_given(const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd, double seconds) {
  Impl& d = *impl_;
  const Index n = d.n();
  if (q.cols() != n || qd.cols() != n || qdd.cols() != n) {
    throw ModelError(fmt::format("given log: found {} joints, expected the robot's {}", q.cols(), n));
  }
  for (Index i = 0; i < q.rows(); ++i) {
    MatrixXd Y = d.columns.regressor(q.row(i), qd.row(i), qdd.row(i))(Eigen::all, d.kept);
    for (Index j = 0; j < n; ++j) {
      if (std::abs(qd(i, j)) < 0.01 * d.limits.velocity[j]) Y.row(j).setZero();
    }
    d.given_unit.noalias() += seconds * Y.transpose() * Y;
    Y = d.noise.cwiseInverse().asDiagonal() * Y;
    d.given_noise.noalias() += seconds * Y.transpose() * Y;
  }
  d.has_given = true;
}

ExcitationTrajectory ExcitationDesign::random_motion(std::uint64_t seed) const {
  return impl_->random_motion(seed);
}

ExcitationScore ExcitationDesign::score(const ExcitationTrajectory& motion) const {
  MatrixXd by_noise, by_unit;
  impl_->information(motion, by_noise, by_unit);
  return impl_->score_of(by_noise + impl_->given_noise, by_unit + impl_->given_unit);
}

std::optional<ExcitationScore> ExcitationDesign::given_score() const {
  if (!impl_->has_given) return std::nullopt;
  const ExcitationScore score = impl_->score_of(impl_->given_noise, impl_->given_unit);
  if (!std::isfinite(score.condition)) return std::nullopt;
  return score;
}

LimitUse ExcitationDesign::use_of(const ExcitationTrajectory& motion) const {
  const Impl& d = *impl_;
  const int n = d.n();
  LimitUse use;
  use.velocity = use.acceleration = use.torque = use.position = VectorXd::Zero(n);
  use.lowest = VectorXd::Constant(n, kInfinity);
  use.highest = -use.lowest;
  use.lowest_height = use.box_distance = kInfinity;
  const MatrixXd c = Impl::coefficients(motion);
  VectorXd q, qd, qdd;
  const double base = d.limits.floor.value_or(0.0);
  for (Index i = 0; i < d.fine.q.rows(); ++i) {
    q = motion.start + (d.fine.q.row(i) * c).transpose();
    qd = (d.fine.qd.row(i) * c).transpose();
    qdd = (d.fine.qdd.row(i) * c).transpose();
    use.lowest = use.lowest.cwiseMin(q);
    use.highest = use.highest.cwiseMax(q);
    use.velocity = use.velocity.cwiseMax(qd.cwiseAbs());
    use.acceleration = use.acceleration.cwiseMax(qdd.cwiseAbs());
    use.torque = use.torque.cwiseMax(d.dynamics.joint_torque(q, qd, qdd).cwiseAbs());
    const Placement placement(d.columns.robot(), q);
    for (const Wall& wall : d.walls) {
      const double slack = placement.slack(wall);
      if (wall.is_floor) {
        use.lowest_height = std::min(use.lowest_height, base + d.limits.clearance + slack);
      } else {
        use.box_distance = std::min(use.box_distance, slack + d.limits.clearance);
      }
    }
  }
  const VectorXd half = 0.5 * (d.limits.upper - d.limits.lower);
  use.position = (use.highest - d.middle).cwiseMax(d.middle - use.lowest).cwiseQuotient(half);
  if (!std::isfinite(use.lowest_height)) use.lowest_height = std::nan("");
  if (!std::isfinite(use.box_distance)) use.box_distance = std::nan("");
  const Closest closest = d.closest(motion, d.fine, -kInfinity);
  use.inside = closest.slack >= 0.0;
  use.worst = closest.what;
  return use;
}

VectorXd ExcitationDesign::torque(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd) const {
  return impl_->dynamics.joint_torque(q, qd, qdd);
}

Excitation ExcitationDesign::optimize(const std::function<void(double)>& progress) const {
  return impl_->optimize(progress);
}

int ExcitationDesign::num_variables() const {
  return (impl_->free_start() ? impl_->n() : 0) + static_cast<int>(impl_->at_rest.cols()) * impl_->n();
}
VectorXd ExcitationDesign::encode(const ExcitationTrajectory& motion) const { return impl_->encode(motion); }
ExcitationTrajectory ExcitationDesign::decode(const VectorXd& variables) const {
  return impl_->decode(variables);
}
double ExcitationDesign::cost(const VectorXd& variables, double barrier, VectorXd* gradient) const {
  double value = 0.0;
  return impl_->evaluate(variables, barrier, value, gradient) ? value : kInfinity;
}

}  // namespace heft::identify
