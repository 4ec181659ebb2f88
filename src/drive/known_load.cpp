#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/drive/torque_constants.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/words.hpp"
#include "heft/model/point_load.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "heft/validate/predict.hpp"
#include "log_slopes.hpp"

namespace heft::drive {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Blocks of the jackknife [s].
constexpr double kBlock = 2.0;
constexpr int kFewestBlocks = 8;
/// Width of the sign of velocity in the change of friction [rad/s, m/s].
constexpr double kSignWidth = validate::kSignWidth;
/// Alternating least squares end after this many rounds, or when no slope changes by more than kSettled.
constexpr int kRounds = 200;
constexpr double kSettled = 1e-10;

/// Terms of one joint's residual: the torque of a unit of each of the last link's ten parameters (mass, first moment,
/// inertia about its origin), and what friction may have changed since the model was fitted: offset, Coulomb, viscous; then
/// the residual itself.
enum Term : Index { kMass, kMoment, kInertia = 4, kOffset = 10, kCoulomb, kViscous, kResidual, kTerms };
constexpr Index kFriction = 3;
using Gram = MatrixXd;  // kTerms × kTerms

/// Products of the terms, by block and joint.
struct Sums {
  std::vector<std::vector<Gram>> blocks;  // [block][joint]
  std::vector<double> residual_power;     // of each joint over all blocks, for the weights

  std::vector<Gram> without(std::size_t left_out) const {
    std::vector<Gram> total(blocks.front().size(), Gram::Zero(kTerms, kTerms));
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (b == left_out) continue;
      for (std::size_t j = 0; j < total.size(); ++j) total[j] += blocks[b][j];
    }
    return total;
  }
};

/// The robot with a unit of one parameter of its last link more.
model::Robot with_unit(model::Robot robot, std::size_t parameter) {
  robot.joints.back().link[parameter] += 1.0;
  return robot;
}

void add_log(const model::Robot& robot, const data::LogSource& log, Sums& sums) {
  data::StreamOptions options;
  options.displacement = true;
  const data::MotionStream stream = data::stream(log, options);
  const double begin = stream.summary().begin;
  const Index n = robot.num_joints();
  std::vector<validate::Predictor> predictors;  // without load, then with a unit of each parameter
  predictors.emplace_back(robot, begin);
  for (std::size_t p = 0; p < kOffset; ++p) predictors.emplace_back(with_unit(robot, p), begin);
  const std::size_t first_block = sums.blocks.size();
  stream.for_each([&](const data::MotionChunk& piece) {
    if (piece.row_tau.cols() != n)
      throw DataError(fmt::format("{}: no torque; expected tau1.., or currents i1..", log.path));
    std::vector<MatrixXd> torque;
    for (validate::Predictor& predictor : predictors) torque.push_back(predictor.rows(piece));
    const Eigen::Ref<const MatrixXd> speed = piece.row_qd();
    for (Index k = 0; k < piece.row_time.size(); ++k) {
      const std::size_t block = first_block + static_cast<std::size_t>((piece.row_time[k] - begin) / kBlock);
      if (block >= sums.blocks.size())
        sums.blocks.resize(block + 1,
                           std::vector<Gram>(static_cast<std::size_t>(n), Gram::Zero(kTerms, kTerms)));
      for (Index j = 0; j < n; ++j) {
        VectorXd row(kTerms);
        for (Index p = 0; p < kOffset; ++p)
          row[p] = torque[static_cast<std::size_t>(p) + 1](k, j) - torque[0](k, j);
        const double v = speed(k, j);
        row[kOffset] = 1.0;
        row[kCoulomb] = std::tanh(v / kSignWidth);
        row[kViscous] = v;
        row[kResidual] = piece.row_tau(k, j) - torque[0](k, j);
        sums.blocks[block][static_cast<std::size_t>(j)].noalias() += row * row.transpose();
      }
    }
  });
}

/// Slope of every joint's residual on the load's torque, with the load's first moment.
struct Solution {
  VectorXd slope;                     ///< n; NaN where the load does not act
  Vector3d moment{Vector3d::Zero()};  ///< at the last link's origin [kg·m]
};

/// Inertia of a point mass about the last link's origin, in the order of a link's parameters [kg·m²]: the load's own
/// inertia about its centre is not known, and small beside it for a tool or a weight that is held off the flange.
VectorXd inertia_of(double mass, const Vector3d& moment) {
  const InertialParameters<double> point = model::point_body(mass, moment / mass);
  return Eigen::Map<const Eigen::Matrix<double, 6, 1>>(point.data() + kIxx);
}

/// Slope of one joint's residual on the torque of a load, its own friction fitted beside it.
/// @return squares of what is left
double fit_slope(const Gram& gram, double mass, const Vector3d& moment, double& slope) {
  // Load, friction and residual as combinations of the terms.
  MatrixXd combine = MatrixXd::Zero(kTerms, kFriction + 2);
  combine(kMass, 0) = mass;
  combine.block(kMoment, 0, 3, 1) = moment;
  combine.block(kInertia, 0, 6, 1) = inertia_of(mass, moment);
  for (Index f = 0; f < kFriction; ++f) combine(kOffset + f, 1 + f) = 1.0;
  combine(kResidual, kFriction + 1) = 1.0;
  const MatrixXd small = combine.transpose() * gram * combine;
  const VectorXd r = small.col(kFriction + 1).head(kFriction + 1);
  const VectorXd x = least_squares(small.topLeftCorner(kFriction + 1, kFriction + 1), r);
  slope = x[0];
  return small(kFriction + 1, kFriction + 1) - x.dot(r);
}

