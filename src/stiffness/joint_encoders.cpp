#include "heft/stiffness/joint_encoders.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/statistics/correlation.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "heft/statistics/residual_statistics.hpp"

namespace heft::stiffness {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kShortestLog = 5.0;      ///< usable [s]
constexpr double kShortestStretch = 2.0;  ///< between gaps [s]
/// Lost samples of less than this are bridged for the filter's sake, and not used [s].
constexpr double kBridged = 0.25;
/// A joint slower than this in rms rests: no delay, direction or position can be seen [rad/s].
constexpr double kResting = 1e-4;
/// Part of a term's power that the terms before it must leave for it to be tried.
constexpr double kOwnPower = 1e-7;
/// A torque of which less than this share (of its rms change) is its own says nothing of the spring.
constexpr double kOwnTorque = 0.005;
/// Changes of torque, as shares of its range, after which its direction has half turned.
constexpr std::array kSlips{0.02, 0.05, 0.1};
constexpr double kLevel = 0.05;
constexpr double kLongestShift = 0.2;  ///< [s]

constexpr std::array kFirst{DeflectionTerm::kOffset, DeflectionTerm::kCompliance, DeflectionTerm::kVelocity,
                            DeflectionTerm::kDirection};
constexpr std::array kCandidates{DeflectionTerm::kPosition,         DeflectionTerm::kEccentricity,
                                 DeflectionTerm::kSecondHarmonic,   DeflectionTerm::kDrift,
                                 DeflectionTerm::kStiffening,       DeflectionTerm::kBacklash,
                                 DeflectionTerm::kTorqueHysteresis, DeflectionTerm::kLoadFriction,
                                 DeflectionTerm::kDamping};

bool contains(const std::vector<DeflectionTerm>& terms, DeflectionTerm term) {
  return std::find(terms.begin(), terms.end(), term) != terms.end();
}

/// Column qlink<joint + 1>, or null.
const VectorXd* link_column(const data::Log& log, int joint) {
  const std::string name = fmt::format("qlink{}", joint + 1);
  for (const auto& [header, values] : log.extra) {
    if (header == name) return &values;
  }
  return nullptr;
}

/// A stretch without gaps on an even grid, one joint.
struct Stretch {
  int log{0};
  double rate{0.0};
  VectorXd time;
  std::vector<char> measured;     ///< grid points that stand for a sample
  VectorXd q, qlink, tau, model;  ///< as read
  VectorXd q_smooth, qlink_smooth, qd, direction;
  VectorXd torque, instrument;  ///< behind the filter, without rotor inertia
  double torque_noise{0.0};     ///< power of the noise of tau that passes the filter [(N·m)²], at most
};

/// Stretches of finite samples of a joint.
std::vector<Stretch> stretches_of(const data::Log& log, int index, int joint, const MatrixXd* model) {
  const VectorXd& qlink = *link_column(log, joint);
  std::vector<Index> rows;
  for (Index k = 0; k < log.num_samples(); ++k) {
    if (std::isfinite(log.time[k]) && std::isfinite(log.q(k, joint)) && std::isfinite(qlink[k]) &&
        std::isfinite(log.tau(k, joint)) && (model == nullptr || std::isfinite((*model)(k, joint))))
      rows.push_back(k);
  }
  std::vector<Stretch> result;
  if (log.num_samples() < 2) return result;
  const double period = 1.0 / data::median_sample_rate(log.time);
  const double gap = std::max(5.0 * period, kBridged);
  for (std::size_t begin = 0; begin < rows.size();) {
    std::size_t end = begin + 1;
    while (end < rows.size() && log.time[rows[end]] - log.time[rows[end - 1]] <= gap) ++end;
    const double duration = log.time[rows[end - 1]] - log.time[rows[begin]];
    if (duration >= kShortestStretch && end - begin >= 10) {
      const Index m = static_cast<Index>(end - begin);
      VectorXd time(m);
      MatrixXd raw(m, model == nullptr ? 3 : 4);
      for (Index i = 0; i < m; ++i) {
        const Index k = rows[begin + static_cast<std::size_t>(i)];
        time[i] = log.time[k];
        raw(i, 0) = log.q(k, joint);
        raw(i, 1) = qlink[k];
        raw(i, 2) = log.tau(k, joint);
        if (model != nullptr) raw(i, 3) = (*model)(k, joint);
      }
      Stretch s;
      s.log = index;
      const Index n = static_cast<Index>(std::llround(duration / period)) + 1;
      s.rate = static_cast<double>(n - 1) / duration;
      s.time = VectorXd::LinSpaced(n, time[0], time[m - 1]);
      s.measured.assign(static_cast<std::size_t>(n), 0);
      for (const double t : time) {
        const Index at = std::clamp<Index>(std::llround((t - time[0]) * s.rate), 0, n - 1);
        s.measured[static_cast<std::size_t>(at)] = 1;
      }
      const MatrixXd even = m == n && data::is_uniform(time) ? raw : data::resample(time, raw, s.time);
      s.q = even.col(0);
      s.qlink = even.col(1);
      s.tau = even.col(2);
      if (model != nullptr) s.model = even.col(3);
      result.push_back(std::move(s));
    }
    begin = end;
  }
  return result;
}

VectorXd smooth(const VectorXd& signal, double rate, double cutoff) {
  return cutoff < 0.4 * rate ? VectorXd(data::low_pass_zero_phase(signal, rate, cutoff)) : signal;
}

/// Bandwidth of the motion of all joints, in the longest stretch without a missing position.
double bandwidth_of(const data::Log& log) {
  Index best = 0, best_begin = 0, begin = 0;
  for (Index k = 0; k <= log.num_samples(); ++k) {
    if (k < log.num_samples() && log.q.row(k).allFinite() && std::isfinite(log.time[k])) continue;
    if (k - begin > best) {
      best = k - begin;
      best_begin = begin;
    }
    begin = k + 1;
  }
  if (best < 10) return 0.0;
  const VectorXd time = log.time.segment(best_begin, best);
  const VectorXd even = VectorXd::LinSpaced(best, time[0], time[best - 1]);
  const MatrixXd q = data::resample(time, log.q.middleRows(best_begin, best), even);
  return data::motion_bandwidth(q, static_cast<double>(best - 1) / (even[best - 1] - even[0]));
}

/// Fills what goes through the filter.
void filter(Stretch& s, double cutoff, double rotor_inertia, const JointEncoderOptions& options) {
  s.q_smooth = smooth(s.q, s.rate, cutoff);
  s.qlink_smooth = smooth(s.qlink, s.rate, cutoff);
  s.qd = data::differentiate(s.time, s.q_smooth);
  const VectorXd qdd = data::differentiate(s.time, s.qd);
  // The sign of the motion is taken where reversals are still sharp, and then filtered like the deflection.
  const double fast = std::min(4.0 * cutoff, 0.39 * s.rate);
  const VectorXd quick = data::differentiate(s.time, smooth(s.q, s.rate, fast));
  s.direction = smooth((quick.array() / options.sign_width).tanh().matrix(), s.rate, cutoff);
  const VectorXd tau = smooth(s.tau, s.rate, cutoff);
  // What the motor feeds into the gear: τ − ρ² I_r q̈.
  const VectorXd measured = tau - rotor_inertia * qdd;
  if (options.torque == GearTorque::kMeasured) {
    s.torque = s.instrument = measured;
  } else {
    s.instrument = smooth(s.model, s.rate, cutoff);
    s.torque = options.torque == GearTorque::kModel ? s.instrument : measured;
  }
  // What tau holds just above the filter's band, noise or not, is as much in every Hz below it at most: torque spectra
  // fall. Ripple far above says nothing.
  if (options.torque == GearTorque::kMeasured && 4.0 * cutoff < 0.4 * s.rate) {
    const VectorXd above = smooth(s.tau, s.rate, 4.0 * cutoff) - smooth(s.tau, s.rate, 2.0 * cutoff);
    s.torque_noise = above.squaredNorm() / static_cast<double>(above.size()) / 2.0;
  }
}

/// Columns of one term in a fit.
struct Columns {
  DeflectionTerm term{};
  std::vector<Index> columns;
};

/// All rows of a joint in some logs, with every term that could be tried, and the sums of each block of them.
class Problem {
 public:
  Problem(std::vector<Stretch> stretches, int num_logs, double cutoff)
      : stretches_(std::move(stretches)), num_logs_(num_logs), cutoff_(cutoff) {
    build(0.0);
  }

