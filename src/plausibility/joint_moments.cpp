#include "joint_moments.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "heft/host/decompositions.hpp"

namespace heft::plausibility {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Behind it a joint counts as moving [rad/s], [m/s].
constexpr double kMovingSpeed = 0.02, kMovingSlide = 0.005;
/// Friction's sign turns over smoothly within this share of the joint's top speed, and no less than kSlowest.
constexpr double kSignWidth = 0.02, kSlowest = 0.003;
constexpr double kRowsPerSecond = 2.0, kFewestRows = 4.0, kMostRows = 150.0;
/// Rotor inertia may make up half of the torque, friction all of it.
constexpr double kRotorShare = 0.5;
/// Among columns of norm 1, a ridge that hides directions in which they differ by less than 1e-4.
constexpr double kRidge = 1e-8;

double arm_length(const model::Robot& robot) {
  double length = 0.0;
  for (std::size_t i = 1; i < robot.joints.size(); ++i) {
    length += Eigen::Vector3d(robot.joints[i].joint.position.data()).norm();
  }
  return std::max(length, 1e-3);
}

}  // namespace

VectorXd prior_deviations(const model::Robot& robot) {
  constexpr double kMassShare = 0.25, kLengthShare = 0.03, kCentreShare = 0.2, kInertiaShare = 0.3;
  constexpr double kPayloadShare = 0.12, kPayloadReach = 0.1;
  const double length = arm_length(robot);
  double arm = 0.0;
  for (const model::RobotJoint& joint : robot.joints) arm += joint.link[kMass];
  VectorXd deviations(kParametersPerLink * robot.num_joints());
  for (int i = 0; i < robot.num_joints(); ++i) {
    const InertialParameters<double>& link = robot.joints[static_cast<std::size_t>(i)].link;
    const double mass = std::max(link[kMass], 0.0);
    const double centre =
        mass > 0.0 ? Eigen::Vector3d(link[kMcx], link[kMcy], link[kMcz]).norm() / mass : 0.0;
    const double shift = kLengthShare * length + kCentreShare * centre;
    std::array<double, 3> std{kMassShare * mass, mass * shift,
                              kInertiaShare * (link[kIxx] + link[kIyy] + link[kIzz]) + mass * shift * shift};
    if (i + 1 == robot.num_joints()) {
      const double payload = kPayloadShare * arm, reach = kPayloadReach * length;
      std = {std::hypot(std[0], payload), std::hypot(std[1], payload * reach),
             std::hypot(std[2], payload * reach * reach)};
    }
    auto block = deviations.segment<kParametersPerLink>(kParametersPerLink * i);
    block[0] = std[0];
    block.segment<3>(1).setConstant(std[1]);
    block.segment<6>(4).setConstant(std[2]);
  }
  return deviations;
}

JointMoments::JointMoments(const model::Robot& robot, int joint, const std::vector<MatrixXd>& regressors,
                           const VectorXd& deviations, const Samples& samples) {
  const Index rows = samples.q.rows(), n = samples.q.cols();
  // Links before the joint do not reach its row.
  const Index first = kParametersPerLink * joint;
  parameters_ = kParametersPerLink * n - first;
  const VectorXd speed = samples.qd.col(joint);
  const double top = rows > 0 ? speed.cwiseAbs().maxCoeff() : 0.0;
  const bool slides = robot.joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
  const double slowest = slides ? kMovingSlide : kMovingSpeed;
  moving_ = top > slowest;
  resting_ = rows > 0 ? static_cast<double>((speed.array().abs() <= slowest).count()) / static_cast<double>(rows) : 1.0;
  rows_ = static_cast<double>(rows);
  effective_ = std::clamp(kRowsPerSecond * samples.duration, kFewestRows, kMostRows);

  MatrixXd all(rows, parameters_ + 6 + n);
  VectorXd parameters(parameters_);
  for (Index k = 0; k < parameters_; ++k) {
    parameters[k] = robot.joints[static_cast<std::size_t>((first + k) / kParametersPerLink)]
                        .link[static_cast<std::size_t>((first + k) % kParametersPerLink)];
  }
  for (Index i = 0; i < rows; ++i) {
    const auto row = regressors[static_cast<std::size_t>(i)].row(joint).segment(first, parameters_);
    all.row(i).head(parameters_) = row.cwiseProduct(deviations.tail(parameters_).transpose());
    all(i, parameters_ + 4) = row.dot(parameters);
  }
  const double width = std::max(kSignWidth * top, kSlowest);
  all.col(parameters_).setOnes();
  all.col(parameters_ + 1) = (speed.array() / width).tanh();
  all.col(parameters_ + 2) = speed;
  all.col(parameters_ + 3) = samples.qdd.col(joint);
  all.col(parameters_ + 5) = samples.q.col(joint).array() - samples.q.col(joint).mean();
  all.rightCols(n) = samples.tau;
  moments_ = all.transpose() * all;
}

