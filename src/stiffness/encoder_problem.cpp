#include "encoder_problem.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A joint slower than this in rms rests: no delay, direction or position can be seen [rad/s].
constexpr double kResting = 1e-4;

}  // namespace

void EncoderProblem::set_friction(double friction, const std::vector<DeflectionTerm>& terms) {
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

void EncoderProblem::set_shift(double shift) {
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

void EncoderProblem::set_memory(double memory) {
  decay_ = memory > 0 ? std::exp(-1.0 / (rate() * memory)) : 0.0;
  yw_ = weighted(y_);
  Ww_.resize(W_.rows(), W_.cols());
  Zw_.resize(W_.rows(), W_.cols());
  for (Index j = 0; j < W_.cols(); ++j) {
    Ww_.col(j) = weighted(W_.col(j));
    Zw_.col(j) = weighted(Z_.col(j));
  }
}

double EncoderProblem::attenuation(const std::vector<Index>& others, Index torque) const {
  if (!(torque_noise_ > 0)) return 0.0;
  // Mean of |1 − a exp(-iωT)|² over the noise's band, which ends at the cut-off.
  const double end = 2.0 * std::numbers::pi * cutoff_ / rate();
  const double gain = 1.0 + decay_ * decay_ - 2.0 * decay_ * std::sin(end) / end;
  const double own = own_power(total_.WW, others, {torque}) * total_.WW(torque, torque) /
                     static_cast<double>(rows()) * scale_[torque] * scale_[torque];
  return std::min(1.0, gain * torque_noise_ / std::max(own, 1e-300));
}

VectorXd EncoderProblem::weighted(const VectorXd& rows) const {
  if (decay_ == 0.0) return rows;
  VectorXd result = rows;
  // The first row of a stretch counts for all those before it (Prais and Winsten).
  for (Index k = 0; k < rows.size(); ++k) {
    if (follows_[static_cast<std::size_t>(k)]) result[k] -= decay_ * rows[k - 1];
    else result[k] *= std::sqrt(1.0 - decay_ * decay_);
  }
  return result;
}

std::vector<EncoderProblem::Index> EncoderProblem::indices(const std::vector<DeflectionTerm>& which) const {
  std::vector<Index> result;
  for (const Columns& t : terms_) {
    if (contains(which, t.term)) result.insert(result.end(), t.columns.begin(), t.columns.end());
  }
  return result;
}

void EncoderProblem::build(double friction) {
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
  const Rows raw = collect(m, friction);
  std::vector<double> usable(static_cast<std::size_t>(num_logs_), 0.0);
  for (const int l : log_of_row_) usable[static_cast<std::size_t>(l)] += 1.0 / rate();
  shortest_log_ = *std::min_element(usable.begin(), usable.end());
  if (m == 0) return;
  moves_ = std::sqrt(raw.qd.squaredNorm() / static_cast<double>(m)) > kResting;
  add_terms(raw);
  gram_ = W_.transpose() * W_;
  set_shift(0.0);
  set_memory(0.0);
}

namespace {

/// Columns of a torque: whole; and, less friction on the motor's side: sign, play, |τ| sign(q̇), dτ/dt, value.
/// @param plays  gets the play of each of kSlips
MatrixXd torque_columns(const Stretch& s, const VectorXd& whole, double friction, double range, double cutoff,
                        MatrixXd& plays) {
  const double sign_width = std::max(0.01 * range, 1e-12);
  const VectorXd tau = whole - friction * s.direction;
  MatrixXd d(tau.size(), 6);
  d.col(0) = whole;
  d.col(5) = tau;
  d.col(1) = smooth((tau.array() / sign_width).tanh().matrix(), s.rate, cutoff);
  plays.resize(tau.size(), static_cast<Index>(kSlips.size()));
  for (std::size_t i = 0; i < kSlips.size(); ++i) {
    // Stop operator: follows the change of torque until it has slipped by the width.
    const double width = std::max(kSlips[i] * range, 1e-12);
    double z = 0.0;
    for (Index k = 0; k < tau.size(); ++k) {
      if (k > 0) z = std::clamp(z + (tau[k] - tau[k - 1]) / width, -1.0, 1.0);
      plays(k, static_cast<Index>(i)) = -z;
    }
  }
  d.col(2) = plays.col(0);
  d.col(3) = -tau.cwiseAbs().cwiseProduct(s.direction);
  d.col(4) = -data::differentiate(s.time, tau);
  return d;
}

}  // namespace

EncoderProblem::Rows EncoderProblem::collect(Index m, double friction) {
  Rows raw{VectorXd(m), VectorXd(m), VectorXd(m), {MatrixXd(m, 6), MatrixXd(m, 6)}, {}, {}};
  double least = kInfinity, most = -kInfinity;
  for (const Stretch& s : stretches_) {
    for (Index k = 0; k < s.time.size(); ++k) {
      if (!is_used(s, k)) continue;
      least = std::min(least, s.torque[k]);
      most = std::max(most, s.torque[k]);
    }
  }
  torque_range_ = m > 0 ? most - least : 0.0;
  for (MatrixXd& plays : plays_) plays.resize(m, static_cast<Index>(kSlips.size()));
  Index row = 0;
  raw.first.assign(static_cast<std::size_t>(num_logs_), kInfinity);
  raw.last.assign(static_cast<std::size_t>(num_logs_), -kInfinity);
  for (const Stretch& s : stretches_) {
    std::array<MatrixXd, 2> derived, derived_plays;
    for (std::size_t side = 0; side < 2; ++side) {
      derived[side] = torque_columns(s, side == 0 ? s.torque : s.instrument, friction, torque_range_, cutoff_,
                                     derived_plays[side]);
    }
    int used = 0;
    for (Index k = 0; k < s.time.size(); ++k) {
      if (!is_used(s, k)) continue;
      follows_.push_back(k > 0 && is_used(s, k - 1));
      time_[row] = s.time[k];
      log_of_row_.push_back(s.log);
      raw.q[row] = s.q_smooth[k];
      raw.qd[row] = s.qd[k];
      raw.direction[row] = s.direction[k];
      raw.by_torque[0].row(row) = derived[0].row(k);
      raw.by_torque[1].row(row) = derived[1].row(k);
      for (std::size_t side = 0; side < 2; ++side) plays_[side].row(row) = derived_plays[side].row(k);
      auto& begin = raw.first[static_cast<std::size_t>(s.log)];
      auto& end = raw.last[static_cast<std::size_t>(s.log)];
      begin = std::min(begin, s.time[k]);
      end = std::max(end, s.time[k]);
      ++row;
      ++used;
    }
    duration_ += used / s.rate;
    torque_noise_ += s.torque_noise * static_cast<double>(used) / static_cast<double>(std::max<Index>(m, 1));
  }
  return raw;
}

void EncoderProblem::add_terms(const Rows& raw) {
  const Index m = raw.q.size();
  const VectorXd &q = raw.q, &qd = raw.qd, &direction = raw.direction;
  const std::array<MatrixXd, 2>& by_torque = raw.by_torque;
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
    const double center =
        0.5 * (raw.first[static_cast<std::size_t>(l)] + raw.last[static_cast<std::size_t>(l)]);
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
}

void EncoderProblem::set_blocks(double length) {
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

MatrixXd EncoderProblem::pick(const MatrixXd& A, const std::vector<Index>& index) { return A(index, index); }
VectorXd EncoderProblem::pick(const VectorXd& a, const std::vector<Index>& index) { return a(index); }

EncoderProblem::Fit EncoderProblem::fit(const std::vector<DeflectionTerm>& which, double edge_factor) const {
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

double EncoderProblem::own_power(const MatrixXd& gram, const std::vector<Index>& others,
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

statistics::Interval uncertain(double value, double variance, double factor) {
  return statistics::Interval::around(value, std::sqrt(std::max(variance, 0.0)), factor);
}

std::vector<statistics::Interval> coefficients(const EncoderProblem& problem, const EncoderProblem::Fit& f,
                                               DeflectionTerm term, double factor) {
  std::vector<statistics::Interval> result;
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

}  // namespace heft::stiffness