  /// The terms that are not linear in the torque, anew from the torque less this friction on the motor's side:
  /// its steps at reversals never reach the gear. Of the widths of the play the one that takes most of what these
  /// terms leave. Asks for set_blocks() anew.
  void set_friction(double friction, const std::vector<DeflectionTerm>& terms) {
    const double shift = shift_;
    build(friction);
    set_shift(shift);
    const std::vector<Index> others = indices(terms);
    const MatrixXd W = W_(Eigen::all, others);
    const MatrixXd A = pick(gram_, others);
    const VectorXd left = y_ - W * least_squares(A, W.transpose() * y_);
    const Index play = term(DeflectionTerm::kTorqueHysteresis)->columns.front();
    double most = -1.0;
    std::size_t best = 0;
    for (std::size_t i = 0; i < kSlips.size(); ++i) {
      const VectorXd z = plays_[0].col(static_cast<Index>(i));
      const VectorXd own = z - W * least_squares(A, W.transpose() * z);
      const double taken = own.dot(left) * own.dot(left) / std::max(own.squaredNorm(), 1e-300);
      if (taken <= most) continue;
      most = taken;
      best = i;
    }
    for (std::size_t side = 0; side < 2; ++side) {
      MatrixXd& target = side == 0 ? W_ : Z_;
      target.col(play) = plays_[side].col(static_cast<Index>(best)) / scale_[play];
    }
    gram_ = W_.transpose() * W_;
    set_memory(0.0);
  }

  /// Deflection with the link's channel taken `shift` later.
  void set_shift(double shift) {
    shift_ = shift;
    Index row = 0;
    for (const Stretch& s : stretches_) {
      const VectorXd link = shift == 0.0
                                ? s.qlink_smooth
                                : VectorXd(data::resample(s.time, s.qlink_smooth, s.time.array() + shift));
      for (Index k = 0; k < s.time.size(); ++k) {
        if (is_used(s, k)) y_[row++] = s.q_smooth[k] - link[k];
      }
    }
    yw_ = weighted(y_);
  }
  double shift() const { return shift_; }

  /// Rows weighted for a residual whose autocorrelation falls off as exp(-|t|/memory): y(k) − a y(k−1), a =
  /// exp(-T/memory), so that what is left of it is white. 0: as they are. Asks for set_blocks() anew.
  void set_memory(double memory) {
    decay_ = memory > 0 ? std::exp(-1.0 / (rate() * memory)) : 0.0;
    yw_ = weighted(y_);
    Ww_.resize(W_.rows(), W_.cols());
    Zw_.resize(W_.rows(), W_.cols());
    for (Index j = 0; j < W_.cols(); ++j) {
      Ww_.col(j) = weighted(W_.col(j));
      Zw_.col(j) = weighted(Z_.col(j));
    }
  }

  /// Sums over blocks of about that length [s].
  void set_blocks(double length);

  Index rows() const { return y_.size(); }
  const VectorXd& deflection() const { return y_; }
  const MatrixXd& columns() const { return W_; }
  const std::vector<Columns>& terms() const { return terms_; }
  const Columns* term(DeflectionTerm which) const {
    for (const Columns& t : terms_) {
      if (t.term == which) return &t;
    }
    return nullptr;
  }
  int num_blocks() const { return static_cast<int>(blocks_.size()); }
  double block_length() const { return block_length_; }
  /// Less than this the filter itself makes [s].
  double shortest_memory() const { return 1.0 / cutoff_; }
  double duration() const { return duration_; }
  double shortest_log() const { return shortest_log_; }
  double rate() const { return stretches_.front().rate; }
  const std::vector<int>& log_of_row() const { return log_of_row_; }
  /// Share by which the noise of tau lowers the compliance beside these columns.
  double attenuation(const std::vector<Index>& others, Index torque) const {
    if (!(torque_noise_ > 0)) return 0.0;
    // Mean of |1 − a exp(-iωT)|² over the noise's band, which ends at the cut-off.
    const double end = 2.0 * std::numbers::pi * cutoff_ / rate();
    const double gain = 1.0 + decay_ * decay_ - 2.0 * decay_ * std::sin(end) / end;
    const double own = own_power(total_.WW, others, {torque}) * total_.WW(torque, torque) /
                       static_cast<double>(rows()) * scale_[torque] * scale_[torque];
    return std::min(1.0, gain * torque_noise_ / std::max(own, 1e-300));
  }
  double torque_range() const { return torque_range_; }
  bool moves() const { return moves_; }

  std::vector<Index> indices(const std::vector<DeflectionTerm>& which) const {
    std::vector<Index> result;
    for (const Columns& t : terms_) {
      if (contains(which, t.term)) result.insert(result.end(), t.columns.begin(), t.columns.end());
    }
    return result;
  }

  struct Fit {
    std::vector<Index> index;  ///< columns of W
    VectorXd x;
    MatrixXd covariance;   ///< jackknife
    VectorXd residual;     ///< y − W x
    VectorXd innovation;   ///< of the weighted rows
    double held_out{0.0};  ///< sum of squares of the weighted rows
  };
  Fit fit(const std::vector<DeflectionTerm>& which, double edge_factor = 1.0) const;

  /// Share of the power of these columns (of the worst of them) that the others cannot stand for.
  double own_power(const std::vector<Index>& others, const std::vector<Index>& columns) const {
    return own_power(gram_, others, columns);
  }

 private:
  struct Sums {
    MatrixXd ZW, WW;
    VectorXd Zy, Wy;
    double yy{0.0};
  };

  bool is_used(const Stretch& s, Index k) const {
    const double edge = 1.0 / cutoff_;
    return s.measured[static_cast<std::size_t>(k)] != 0 && s.time[k] - s.time[0] >= edge &&
           s.time[s.time.size() - 1] - s.time[k] >= edge;
  }
  void build(double friction);
  VectorXd weighted(const VectorXd& rows) const {
    if (decay_ == 0.0) return rows;
    VectorXd result = rows;
    // The first row of a stretch counts for all those before it (Prais and Winsten).
    for (Index k = 0; k < rows.size(); ++k) {
      if (follows_[static_cast<std::size_t>(k)]) result[k] -= decay_ * rows[k - 1];
      else result[k] *= std::sqrt(1.0 - decay_ * decay_);
    }
    return result;
  }
  static double own_power(const MatrixXd& gram, const std::vector<Index>& others,
                          const std::vector<Index>& columns);
  static MatrixXd pick(const MatrixXd& A, const std::vector<Index>& index);
  static VectorXd pick(const VectorXd& a, const std::vector<Index>& index);

