#include "heft/validate/score.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/statistics/correlation.hpp"
#include "heft/statistics/spectrum.hpp"
#include "heft/validate/predict.hpp"

namespace heft::validate {

static_assert(model::kSeenAtRest <= kScoreEnd, "no error counts what friction's memory begins with");

namespace {

using Eigen::Index;

/// Largest `capacity` values seen.
class LargestValues {
 public:
  explicit LargestValues(std::size_t capacity) : capacity_(capacity) {}
  void add(double value) {
    if (heap_.size() < capacity_) {
      heap_.push(value);
    } else if (value > heap_.top()) {
      heap_.pop();
      heap_.push(value);
    }
  }
  /// The value that `above` of those seen exceed.
  double exceeded_by(std::size_t above) const {
    if (heap_.empty()) return kNaN;
    auto rest = heap_;
    while (rest.size() > above + 1) rest.pop();
    return rest.top();
  }

 private:
  std::size_t capacity_;
  std::priority_queue<double, std::vector<double>, std::greater<>> heap_;
};

/// Segments of up to ten seconds, at least four in the log.
Index segment_length(double sample_rate, double duration) {
  const double most = std::min({10.0 * sample_rate, duration * sample_rate / 2.5, 32768.0});
  Index length = 32;
  while (2.0 * static_cast<double>(length) <= most) length *= 2;
  return length;
}

}  // namespace

// Scores -------------------------------------------------------------------------------------------------------

struct TorqueScorer::Impl {
  explicit Impl(const Setup& given)
      : setup(given),
        scored(given.begin, given.end, given.gaps),
        n(given.max_torque.size()),
        filtered(given.band > 0 && given.band < 0.5 * given.sample_rate) {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
    squares = sum = torque_sum = torque_squares = band_squares = shift = zero;
    moving_squares = moving_band_squares = zero;
    // Rows that exceed the quantile, and some to spare for rows whose number is not known beforehand.
    const auto above = static_cast<std::size_t>(static_cast<double>(std::max(0L, setup.samples)) / 1000.0);
    largest.assign(static_cast<std::size_t>(n), LargestValues(above + 2));
    const Index length = segment_length(setup.sample_rate, setup.end - setup.begin);
    for (Index j = 0; j < n; ++j) spectra.emplace_back(length);
    segment = length;
    // The slowest pole of the low-pass, Q = 1.3066, fades as exp(−2.4 f t): after 6/f it has gone to 6e-7.
    if (filtered) margin = static_cast<Index>(std::ceil(6.0 / setup.band * setup.sample_rate));
    buffer.resize(0, n);
    buffer_time.resize(0);
  }

  bool moves(double time) const { return time >= setup.moving_from && time <= setup.moving_to; }

  /// Filters what has come in and counts it; keeps what the next rows need for their margin.
  void filter(bool last) {
    const Index rows = buffer_time.size();
    const Index stop = last ? rows : rows - margin;
    if (stop <= fresh) return;
    const Eigen::MatrixXd low = data::low_pass_zero_phase(buffer, setup.sample_rate, setup.band);
    for (Index k = fresh; k < stop; ++k) {
      if (!scored.counts(buffer_time[k])) continue;
      band_squares += low.row(k).transpose().cwiseAbs2();
      ++band_count;
      if (!moves(buffer_time[k])) continue;
      moving_band_squares += low.row(k).transpose().cwiseAbs2();
      ++moving_band_count;
    }
    const Index from = std::max<Index>(0, stop - margin);
    buffer = buffer.bottomRows(rows - from).eval();
    buffer_time = buffer_time.tail(rows - from).eval();
    fresh = stop - from;
  }

  void whiteness(Score& score) const {
    score.correlated_share = score.correlated_below = score.correlation_time =
        Eigen::VectorXd::Constant(n, kNaN);
    for (Index j = 0; j < n; ++j) {
      const statistics::Spectrum& spectrum = spectra[static_cast<std::size_t>(j)];
      if (spectrum.segments() < 2) continue;
      const Eigen::VectorXd power = spectrum.power_about_mean();
      const Eigen::VectorXd rho = spectrum.autocorrelation(power);
      score.correlation_time[j] =
          statistics::correlated_samples([&](Index lag) { return rho[lag]; }, rho.size()) / setup.sample_rate;
      // Bins 1 .. L/2 − 1: the mean and the highest frequency have no partner.
      const Eigen::VectorXd inner = power.segment(1, power.size() - 2);
      std::vector<double> upper(inner.data() + inner.size() / 2, inner.data() + inner.size());
      std::nth_element(upper.begin(), upper.begin() + static_cast<std::ptrdiff_t>(upper.size() / 2),
                       upper.end());
      // Median of a mean of K exponentials: (1 − 1/(9K))³ of its mean (Wilson and Hilferty).
      const double median_share = std::pow(1.0 - 1.0 / (9.0 * static_cast<double>(spectrum.segments())), 3);
      const double level = upper[upper.size() / 2] / median_share;
      const double total = inner.sum();
      if (!(total > 0)) {
        score.correlated_share[j] = 0.0;
        continue;
      }
      const double correlated = total - level * static_cast<double>(inner.size());
      score.correlated_share[j] = std::clamp(correlated / total, 0.0, 1.0);
      if (!(correlated > 0)) continue;
      double above = 0.0;
      for (Index k = 0; k < inner.size(); ++k) {
        above += inner[k] - level;
        if (above >= 0.9 * correlated) {
          score.correlated_below[j] =
              static_cast<double>(k + 1) * setup.sample_rate / static_cast<double>(segment);
          break;
        }
      }
    }
  }

