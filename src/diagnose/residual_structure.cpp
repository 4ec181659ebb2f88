#include "residual_structure.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/parallel.hpp"
#include "heft/statistics/spectrum.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Share of the squared error that bin means of a quantity explain, bins filled on all blocks but the fold judged.
/// @param keep  m, 1 or 0: the row counts
double binned_share(const MotionTable& table, const VectorXd& keep, const VectorXd& residual,
                    const VectorXd& quantity, int bins) {
  const double low = quantity.minCoeff(), high = quantity.maxCoeff();
  if (!(high > low)) return 0.0;
  int folds = 0;
  for (const Block& b : table.blocks) folds = std::max(folds, b.fold + 1);
  MatrixXd sum = MatrixXd::Zero(bins, folds), count = MatrixXd::Zero(bins, folds);
  const auto bin = [&](Index i) {
    return std::min<Index>(bins - 1, static_cast<Index>((quantity[i] - low) / (high - low) * bins));
  };
  for (const Block& b : table.blocks) {
    for (Index i = b.begin; i < b.begin + b.count; ++i) {
      if (keep[i] == 0.0) continue;
      sum(bin(i), b.fold) += residual[i];
      count(bin(i), b.fold) += 1.0;
    }
  }
  const VectorXd all = sum.rowwise().sum(), rows = count.rowwise().sum();
  double before = 0.0, after = 0.0;
  for (const Block& b : table.blocks) {
    for (Index i = b.begin; i < b.begin + b.count; ++i) {
      if (keep[i] == 0.0) continue;
      const Index k = bin(i);
      const double n = rows[k] - count(k, b.fold);
      const double mean = n > 0.0 ? (all[k] - sum(k, b.fold)) / n : 0.0;
      before += residual[i] * residual[i];
      after += (residual[i] - mean) * (residual[i] - mean);
    }
  }
  return before > 0.0 ? 1.0 - after / before : 0.0;
}

/// Power spectrum of Hann-windowed pieces of about 4 s, half overlapping, of the rows that are scored; no rows where these make fewer than three.
VectorXd power_of(const MotionTable& table, const Eigen::Ref<const VectorXd>& signal) {
  Index length = 1;
  while (static_cast<double>(length) < 4.0 * table.sample_rate) length *= 2;
  statistics::Spectrum spectrum(length);
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    for (Index i = table.run_begin[r]; i < table.run_begin[r + 1]; ++i) {
      if (table.scored[i] > 0.0) {
        spectrum.add(signal[i]);
      } else {
        spectrum.interrupt();
      }
    }
    spectrum.interrupt();
  }
  if (spectrum.segments() < 3) return {};
  return spectrum.power().head(length / 2);
}

/// Power within a window around a peak that stands out from the level next to it; 0: it does not.
double line_at(const VectorXd& power, Index peak) {
  constexpr double kStandsOut = 5.0;
  const Index half = 2;
  const Index from = std::max<Index>(1, peak - half), to = std::min(power.size() - 1, peak + half);
  double inside = 0.0, beside = 0.0;
  Index beside_count = 0;
  for (Index k = from; k <= to; ++k) inside += power[k];
  for (Index k = std::max<Index>(1, peak - 8 * half); k <= std::min(power.size() - 1, peak + 8 * half); ++k) {
    if (k < from || k > to) beside += power[k], ++beside_count;
  }
  const double level = beside_count > 0
                           ? beside / static_cast<double>(beside_count) * static_cast<double>(to - from + 1)
                           : 0.0;
  return inside < kStandsOut * level ? 0.0 : inside - level;
}

struct Line {
  Index peak{0};
  double frequency{0.0};  ///< [Hz]
  double share{0.0};      ///< of the power; 0: nothing stands out
};

/// The strongest line of a signal.
Line strongest_line(const MotionTable& table, const Eigen::Ref<const VectorXd>& signal) {
  const VectorXd power = power_of(table, signal);
  if (power.size() == 0) return {};
  Line line{1};
  for (Index k = 2; k + 3 < power.size(); ++k) {
    if (power[k] > power[line.peak]) line.peak = k;
  }
  line.frequency = static_cast<double>(line.peak) * table.sample_rate / static_cast<double>(2 * power.size());
  line.share = line_at(power, line.peak) / power.tail(power.size() - 1).sum();
  return line;
}

/// The same in words.
Structure spectral_line(const MotionTable& table, const VectorXd& residual) {
  constexpr double kSlowestVibration = 1.0;  // [Hz]; slower, it is a swing
  const Line line = strongest_line(table, residual);
  if (line.peak == 0) return {};
  return {line.frequency < kSlowestVibration ? fmt::format("swings at {:.2f} Hz", line.frequency)
                                             : fmt::format("vibrates at {:.1f} Hz", line.frequency),
          line.share, line.frequency};
}