  std::vector<Stretch> stretches_;
  int num_logs_;
  double cutoff_;
  double shift_{0.0}, block_length_{0.0}, duration_{0.0}, shortest_log_{0.0};
  double torque_noise_{0.0}, torque_range_{0.0};
  bool moves_{false};
  double decay_{0.0};
  VectorXd y_, yw_, time_;
  MatrixXd W_, Z_;                 ///< columns of unit rms, see scale_
  MatrixXd Ww_, Zw_;               ///< weighted
  MatrixXd gram_;                  ///< Wᵀ W
  std::array<MatrixXd, 2> plays_;  ///< column of kTorqueHysteresis for each of kSlips
  std::vector<char> follows_;      ///< the row before is the sample before
  VectorXd scale_;
  std::vector<int> log_of_row_;
  std::vector<Columns> terms_;
  std::vector<Sums> blocks_;
  Sums total_;

 public:
  /// Columns were divided by this.
  double scale(Index column) const { return scale_[column]; }
};

void Problem::build(double friction) {
  terms_.clear();
  log_of_row_.clear();
  follows_.clear();
  duration_ = torque_noise_ = 0.0;
  Index m = 0;
  for (const Stretch& s : stretches_) {
    for (Index k = 0; k < s.time.size(); ++k) m += is_used(s, k);
  }
  y_.resize(m);
  time_.resize(m);
  log_of_row_.reserve(static_cast<std::size_t>(m));
  VectorXd q(m), qd(m), direction(m);
  // Torque and instrument: whole; and, less friction: sign, play, |τ| sign(q̇), dτ/dt, value.
  std::array<MatrixXd, 2> by_torque{MatrixXd(m, 6), MatrixXd(m, 6)};
  double least = kInfinity, most = -kInfinity;
  for (const Stretch& s : stretches_) {
    for (Index k = 0; k < s.time.size(); ++k) {
      if (!is_used(s, k)) continue;
      least = std::min(least, s.torque[k]);
      most = std::max(most, s.torque[k]);
    }
  }
  torque_range_ = m > 0 ? most - least : 0.0;
  const double sign_width = std::max(0.01 * torque_range_, 1e-12);
  for (MatrixXd& plays : plays_) plays.resize(m, static_cast<Index>(kSlips.size()));
  Index row = 0;
  std::vector<double> first(static_cast<std::size_t>(num_logs_), kInfinity);
  std::vector<double> last(static_cast<std::size_t>(num_logs_), -kInfinity);
  for (const Stretch& s : stretches_) {
    std::array<MatrixXd, 2> derived, derived_plays;
    for (std::size_t side = 0; side < 2; ++side) {
      const VectorXd& whole = side == 0 ? s.torque : s.instrument;
      const VectorXd tau = whole - friction * s.direction;
      MatrixXd& d = derived[side];
      d.resize(tau.size(), 6);
      d.col(0) = whole;
      d.col(5) = tau;
      d.col(1) = smooth((tau.array() / sign_width).tanh().matrix(), s.rate, cutoff_);
      derived_plays[side].resize(tau.size(), static_cast<Index>(kSlips.size()));
      for (std::size_t i = 0; i < kSlips.size(); ++i) {
        // Stop operator: follows the change of torque until it has slipped by the width.
        const double width = std::max(kSlips[i] * torque_range_, 1e-12);
        double z = 0.0;
        for (Index k = 0; k < tau.size(); ++k) {
          if (k > 0) z = std::clamp(z + (tau[k] - tau[k - 1]) / width, -1.0, 1.0);
          derived_plays[side](k, static_cast<Index>(i)) = -z;
        }
      }
      d.col(2) = derived_plays[side].col(0);
      d.col(3) = -tau.cwiseAbs().cwiseProduct(s.direction);
      d.col(4) = -data::differentiate(s.time, tau);
    }
    int used = 0;
    for (Index k = 0; k < s.time.size(); ++k) {
      if (!is_used(s, k)) continue;
      follows_.push_back(k > 0 && is_used(s, k - 1));
      time_[row] = s.time[k];
      log_of_row_.push_back(s.log);
      q[row] = s.q_smooth[k];
      qd[row] = s.qd[k];
      direction[row] = s.direction[k];
      by_torque[0].row(row) = derived[0].row(k);
      by_torque[1].row(row) = derived[1].row(k);
      for (std::size_t side = 0; side < 2; ++side) plays_[side].row(row) = derived_plays[side].row(k);
      auto& begin = first[static_cast<std::size_t>(s.log)];
      auto& end = last[static_cast<std::size_t>(s.log)];
      begin = std::min(begin, s.time[k]);
      end = std::max(end, s.time[k]);
      ++row;
      ++used;
    }
    duration_ += used / s.rate;
    torque_noise_ += s.torque_noise * static_cast<double>(used) / static_cast<double>(std::max<Index>(m, 1));
  }
  std::vector<double> usable(static_cast<std::size_t>(num_logs_), 0.0);
  for (const int l : log_of_row_) usable[static_cast<std::size_t>(l)] += 1.0 / rate();
  shortest_log_ = *std::min_element(usable.begin(), usable.end());
  if (m == 0) return;

  moves_ = std::sqrt(qd.squaredNorm() / static_cast<double>(m)) > kResting;
  const double middle = 0.5 * (q.minCoeff() + q.maxCoeff());
  const Eigen::ArrayXd angle = q.array() - middle;
  std::vector<VectorXd> columns, instruments;
  const auto add = [&](DeflectionTerm term, std::vector<VectorXd> w, std::vector<VectorXd> z = {}) {
    Columns c;
    c.term = term;
    for (std::size_t i = 0; i < w.size(); ++i) {
      c.columns.push_back(static_cast<Index>(columns.size()));
      instruments.push_back(z.empty() ? w[i] : z[i]);
      columns.push_back(std::move(w[i]));
    }
    terms_.push_back(std::move(c));
  };
  std::vector<VectorXd> ones, lines;
  for (int l = 0; l < num_logs_; ++l) {
    VectorXd one = VectorXd::Zero(m), line = VectorXd::Zero(m);
    const double center = 0.5 * (first[static_cast<std::size_t>(l)] + last[static_cast<std::size_t>(l)]);
    for (Index k = 0; k < m; ++k) {
      if (log_of_row_[static_cast<std::size_t>(k)] != l) continue;
      one[k] = 1.0;
      line[k] = time_[k] - center;
    }
    ones.push_back(std::move(one));
    lines.push_back(std::move(line));
  }
  const auto torque = [&](int column) {
    return std::pair{std::vector<VectorXd>{by_torque[0].col(column)},
                     std::vector<VectorXd>{by_torque[1].col(column)}};
  };
  add(DeflectionTerm::kOffset, ones);
  add(DeflectionTerm::kCompliance, torque(0).first, torque(0).second);
  if (moves_) {
    add(DeflectionTerm::kVelocity, {qd});
    add(DeflectionTerm::kDirection, {direction});
    add(DeflectionTerm::kPosition, {angle});
    add(DeflectionTerm::kEccentricity, {angle.sin(), 1.0 - angle.cos()});
    add(DeflectionTerm::kSecondHarmonic, {(2.0 * angle).sin(), 1.0 - (2.0 * angle).cos()});
  }
  add(DeflectionTerm::kDrift, lines);
  // Of τ³ only what no straight line holds, so that c stays the compliance over the range of the torque.
  MatrixXd line(m, 2);
  line.col(0).setOnes();
  line.col(1) = by_torque[0].col(5);
  const auto curved = [&](const VectorXd& tau) {
    const VectorXd cube = tau.array().cube();
    return VectorXd(cube - line * least_squares(line.transpose() * line, line.transpose() * cube));
  };
  add(DeflectionTerm::kStiffening, {curved(by_torque[0].col(5))}, {curved(by_torque[1].col(5))});
  const double share = (by_torque[0].col(1).array() > 0.5).cast<double>().mean();
  const double other = (by_torque[0].col(1).array() < -0.5).cast<double>().mean();
  if (std::min(share, other) > 0.05) add(DeflectionTerm::kBacklash, torque(1).first, torque(1).second);
  add(DeflectionTerm::kTorqueHysteresis, torque(2).first, torque(2).second);
  if (moves_) add(DeflectionTerm::kLoadFriction, torque(3).first, torque(3).second);
  add(DeflectionTerm::kDamping, torque(4).first, torque(4).second);

  W_.resize(m, static_cast<Index>(columns.size()));
  Z_.resize(m, W_.cols());
  scale_.resize(W_.cols());
  for (Index j = 0; j < W_.cols(); ++j) {
    const VectorXd& w = columns[static_cast<std::size_t>(j)];
    scale_[j] = std::max(std::sqrt(w.squaredNorm() / static_cast<double>(m)), 1e-300);
    W_.col(j) = w / scale_[j];
    Z_.col(j) = instruments[static_cast<std::size_t>(j)] / scale_[j];
  }
  gram_ = W_.transpose() * W_;
  set_shift(0.0);
  set_memory(0.0);
}

void Problem::set_blocks(double length) {
  // In each log as many blocks of equal length as fit.
  std::vector<double> begin(static_cast<std::size_t>(num_logs_), kInfinity);
  std::vector<double> end(static_cast<std::size_t>(num_logs_), -kInfinity);
  for (Index k = 0; k < rows(); ++k) {
    const auto l = static_cast<std::size_t>(log_of_row_[static_cast<std::size_t>(k)]);
    begin[l] = std::min(begin[l], time_[k]);
    end[l] = std::max(end[l], time_[k]);
  }
  std::vector<int> offset, count;
  int all = 0;
  for (std::size_t l = 0; l < begin.size(); ++l) {
    offset.push_back(all);
    count.push_back(std::max(1, static_cast<int>((end[l] - begin[l]) / length + 0.01)));
    all += count.back();
  }
  std::vector<std::vector<Index>> members(static_cast<std::size_t>(all));
  for (Index k = 0; k < rows(); ++k) {
    const auto l = static_cast<std::size_t>(log_of_row_[static_cast<std::size_t>(k)]);
    const double part = (time_[k] - begin[l]) / std::max(end[l] - begin[l], 1e-12);
    const int b = std::min(count[l] - 1, static_cast<int>(part * count[l]));
    members[static_cast<std::size_t>(offset[l] + b)].push_back(k);
  }
  block_length_ = length;
  blocks_.clear();
  const Index p = W_.cols();
  total_ = {MatrixXd::Zero(p, p), MatrixXd::Zero(p, p), VectorXd::Zero(p), VectorXd::Zero(p), 0.0};
  for (const std::vector<Index>& rows : members) {
    if (rows.empty()) continue;
    const MatrixXd W = Ww_(rows, Eigen::all), Z = Zw_(rows, Eigen::all);
    const VectorXd y = yw_(rows);
    Sums s;
    s.ZW = Z.transpose() * W;
    s.WW = W.transpose() * W;
    s.Zy = Z.transpose() * y;
    s.Wy = W.transpose() * y;
    s.yy = y.squaredNorm();
    total_.ZW += s.ZW;
    total_.WW += s.WW;
    total_.Zy += s.Zy;
    total_.Wy += s.Wy;
    total_.yy += s.yy;
    blocks_.push_back(std::move(s));
  }
}

MatrixXd Problem::pick(const MatrixXd& A, const std::vector<Index>& index) { return A(index, index); }
VectorXd Problem::pick(const VectorXd& a, const std::vector<Index>& index) { return a(index); }

Problem::Fit Problem::fit(const std::vector<DeflectionTerm>& which, double edge_factor) const {
  Fit f;
  f.index = indices(which);
  const MatrixXd A = pick(total_.ZW, f.index);
  const VectorXd r = pick(total_.Zy, f.index);
  // x = (Zᵀ W)⁻¹ Zᵀ y
  f.x = least_squares(A, r);
  f.residual = y_;
  f.innovation = yw_;
  for (std::size_t i = 0; i < f.index.size(); ++i) {
    f.residual -= f.x[static_cast<Index>(i)] * W_.col(f.index[i]);
    f.innovation -= f.x[static_cast<Index>(i)] * Ww_.col(f.index[i]);
  }
  MatrixXd changes(r.size(), static_cast<Index>(blocks_.size()));
  for (Index b = 0; b < changes.cols(); ++b) {
    const Sums& s = blocks_[static_cast<std::size_t>(b)];
    const VectorXd x = least_squares(A - pick(s.ZW, f.index), r - pick(s.Zy, f.index));
    changes.col(b) = x - f.x;
    f.held_out += s.yy - 2.0 * x.dot(pick(s.Wy, f.index)) + x.dot(pick(s.WW, f.index) * x);
  }
  f.covariance = statistics::jackknife_covariance(changes, edge_factor);
  f.held_out = std::max(f.held_out, 0.0);
  return f;
}

double Problem::own_power(const MatrixXd& gram, const std::vector<Index>& others,
                          const std::vector<Index>& columns) {
  std::vector<Index> before = others;
  double least = 1.0;
  for (const Index j : columns) {
    double power = gram(j, j);
    if (!before.empty()) {
      const VectorXd cross = VectorXd(gram.col(j))(before);
      power -= cross.dot(VectorXd(least_squares(pick(gram, before), cross)));
    }
    least = std::min(least, power / std::max(gram(j, j), 1e-300));
    before.push_back(j);
  }
  return least;
}

Uncertain uncertain(double value, double variance, double factor) {
  Uncertain u;
  u.value = value;
  u.std = std::sqrt(std::max(variance, 0.0));
  u.lower = value - factor * u.std;
  u.upper = value + factor * u.std;
  return u;
}

/// Coefficients of a term in a fit.
std::vector<Uncertain> coefficients(const Problem& problem, const Problem::Fit& f, DeflectionTerm term,
                                    double factor) {
  std::vector<Uncertain> result;
  const Columns* columns = problem.term(term);
  if (columns == nullptr) return result;
  for (const Index j : columns->columns) {
    const auto found = std::find(f.index.begin(), f.index.end(), j);
    if (found == f.index.end()) continue;
    const Index i = found - f.index.begin();
    const double s = problem.scale(j);
    result.push_back(uncertain(f.x[i] / s, f.covariance(i, i) / (s * s), factor));
  }
  return result;
}

/// Chance that the coefficients of these columns are all 0: Wald statistic with the jackknife covariance of B
/// blocks, W (B − k)/(k (B − 1)) ~ F(k, B − k).
double wald_p_value(const Problem::Fit& f, const std::vector<Index>& columns, int blocks) {
  std::vector<Index> at;
  for (const Index j : columns) {
    const auto found = std::find(f.index.begin(), f.index.end(), j);
    if (found != f.index.end()) at.push_back(found - f.index.begin());
  }
  const auto k = static_cast<double>(at.size());
  if (at.empty() || blocks - k < 1) return 1.0;
  const VectorXd x = f.x(at);
  MatrixXd solution = x;
  if (!solve_positive(f.covariance(at, at), solution)) return 1.0;
  const double wald = x.dot(VectorXd(solution.col(0)));
  return statistics::fisher_tail(wald * (blocks - k) / (k * (blocks - 1.0)), k, blocks - k);
}

/// What adding a term would make of the terms used.
std::vector<DeflectionTerm> with(const std::vector<DeflectionTerm>& used, DeflectionTerm term) {
  std::vector<DeflectionTerm> result = used;
  // The first harmonic holds the straight line.
  if (term == DeflectionTerm::kEccentricity) std::erase(result, DeflectionTerm::kPosition);
  result.push_back(term);
  return result;
}

std::vector<DeflectionTerm> without(const std::vector<DeflectionTerm>& used, DeflectionTerm term) {
  std::vector<DeflectionTerm> result = used;
  std::erase(result, term);
  return result;
}

/// Why a term cannot be tried beside these; empty if it can.
std::string obstacle(const Problem& problem, const std::vector<DeflectionTerm>& used, DeflectionTerm term) {
  const Columns* columns = problem.term(term);
  if (columns == nullptr)
    return term == DeflectionTerm::kBacklash ? "the torque does not change its sign"
                                             : "the joint does not move";
  if (term == DeflectionTerm::kPosition && contains(used, DeflectionTerm::kEccentricity))
    return "contained in the first harmonic";
  if (term == DeflectionTerm::kSecondHarmonic && !contains(used, DeflectionTerm::kEccentricity))
    return "only beside the first harmonic";
  std::vector<DeflectionTerm> rest = with(used, term);
  std::erase(rest, term);
  if (problem.own_power(problem.indices(rest), columns->columns) < kOwnPower)
    return "this motion cannot tell it from the other terms";
  return {};
}

/// The columns whose coefficients the term stands or falls with.
std::vector<Index> tested(const Problem& problem, const std::vector<DeflectionTerm>& used,
                          DeflectionTerm term) {
  const std::vector<Index>& all = problem.term(term)->columns;
  // Beside a straight line only the curvature is new.
  if (term == DeflectionTerm::kEccentricity && contains(used, DeflectionTerm::kPosition)) return {all.back()};
  return all;
}

double correlation_time_of(const Problem& problem, const VectorXd& residual) {
  // Log by log: what follows the end of one is not the beginning of the next.
  double longest = 0.0;
  const std::vector<int>& log = problem.log_of_row();
  for (Index begin = 0; begin < residual.size();) {
    Index end = begin;
    while (end < residual.size() &&
           log[static_cast<std::size_t>(end)] == log[static_cast<std::size_t>(begin)])
      ++end;
    longest = std::max(
        longest, statistics::correlation_time(residual.segment(begin, end - begin), 1.0 / problem.rate()));
    begin = end;
  }
  return longest;
}

/// Blocks as this residual asks for. @return factor on the variance
double set_blocks(Problem& problem, const VectorXd& residual) {
  statistics::ResidualStatistics statistics;
  statistics.correlation_time = VectorXd::Constant(1, correlation_time_of(problem, residual));
  // At least six blocks even of the shortest log.
  const double block = std::min(statistics.block_length(problem.duration()), problem.shortest_log() / 6.0);
  problem.set_blocks(block);
  return statistics.edge_factor(block);
}

/// What a term does beside others, judged on blocks as the residual with it asks for: without a term that is
/// really there the residual has a long memory, few blocks are left, and nothing could be shown.
struct Trial {
  Problem::Fit fit;     ///< with the term
  bool possible{true};  ///< the coefficient has the sign that the effect must have
  double with{0.0};     ///< sum of squares on held-out blocks
  double without{0.0};
  double p_value{1.0};  ///< times the number of candidates
};
/// Lost motion, friction and damping take energy out; the other way round they would put it in.
bool must_be_positive(DeflectionTerm term) {
  return term == DeflectionTerm::kBacklash || term == DeflectionTerm::kTorqueHysteresis ||
         term == DeflectionTerm::kLoadFriction || term == DeflectionTerm::kDamping;
}
Trial try_term(Problem& problem, const std::vector<DeflectionTerm>& less, DeflectionTerm term) {
  Trial t;
  const std::vector<DeflectionTerm> more = with(less, term);
  const double edge = set_blocks(problem, problem.fit(more).innovation);
  t.fit = problem.fit(more, edge);
  t.possible = !must_be_positive(term) || coefficients(problem, t.fit, term, 1.0).front().value > 0;
  t.with = t.fit.held_out;
  t.without = problem.fit(less).held_out;
  t.p_value = std::min(1.0, static_cast<double>(kCandidates.size()) *
                                wald_p_value(t.fit, tested(problem, less, term), problem.num_blocks()));
  return t;
}

/// Terms one after the other, the one that predicts held-out blocks best first, as long as it does so better
/// than without and is not explained by chance.
std::vector<DeflectionTerm> choose(Problem& problem, std::vector<DeflectionTerm> used) {
  for (std::size_t round = 0; round < kCandidates.size(); ++round) {
    double best = 1.0;
    std::optional<DeflectionTerm> found;
    for (const DeflectionTerm term : kCandidates) {
      if (contains(used, term) || !obstacle(problem, used, term).empty()) continue;
      const Trial trial = try_term(problem, used, term);
      if (!trial.possible || trial.with >= best * trial.without || trial.p_value >= kLevel) continue;
      best = trial.with / trial.without;
      found = term;
    }
    if (!found) break;
    used = with(used, *found);
  }
  return used;
}

void read_direction(JointStiffness& s, const Uncertain& h, double coulomb) {
  DirectionReading& d = s.direction;
  d.loop = {2.0 * h.value, 2.0 * h.std, 2.0 * h.lower, 2.0 * h.upper};
  const double c = s.compliance.value;
  // 2 h = w − 2 c f
  d.lost_motion_if_no_friction = std::max(0.0, d.loop.value);
  if (c > 0) d.friction_if_no_lost_motion = std::max(0.0, -h.value / c);
  d.lost_motion_at_least = std::max(0.0, d.loop.lower);
  if (s.compliance.upper > 0) d.motor_friction_at_least = std::max(0.0, -h.upper / s.compliance.upper);
  if (std::isfinite(coulomb))
    d.lost_motion_at_most = std::max(0.0, d.loop.upper + 2.0 * std::max(0.0, s.compliance.upper) * coulomb);
  constexpr double kMicro = 1e6;
  const std::string most =
      std::isfinite(d.lost_motion_at_most)
          ? fmt::format("at most {:.0f} µrad, were all friction of the joint on the motor's side",
                        kMicro * d.lost_motion_at_most)
          : std::string("unknown without the joint's friction");
  if (d.loop.upper < 0) {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad against the motion: at least {:.0f} N·m of friction act on the motor's "
        "side of "
        "the gear, {:.0f} N·m if the gear has no lost motion; lost motion {}",
        kMicro * d.loop.value, kMicro * d.loop.std, d.motor_friction_at_least, d.friction_if_no_lost_motion,
        most);
  } else if (d.loop.lower > 0) {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad with the motion: the gear has at least {:.0f} µrad of lost motion, {:.0f} "
        "µrad if "
        "no friction acts on the motor's side of it; {}",
        kMicro * d.loop.value, kMicro * d.loop.std, kMicro * d.lost_motion_at_least,
        kMicro * d.lost_motion_if_no_friction, most);
  } else {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad, not told from none: lost motion and motor-side friction are absent or "
        "cancel; "
        "lost motion {}",
        kMicro * d.loop.value, kMicro * d.loop.std, most);
  }
}

