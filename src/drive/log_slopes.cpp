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

data::StreamOptions with_signals(const std::string& signal) {
  data::StreamOptions options;
  options.cut_standstill = false;
  options.extra = {"tauref", signal};
  return options;
}

/// Terms of the equation of from_targets for one joint, rows × kColumns, and the signal behind the same low-pass.
std::pair<MatrixXd, VectorXd> terms(const data::MotionChunk& piece, Index joint, double cutoff,
                                    bool with_acceleration) {
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
  all.col(kColumns) = piece.extra[1].col(joint);
  if (cutoff > 0.0) all = data::low_pass_zero_phase(all, piece.sample_rate, cutoff);
  return {all.leftCols(kColumns), all.col(kColumns)};
}

/// Largest absolute values of target torque, signal, speed and acceleration of one joint: the scale of each term.
struct Scales {
  VectorXd target, signal, speed, acceleration;
};

Scales scales_of(const data::MotionStream& stream) {
  const Index n = stream.summary().num_joints;
  Scales scales{VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n)};
  const auto widen = [](VectorXd& largest, const MatrixXd& values) {
    largest = largest.cwiseMax(values.cwiseAbs().colwise().maxCoeff().transpose());
  };
  stream.for_each([&](const data::MotionChunk& piece) {
    if (piece.extra[0].cols() != n || piece.extra[1].cols() != n) return;
    widen(scales.target, piece.extra[0]);
    widen(scales.signal, piece.extra[1]);
    widen(scales.speed, piece.qd);
    widen(scales.acceleration, piece.qdd);
  });
  return scales;
}

/// Before the data every coefficient is zero, give or take what explains the whole signal many times over.
VectorXd vague_variance(const Scales& scales, Index joint) {
  const double signal = scales.signal[joint], target = scales.target[joint], speed = scales.speed[joint];
  const std::array<double, kColumns> size{
      target, target, 1.0, 1.0, speed, std::sqrt(speed), speed * speed * speed, scales.acceleration[joint]};
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
  slope.opposite = b < -result.interval_factor * std::sqrt(result.covariance(kTarget, kTarget));
  if (!(b > 0.0)) return slope;
  slope.value = b;
  slope.std = std::sqrt(result.covariance(kTarget, kTarget));
  slope.factor = result.interval_factor;
  slope.load_friction = result.estimate[kLoadFriction] / b;
  return slope;
}

}  // namespace

std::vector<Slope> slopes_at_rest(const data::LogSource& log, const std::string& signal) {
  const data::MotionStream stream = data::stream(log, with_signals(signal));
  const Scales scales = scales_of(stream);
  const Index n = stream.summary().num_joints;
  std::vector<std::vector<double>> of_stretches(static_cast<std::size_t>(n));  // medians, one a standstill
  stream.for_each([&](const data::MotionChunk& piece) {
    if (piece.extra[0].cols() != n || piece.extra[1].cols() != n) return;
    const std::vector<bool> calm = calm_rows(piece);
    for (Index j = 0; j < n; ++j) {
      std::vector<double> ratios;
      const auto end_stretch = [&] {
        if (!ratios.empty()) of_stretches[static_cast<std::size_t>(j)].push_back(statistics::median(ratios));
        ratios.clear();
      };
      for (Index k = piece.begin; k < piece.begin + piece.count; ++k) {
        const double target = piece.extra[0](k, j);
        const bool loaded = std::abs(target) > kLeastLoad * scales.target[j];
        if (calm[static_cast<std::size_t>(k)] && loaded) {
          ratios.push_back(piece.extra[1](k, j) / target);
        } else {
          end_stretch();
        }
      }
      end_stretch();
    }
  });
  std::vector<Slope> slopes(static_cast<std::size_t>(n));
  for (std::size_t j = 0; j < slopes.size(); ++j) {
    std::vector<double>& ratios = of_stretches[j];
    if (ratios.empty()) continue;
    const double value = statistics::median(ratios);
    slopes[j].opposite = value < 0.0;
    if (!(value > 0.0)) continue;
    std::vector<double> off;
    for (const double ratio : ratios) off.push_back(std::abs(ratio - value));
    constexpr double kStdOfMedianDeviation = 1.4826;  // of a normal distribution
    slopes[j].value = value;
    slopes[j].std =
        kStdOfMedianDeviation * statistics::median(off) / std::sqrt(static_cast<double>(ratios.size()));
    slopes[j].factor = statistics::kNormal95;
  }
  return slopes;
}

std::vector<Slope> slopes_in_motion(const data::LogSource& log, const std::string& signal) {
  const data::MotionStream stream = data::stream(log, with_signals(signal));
  const data::StreamSummary& summary = stream.summary();
  const Scales scales = scales_of(stream);
  const Index n = summary.num_joints;
  std::vector<statistics::BlockJackknife> fits;
  for (Index j = 0; j < n; ++j) fits.emplace_back(VectorXd::Zero(kColumns), vague_variance(scales, j));
  const bool with_acceleration = signal != "iref";  // a target current is made from the target torque alone
  stream.for_each([&](const data::MotionChunk& piece) {
    if (piece.extra[0].cols() != n || piece.extra[1].cols() != n) return;
    for (Index j = 0; j < n; ++j) {
      if (!(scales.target[j] > 0.0) || !(scales.signal[j] > 0.0)) continue;
      const auto [columns, values] = terms(piece, j, summary.cutoff, with_acceleration);
      const double variance = scales.signal[j] * scales.signal[j];
      for (Index k = piece.begin; k < piece.begin + piece.count; ++k) {
        if (!piece.usable[k] || std::abs(piece.qd(k, j)) < kMoving) continue;
        const int block = static_cast<int>((piece.time[k] - summary.begin) / kBlock);
        fits[static_cast<std::size_t>(j)].add(block, columns.row(k).transpose(), values[k], variance);
      }
    }
  });
  std::vector<Slope> slopes;
  for (const statistics::BlockJackknife& fit : fits) slopes.push_back(slope_of(fit));
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