double JointMoments::torque_rms(int torque) const {
  return std::sqrt(moments_(tau(torque), tau(torque)) / rows_);
}

double JointMoments::expected_rms() const {
  return std::sqrt(moments_(parameters_ + 4, parameters_ + 4) / rows_);
}

double JointMoments::free_residual(int torque, bool friction) const {
  std::vector<Index> used;
  for (Index k = 0; k < parameters_ + 4; ++k) {
    const bool is_friction = k == parameters_ + 1 || k == parameters_ + 2;
    if (moments_(k, k) > 0.0 && (friction || !is_friction)) used.push_back(k);
  }
  const auto p = static_cast<Index>(used.size());
  const VectorXd scale = moments_.diagonal()(used).cwiseSqrt().cwiseInverse();
  MatrixXd gram = scale.asDiagonal() * moments_(used, used) * scale.asDiagonal();
  const VectorXd right = scale.cwiseProduct(moments_(used, tau(torque)));
  const MatrixXd plain = gram;
  gram.diagonal().array() += kRidge * static_cast<double>(p);
  const VectorXd x = solve_symmetric(gram, right);
  const double left = moments_(tau(torque), tau(torque)) - 2.0 * right.dot(x) + x.dot(plain * x);
  return std::sqrt(std::max(left, 0.0) / rows_);
}

double JointMoments::dissipation(int torque) const {
  if (!moving_) return 0.0;
  const Index sign = parameters_ + 1, speed = parameters_ + 2;
  std::vector<Index> used;
  for (Index k = 0; k < parameters_ + 6; ++k) {
    if (k != parameters_ + 4 && moments_(k, k) > 0.0) used.push_back(k);
  }
  const auto p = static_cast<Index>(used.size());
  const VectorXd scale = moments_.diagonal()(used).cwiseSqrt().cwiseInverse();
  const MatrixXd gram = scale.asDiagonal() * moments_(used, used) * scale.asDiagonal();
  const VectorXd right = scale.cwiseProduct(moments_(used, tau(torque)));
  MatrixXd steadied = gram;
  steadied.diagonal().array() += kRidge * static_cast<double>(p);
  // Mean of f_c |q̇| + f_v q̇².
  VectorXd power = VectorXd::Zero(p);
  for (Index k = 0; k < p; ++k) {
    const Index column = used[static_cast<std::size_t>(k)];
    if (column == sign || column == speed) power[k] = scale[k] * moments_(column, speed) / rows_;
  }
  MatrixXd sides(p, 2);
  sides << right, power;
  const MatrixXd solved = solve_symmetric(steadied, sides);
  const VectorXd x = solved.col(0);
  const double left = moments_(tau(torque), tau(torque)) - 2.0 * right.dot(x) + x.dot(gram * x);
  const double variance = std::max(left, 0.0) / effective_ * power.dot(solved.col(1));
  return variance > 0.0 ? power.dot(x) / std::sqrt(variance) : 0.0;
}