/// Words for a compliance that the log does not show.
std::string why_not(const JointStiffness& s) {
  const Uncertain& c = s.compliance;
  if (c.upper <= 0)
    return fmt::format(
        "the deflection goes against the torque (compliance {:.3g} ± {:.2g} rad/(N·m)): check the signs of "
        "qlink{} and "
        "tau{}, or a term is missing",
        c.value, c.std, s.joint + 1, s.joint + 1);
  std::string text = fmt::format(
      "the 95 % interval of the compliance includes 0: the stiffness is at least {:.3g} N·m/rad. The torque "
      "changes by "
      "{:.0f} N·m, of which {:.0f} N·m (rms) could not be any other term",
      1.0 / c.upper, s.torque_range, s.independent_torque);
  if (c.value > 0)
    text += fmt::format("; {:.0f} times as much would give ± 20 %",
                        std::ceil((c.upper - c.lower) / (2.0 * 0.2 * c.value)));
  text += ". Load the joint more, best by another payload or posture at the same speed, or record longer";
  return text;
}

struct Prepared {
  int joint{0};
  double coulomb{std::numeric_limits<double>::quiet_NaN()};
};

/// Terms and weighting of a fit.
struct Chosen {
  std::vector<DeflectionTerm> terms;
  double memory{0.0};
  Uncertain compliance;
};

