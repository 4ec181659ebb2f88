#include "log_slopes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "heft/statistics/block_jackknife.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/median.hpp"

namespace heft::drive {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Slower than this all joints rest [rad/s, m/s]: above the noise of velocities, below any wanted motion.
constexpr double kRest = 2e-3;
/// How long all joints have rested, and go on to, when a sample counts as standstill [s]: the target current has settled.
constexpr double kCalm = 0.2;
/// Share of the joint's largest target torque below which a standstill says nothing of it [1]: the drive's resolution.
constexpr double kLeastLoad = 0.05;
/// Width of the sign of velocity [rad/s, m/s].
constexpr double kSignWidth = 0.01;
/// Slower samples are left out of a fit in motion [rad/s, m/s]: static friction is not its sign times a constant there.
constexpr double kMoving = 0.03;
/// Blocks of the jackknife [s]: several times as long as a residual of friction remembers.
constexpr double kBlock = 2.0;
/// Fewer blocks give no interval worth having.
constexpr int kFewestBlocks = 8;
/// Standard deviation of a column's coefficient before the data, in units of what would explain the whole signal [1].
constexpr double kVague = 1e3;

enum Column : Index {
  kTarget,
  kLoadFriction,
  kOffset,
  kCoulomb,
  kViscous,
  kRoot,
  kCubic,
  kAcceleration,
  kColumns
};

/// Rows of a piece of which all joints have rested for kCalm, and go on to.
std::vector<bool> calm_rows(const data::MotionChunk& piece) {
  const auto reach = static_cast<Index>(std::ceil(kCalm * piece.sample_rate));
  const Index rows = piece.time.size();
  std::vector<bool> calm(static_cast<std::size_t>(rows), false);
  Index rested = 0;
  for (Index k = 0; k < rows; ++k) {
    rested = piece.qd.row(k).cwiseAbs().maxCoeff() < kRest ? rested + 1 : 0;
    if (rested > 2 * reach) calm[static_cast<std::size_t>(k - reach)] = true;
  }
  return calm;
}

data::StreamOptions all_signals() {
  data::StreamOptions options;
  options.cut_standstill = false;
  options.extra = {"tauref", "iref", "i", "tau"};
  return options;
}

/// Terms of the equation of from_targets for one joint, rows × kColumns, and the signal behind the same low-pass.
std::pair<MatrixXd, VectorXd> terms(const data::MotionChunk& piece, std::size_t signal, Index joint,
                                    double cutoff, bool with_acceleration) {
  const VectorXd target = piece.extra[0].col(joint), v = piece.qd.col(joint);
  const VectorXd sign = (v.array() / kSignWidth).tanh();
  MatrixXd all(piece.time.size(), kColumns + 1);
  all.col(kTarget) = target;
  all.col(kLoadFriction) = target.array().abs() * sign.array();
  all.col(kOffset).setOnes();
  all.col(kCoulomb) = sign;
  all.col(kViscous) = v;
  all.col(kRoot) = v.array().abs().sqrt() * sign.array();
  all.col(kCubic) = v.array().cube();
  all.col(kAcceleration) = with_acceleration ? VectorXd(piece.qdd.col(joint)) : VectorXd::Zero(v.size());
  all.col(kColumns) = piece.extra[signal].col(joint);
  if (cutoff > 0.0) all = data::low_pass_zero_phase(all, piece.sample_rate, cutoff);
  return {all.leftCols(kColumns), all.col(kColumns)};
}

/// Largest absolute values of one joint: the scale of each term.
struct Scales {
  double target, signal, speed, acceleration;
};

/// Before the data every coefficient is zero, give or take what explains the whole signal many times over.
VectorXd vague_variance(const Scales& scales) {
  const double signal = scales.signal, target = scales.target, speed = scales.speed;
  const std::array<double, kColumns> size{
      target, target, 1.0, 1.0, speed, std::sqrt(speed), speed * speed * speed, scales.acceleration};
  VectorXd variance(kColumns);
  for (Index c = 0; c < kColumns; ++c) {
    const double unit = size[static_cast<std::size_t>(c)];
    const double std = unit > 0.0 ? kVague * signal / unit : kVague;
    variance[c] = std * std;
  }
  return variance;
}

Slope slope_of(const statistics::BlockJackknife& fit) {
  const statistics::BlockJackknife::Result result = fit.solve();
  Slope slope;
  const double b = result.estimate[kTarget];
  if (result.blocks < kFewestBlocks) return slope;
  // As sharp as a slope has to be: of many unloaded joints, some fall significantly by chance.
  slope.opposite = kWidestLog * -b > result.interval_factor * std::sqrt(result.covariance(kTarget, kTarget));
  if (!(b > 0.0)) return slope;
  slope.value = b;
  slope.std = std::sqrt(result.covariance(kTarget, kTarget));
  slope.factor = result.interval_factor;
  slope.load_friction = result.estimate[kLoadFriction] / b;
  return slope;
}

/// Ratios at standstill of one joint, a median each standstill.
class RestRatios {
 public:
  /// @param target,signal  columns of a piece
  /// @param least  target torque that says something
  void add(const data::MotionChunk& piece, const std::vector<bool>& calm, const VectorXd& target,
           const VectorXd& signal, double least) {
    for (Index k = piece.begin; k < piece.begin + piece.count; ++k) {
      if (calm[static_cast<std::size_t>(k)] && std::abs(target[k]) > least) {
        ratios_.push_back(signal[k] / target[k]);
      } else {
        end_standstill();
      }
    }
    end_standstill();
  }

