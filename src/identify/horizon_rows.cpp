#include "horizon_rows.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "heft/core/numeric_range.hpp"

namespace heft::identify {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Time for which a joint may be slow without being at rest [s]: a reversal takes less.
constexpr double kReversal = 0.05;
/// Time constants after which the filter has forgotten what was before: e⁻⁸ (1 + 8 + 32) is 1.4 %.
constexpr double kMemory = 8.0;

using Number = JointVector<double, 1>;

Number number(double value) { return Number::Constant(value); }

}  // namespace

HorizonRows::HorizonRows(std::shared_ptr<const regression::RegressionColumns> columns,
                         std::vector<int> unknown, const HorizonOptions& options)
    : columns_(std::move(columns)),
      unknown_(std::move(unknown)),
      known_(columns_->values(columns_->robot())),
      rest_speed_(options.rest_speed),
      spacing_(1.0 / options.row_rate),
      time_constant_(0.5 / (std::numbers::pi * options.cutoff)) {
  for (const int k : unknown_) known_[k] = 0.0;
  AlignedMotion<double, 1> filter;
  static_cast<void>(filter.configure(options.cutoff, 0.0));  // the facade has checked the range
  const auto n = static_cast<std::size_t>(columns_->num_joints());
  joints_.assign(n, filter);
  last_fast_.assign(n, -kInfinity);
  useful_from_.assign(n, -kInfinity);
}

void HorizonRows::restart() {
  for (AlignedMotion<double, 1>& joint : joints_) joint.reset();
}

void HorizonRows::watch_rest(double time, const VectorXd& qd) {
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    if (std::abs(qd[static_cast<Index>(j)]) >= rest_speed_) last_fast_[j] = time;
    if (time - last_fast_[j] > kReversal) useful_from_[j] = time + kMemory * time_constant_;
  }
}

std::optional<HorizonTick> HorizonRows::tick_at(double time) const {
  const Index n = columns_->num_joints();
  HorizonTick tick;
  tick.time = time;
  VectorXd q(n), qd(n), qdd(n);
  for (Index j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    q[j] = joints_[at].q()[0];
    qd[j] = joints_[at].qd()[0];
    qdd[j] = joints_[at].qdd()[0];
    if (joints_[at].settled() && time >= useful_from_[at]) tick.joints.push_back(static_cast<int>(j));
  }
  if (tick.joints.empty()) return std::nullopt;
  MatrixXd Y = columns_->regressor(q, qd, qdd);
  for (int k = 0; k < columns_->count(); ++k) {
    // The sign passed the filter as a sign: a filtered sign is not the sign of a filtered velocity.
    const regression::Column& column = (*columns_)[k];
    if (column.kind == regression::ColumnKind::kCoulomb)
      Y(column.joint, k) = joints_[static_cast<std::size_t>(column.joint)].sign()[0];
  }
  const VectorXd known = Y * known_;
  const auto m = static_cast<Index>(tick.joints.size());
  tick.W.resize(m, static_cast<Index>(unknown_.size()));
  tick.y.resize(m);
  for (Index i = 0; i < m; ++i) {
    const int joint = tick.joints[static_cast<std::size_t>(i)];
    tick.W.row(i) = Y.row(joint)(unknown_);
    tick.y[i] = joints_[static_cast<std::size_t>(joint)].tau()[0] - known[joint];
  }
  return tick;
}

Status HorizonRows::add(const HorizonSample& sample, std::optional<HorizonTick>& tick) {
  tick.reset();
  if (!is_usable(sample.time) || !all_usable(sample.q) || !all_usable(sample.qd) || !all_usable(sample.tau))
    return Status::kNonFiniteInput;
  // Shorter steps than this the filter refuses.
  constexpr double kShortest = 1e-9;
  const bool first = std::isnan(time_);
  const double dt = sample.time - time_;
  if (!first && !(dt > kShortest * time_constant_)) return Status::kOutOfRange;

  VectorXd qd = sample.qd;
  if (qd.size() == 0) qd = first ? VectorXd::Zero(sample.q.size()) : VectorXd((sample.q - last_q_) / dt);
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const auto at = static_cast<Index>(j);
    const Number q = number(sample.q[at]);
    // What remains is refused by none: a step beyond any filter counts as a new start.
    if (joints_[j].update(q, number(qd[at]), q, number(sample.tau[at]), dt) != Status::kOk) restart();
  }
  watch_rest(sample.time, qd);
  last_q_ = sample.q;
  time_ = sample.time;
  if (first) next_ = sample.time;
  if (sample.time < next_) return Status::kOk;
  next_ = std::max(next_ + spacing_, sample.time + 0.5 * spacing_);
  tick = tick_at(sample.time);
  return Status::kOk;
}

}  // namespace heft::identify