/// @param base    terms that the motion shows of the first four
/// @param given   terms, or null: to be chosen
/// @param memory  weighting, or none: to be chosen
/// @param other   the weighting that was not chosen, if there were two
Chosen choose_fit(Problem& problem, const std::vector<DeflectionTerm>& base,
                  const std::vector<DeflectionTerm>* given, std::optional<double> memory,
                  std::optional<Chosen>& other) {
  const auto attempt = [&](double weighting, double* next) {
    Chosen c;
    c.memory = weighting;
    problem.set_memory(weighting);
    problem.set_blocks(problem.block_length());
    c.terms = base;
    if (given == nullptr) {
      c.terms = choose(problem, base);
    } else {
      for (const DeflectionTerm term : kCandidates) {
        if (contains(*given, term) && obstacle(problem, c.terms, term).empty()) c.terms = with(c.terms, term);
      }
    }
    const Problem::Fit f = problem.fit(c.terms);
    if (next != nullptr) *next = 0.5 * correlation_time_of(problem, f.residual);
    const double edge = set_blocks(problem, f.innovation);
    c.compliance = coefficients(problem, problem.fit(c.terms, edge), DeflectionTerm::kCompliance,
                                statistics::interval_factor(problem.num_blocks() - 1))
                       .front();
    return c;
  };
  if (memory) return attempt(*memory, nullptr);
  double found = 0.0;
  Chosen plain = attempt(0.0, &found);
  if (!(found > problem.shortest_memory())) return plain;
  Chosen weighted = attempt(found, nullptr);
  const bool better = weighted.compliance.std < plain.compliance.std;
  other = better ? plain : weighted;
  return better ? weighted : plain;
}