/// First moment of the load given the slopes, all joints weighted by what they leave; inertia as that of `before`.
Vector3d fit_moment(const std::vector<Gram>& grams, double mass, const Vector3d& before,
                    const VectorXd& slope, const VectorXd& noise) {
  MatrixXd A = MatrixXd::Zero(3, 3);
  VectorXd r = VectorXd::Zero(3);
  const VectorXd inertia = inertia_of(mass, before);
  for (std::size_t j = 0; j < grams.size(); ++j) {
    const double b = slope[static_cast<Index>(j)];
    const double left = noise[static_cast<Index>(j)];
    if (!std::isfinite(b) || !(left > 0.0)) continue;
    // Friction is taken out of all terms first: G − G_f F⁻¹ G_fᵀ.
    const Gram& G = grams[j];
    const MatrixXd Gf = G.middleCols(kOffset, kFriction);
    const MatrixXd free =
        G - Gf * least_squares(G.block(kOffset, kOffset, kFriction, kFriction), Gf.transpose());
    const auto of_load = [&](Index first, Index count) { return free.block(kMoment, first, 3, count); };
    A += b * b / left * of_load(kMoment, 3);
    r += b / left * (of_load(kResidual, 1) - b * (mass * of_load(kMass, 1) + of_load(kInertia, 6) * inertia));
  }
  return least_squares(A, r);
}

Solution solve(const std::vector<Gram>& grams, double mass, const std::optional<Vector3d>& known) {
  const auto n = static_cast<Index>(grams.size());
  Solution solution{VectorXd::Ones(n), known.value_or(Vector3d::Zero())};
  VectorXd noise = VectorXd::Ones(n);
  for (Index j = 0; j < n; ++j) noise[j] = grams[static_cast<std::size_t>(j)](kResidual, kResidual);
  for (int round = 0; round < kRounds; ++round) {
    const VectorXd before = solution.slope;
    if (!known) solution.moment = fit_moment(grams, mass, solution.moment, solution.slope, noise);
    for (Index j = 0; j < n; ++j)
      noise[j] = fit_slope(grams[static_cast<std::size_t>(j)], mass, solution.moment, solution.slope[j]);
    if (known || (solution.slope - before).cwiseAbs().maxCoeff() < kSettled) break;
  }
  return solution;
}

/// First moment at the last link's origin of a body whose centre is given in the frame of the tip [kg·m].
Vector3d moment_of(const model::Robot& robot, double mass, const std::array<double, 3>& com) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(robot.tip_rotation.data());
  const Eigen::Map<const Vector3d> p(robot.tip_position.data()), c(com.data());
  return mass * (R * c + p);
}

}  // namespace

TorqueConstants from_known_load(const model::Robot& robot, const data::LogSet& logs, const KnownLoad& load,
                                const std::vector<double>& assumed,
                                const std::vector<std::string>& fitted_to) {
  if (!(load.mass > 0.0) || !std::isfinite(load.mass))
    throw InputError(fmt::format("a known load of {} kg: expected a mass above 0", load.mass));
  const auto n = static_cast<std::size_t>(robot.num_joints());
  if (assumed.size() != 1 && assumed.size() != n) {
    throw InputError(fmt::format(
        "{} torque constants were given; expected 1 or {}, those that made the torque", assumed.size(), n));
  }
  TorqueConstants constants;
  data::refuse_seen(logs, fitted_to, &constants.notes);
  Sums sums;
  for (const data::LogSource& log : logs.judge().empty() ? logs.train() : logs.judge()) {
    constants.logs.push_back(log.path);
    add_log(robot, log, sums);
  }
  if (static_cast<int>(sums.blocks.size()) < kFewestBlocks) {
    throw NotIdentifiableError(fmt::format(
        "the logs with the load last {:.0f} s; expected at least {:.0f} s for an interval; record a longer motion",
        kBlock * static_cast<double>(sums.blocks.size()), kBlock * kFewestBlocks));
  }
  std::optional<Vector3d> known;
  if (load.com) known = moment_of(robot, load.mass, *load.com);
  const Solution all = solve(sums.without(sums.blocks.size()), load.mass, known);
  MatrixXd changes(static_cast<Index>(n), static_cast<Index>(sums.blocks.size()));
  for (std::size_t b = 0; b < sums.blocks.size(); ++b)
    changes.col(static_cast<Index>(b)) = solve(sums.without(b), load.mass, known).slope - all.slope;
  const MatrixXd covariance = statistics::jackknife_covariance(changes);
  const double factor = statistics::interval_factor(static_cast<int>(sums.blocks.size()) - 1);
  std::vector<int> unknown;
  for (std::size_t j = 0; j < n; ++j) {
    const auto at = static_cast<Index>(j);
    JointConstant constant;
    constant.from = From::kLoad;
    const auto slope = statistics::Interval::around(all.slope[at], std::sqrt(covariance(at, at)), factor);
    if (slope.value > 0.0 && slope.half_width() < kWidest * slope.value) {
      const double k = assumed.size() == 1 ? assumed[0] : assumed[j];
      constant.constant =
          statistics::reciprocal({slope.value / k, slope.std / k, slope.lower / k, slope.upper / k});
    } else {
      unknown.push_back(static_cast<int>(j));
      constant.missing =
          "the load hardly acts on this joint; record a motion in which it does: the arm stretched out, the tool turned";
    }
    constants.joints.push_back(std::move(constant));
  }
  if (unknown.size() == n) {
    constants.judgement.add(host::Verdict::kBad, "the load shows the torque constant of no joint");
  } else if (!unknown.empty()) {
    constants.judgement.add(host::Verdict::kDoubtful, fmt::format("the torque constant of {} is not known",
                                                                  host::joints_in_words(unknown)));
  }
  constants.notes.push_back(
      "The model of the arm was fitted with other constants: identify it again with these before weighing a load.");
  return constants;
}

}  // namespace heft::drive