  Setup setup;
  ScoredTime scored;
  Index n;
  bool filtered;
  long count{0}, band_count{0}, moving_count{0}, moving_band_count{0};
  Eigen::VectorXd squares, sum, torque_sum, torque_squares, band_squares, shift;
  Eigen::VectorXd moving_squares, moving_band_squares;
  std::vector<LargestValues> largest;
  std::vector<statistics::Spectrum> spectra;
  Index segment{0}, margin{0}, fresh{0};
  Eigen::MatrixXd buffer;
  Eigen::VectorXd buffer_time;
  bool was_in_gap{false};
};

TorqueScorer::TorqueScorer(const Setup& setup) : impl_(std::make_unique<Impl>(setup)) {}
TorqueScorer::~TorqueScorer() = default;
TorqueScorer::TorqueScorer(TorqueScorer&&) noexcept = default;
TorqueScorer& TorqueScorer::operator=(TorqueScorer&&) noexcept = default;

void TorqueScorer::add_rows(const Eigen::Ref<const Eigen::VectorXd>& time,
                            const Eigen::Ref<const Eigen::MatrixXd>& measured,
                            const Eigen::Ref<const Eigen::MatrixXd>& predicted) {
  Impl& s = *impl_;
  for (Index k = 0; k < time.size(); ++k) {
    if (!s.scored.counts(time[k])) continue;
    // Sums about the first torque, so that a large mean does not drown a small variance.
    if (s.count == 0) s.shift = measured.row(k);
    ++s.count;
    const bool moves = s.moves(time[k]);
    if (moves) ++s.moving_count;
    for (Index j = 0; j < s.n; ++j) {
      const double residual = measured(k, j) - predicted(k, j);
      if (moves) s.moving_squares[j] += residual * residual;
      const double torque = measured(k, j) - s.shift[j];
      s.squares[j] += residual * residual;
      s.sum[j] += residual;
      s.torque_sum[j] += torque;
      s.torque_squares[j] += torque * torque;
      s.largest[static_cast<std::size_t>(j)].add(std::abs(residual));
    }
  }
}

void TorqueScorer::add_grid(const Eigen::Ref<const Eigen::VectorXd>& time,
                            const Eigen::Ref<const Eigen::MatrixXd>& residual) {
  Impl& s = *impl_;
  for (Index k = 0; k < time.size(); ++k) {
    if (s.scored.is_in_gap(time[k])) {
      if (!s.was_in_gap) {
        for (statistics::Spectrum& spectrum : s.spectra) spectrum.interrupt();
      }
      s.was_in_gap = true;
      continue;
    }
    s.was_in_gap = false;
    if (!s.scored.is_inside(time[k])) continue;
    for (Index j = 0; j < s.n; ++j) s.spectra[static_cast<std::size_t>(j)].add(residual(k, j));
  }
  if (!s.filtered) return;
  const Index before = s.buffer_time.size();
  s.buffer.conservativeResize(before + time.size(), s.n);
  s.buffer.bottomRows(time.size()) = residual;
  // What was made up in a gap must not ring on beside it.
  for (Index k = 0; k < time.size(); ++k) {
    if (s.scored.is_in_gap(time[k])) s.buffer.row(before + k).setZero();
  }
  s.buffer_time.conservativeResize(before + time.size());
  s.buffer_time.tail(time.size()) = time;
  // Work in pieces several margins long, or the margins would be the work.
  if (s.buffer_time.size() - s.fresh > 6 * s.margin + 4096) s.filter(false);
}

Score TorqueScorer::finish() {
  Impl& s = *impl_;
  if (s.filtered) s.filter(true);
  Score score;
  score.log = s.setup.log;
  score.samples = s.count;
  score.ends_left_out = s.scored.ends_left_out();
  score.band = s.filtered && s.band_count > 0 ? s.setup.band : 0.0;
  score.sample_rate = s.setup.sample_rate;
  score.max_torque = s.setup.max_torque;
  const auto rows = static_cast<double>(s.count);
  score.rmse = (s.squares / rows).cwiseSqrt();
  score.bias = s.sum / rows;
  score.torque_mean = s.shift + s.torque_sum / rows;
  score.torque_variance = (s.torque_squares / rows - (s.torque_sum / rows).cwiseAbs2()).cwiseMax(0.0);
  score.rmse_in_band = Eigen::VectorXd::Constant(s.n, kNaN);
  if (score.band > 0) score.rmse_in_band = (s.band_squares / static_cast<double>(s.band_count)).cwiseSqrt();
  score.samples_moving = s.moving_count;
  const auto moving_rmse = [&](const Eigen::VectorXd& squares, long rows_moving) -> Eigen::VectorXd {
    if (rows_moving == 0) return Eigen::VectorXd::Constant(s.n, kNaN);
    return (squares / static_cast<double>(rows_moving)).cwiseSqrt();
  };
  score.rmse_moving = moving_rmse(s.moving_squares, s.moving_count);
  score.rmse_in_band_moving = moving_rmse(s.moving_band_squares, s.moving_band_count);
  const auto percent = [&](const Eigen::VectorXd& error) {
    return Eigen::VectorXd::NullaryExpr(
               s.n,
               [&](Index j) {
                 return score.max_torque[j] > 0 ? 100.0 * error[j] / score.max_torque[j] : kNaN;
               })
        .eval();
  };
  score.percent_of_max = percent(score.rmse);
  score.in_band_percent_of_max = percent(score.rmse_in_band);
  score.r2.resize(s.n);
  score.quantile_999.resize(s.n);
  for (Index j = 0; j < s.n; ++j) {
    score.r2[j] = score.torque_variance[j] > 0 ? 1.0 - s.squares[j] / rows / score.torque_variance[j] : kNaN;
    score.quantile_999[j] =
        s.largest[static_cast<std::size_t>(j)].exceeded_by(static_cast<std::size_t>(rows / 1000.0));
  }
  s.whiteness(score);
  return score;
}

double default_band(double motion_bandwidth) { return std::max(1.0, 5.0 * motion_bandwidth); }

Score score(const model::Robot& robot, const data::MotionStream& log, const ScoreOptions& options) {
  const data::StreamSummary& summary = log.summary();
  const Index n = robot.num_joints();
  if (summary.num_joints != n) {
    throw DataError(
        fmt::format("{}: {} joints; expected {}, as robot \"{}\" has; use the model of the robot that "
                    "made the log",
                    summary.path, summary.num_joints, n, robot.name));
  }
  if (summary.max_torque.size() != n) {
    throw DataError(
        fmt::format("{}: no torque; expected tau1..tau{} to compare the model with", summary.path, n));
  }
  // The bandwidth is known unless the stream was given its cut-off.
  const double band = options.band > 0                               ? options.band
                      : summary.bandwidth == 0 && summary.cutoff > 0 ? summary.cutoff
                                                                     : default_band(summary.bandwidth);
  TorqueScorer scorer({summary.path, summary.begin, summary.end, summary.samples, summary.max_torque,
                       summary.sample_rate, band, summary.gaps, summary.moving_from, summary.moving_to});
  /// A piece's own rows, and the residual on its grid.
  struct Judged {
    Eigen::VectorXd row_time, time;
    Eigen::MatrixXd row_tau, predicted, residual;
  };
  const auto judge = [&](Predictor& predictor, const data::MotionChunk& piece) {
    Judged judged{piece.row_time, piece.time.segment(piece.begin, piece.count), piece.row_tau, predictor.rows(piece), {}};
    judged.residual = piece.tau.middleRows(piece.begin, piece.count);
    // On a log with even time stamps the grid is the log's own.
    const bool same = !summary.resampled && piece.count == piece.row_time.size();
    if (same) {
      judged.residual -= judged.predicted;
    } else {
      judged.residual -= predictor.grid(piece);
    }
    return judged;
  };
  const auto take = [&](const Judged& judged) {
    scorer.add_rows(judged.row_time, judged.row_tau, judged.predicted);
    if (options.rows) options.rows(judged.row_time, judged.row_tau, judged.predicted);
    scorer.add_grid(judged.time, judged.residual);
  };
  const auto fresh = [&] { return Predictor(robot, summary.begin, {options.sign_width}); };
  if (model::depends_on_past(robot)) {
    Predictor predictor = fresh();
    log.for_each([&](const data::MotionChunk& piece) { take(judge(predictor, piece)); }, options.progress);
  } else {
    log.for_each<Judged>(
        [&](const data::MotionChunk& piece) {
          Predictor predictor = fresh();
          return judge(predictor, piece);
        },
        take, options.progress);
  }
  return scorer.finish();
}

Score score(const data::Log& log, const Eigen::MatrixXd& predicted, double band) {
  const Index rows = log.time.size();
  TorqueScorer::Setup setup;
  setup.log = log.path;
  setup.begin = log.time[0];
  setup.end = log.time[rows - 1];
  setup.samples = rows;
  setup.max_torque = log.tau.cwiseAbs().colwise().maxCoeff();
  constexpr Index kFewestForAGrid = 16;
  if (rows < kFewestForAGrid) {
    TorqueScorer scorer(setup);
    scorer.add_rows(log.time, log.tau, predicted);
    return scorer.finish();
  }
  // The filter needs an even grid. Filtering is linear, so the residual alone is filtered.
  data::Log even;
  even.time = log.time;
  even.q = log.q;
  even.tau = log.tau - predicted;
  even = data::resample_uniform(even);
  setup.sample_rate = data::median_sample_rate(even.time);
  setup.band = band > 0 ? band : default_band(data::motion_bandwidth(even.q, setup.sample_rate));
  setup.gaps = data::find_gaps(log.time);
  TorqueScorer scorer(setup);
  scorer.add_rows(log.time, log.tau, predicted);
  scorer.add_grid(even.time, even.tau);
  return scorer.finish();
}

std::string describe_residual(const Score& score, int joint) {
  const double share = score.correlated_share[joint];
  if (!std::isfinite(share)) return "too few samples to distinguish noise from model error";
  if (share <= kWhiteShare) {
    return fmt::format("white: {:.0f} % of the variance is correlated in time, the rest is noise",
                       100.0 * share);
  }
  const double below = score.correlated_below[joint];
  return fmt::format(
      "{:.0f} % of the variance is correlated in time, nine tenths of that below {:.{}f} Hz: model error, "
      "not noise",
      100.0 * share, below, below < 10.0 ? 1 : 0);
}

Score pool(const std::vector<Score>& scores) {
  const auto longest = std::max_element(scores.begin(), scores.end(),
                                        [](const Score& a, const Score& b) { return a.samples < b.samples; });
  Score all = *longest;
  if (scores.size() == 1) return all;
  all.log.clear();
  const Index n = all.rmse.size();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(n), band_squares = squares, bias = squares, mean = squares,
                  torque_squares = squares, moving_squares = squares, moving_band_squares = squares;
  all.samples = all.samples_moving = 0;
  for (const Score& part : scores) {
    const auto weight = static_cast<double>(part.samples);
    all.samples += part.samples;
    all.ends_left_out = all.ends_left_out && part.ends_left_out;
    squares += weight * part.rmse.cwiseAbs2();
    band_squares += weight * part.rmse_in_band.cwiseAbs2();
    if (part.samples_moving > 0) {
      const auto moving = static_cast<double>(part.samples_moving);
      all.samples_moving += part.samples_moving;
      moving_squares += moving * part.rmse_moving.cwiseAbs2();
      moving_band_squares += moving * part.rmse_in_band_moving.cwiseAbs2();
    }
    bias += weight * part.bias;
    mean += weight * part.torque_mean;
    torque_squares += weight * (part.torque_variance + part.torque_mean.cwiseAbs2());
    all.max_torque = all.max_torque.cwiseMax(part.max_torque);
    all.quantile_999 = all.quantile_999.cwiseMax(part.quantile_999);
  }
  const auto rows = static_cast<double>(all.samples);
  all.rmse = (squares / rows).cwiseSqrt();
  all.rmse_in_band = (band_squares / rows).cwiseSqrt();
  const double moving = all.samples_moving > 0 ? static_cast<double>(all.samples_moving) : kNaN;
  all.rmse_moving = (moving_squares / moving).cwiseSqrt();
  all.rmse_in_band_moving = (moving_band_squares / moving).cwiseSqrt();
  all.bias = bias / rows;
  all.torque_mean = mean / rows;
  all.torque_variance = (torque_squares / rows - all.torque_mean.cwiseAbs2()).cwiseMax(0.0);
  for (Index j = 0; j < n; ++j) {
    const double largest = all.max_torque[j] > 0 ? all.max_torque[j] : kNaN;
    all.percent_of_max[j] = 100.0 * all.rmse[j] / largest;
    all.in_band_percent_of_max[j] = 100.0 * all.rmse_in_band[j] / largest;
    all.r2[j] = all.torque_variance[j] > 0 ? 1.0 - squares[j] / rows / all.torque_variance[j] : kNaN;
  }
  return all;
}

void put_training(const Score& training, model::FitRecord& record) {
  record.rmse = training.rmse;
  record.rmse_in_band = training.rmse_in_band;
  record.rmse_percent_of_max = training.percent_of_max;
  record.r2 = training.r2;
  record.band_hz = training.band;
}

}  // namespace heft::validate