JointStiffness solve(Problem& problem, const Prepared& about, int num_logs,
                     const std::vector<DeflectionTerm>* given, std::optional<double> memory,
                     bool model_torque) {
  JointStiffness s;
  s.joint = about.joint;
  s.samples = static_cast<int>(problem.rows());
  s.torque_range = problem.torque_range();
  const VectorXd& y = problem.deflection();

  std::vector<DeflectionTerm> used{DeflectionTerm::kOffset};
  problem.set_blocks(problem.shortest_log() / 6.0);
  for (const DeflectionTerm term : kFirst) {
    if (term == DeflectionTerm::kOffset || term == DeflectionTerm::kCompliance) continue;
    const std::string reason = obstacle(problem, used, term);
    if (reason.empty()) {
      used.push_back(term);
    } else {
      s.notes.push_back(fmt::format("{} left out: {}", to_string(term), reason));
    }
  }
  // A torque that other terms could stand for says nothing of the spring.
  const std::vector<Index>& torque_column = problem.term(DeflectionTerm::kCompliance)->columns;
  const auto own_torque = [&](const std::vector<DeflectionTerm>& terms) {
    return std::sqrt(
               std::max(0.0, problem.own_power(problem.indices(without(terms, DeflectionTerm::kCompliance)),
                                               torque_column))) *
           problem.scale(torque_column.front());
  };
  used.push_back(DeflectionTerm::kCompliance);
  s.terms = used;
  s.independent_torque = own_torque(used);

  const auto shift_of = [&](const Problem::Fit& f) {
    const std::vector<Uncertain> v = coefficients(problem, f, DeflectionTerm::kVelocity, 1.0);
    return v.empty() ? 0.0 : v.front().value;
  };
  // A delay is not quite δ q̇: the link's channel is moved by it, until what is left is little.
  const auto settle_shift = [&](const std::vector<DeflectionTerm>& terms) {
    for (int i = 0; i < 4; ++i) {
      const double step = shift_of(problem.fit(terms));
      const double shift = problem.shift() + step;
      if (std::abs(shift) > kLongestShift) return;
      problem.set_shift(shift);
      problem.set_blocks(problem.block_length());
      if (std::abs(step) < 1e-3 / problem.rate()) return;
    }
  };
  settle_shift(used);
  // The reading without lost motion; where the loop speaks for lost motion, no friction is taken off.
  double friction = 0.0;
  if (contains(used, DeflectionTerm::kDirection) && !model_torque) {
    const Problem::Fit first = problem.fit(used);
    const double c = coefficients(problem, first, DeflectionTerm::kCompliance, 1.0).front().value;
    const double h = coefficients(problem, first, DeflectionTerm::kDirection, 1.0).front().value;
    if (c > 0 && h < 0 && -h / c < 0.5 * problem.torque_range()) friction = -h / c;
  }
  problem.set_friction(friction, used);
  problem.set_blocks(problem.block_length());
  std::optional<Chosen> other;
  const Chosen chosen = choose_fit(problem, used, given, memory, other);
  if (given != nullptr) {
    for (const DeflectionTerm term : *given) {
      if (std::find(kCandidates.begin(), kCandidates.end(), term) != kCandidates.end() &&
          !contains(chosen.terms, term))
        s.notes.push_back(
            fmt::format("{} left out: {}", to_string(term), obstacle(problem, chosen.terms, term)));
    }
  }
  used = chosen.terms;
  s.memory = chosen.memory;
  if (other) s.other_weighting = other->compliance;
  const bool at_odds = other &&
                       (other->compliance.value < chosen.compliance.lower ||
                        other->compliance.value > chosen.compliance.upper) &&
                       (chosen.compliance.value < other->compliance.lower ||
                        chosen.compliance.value > other->compliance.upper);
  problem.set_memory(s.memory);
  problem.set_blocks(problem.block_length());
  settle_shift(used);
  const double edge = set_blocks(problem, problem.fit(used).innovation);
  s.correlation_time = correlation_time_of(problem, problem.fit(used).residual);
  s.terms = used;
  s.independent_torque = own_torque(used);
  s.blocks = problem.num_blocks();
  s.block_length = problem.block_length();
  const double factor = statistics::interval_factor(s.blocks - 1);
  const Problem::Fit f = problem.fit(used, edge);

  double total = 0.0;
  for (int l = 0; l < num_logs; ++l) {
    double sum = 0.0, squares = 0.0;
    Index count = 0;
    for (Index k = 0; k < y.size(); ++k) {
      if (problem.log_of_row()[static_cast<std::size_t>(k)] != l) continue;
      sum += y[k];
      squares += y[k] * y[k];
      ++count;
    }
    if (count > 0) total += std::max(0.0, squares - sum * sum / static_cast<double>(count));
  }
  const auto m = static_cast<double>(y.size());
  const Problem::Fit rigid = problem.fit(without(used, DeflectionTerm::kCompliance), edge);
  s.rms_deflection = std::sqrt(total / m);
  // Weighted rows are smaller than the rows themselves: put back on their scale.
  const double scale =
      f.innovation.squaredNorm() > 0 ? std::sqrt(f.residual.squaredNorm() / f.innovation.squaredNorm()) : 1.0;
  s.rms = scale * std::sqrt(f.held_out / m);
  s.rms_rigid = scale * std::sqrt(rigid.held_out / m);
  if (total > 0) {
    s.r2 = 1.0 - f.residual.squaredNorm() / total;
    s.torque_share = (rigid.residual.squaredNorm() - f.residual.squaredNorm()) / total;
  }
  s.compliance = coefficients(problem, f, DeflectionTerm::kCompliance, factor).front();
  if (at_odds) {
    s.compliance.lower = std::min(s.compliance.lower, other->compliance.lower);
    s.compliance.upper = std::max(s.compliance.upper, other->compliance.upper);
    s.notes.push_back(
        fmt::format("slow and quick changes of the torque tell different compliances ({:.3g} and {:.3g} "
                    "rad/(N·m)): a term is missing or stands for another; the interval holds both",
                    s.compliance.value, other->compliance.value));
  }
  s.offset = coefficients(problem, f, DeflectionTerm::kOffset, factor);
  s.attenuation =
      problem.attenuation(problem.indices(without(used, DeflectionTerm::kCompliance)), torque_column.front());
  if (s.attenuation > 0.05)
    s.notes.push_back(fmt::format(
        "noise of tau{} may lower the compliance by up to {:.0f} %: give a model's torque as instrument",
        s.joint + 1, 100.0 * s.attenuation));
  if (contains(used, DeflectionTerm::kVelocity)) {
    s.time_shift = coefficients(problem, f, DeflectionTerm::kVelocity, factor).front();
    s.time_shift.value += problem.shift();
    s.time_shift.lower += problem.shift();
    s.time_shift.upper += problem.shift();
    s.time_shift_known = true;
  }
  if (contains(used, DeflectionTerm::kPosition))
    s.ratio_error = coefficients(problem, f, DeflectionTerm::kPosition, factor).front();

  for (const DeflectionTerm term : kCandidates) {
    TermEvidence e;
    e.term = term;
    e.used = contains(used, term);
    e.verdict = e.used ? "used" : obstacle(problem, used, term);
    if (e.used || e.verdict.empty()) {
      const std::vector<DeflectionTerm> less = e.used ? without(used, term) : used;
      const Trial trial = try_term(problem, less, term);
      e.coefficients = coefficients(problem, trial.fit, term, factor);
      e.rms_with = scale * std::sqrt(trial.with / m);
      e.rms_without = scale * std::sqrt(trial.without / m);
      e.p_value = trial.p_value;
      const double own = statistics::interval_factor(problem.num_blocks() - 1);
      e.compliance =
          coefficients(problem, e.used ? problem.fit(less) : trial.fit, DeflectionTerm::kCompliance, own)
              .front();
      if (!e.used) {
        e.verdict = !trial.possible               ? "its coefficient has the wrong sign"
                    : e.rms_with >= e.rms_without ? "held-out blocks are predicted no better"
                    : e.p_value >= kLevel         ? fmt::format("chance explains it (p = {:.2g})", e.p_value)
                    : given != nullptr            ? "not asked for"
                                                  : "another term explains it better";
      }
    }
    // Held-out blocks speak for the term, chance cannot be excluded: the answer with it stays possible.
    if (!e.used && e.verdict.starts_with("chance") && std::isfinite(e.compliance.value)) {
      s.compliance.lower = std::min(s.compliance.lower, e.compliance.value);
      s.compliance.upper = std::max(s.compliance.upper, e.compliance.value);
    }
    s.evidence.push_back(std::move(e));
  }

  // The numbers of a joint that does not deflect at all, or whose torque is another term in disguise, are
  // rounding.
  const double rms_torque = problem.scale(torque_column.front());
  if (!(s.rms_deflection > 1e-12)) {
    s.reason = fmt::format(
        "qlink{0} repeats q{0} in every sample: not the reading of a second encoder, or it is behind the "
        "same one",
        s.joint + 1);
  } else if (!(s.torque_range > 0) ||
             s.independent_torque < kOwnTorque * std::min(rms_torque, s.torque_range)) {
    s.reason = fmt::format(
        "the torque changes by {:.3g} N·m, of which {:.2g} N·m (rms) could not be any other term of the "
        "deflection: "
        "load the joint in more than one way",
        s.torque_range, s.independent_torque);
    s.compliance = uncertain(0.0, kInfinity, 1.0);
  } else if (s.compliance.lower > 0) {
    s.identifiable = true;
  } else {
    s.reason = why_not(s);
  }
  const Uncertain& c = s.compliance;
  if (s.rms_deflection > 1e-12 && std::isfinite(c.std)) {
    if (c.value > 0) {
      s.stiffness = 1.0 / c.value;
      s.stiffness_std = c.std / (c.value * c.value);
    }
    if (c.upper > 0) s.stiffness_lower = 1.0 / c.upper;
    if (c.lower > 0) s.stiffness_upper = 1.0 / c.lower;
  }

  if (contains(used, DeflectionTerm::kDirection))
    read_direction(s, coefficients(problem, f, DeflectionTerm::kDirection, factor).front(), about.coulomb);
  for (const DeflectionTerm term : {DeflectionTerm::kBacklash, DeflectionTerm::kTorqueHysteresis}) {
    if (!contains(used, term)) continue;
    Uncertain u = coefficients(problem, f, term, factor).front();
    u = {2.0 * u.value, 2.0 * u.std, 2.0 * u.lower, 2.0 * u.upper};
    if (!s.gear_hysteresis || term == DeflectionTerm::kTorqueHysteresis) s.gear_hysteresis = u;
  }
  if (s.gear_hysteresis && s.identifiable) s.gear_hysteresis_torque = s.gear_hysteresis->value * s.stiffness;

  return s;
}