  Slope slope() const {
    Slope slope;
    if (medians_.empty()) return slope;
    const double value = statistics::median(medians_);
    slope.opposite = value < 0.0;
    if (!(value > 0.0)) return slope;
    std::vector<double> off;
    for (const double ratio : medians_) off.push_back(std::abs(ratio - value));
    constexpr double kStdOfMedianDeviation = 1.4826;  // of a normal distribution
    slope.value = value;
    slope.std =
        kStdOfMedianDeviation * statistics::median(off) / std::sqrt(static_cast<double>(medians_.size()));
    slope.factor = statistics::kNormal95;
    return slope;
  }

 private:
  void end_standstill() {
    if (!ratios_.empty()) medians_.push_back(statistics::median(ratios_));
    ratios_.clear();
  }

  std::vector<double> ratios_, medians_;
};

}  // namespace

DriveLog::DriveLog(const data::LogSource& log) : stream_(data::stream(log, all_signals())) {
  const Index n = stream_.summary().num_joints;
  const auto widen = [n](VectorXd& largest, const MatrixXd& values) {
    if (largest.size() == 0) largest = VectorXd::Zero(n);
    largest = largest.cwiseMax(values.cwiseAbs().colwise().maxCoeff().transpose());
  };
  stream_.for_each([&](const data::MotionChunk& piece) {
    for (std::size_t g = 0; g < kGroups; ++g) {
      has_[g] = piece.extra[g].cols() == n;
      if (has_[g]) widen(largest_[g], piece.extra[g]);
    }
    widen(speed_, piece.qd);
    widen(acceleration_, piece.qdd);
  });
}

Slopes DriveLog::slopes(Signal signal, bool at_rest) const {
  const data::StreamSummary& summary = stream_.summary();
  const std::size_t group = index(signal);
  const auto n = static_cast<std::size_t>(summary.num_joints);
  const auto scales_of = [&](std::size_t j) {
    const auto at = static_cast<Index>(j);
    return Scales{largest_[0][at], largest_[group][at], speed_[at], acceleration_[at]};
  };
  std::vector<RestRatios> ratios(n);
  std::vector<statistics::BlockJackknife> fits;
  for (std::size_t j = 0; j < n; ++j)
    fits.emplace_back(VectorXd::Zero(kColumns), vague_variance(scales_of(j)));
  const bool with_acceleration =
      signal != Signal::kTargetCurrent;  // a target current is made from the target torque alone
  const auto add_motion = [&](const data::MotionChunk& piece, std::size_t j) {
    const Scales scales = scales_of(j);
    if (!(scales.target > 0.0) || !(scales.signal > 0.0)) return;
    const auto at = static_cast<Index>(j);
    const auto [columns, values] = terms(piece, group, at, summary.cutoff, with_acceleration);
    for (Index k = piece.begin; k < piece.begin + piece.count; ++k) {
      if (!piece.usable[k] || std::abs(piece.qd(k, at)) < kMoving) continue;
      const int block = static_cast<int>((piece.time[k] - summary.begin) / kBlock);
      fits[j].add(block, columns.row(k).transpose(), values[k], scales.signal * scales.signal);
    }
  };
  stream_.for_each([&](const data::MotionChunk& piece) {
    const std::vector<bool> calm = at_rest ? calm_rows(piece) : std::vector<bool>{};
    for (std::size_t j = 0; j < n; ++j) {
      const auto at = static_cast<Index>(j);
      if (at_rest)
        ratios[j].add(piece, calm, piece.extra[0].col(at), piece.extra[group].col(at),
                      kLeastLoad * scales_of(j).target);
      add_motion(piece, j);
    }
  });
  Slopes slopes;
  for (const RestRatios& of_joint : ratios)
    if (at_rest) slopes.at_rest.push_back(of_joint.slope());
  for (const statistics::BlockJackknife& fit : fits) slopes.in_motion.push_back(slope_of(fit));
  return slopes;
}

Combined combine(const std::vector<Slope>& slopes) {
  // Weights 1/(s² + t²); t² such that the weighted scatter is what both together let expect.
  double w1 = 0.0, w2 = 0.0, wx = 0.0;
  const auto variance_of = [](const Slope& slope) {
    // A drive's own constant has no scatter; a millionth keeps the weights finite.
    const double least = 1e-6 * slope.value;
    return slope.std * slope.std + least * least;
  };
  for (const Slope& slope : slopes) {
    const double w = 1.0 / variance_of(slope);
    w1 += w, w2 += w * w, wx += w * slope.value;
  }
  const double fixed = wx / w1;
  double q = 0.0;
  for (const Slope& slope : slopes) q += std::pow(slope.value - fixed, 2) / variance_of(slope);
  const double freedom = static_cast<double>(slopes.size()) - 1.0;
  const double between = freedom > 0.0 ? std::max(0.0, (q - freedom) / (w1 - w2 / w1)) : 0.0;
  double sum = 0.0, weighted = 0.0;
  for (const Slope& slope : slopes) {
    const double w = 1.0 / (variance_of(slope) + between);
    sum += w, weighted += w * slope.value;
  }
  return {weighted / sum, std::sqrt(1.0 / sum), std::sqrt(between)};
}

}  // namespace heft::drive
