#include "comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "heft/host/parallel.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::plausibility {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoiseShare = 0.1;  ///< of the torque, at least: no model of a real arm is better than that
constexpr double kSlopeNoiseShare = 0.05;
/// Offset of a joint: sensor zero and asymmetric friction where it moves, friction of any size where it rests.
constexpr double kMovingOffset = 0.1, kRestingOffset = 0.35;
constexpr double kEffortFloor = 0.01, kArmFloor = 0.02;
constexpr double kFeltWeight = 0.2;  ///< of a joint's torque that changes with its weight
constexpr double kQuarterTurn = 0.5 * std::numbers::pi;
/// A base that is not level [°], towards so many sides.
constexpr std::array<double, 3> kTilts = {5.0, 10.0, 15.0};
constexpr int kSides = 8;

}  // namespace

std::vector<JointMoments> moments_of(const model::Robot& robot, const Samples& samples) {
  const model::Dynamics dynamics(robot);
  std::vector<MatrixXd> regressors;
  for (Index i = 0; i < samples.q.rows(); ++i) {
    regressors.push_back(dynamics.regressor(samples.q.row(i).transpose(), samples.qd.row(i).transpose(),
                                            samples.qdd.row(i).transpose()));
  }
  const VectorXd deviations = prior_deviations(robot);
  std::vector<std::optional<JointMoments>> joints(robot.joints.size());
  host::for_each_parallel(joints.size(), [&](std::size_t j) {
    joints[j].emplace(robot, static_cast<int>(j), regressors, deviations, samples);
  });
  std::vector<JointMoments> moments;
  for (std::optional<JointMoments>& joint : joints) moments.push_back(std::move(*joint));
  return moments;
}

Comparison::Comparison(const model::Robot& robot, Samples samples)
    : robot_(robot), samples_(std::move(samples)), given_(moments_of(robot_, samples_)) {
  const Index n = samples_.q.cols();
  rms_.resize(n), floor_.resize(n), residual_.resize(n);
  for (Index j = 0; j < n; ++j) {
    const VectorXd torque = samples_.tau.col(j);
    rms_[j] = joint(static_cast<int>(j)).torque_rms(static_cast<int>(j));
    residual_[j] = joint(static_cast<int>(j)).free_residual(static_cast<int>(j));
    dead_.push_back(torque.maxCoeff() - torque.minCoeff() <=
                    1e-9 * std::max(1.0, torque.cwiseAbs().maxCoeff()));
  }
  for (Index j = 0; j < n; ++j) {
    const double limit = robot_.joints[static_cast<std::size_t>(j)].effort_limit;
    floor_[j] = std::min(kEffortFloor * (limit > 0.0 ? limit : std::numeric_limits<double>::infinity()),
                         kArmFloor * rms_.maxCoeff());
  }
}

double Comparison::offset(const JointMoments& moments, int torque) const {
  return (moments.moving() ? kMovingOffset : kRestingOffset) * rms_[torque] + floor_[torque];
}

double Comparison::noise(int torque, std::initializer_list<double> residuals) const {
  // Where a joint rests friction takes up any torque below its level, whatever the load.
  const double share = kNoiseShare + (kRestingOffset - kNoiseShare) * joint(torque).resting();
  return std::max({share * rms_[torque], floor_[torque], std::min(residuals), 1e-12});
}

std::pair<double, double> Comparison::slope_of(const std::vector<JointMoments>& moments, int j) const {
  const JointMoments& own = moments[static_cast<std::size_t>(j)];
  const double noise = std::max({kSlopeNoiseShare * rms_[j], own.free_residual(j), 1e-12});
  return own.slope(j, noise, offset(own, j));
}

double Comparison::misfit() const {
  double sum = 0.0;
  for (int j = 0; j < num_joints(); ++j) {
    if (!dead(j)) sum += joint(j).misfit(j, 1.0, noise(j, {free_residual(j)}), offset(joint(j), j));
  }
  return sum;
}

std::vector<Hypothesis> Comparison::signs() const {
  std::vector<Hypothesis> list;
  for (int j = 0; j < num_joints(); ++j) {
    if (dead(j)) continue;
    const double sigma = noise(j, {free_residual(j)}), shift = offset(joint(j), j);
    list.push_back({Contradiction::kSign,
                    j,
                    -1,
                    0.0,
                    {},
                    joint(j).misfit(j, 1.0, sigma, shift) - joint(j).misfit(j, -1.0, sigma, shift)});
  }
  return list;
}

std::vector<Hypothesis> Comparison::interchanges() const {
  std::vector<Hypothesis> list;
  for (int j = 0; j < num_joints(); ++j) {
    for (int k = j + 1; k < num_joints(); ++k) {
      if (dead(j) || dead(k)) continue;
      // The noise of a torque is its residual where it fits better.
      const double of_j = noise(j, {free_residual(j), joint(k).free_residual(j)});
      const double of_k = noise(k, {free_residual(k), joint(j).free_residual(k)});
      const double own = joint(j).misfit(j, 1.0, of_j, offset(joint(j), j)) +
                         joint(k).misfit(k, 1.0, of_k, offset(joint(k), k));
      const double crossed = joint(j).misfit(k, 1.0, of_k, offset(joint(j), k)) +
                             joint(k).misfit(j, 1.0, of_j, offset(joint(k), j));
      list.push_back({Contradiction::kInterchanged, j, k, 0.0, {}, own - crossed, Columns::kTorque});
      // Friction follows its joint, so less speaks against swapped joints: only neighbours are looked at.
      if (k > j + 1) continue;
      Samples swapped = samples_;
      for (MatrixXd* columns : {&swapped.q, &swapped.qd, &swapped.qdd}) columns->col(j).swap(columns->col(k));
      const std::vector<JointMoments> moments = moments_of(robot_, swapped);
      std::vector<int> torques(static_cast<std::size_t>(num_joints()));
      std::iota(torques.begin(), torques.end(), 0);
      list.push_back(
          {Contradiction::kInterchanged, j, k, 0.0, {}, gain_of(moments, torques), Columns::kPosition});
      std::swap(torques[static_cast<std::size_t>(j)], torques[static_cast<std::size_t>(k)]);
      list.push_back(
          {Contradiction::kInterchanged, j, k, 0.0, {}, gain_of(moments, torques), Columns::kBoth});
    }
  }
  return list;
}