/// Weighted mean of independent estimates with few degrees of freedom each, and Welch's test that they estimate
/// the same: B. L. Welch, On the comparison of several mean values, Biometrika 38 (1951).
struct Mean {
  double value{0.0}, variance{0.0}, chi_square{0.0}, p_value{1.0};
};
Mean weighted_mean(const std::vector<double>& x, const std::vector<double>& variance,
                   const std::vector<double>& dof) {
  Mean mean;
  double weights = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    weights += 1.0 / variance[i];
    mean.value += x[i] / variance[i];
  }
  mean.value /= weights;
  mean.variance = 1.0 / weights;
  const auto k = static_cast<double>(x.size());
  double spread = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean.chi_square += (x[i] - mean.value) * (x[i] - mean.value) / variance[i];
    const double share = 1.0 - 1.0 / (variance[i] * weights);
    spread += share * share / dof[i];
  }
  // F = [χ²/(k − 1)] / [1 + 2 (k − 2)/(k² − 1) s], ν = (k² − 1)/(3 s), s = Σ (1 − w_i/w)²/ν_i
  if (x.size() > 1) {
    const double f = mean.chi_square / (k - 1) / (1.0 + 2.0 * (k - 2) / (k * k - 1) * spread);
    mean.p_value = statistics::fisher_tail(f, k - 1, (k * k - 1) / (3.0 * spread));
  }
  return mean;
}

StiffnessAgreement compare(const std::vector<std::vector<JointStiffness>>& separate, std::size_t j) {
  StiffnessAgreement a;
  a.joint = separate.front()[j].joint;
  std::vector<double> x, variance, dof;
  for (const std::vector<JointStiffness>& fits : separate) {
    const JointStiffness& s = fits[j];
    if (!std::isfinite(s.compliance.std) || !(s.compliance.std > 0)) continue;
    x.push_back(s.compliance.value);
    variance.push_back(s.compliance.std * s.compliance.std);
    dof.push_back(std::max(1, s.blocks - 1));
  }
  if (x.size() < 2) {
    a.text = "fewer than two logs tell the stiffness of this joint";
    return a;
  }
  const Mean mean = weighted_mean(x, variance, dof);
  a.chi_square = mean.chi_square;
  a.degrees_of_freedom = static_cast<int>(x.size()) - 1;
  a.p_value = mean.p_value;
  a.agrees = a.p_value >= kLevel;
  a.text = fmt::format("{} logs {}: chi-square {:.2f} at {} degrees of freedom, p = {:.2g}", x.size(),
                       a.agrees ? "agree" : "do not agree", a.chi_square, a.degrees_of_freedom, a.p_value);
  return a;
}

