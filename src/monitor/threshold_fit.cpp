#include "threshold_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "heft/core/monitor/contact_thresholds.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// Above any torque that core compares.
constexpr double kOpen = 1e30;
/// Blocks from whose maxima a scale is taken [s], and the share of them that exceeds it: a scale is no tail, and a phase
/// such as a reversal is short.
constexpr double kScaleBlock = 0.5;
constexpr std::size_t kScaleShare = 50;
/// Fewer blocks of a phase give no scale: that of the phase which shows most takes its place.
constexpr std::size_t kFewBlocks = 10;
/// Part of the samples of the arm's load rate beyond which values are no longer usual.
constexpr double kUsual = 0.99;
/// A joint moves above that part of its top speed.
constexpr double kRestShare = 0.01;
/// No scale vanishes, not even that of a log without noise [N·m, N].
constexpr double kLeastScale = 1e-6;
/// Share of the blocks that make up the tail: a fifth is still far above the middle and keeps the excesses many.
constexpr std::size_t kTailShare = 5;
constexpr std::size_t kLeastTail = 3;
/// Of the tail: a shape from some twenty excesses is uncertain by as much.
constexpr double kLeastShape = -0.25;

constexpr MotionPhase kPhases[] = {MotionPhase::kRest, MotionPhase::kTurning, MotionPhase::kMoving};

/// Of a joint in each phase, as kPhases.
using PhaseScales = std::array<double JointThreshold<double>::*, 3>;
constexpr PhaseScales kLevels{&JointThreshold<double>::rest, &JointThreshold<double>::turning,
                              &JointThreshold<double>::moving};
constexpr PhaseScales kChanges{&JointThreshold<double>::rest_change, &JointThreshold<double>::turning_change,
                               &JointThreshold<double>::moving_change};

/// The value that the stated part of them does not exceed; 0 of none.
double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Speeds and usual load rate; thresholds of one.
Thresholds limits_of(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                     double bandwidth) {
  Thresholds limits;
  limits.bandwidth = bandwidth;
  limits.load_rate = kOpen;
  limits.largest_step =
      1000.0;  // a glitch shows in full: what it leaves behind the limit depends on the thresholds
  for (Index j = 0; j < least_speed.size(); ++j) {
    double top = 0.0;
    for (const Balance* log : logs) top = std::max(top, log->qd.col(j).cwiseAbs().maxCoeff());
    const double rest = std::max(least_speed[j], kRestShare * top);
    JointThreshold<double> joint = JointThreshold<double>::uniform(1.0, 0.0);
    joint.rest_speed = rest;
    joint.top_speed = std::max(top, 2.0 * rest);
    limits.joints.push_back(joint);
  }
  std::vector<double> rates;
  for (const Balance* log : logs) {
    const Deviations found = deviations_of(*log, limits);
    for (Index k = 0; k < log->time.size(); ++k) {
      if (found.judged[static_cast<std::size_t>(k)] != 0) rates.push_back(found.load_rate[k]);
    }
  }
  limits.load_rate = std::max(quantile(std::move(rates), kUsual), kLeastScale);
  return limits;
}

/// Maxima over blocks of what `value` gives for the judged rows; below 0: not looked at.
template <typename Value>
void add_block_maxima(const Balance& log, const Deviations& found, double length, const Value& value,
                      std::vector<double>& maxima) {
  double block = -1.0;
  for (Index k = 0; k < log.time.size(); ++k) {
    const double now = value(k);
    if (found.judged[static_cast<std::size_t>(k)] == 0 || now < 0) continue;
    const double at = std::floor((log.time[k] - log.time[0]) / length);
    if (at != block) maxima.push_back(now);
    block = at;
    maxima.back() = std::max(maxima.back(), now);
  }
}

/// Scales of a joint's phases from multiples of the scales before, given with the phase of each sample.
void rescale(const std::vector<const Balance*>& logs, const std::vector<Deviations>& all,
             Eigen::MatrixXd Deviations::*multiple, Index j, const PhaseScales& scales,
             JointThreshold<double>& joint) {
  std::array<double, 3> found{};
  double largest = kLeastScale;
  for (std::size_t p = 0; p < scales.size(); ++p) {
    std::vector<double> maxima;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      add_block_maxima(
          *logs[l], all[l], kScaleBlock,
          [&](Index k) {
            return all[l].phase(k, j) == static_cast<int>(kPhases[p]) ? (all[l].*multiple)(k, j) : -1.0;
          },
          maxima);
    }
    if (maxima.size() < (kPhases[p] == MotionPhase::kRest ? 1 : kFewBlocks)) continue;
    std::sort(maxima.begin(), maxima.end(), std::greater<>());
    found[p] = std::max(joint.*scales[p] * maxima[maxima.size() / kScaleShare], kLeastScale);
    largest = std::max(largest, found[p]);
  }
  for (std::size_t p = 0; p < scales.size(); ++p) joint.*scales[p] = found[p] > 0 ? found[p] : largest;
  // A phase that shows little by chance.
  for (const auto scale : scales) joint.*scale = std::max(joint.*scale, joint.*scales.back());
}