double Comparison::gain_of(const std::vector<JointMoments>& moments, const std::vector<int>& torques) const {
  double gain = 0.0;
  for (int row = 0; row < num_joints(); ++row) {
    const int j = torques.empty() ? row : torques[static_cast<std::size_t>(row)];
    if (dead(j)) continue;
    const JointMoments& changed = moments[static_cast<std::size_t>(row)];
    const double sigma = noise(j, {free_residual(j), changed.free_residual(j)});
    gain += joint(j).misfit(j, 1.0, sigma, offset(joint(j), j)) -
            changed.misfit(j, 1.0, sigma, offset(changed, j));
  }
  return gain;
}

std::vector<Hypothesis> Comparison::zeros() const {
  std::vector<Hypothesis> list;
  for (int j = 0; j < num_joints(); ++j) {
    if (robot_.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic) continue;
    for (const double turn : {kQuarterTurn, -kQuarterTurn, 2.0 * kQuarterTurn}) {
      list.push_back({Contradiction::kZero, j, -1, turn, {}, 0.0});
    }
  }
  host::for_each_parallel(list.size(), [&](std::size_t k) {
    Samples turned = samples_;
    turned.q.col(list[k].joint).array() += list[k].value;
    list[k].gain = gain_of(moments_of(robot_, turned));
  });
  return list;
}

double Comparison::gain_under(const Eigen::Vector3d& gravity) const {
  model::Robot turned = robot_;
  turned.gravity = {gravity[0], gravity[1], gravity[2]};
  return gain_of(moments_of(turned, samples_));
}

std::vector<Hypothesis> Comparison::gravities() const {
  std::vector<Hypothesis> list;
  const Eigen::Vector3d given(robot_.gravity.data());
  const double size = given.norm();
  if (size == 0.0) return list;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector3d down = sign * size * Eigen::Vector3d::Unit(axis);
      // Within a tenth of the given direction it is that direction.
      if (given.dot(down) > 0.995 * size * size) continue;
      list.push_back({Contradiction::kGravity, -1, -1, 0.0, {down[0], down[1], down[2]}, gain_under(down)});
    }
  }
  return list;
}

double Comparison::gain_of_tilt() const {
  const Eigen::Vector3d given(robot_.gravity.data());
  std::array<double, kTilts.size() * kSides> gains{};
  host::for_each_parallel(gains.size(), [&](std::size_t k) {
    const double towards = 2.0 * std::numbers::pi * static_cast<double>(k % kSides) / kSides;
    const Eigen::Vector3d across = given.unitOrthogonal();
    const Eigen::Vector3d about = Eigen::AngleAxisd(towards, given.normalized()) * across;
    gains[k] = gain_under(Eigen::AngleAxisd(kTilts[k / kSides] * std::numbers::pi / 180.0, about) * given);
  });
  return *std::max_element(gains.begin(), gains.end());
}

Comparison::Weightless Comparison::weightless() const {
  model::Robot floating = robot_;
  floating.gravity = {0.0, 0.0, 0.0};
  const std::vector<JointMoments> moments = moments_of(floating, samples_);
  const model::Dynamics dynamics(robot_);
  MatrixXd weight(samples_.q.rows(), samples_.q.cols());
  for (Index i = 0; i < weight.rows(); ++i)
    weight.row(i) = dynamics.gravity_torque(samples_.q.row(i).transpose());
  weight.rowwise() -= weight.colwise().mean().eval();
  Weightless found{gain_of(moments), {}};
  for (int j = 0; j < num_joints(); ++j) {
    const double varies = std::sqrt(weight.col(j).squaredNorm() / static_cast<double>(weight.rows()));
    // No sensor's error, and not next to nothing in what the joint carries.
    if (dead(j) || varies < 2.0 * floor(j) || varies < kFeltWeight * joint(j).expected_rms()) continue;
    const double with = joint(j).free_residual(j),
                 without = moments[static_cast<std::size_t>(j)].free_residual(j);
    found.joints.push_back({j, std::sqrt(std::max(0.0, without * without - with * with)) / varies,
                            without / std::max(with, 1e-12)});
  }
  return found;
}

Comparison::Other Comparison::under(const model::Robot& other) const {
  model::Robot placed = other;
  placed.gravity = robot_.gravity;
  const std::vector<JointMoments> moments = moments_of(placed, samples_);
  Other found{gain_of(moments), {}};
  for (int j = 0; j < num_joints(); ++j) found.slopes.push_back(slope_of(moments, j));
  return found;
}

}  // namespace heft::plausibility