CommonTimeShift common_shift(const std::vector<JointStiffness>& fits) {
  CommonTimeShift c;
  std::vector<double> x, variance, dof;
  for (const JointStiffness& s : fits) {
    if (!s.time_shift_known || !(s.time_shift.std > 0)) continue;
    x.push_back(s.time_shift.value);
    variance.push_back(s.time_shift.std * s.time_shift.std);
    dof.push_back(std::max(1, s.blocks - 1));
  }
  if (x.size() < 2) return c;
  const Mean mean = weighted_mean(x, variance, dof);
  c.known = true;
  c.value =
      uncertain(mean.value, mean.variance,
                statistics::interval_factor(static_cast<int>(std::accumulate(dof.begin(), dof.end(), 0.0))));
  c.p_value = mean.p_value;
  c.agrees = c.p_value >= kLevel;
  return c;
}

void check_options(const std::vector<data::Log>& logs, const JointEncoderOptions& options, int n) {
  const auto size = [&](const std::vector<double>& values, const char* name) {
    if (!values.empty() && static_cast<int>(values.size()) != n)
      throw DataError(fmt::format("{}: {} values given for {} joints: give one a joint, or none", name,
                                  values.size(), n));
  };
  size(options.rotor_inertia, "rotor inertia");
  size(options.coulomb_friction, "Coulomb friction");
  if (options.cutoff < 0 || !(options.sign_width > 0))
    throw DataError("joint encoders: the cut-off must not be negative and the sign width must be above 0");
  if (options.torque == GearTorque::kMeasured) return;
  if (options.model_torque.size() != logs.size())
    throw DataError(fmt::format("model torque: {} matrices given for {} logs: give one a log",
                                options.model_torque.size(), logs.size()));
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const MatrixXd& tau = options.model_torque[l];
    if (tau.rows() != logs[l].num_samples() || tau.cols() != n)
      throw DataError(fmt::format("{}: model torque is {} × {}, expected {} samples × {} joints",
                                  logs[l].path, tau.rows(), tau.cols(), logs[l].num_samples(), n));
  }
}

}  // namespace

std::string to_string(DeflectionTerm term) {
  switch (term) {
    case DeflectionTerm::kOffset: return "offset";
    case DeflectionTerm::kCompliance: return "compliance";
    case DeflectionTerm::kVelocity: return "time shift";
    case DeflectionTerm::kDirection: return "direction of motion";
    case DeflectionTerm::kPosition: return "gear ratio";
    case DeflectionTerm::kEccentricity: return "first harmonic";
    case DeflectionTerm::kSecondHarmonic: return "second harmonic";
    case DeflectionTerm::kDrift: return "drift";
    case DeflectionTerm::kStiffening: return "stiffening";
    case DeflectionTerm::kBacklash: return "backlash";
    case DeflectionTerm::kTorqueHysteresis: return "torque hysteresis";
    case DeflectionTerm::kLoadFriction: return "load friction";
    case DeflectionTerm::kDamping: return "damping";
  }
  return "?";
}

std::vector<int> link_encoder_joints(const data::Log& log) {
  std::vector<int> joints;
  for (int i = 0; i < log.num_joints(); ++i) {
    if (link_column(log, i) != nullptr) joints.push_back(i);
  }
  return joints;
}

JointEncoderFit fit_joint_encoders(const std::vector<data::Log>& logs, const JointEncoderOptions& options) {
  if (logs.empty()) throw DataError("joint encoders: no log given");
  const int n = logs.front().num_joints();
  JointEncoderFit result;
  result.joints = link_encoder_joints(logs.front());
  double bandwidth = 0.0;
  for (const data::Log& log : logs) {
    const std::vector<int> joints = link_encoder_joints(log);
    if (joints.empty())
      throw DataError(
          fmt::format("{}: no column qlink1.. found: stiffness from two encoders needs the link's position "
                      "of at least one of the "
                      "{} joints (motor-side data alone: see the elasticity that `heft diagnose` looks for)",
                      log.path, log.num_joints()));
    if (log.tau.cols() != log.num_joints())
      throw DataError(
          fmt::format("{}: no column tau1.. found: the stiffness is a torque over a deflection", log.path));
    if (log.num_joints() != n || joints != result.joints)
      throw DataError(
          fmt::format("{}: other joints or other qlink columns than in {}: give logs of one robot", log.path,
                      logs.front().path));
    bandwidth = std::max(bandwidth, bandwidth_of(log));
  }
  check_options(logs, options, n);
  double cutoff = options.cutoff;
  if (cutoff == 0.0) cutoff = bandwidth > 0 ? std::max(3.0, 10.0 * bandwidth) : 10.0;

  result.separate.resize(logs.size());
  for (const int joint : result.joints) {
    Prepared about;
    about.joint = joint;
    if (!options.coulomb_friction.empty())
      about.coulomb = options.coulomb_friction[static_cast<std::size_t>(joint)];
    const double rotor =
        options.rotor_inertia.empty() ? 0.0 : options.rotor_inertia[static_cast<std::size_t>(joint)];
    std::vector<std::vector<Stretch>> of_log;
    std::vector<Stretch> all;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      const MatrixXd* model = options.torque == GearTorque::kMeasured ? nullptr : &options.model_torque[l];
      std::vector<Stretch> stretches = stretches_of(logs[l], static_cast<int>(l), joint, model);
      for (Stretch& s : stretches) filter(s, cutoff, rotor, options);
      all.insert(all.end(), stretches.begin(), stretches.end());
      for (Stretch& s : stretches) s.log = 0;
      of_log.push_back(std::move(stretches));
    }
    for (std::size_t l = 0; l < logs.size(); ++l) {
      double usable = 0.0;
      for (const Stretch& s : of_log[l]) usable += s.time[s.time.size() - 1] - s.time[0];
      if (usable < kShortestLog)
        throw DataError(fmt::format(
            "{}: {:.1f} s of samples with q{}, qlink{} and tau{} in stretches of at least {:.0f} s: at least "
            "{:.0f} s "
            "are needed",
            logs[l].path, usable, joint + 1, joint + 1, joint + 1, kShortestStretch, kShortestLog));
    }
    const std::vector<DeflectionTerm>* asked = options.terms ? &*options.terms : nullptr;
    Problem pooled(std::move(all), static_cast<int>(logs.size()), cutoff);
    result.pooled.push_back(solve(pooled, about, static_cast<int>(logs.size()), asked, options.memory,
                                  options.torque == GearTorque::kModel));
    if (options.rotor_inertia.empty() && options.torque != GearTorque::kModel)
      result.pooled.back().notes.push_back(
          "no rotor inertia given: the part of tau that turns the rotor counts as load of the gear");
    if (logs.size() == 1) {
      result.separate[0].push_back(result.pooled.back());
      continue;
    }
    const std::vector<DeflectionTerm> same = result.pooled.back().terms;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      Problem own(std::move(of_log[l]), 1, cutoff);
      result.separate[l].push_back(
          solve(own, about, 1, &same, options.memory, options.torque == GearTorque::kModel));
    }
  }
  for (std::size_t l = 0; l < logs.size(); ++l) result.time_shift.push_back(common_shift(result.separate[l]));
  if (logs.size() > 1) {
    for (std::size_t j = 0; j < result.joints.size(); ++j)
      result.agreement.push_back(compare(result.separate, j));
  }
  return result;
}

}  // namespace heft::stiffness