double JointMoments::misfit(int torque, double sign, double noise, double offset) const {
  const Index y = tau(torque), expected = parameters_ + 4, base = parameters_ + 1;
  const double weight = effective_ / (rows_ * noise * noise);
  const double rms = torque_rms(torque);
  // Scales of the unknowns: 1 for errors of parameters, then offset, friction and rotor inertia.
  VectorXd scale = VectorXd::Ones(parameters_ + 4);
  scale[parameters_] = offset;
  for (const auto& [place, share] : {std::pair{1, 1.0}, {2, 1.0}, {3, kRotorShare}}) {
    const double column = std::sqrt(moments_(parameters_ + place, parameters_ + place) / rows_);
    scale[parameters_ + place] = moving_ && column > 0.0 ? share * rms / column : 0.0;
  }
  MatrixXd H = weight * (scale.asDiagonal() * moments_.topLeftCorner(parameters_ + 4, parameters_ + 4) *
                         scale.asDiagonal());
  H.diagonal().array() += 1.0;
  const VectorXd g = weight * scale.cwiseProduct(sign * moments_.col(y).head(parameters_ + 4) -
                                                 moments_.col(expected).head(parameters_ + 4));
  const double squares =
      weight * (moments_(y, y) - 2.0 * sign * moments_(expected, y) + moments_(expected, expected));

  // Friction and rotor inertia are not negative: the best of the subsets of the three in which none is.
  MatrixXd sides(base, 4);
  sides << H.topRightCorner(base, 3), g.head(base);
  const MatrixXd solved = solve_symmetric(H.topLeftCorner(base, base), sides);
  const MatrixXd coupling = solved.leftCols(3);
  const Eigen::Matrix3d schur = H.bottomRightCorner(3, 3) - H.bottomLeftCorner(3, base) * coupling;
  const Eigen::Vector3d rest = g.tail(3) - coupling.transpose() * g.head(base);
  const double without = squares - g.head(base).dot(solved.col(3));
  double best = without;
  for (int subset = 1; moving_ && subset < 8; ++subset) {
    std::vector<int> in;
    for (int k = 0; k < 3; ++k) {
      if ((subset >> k & 1) != 0) in.push_back(k);
    }
    const VectorXd right = rest(in);
    const VectorXd x = solve_symmetric(schur(in, in), right);
    if (x.minCoeff() >= 0.0) best = std::min(best, without - right.dot(x));
  }
  return effective_ * std::log1p(std::max(best, 0.0) / effective_);
}

std::pair<double, double> JointMoments::slope(int torque, double noise, double offset) const {
  const Index expected = parameters_ + 4, p = parameters_ + 5;
  constexpr double kFree = 1e-6;  // of unknowns without a prior, whose columns have norm 1
  VectorXd scale = VectorXd::Ones(p), prior = VectorXd::Ones(p);
  scale[parameters_] = offset;
  for (const Index k : {parameters_ + 1, parameters_ + 2, parameters_ + 3, expected}) {
    const double column = std::sqrt(moments_(k, k) / rows_);
    const bool used = column > 0.0 && (moving_ || k == expected);
    scale[k] = used ? 1.0 / column : 0.0;
    prior[k] = used ? kFree : 1.0;
  }
  if (scale[expected] == 0.0) return {0.0, std::numeric_limits<double>::infinity()};
  const double weight = effective_ / (rows_ * noise * noise);
  MatrixXd H = weight * (scale.asDiagonal() * moments_.topLeftCorner(p, p) * scale.asDiagonal());
  H.diagonal() += prior;
  MatrixXd sides(p, 2);
  sides << weight * scale.cwiseProduct(moments_.col(tau(torque)).head(p)), VectorXd::Unit(p, expected);
  const MatrixXd solved = solve_symmetric(H, sides);
  const VectorXd x = solved.col(0);
  const double variance = solved(expected, 1);
  return {x[expected] * scale[expected], std::sqrt(std::max(variance, 0.0)) * scale[expected]};
}

}  // namespace heft::plausibility