/// How well the residual is predicted by what it was a moment earlier, means of 0.1 s; share 0 where it is not.
Structure slow_drift(const MotionTable& table, const VectorXd& keep, const VectorXd& residual) {
  const Index step = std::max<Index>(1, static_cast<Index>(0.1 * table.sample_rate));
  double product = 0.0, square = 0.0, total = 0.0;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    double last = 0.0;
    bool has_last = false;
    for (Index at = table.run_begin[r]; at + step <= table.run_begin[r + 1]; at += step) {
      const double rows = keep.segment(at, step).sum();
      if (rows < 0.5 * static_cast<double>(step)) {
        has_last = false;
        continue;
      }
      const double mean = residual.segment(at, step).sum() / rows;
      if (has_last) product += mean * last, square += mean * mean;
      last = mean;
      has_last = true;
      total += residual.segment(at, step).squaredNorm();
    }
  }
  Structure drift{"drifts slowly, with nothing that was measured"};
  if (square > 0.0 && total > 0.0 && product > 0.0) {
    const double slow = product / square;  // correlation of neighbouring means
    drift.share = slow * square * static_cast<double>(step) / std::max(1e-300, total);
  }
  return drift;
}

}  // namespace

VectorXd white_noise(const MotionTable& table, const MatrixXd& keep, const MatrixXd& residual) {
  const Index n = residual.cols();
  VectorXd noise = VectorXd::Zero(n);
  host::for_each_parallel(static_cast<std::size_t>(n), [&](std::size_t joint) {
    const auto j = static_cast<Index>(joint);
    std::vector<double> squares;
    for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
      for (Index i = table.run_begin[r] + 3; i < table.run_begin[r + 1]; ++i) {
        if (keep.col(j).segment(i - 3, 4).minCoeff() == 0.0) continue;
        // Var(Δ³ r) = 20 σ² for white noise.
        const double d =
            residual(i, j) - 3.0 * residual(i - 1, j) + 3.0 * residual(i - 2, j) - residual(i - 3, j);
        squares.push_back(d * d / 20.0);
      }
    }
    if (squares.size() < 30) return;
    double sum = 0.0;
    for (const double s : squares) sum += s;
    noise[j] = std::sqrt(sum / static_cast<double>(squares.size()));
  });
  return noise;
}

VectorXd noise_with_hum(const MotionTable& table, const MatrixXd& keep, const MatrixXd& residual) {
  constexpr double kQuick = 3.0;  // [Hz]; what goes with the motion has lines below
  VectorXd noise = white_noise(table, keep, residual);
  const auto joints = static_cast<std::size_t>(residual.cols());
  std::vector<Line> lines(joints);
  host::for_each_parallel(joints, [&](std::size_t j) {
    const Line line = strongest_line(table, residual.col(static_cast<Index>(j)));
    if (line.frequency > kQuick) lines[j] = line;
  });
  if (std::none_of(lines.begin(), lines.end(), [](const Line& line) { return line.share > 0.0; })) return noise;
  std::vector<VectorXd> motion(joints);
  host::for_each_parallel(joints, [&](std::size_t j) { motion[j] = power_of(table, table.qdd.col(static_cast<Index>(j))); });
  for (std::size_t j = 0; j < joints; ++j) {
    const auto shakes = [&](const VectorXd& power) { return line_at(power, lines[j].peak) > 0.0; };
    if (!(lines[j].share > 0.0) || std::any_of(motion.begin(), motion.end(), shakes)) continue;
    const auto column = static_cast<Index>(j);
    const double square = residual.col(column).squaredNorm() / std::max(1.0, keep.col(column).sum());
    noise[column] = std::sqrt(noise[column] * noise[column] + lines[j].share * square);
  }
  return noise;
}

std::vector<Structure> structures(const MotionTable& table, const VectorXd& keep, const VectorXd& residual,
                                  int joint) {
  std::vector<Structure> found;
  found.push_back(spectral_line(table, residual));
  found.push_back(
      {"goes with the joint's position", binned_share(table, keep, residual, table.q.col(joint), 40), 0.0});
  found.push_back(
      {"goes with the joint's velocity", binned_share(table, keep, residual, table.qd.col(joint), 40), 0.0});
  found.push_back({"goes with the joint's acceleration",
                   binned_share(table, keep, residual, table.qdd.col(joint), 25), 0.0});
  for (int other = 0; other < table.num_joints; ++other) {
    if (other == joint) continue;
    found.push_back({fmt::format("goes with the velocity of joint {}", other + 1),
                     binned_share(table, keep, residual, table.qd.col(other), 25), 0.0});
    found.push_back({fmt::format("goes with the position of joint {}", other + 1),
                     binned_share(table, keep, residual, table.q.col(other), 25), 0.0});
  }
  const Structure drift = slow_drift(table, keep, residual);
  if (drift.share > 0.0) found.push_back(drift);
  std::sort(found.begin(), found.end(),
            [](const Structure& a, const Structure& b) { return a.share > b.share; });
  return found;
}

}  // namespace heft::diagnose