/// Scales from deviations by the scales before.
void rescale(const std::vector<const Balance*>& logs, Thresholds& scales) {
  std::vector<Deviations> all;
  for (const Balance* log : logs) all.push_back(deviations_of(*log, scales));
  for (std::size_t i = 0; i < scales.joints.size(); ++i) {
    const auto j = static_cast<Index>(i);
    rescale(logs, all, &Deviations::level, j, kLevels, scales.joints[i]);
    rescale(logs, all, &Deviations::change, j, kChanges, scales.joints[i]);
  }
}

}  // namespace

Thresholds scales_of(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                     double bandwidth) {
  Thresholds scales = limits_of(logs, least_speed, bandwidth);
  rescale(logs, scales);
  return scales;
}

BlockMaxima block_maxima(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                         double bandwidth) {
  BlockMaxima maxima;
  const auto joints = static_cast<std::size_t>(least_speed.size());
  maxima.rest_change.resize(joints);
  maxima.motion_change.resize(joints);
  for (const Balance* log : logs) {
    std::vector<const Balance*> others;
    for (const Balance* other : logs) {
      if (other != log || logs.size() == 1) others.push_back(other);
    }
    const Deviations found = deviations_of(*log, scales_of(others, least_speed, bandwidth));
    for (const bool rest : {true, false}) {
      const auto of_joint = [&](const Eigen::MatrixXd& multiple, Index k, Index j) {
        return (found.phase(k, j) == static_cast<int>(MotionPhase::kRest)) == rest ? multiple(k, j) : -1.0;
      };
      const auto largest = [&](Index k) {
        double most = -1.0;
        for (Index j = 0; j < found.level.cols(); ++j) most = std::max(most, of_joint(found.level, k, j));
        return most;
      };
      add_block_maxima(*log, found, kBlock, largest, rest ? maxima.rest : maxima.motion);
      for (std::size_t j = 0; j < joints; ++j) {
        add_block_maxima(
            *log, found, kBlock, [&](Index k) { return of_joint(found.change, k, static_cast<Index>(j)); },
            (rest ? maxima.rest_change : maxima.motion_change)[j]);
      }
    }
  }
  return maxima;
}

Tail tail_of(std::vector<double> maxima) {
  std::sort(maxima.begin(), maxima.end(), std::greater<>());
  Tail tail;
  tail.blocks = static_cast<long>(maxima.size());
  const std::size_t beyond = std::min(std::max(kLeastTail, maxima.size() / kTailShare), maxima.size() - 1);
  tail.beyond = static_cast<long>(beyond);
  tail.from = maxima[beyond];
  // Probability-weighted moments (Hosking and Wallis, 1987): a0 is the mean excess, a1 that of the excesses weighted by
  // the share of larger ones.
  double weighted = 0.0;
  for (std::size_t k = 0; k < beyond; ++k) {
    const double excess = (maxima[k] - tail.from) / static_cast<double>(beyond);
    tail.mean_excess += excess;
    if (beyond > 1) weighted += excess * static_cast<double>(k) / static_cast<double>(beyond - 1);
  }
  const double spread = tail.mean_excess - 2.0 * weighted;
  if (spread > 0) tail.shape = std::clamp(2.0 - tail.mean_excess / spread, kLeastShape, 0.0);
  return tail;
}

double Tail::level(double rate) const {
  const double decades =
      std::max(std::log(static_cast<double>(beyond) / static_cast<double>(blocks) / rate), 0.0);
  const double scale = mean_excess * (1.0 - shape);
  return from + (shape < 0 ? scale * std::expm1(shape * decades) / shape : scale * decades);
}

double Tail::log_rate(double level) const {
  return std::log(static_cast<double>(beyond) / static_cast<double>(blocks)) -
         (mean_excess > 0 ? (level - from) / mean_excess : std::numeric_limits<double>::infinity());
}

double Tail::log_rate_std(double level) const {
  const double decades = mean_excess > 0 ? (level - from) / mean_excess : 0.0;
  return std::sqrt((1.0 + decades * decades) / static_cast<double>(beyond));
}

}  // namespace heft::monitor
