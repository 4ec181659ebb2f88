#include "heft/data/decimate.hpp"

#include <algorithm>

#include "low_pass_sections.hpp"
#include "signal_lanes.hpp"

namespace heft::data {

using Eigen::Index;

namespace {

/// Both sections as one: states s1, s2 of the first, then of the second.
void step_states(const LowPass& filter, Eigen::Vector4d& x, double input, double& output) {
  output = filter.second().step(x[2], x[3], filter.first().step(x[0], x[1], input));
}

Index number_kept(Index rows, Index first, Index step) { return rows > first ? (rows - first - 1) / step + 1 : 0; }

}  // namespace

DecimatedLowPass::DecimatedLowPass(double sample_rate, double cutoff, Index signals, Index rows, Index first_kept,
                                   Index step)
    : sample_rate_(sample_rate),
      cutoff_(cutoff),
      signals_(signals),
      rows_(rows),
      first_kept_(first_kept),
      step_(step),
      kept_(number_kept(rows, first_kept, step)),
      padding_(rows > 1 ? low_pass_padding(rows, sample_rate, cutoff) : 0),
      head_rows_(std::min(rows, std::max(padding_, first_kept) + 1)),
      tail_first_(std::max<Index>(0, std::min(rows - 1 - padding_, first_kept + (kept_ - 1) * step + 1))) {
  if (kept_ == 0) return;
  make_tables();
  head_.resize(head_rows_, signals);
  tail_.resize(rows - tail_first_, signals);
  sums_ = Kept::Zero(kSums, signals);
  forward_ = Kept::Zero(kStates, signals);
  output_.resize(kept_, signals);
  behind_.resize(kStates * kept_, signals);
}

void DecimatedLowPass::make_tables() {
  static_assert(kSums == SignalLanes::kSums && kStates == StretchFilter::kStates);
  const LowPass filter(sample_rate_, cutoff_);
  for (int s = 0; s < kStates; ++s) {
    Eigen::Vector4d x = Eigen::Vector4d::Unit(s);
    step_states(filter, x, 0.0, C_[s]);
    A_.col(s) = x;
  }
  B_.setZero();
  step_states(filter, B_, 1.0, D_);

  table_.resize(static_cast<std::size_t>(step_ * kSums));
  const auto sums_of = [&](Index row) { return table_.data() + row * kSums; };
  // Forward, from the last row of a stretch to its first: A^(M-1-j) B; of the output in the last row C A^(M-2-j) B.
  Eigen::Vector4d forward = B_;
  double output = D_;
  for (Index j = step_ - 1; j >= 0; --j) {
    Eigen::Map<Eigen::Vector4d>{sums_of(j)} = forward;
    sums_of(j)[2 * kStates] = output;
    output = C_ * forward;
    forward = A_ * forward;
  }
  // Backward: Σ A^j B y_j with y_j the forward output. P_i = A^i B C + P_(i+1) A, G_i = A^i B D + P_(i+1) B.
  std::vector<Eigen::Vector4d> powers;  // A^i B
  A_step_.setIdentity();
  H_.setZero();
  e_ = C_;
  for (Index i = 0; i < step_; ++i) {
    powers.push_back(A_step_ * B_);
    H_ += powers.back() * (C_ * A_step_);
    if (i + 1 == step_) e_ = C_ * A_step_;
    A_step_ = A_step_ * A_;
  }
  Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
  for (Index i = step_ - 1; i >= 0; --i) {
    const Eigen::Vector4d& power = powers[static_cast<std::size_t>(i)];
    Eigen::Map<Eigen::Vector4d>{sums_of(i) + kStates} = power * D_ + P * B_;
    P = power * C_ + P * A_;
  }
}

void DecimatedLowPass::add(const double* rows, Index count) {
  for (Index k = 0; k < count && kept_ > 0;) {
    const double* const row = rows + k * signals_;
    if (added_ < head_rows_ || added_ >= tail_first_) {
      const Eigen::Map<const Eigen::RowVectorXd> values(row, signals_);
      if (added_ < head_rows_) head_.row(added_) = values;
      if (added_ >= tail_first_) tail_.row(added_ - tail_first_) = values;
    }
    if (added_ < head_rows_) {
      ++k;
      if (++added_ == head_rows_) begin_at_head();
      continue;
    }
    // As many as neither end the stretch nor have to be kept for the end.
    Index some = std::min(count - k, step_ - in_stretch_);
    some = added_ < tail_first_ ? std::min(some, tail_first_ - added_) : 1;
    added_ += some;
    k += some;
    accumulate(row, some);
  }
}

void DecimatedLowPass::add_columns(const double* const* columns, Index count) {
  rows_of_columns_.resize(static_cast<std::size_t>(count * signals_));
  signal_lanes().side_by_side(columns, rows_of_columns_.data(), signals_, count);
  add(rows_of_columns_.data(), count);
}

/// Rows of the present stretch; none of them behind its end. Rows behind the last kept one are left to the end.
void DecimatedLowPass::accumulate(const double* rows, Index count) {
  if (stretch_ >= kept_) return;
  signal_lanes().add(sums_.data(), rows, table_.data() + in_stretch_ * kSums, signals_, count);
  in_stretch_ += count;
  if (in_stretch_ == step_) end_stretch();
}

StretchFilter DecimatedLowPass::over_stretch() const {
  return {A_step_.data(), H_.data(), e_.data(), C_.data(), D_};
}

void DecimatedLowPass::end_stretch() {
  signal_lanes().end(over_stretch(), sums_.data(), forward_.data(), output_.row(stretch_).data(),
                         behind_.row(kStates * stretch_).data(), signals_);
  in_stretch_ = 0;
  ++stretch_;
}

/// Columns for all lanes: those of the signals, then zeros.
Eigen::MatrixXd DecimatedLowPass::columns_in_lanes(Index rows) const {
  const Index columns = signal_lanes().padded(signals_);
  Eigen::MatrixXd x(rows, columns);
  x.rightCols(columns - signals_).setZero();
  return x;
}

/// Runs all columns through the filter from `states` on.
/// @param states  kStates × columns: becomes those behind the last row
void DecimatedLowPass::run(Eigen::MatrixXd& x, Kept& states, bool backward) const {
  const SignalLanes& lanes = signal_lanes();
  const LowPass filter(sample_rate_, cutoff_);
  for (Index first = 0; first < x.cols(); first += lanes.most) {
    lanes.filter(filter, x.col(first).data(), x.rows(), x.rows(), std::min(lanes.most, x.cols() - first), backward,
                 states.data() + first, x.cols());
  }
}

/// States of signals at rest on their values in a row.
DecimatedLowPass::Kept DecimatedLowPass::at_rest(const Eigen::RowVectorXd& values) {
  Kept states = Kept::Zero(kStates, values.size());
  states.row(1) = states.row(3) = values;
  return states;
}

/// The forward run from the rows that continue the log in front of it, to the first kept row.
void DecimatedLowPass::begin_at_head() {
  const Index size = padding_ + first_kept_ + 1;
  Eigen::MatrixXd x = columns_in_lanes(size);
  for (Index k = 0; k < padding_; ++k) x.row(k).head(signals_) = 2.0 * head_.row(0) - head_.row(padding_ - k);
  x.block(padding_, 0, first_kept_ + 1, signals_) = head_.topRows(first_kept_ + 1);
  Kept states = at_rest(x.row(0));
  run(x, states, false);
  output_.row(0) = x.row(size - 1).head(signals_);
  forward_ = states.leftCols(signals_);
  stretch_ = 1;
  for (Index row = first_kept_ + 1; row < head_rows_;) {
    const Index some = std::min(head_rows_ - row, step_ - in_stretch_);
    accumulate(head_.data() + row * signals_, some);
    row += some;
  }
}

/// The backward run from behind the rows that continue the log at its end, to behind the last kept row: kStates × signals.
DecimatedLowPass::Kept DecimatedLowPass::backward_state_behind_last() const {
  const Index last = first_kept_ + (kept_ - 1) * step_;
  const Index left = rows_ - 1 - last, end = tail_.rows() - 1;
  Eigen::MatrixXd x = columns_in_lanes(left + padding_);
  x.topLeftCorner(left, signals_) = tail_.bottomRows(left);
  for (Index k = 0; k < padding_; ++k) x.row(left + k).head(signals_) = 2.0 * tail_.row(end) - tail_.row(end - 1 - k);
  if (x.rows() == 0) return at_rest(output_.row(kept_ - 1));
  Kept states = Kept::Zero(kStates, x.cols());
  states.leftCols(signals_) = forward_;
  run(x, states, false);
  states = at_rest(x.row(x.rows() - 1));
  run(x, states, true);
  return states.leftCols(signals_);
}

DecimatedLowPass::Kept DecimatedLowPass::finish() {
  if (kept_ == 0) return Kept(0, signals_);
  Kept backward = backward_state_behind_last();
  for (Index k = kept_ - 1; k >= 0; --k) {
    signal_lanes().back(over_stretch(), output_.row(k).data(), k > 0 ? behind_.row(kStates * k).data() : nullptr,
                            backward.data(), signals_);
  }
  return std::move(output_);
}

}  // namespace heft::data
