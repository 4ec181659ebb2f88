#include "threshold_fit.hpp"

#include <algorithm>
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
constexpr std::size_t kScaleShare = 20;
/// The same at rest, where little happens until a joint breaks away.
constexpr std::size_t kRestScaleShare = 50;
/// Fewer blocks of a phase give no scale: the limit of the offsets takes its place.
constexpr std::size_t kFewBlocks = 10;
/// A single sample counts as that many scales at most, which is about one threshold.
constexpr double kLargestStep = 2.0;
/// Offsets may be larger by that part than any that the logs show.
constexpr double kOffsetMargin = 1.2;
/// Part of the samples of a joint at rest, or of the arm's load rate, beyond which values are no longer usual.
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

double& scale_of(JointThreshold<double>& joint, MotionPhase phase) {
  return phase == MotionPhase::kRest      ? joint.rest
         : phase == MotionPhase::kTurning ? joint.turning
                                          : joint.moving;
}

/// The value that the stated part of them does not exceed; 0 of none.
double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Speeds, limits of the offsets and usual load rate.
Thresholds limits_of(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                     double bandwidth) {
  const Index n = least_speed.size();
  Thresholds open;
  open.bandwidth = bandwidth;
  open.load_rate = kOpen;
  for (Index j = 0; j < n; ++j) {
    double top = 0.0;
    for (const Balance* log : logs) top = std::max(top, log->qd.col(j).cwiseAbs().maxCoeff());
    const double rest = std::max(least_speed[j], kRestShare * top);
    open.joints.push_back({kOpen, kOpen, kOpen, kOpen, rest, std::max(top, 2.0 * rest)});
  }
  Thresholds limits = open;
  std::vector<double> rates;
  std::vector<std::vector<double>> resting(static_cast<std::size_t>(n));
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(n);
  for (const Balance* log : logs) {
    const Deviations found = deviations_of(*log, open);
    for (Index k = 0; k < log->time.size(); ++k) {
      if (found.judged[static_cast<std::size_t>(k)] == 0) continue;
      rates.push_back(found.load_rate[k]);
      for (Index j = 0; j < n; ++j) {
        if (found.phase(k, j) == static_cast<int>(MotionPhase::kRest)) {
          resting[static_cast<std::size_t>(j)].push_back(std::abs(found.residual(k, j)));
        } else {
          largest[j] = std::max(largest[j], std::abs(found.offset(k, j)));
        }
      }
    }
  }
  limits.load_rate = std::max(quantile(std::move(rates), kUsual), kLeastScale);
  for (Index j = 0; j < n; ++j) {
    const auto i = static_cast<std::size_t>(j);
    limits.joints[i].offset_limit = kOffsetMargin * std::max(largest[j], quantile(resting[i], kUsual));
  }
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

/// Deviation of a joint as a multiple of its threshold, both without what is not known yet.
double multiple(const Deviations& found, Index k, Index j) {
  const double unknown = found.allowance(k, j);
  return std::max(0.0, std::abs(found.deviation(k, j)) - unknown) / (found.threshold(k, j) - unknown);
}

/// Scales from deviations by the scales before.
void rescale(const std::vector<const Balance*>& logs, Thresholds& scales) {
  std::vector<Deviations> all;
  for (const Balance* log : logs) all.push_back(deviations_of(*log, scales));
  for (std::size_t i = 0; i < scales.joints.size(); ++i) {
    JointThreshold<double>& joint = scales.joints[i];
    const JointThreshold<double> before = joint;
    for (const MotionPhase phase : kPhases) {
      std::vector<double> maxima;
      for (std::size_t l = 0; l < logs.size(); ++l) {
        const auto j = static_cast<Index>(i);
        add_block_maxima(
            *logs[l], all[l], kScaleBlock,
            [&](Index k) {
              return all[l].phase(k, j) == static_cast<int>(phase) ? multiple(all[l], k, j) : -1.0;
            },
            maxima);
      }
      JointThreshold<double> old = before;
      double& scale = scale_of(joint, phase);
      const double known = scale_of(old, phase);
      std::sort(maxima.begin(), maxima.end(), std::greater<>());
      scale =
          maxima.empty()
              ? 0.0
              : known * maxima[maxima.size() / (phase == MotionPhase::kRest ? kRestScaleShare : kScaleShare)];
      if (maxima.size() >= kFewBlocks || phase == MotionPhase::kRest) continue;
      scale = std::max(scale, (phase == MotionPhase::kMoving ? 0.5 : 1.0) * joint.offset_limit);
    }
    joint.moving = std::max(joint.moving, kLeastScale);
    joint.turning = std::max(joint.turning, joint.moving);
    joint.rest = std::max(joint.rest, joint.moving);
  }
}

}  // namespace

Thresholds scales_of(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                     double bandwidth) {
  Thresholds scales = limits_of(logs, least_speed, bandwidth);
  for (JointThreshold<double>& joint : scales.joints)
    joint.moving = joint.turning = joint.rest = std::max(joint.offset_limit, kLeastScale);
  scales.largest_step = 1000.0;
  rescale(logs, scales);
  scales.largest_step = kLargestStep;
  for (int pass = 0; pass < 2; ++pass) rescale(logs, scales);
  return scales;
}

BlockMaxima block_maxima(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                         double bandwidth) {
  BlockMaxima maxima;
  for (const Balance* log : logs) {
    std::vector<const Balance*> others;
    for (const Balance* other : logs) {
      if (other != log || logs.size() == 1) others.push_back(other);
    }
    const Deviations found = deviations_of(*log, scales_of(others, least_speed, bandwidth));
    for (const bool rest : {true, false}) {
      const auto largest = [&](Index k) {
        double most = -1.0;
        for (Index j = 0; j < found.deviation.cols(); ++j) {
          if ((found.phase(k, j) == static_cast<int>(MotionPhase::kRest)) == rest)
            most = std::max(most, multiple(found, k, j));
        }
        return most;
      };
      add_block_maxima(*log, found, kBlock, largest, rest ? maxima.rest : maxima.motion);
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
