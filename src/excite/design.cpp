#include "heft/excite/excitation_design.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "design_impl.hpp"
#include "heft/data/motion_rows.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/regression/base_parameters.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using regression::BaseParameters;
using regression::find_base_parameters;

// Bounds on the work of a design, beside the rows of the log that its score represents (data::kMostMotionRows).
constexpr double kMostSamples = 20'000;  // of the search
constexpr double kMostChecks = 1e5;      // instants in the final check of one motion
constexpr int kMostHarmonics = 40;

void check_joints(const model::Robot& robot, const MotionLimits& limits, const ExcitationOptions& options) {
  const Index n = robot.num_joints();
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  const auto sized = [&](const VectorXd& v, const char* what) {
    if (v.size() != n)
      refuse(fmt::format("{}: found {} numbers, expected {}, one a joint", what, v.size(), n));
  };
  if (options.start.size() > 0) sized(options.start, "start");
  if (options.torque_noise.size() > 0) sized(options.torque_noise, "torque noise");
  for (Index j = 0; j < n; ++j) {
    const std::string name = joint_name(robot, j);
    if (options.torque_noise.size() > 0 && !(options.torque_noise[j] > 0.0)) {
      refuse(fmt::format("{}: torque noise: found {}, expected more than 0", name, options.torque_noise[j]));
    }
    if (options.start.size() > 0 &&
        !(options.start[j] > limits.lower[j] && options.start[j] < limits.upper[j])) {
      refuse(fmt::format("{}: start: found {}, expected a position inside the limits {} to {}", name,
                         options.start[j], limits.lower[j], limits.upper[j]));
    }
  }
}

void check(const model::Robot& robot, const MotionLimits& limits, const ExcitationOptions& options) {
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  check_joints(robot, limits, options);
  if (!(options.duration > 0.0) || !(options.period >= 0.0) || !std::isfinite(options.duration)) {
    refuse(
        fmt::format("duration {} s and period {} s: expected more than 0", options.duration, options.period));
  }
  if (options.period > options.duration) {
    refuse(fmt::format("period: found {} s, expected at most the duration of {} s", options.period,
                       options.duration));
  }
  if (options.harmonics < 2) {
    refuse(
        fmt::format("harmonics: found {}, expected at least 2: start and end at rest take two coefficients a "
                    "joint, so one harmonic leaves no motion",
                    options.harmonics));
  }
  if (!(options.sample_rate > 0.0)) {
    refuse(fmt::format("sample rate: found {}, expected more than 0", options.sample_rate));
  }
  if (options.starts < 1 || options.iterations < 1) {
    refuse(
        fmt::format("starts {} and iterations {}: expected at least 1", options.starts, options.iterations));
  }
  if (options.harmonics > kMostHarmonics) {
    refuse(fmt::format("harmonics: found {}, expected at most {}", options.harmonics, kMostHarmonics));
  }
  if (!(options.duration * options.sample_rate <= data::kMostMotionRows)) {
    refuse(fmt::format(
        "duration {:g} s at {:g} Hz: found {:.3g} rows, expected at most {:g}; take a shorter motion or a "
        "lower rate",
        options.duration, options.sample_rate, options.duration * options.sample_rate,
        data::kMostMotionRows));
  }
  const double periods = options.period > 0.0 ? options.duration / options.period : 1.0;
  const bool whole = std::abs(periods - std::round(periods)) < 1e-9;
  if (!whole && 30.0 * options.harmonics * periods > kMostSamples) {
    refuse(
        fmt::format("period: found {:g} s for a duration of {:g} s, expected a whole number of periods or "
                    "fewer of them ({} harmonics of {:.4g} periods take too many samples)",
                    options.period, options.duration, options.harmonics, periods));
  }
}

/// Instants over a time: in the middle of equal parts, or both ends among them.
VectorXd evenly(double length, Index count, bool with_ends) {
  VectorXd t(count);
  for (Index i = 0; i < count; ++i) {
    t[i] = with_ends ? length * static_cast<double>(i) / static_cast<double>(count - 1)
                     : length * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
  }
  return t;
}

}  // namespace

ExcitationDesign::Impl::Impl(const model::Robot& robot, const MotionLimits& limits,
                             ExcitationOptions given_options)
    : options(std::move(given_options)),
      bounds(robot, limits),
      columns(robot, options.structure),
      dynamics(robot) {
  check(robot, limits, options);
  if (options.period == 0.0) options.period = options.duration;
  if (options.payload_only) {
    choose_last_link();
  } else {
    choose_base_parameters();
  }
  for (const int c : kept) units.push_back(columns[c].unit);
  set_weights(limits.torque);
  regressor = make_differentiable_regressor(columns, kept, 0.02 * bounds.velocity);
  choose_span();
  keep_ends_at_rest();
  choose_instants(limits);
  given_noise = given_unit = MatrixXd::Zero(b(), b());
  if (!free_start()) check_start(limits);
}

void ExcitationDesign::Impl::choose_last_link() {
  const int last = n() - 1;
  std::mt19937_64 random(1);
  const int rows = 20 * n();
  MatrixXd W(rows, 10);
  for (int s = 0; s < 20; ++s) {
    const VectorXd q =
        random_position(random, VectorXd::Zero(n()), VectorXd::Constant(n(), std::numbers::pi), 1.0);
    const VectorXd qd = random_position(random, VectorXd::Zero(n()), VectorXd::Ones(n()), 1.0);
    const VectorXd qdd = random_position(random, VectorXd::Zero(n()), VectorXd::Ones(n()), 1.0);
    W.middleRows(s * n(), n()) = columns.regressor(q, qd, qdd).middleCols(10 * last, 10);
  }
  MatrixXd Q(rows, 0);
  for (int k = 0; k < 10; ++k) {
    VectorXd left = W.col(k);
    for (int pass = 0; pass < 2; ++pass) left -= Q * (Q.transpose() * left);
    if (left.norm() <= 1e-9 * (1.0 + W.col(k).norm())) continue;
    Q.conservativeResize(rows, Q.cols() + 1);
    Q.col(Q.cols() - 1) = left.normalized();
    kept.push_back(10 * last + k);
    names.push_back(columns[10 * last + k].name);
    expressions.push_back(names.back());
  }
  regrouping = MatrixXd::Zero(b(), columns.count());
  for (int i = 0; i < b(); ++i) regrouping(i, kept[static_cast<std::size_t>(i)]) = 1.0;
}

void ExcitationDesign::Impl::choose_base_parameters() {
  const BaseParameters base = find_base_parameters(columns);
  kept = base.kept;
  expressions = base.expressions;
  regrouping = base.regrouping;
  for (int i = 0; i < base.count(); ++i) names.push_back(base.name(columns, i));
}

void ExcitationDesign::Impl::set_weights(const VectorXd& torque_limits) {
  noise = options.torque_noise;
  if (noise.size() == 0) {
    noise = 0.01 * torque_limits;
    if (!noise.allFinite()) noise.setOnes();
  }
  weights = options.weights == RowWeights::kUnit ? VectorXd::Ones(n()) : VectorXd(noise.cwiseInverse());
  // Only ratios matter to the search; a largest weight of 1 keeps its numbers near 1.
  weights /= weights.maxCoeff();
}

void ExcitationDesign::Impl::choose_span() {
  const double periods = options.duration / options.period;
  if (std::abs(periods - std::round(periods)) < 1e-9) {
    repeats = static_cast<int>(std::round(periods));
    span = options.period;
  } else {
    span = options.duration;
  }
}

void ExcitationDesign::Impl::keep_ends_at_rest() {
  const int K = options.harmonics;
  const FourierBasis ends = basis_at(Eigen::Vector2d(0.0, options.duration));
  MatrixXd C(4, 2 * K);
  C << ends.qd, ends.qdd / (omega() * K);
  at_rest = complement_of(C.transpose(), 1e-9);
  if (at_rest.cols() == 0) {
    throw ModelError(
        fmt::format("robot \"{}\": harmonics: found {} over {:.4g} periods, expected more: start and "
                    "end at rest take {} coefficients a joint and leave no motion",
                    columns.robot().name, K, options.duration / options.period, 2 * K - at_rest.cols()));
  }
}

void ExcitationDesign::Impl::choose_instants(const MotionLimits& limits) {
  // 30 samples of the fastest harmonic: torque and height, which are not band-limited, are then sampled well
  // enough for a search; what they do between samples the final check sees.
  const Index samples =
      std::max<Index>(60, static_cast<Index>(std::ceil(30.0 * options.harmonics * span / options.period)));
  times = evenly(span, samples, false);
  coarse = basis_at(times);
  dense = basis_at(evenly(span, 5 * samples, false));
  // Fine enough, too, that two links which both move at the tool's speed limit approach each other by less than the
  // clearance from one instant to the next.
  double checks = 10.0 * static_cast<double>(samples);
  if (std::isfinite(limits.tool_speed) && limits.clearance > 0.0) {
    checks =
        std::clamp(span * 2.0 * limits.tool_speed / limits.clearance, checks, std::max(checks, kMostChecks));
  }
  fine = basis_at(evenly(span, static_cast<Index>(checks) + 1, true));
}

void ExcitationDesign::Impl::check_start(const MotionLimits& limits) const {
  const Closest found = bounds.closest_at_rest(options.start);
  if (!(found.slack > kRoom)) {
    throw ModelError(
        fmt::format("robot \"{}\": start: at this pose the arm passes a limit ({}); expected a "
                    "position that can be held inside all limits with their margin of {} %",
                    columns.robot().name, found.what, 100.0 * limits.margin));
  }
}

double ExcitationDesign::Impl::omega() const { return 2.0 * std::numbers::pi / options.period; }

FourierBasis ExcitationDesign::Impl::basis_at(const VectorXd& at) const {
  const int K = options.harmonics;
  FourierBasis basis;
  basis.q.resize(at.size(), 2 * K);
  basis.qd.resize(at.size(), 2 * K);
  basis.qdd.resize(at.size(), 2 * K);
  for (Index i = 0; i < at.size(); ++i) {
    for (int k = 0; k < K; ++k) {
      const double w = omega() * (k + 1), c = std::cos(w * at[i]), s = std::sin(w * at[i]);
      basis.q(i, k) = (1.0 - c) / w;
      basis.q(i, K + k) = s / w;
      basis.qd(i, k) = s;
      basis.qd(i, K + k) = c;
      basis.qdd(i, k) = w * c;
      basis.qdd(i, K + k) = -w * s;
    }
  }
  return basis;
}

MatrixXd ExcitationDesign::Impl::coefficients(const ExcitationTrajectory& motion) {
  MatrixXd c(2 * motion.num_harmonics(), motion.num_joints());
  c << motion.sine.transpose(), motion.cosine.transpose();
  return c;
}

ExcitationTrajectory ExcitationDesign::Impl::make(const VectorXd& start, const MatrixXd& c) const {
  const int K = options.harmonics;
  ExcitationTrajectory motion;
  motion.period = options.period;
  motion.duration = options.duration;
  motion.start = start;
  motion.sine = c.topRows(K).transpose();
  motion.cosine = c.bottomRows(K).transpose();
  return motion;
}

ExcitationTrajectory ExcitationDesign::Impl::decode(const VectorXd& x) const {
  const Index m = at_rest.cols(), first = free_start() ? n() : 0;
  const VectorXd start =
      free_start() ? VectorXd(bounds.middle + bounds.half.cwiseProduct(x.head(n()))) : options.start;
  const MatrixXd c = at_rest * x.tail(x.size() - first).reshaped(m, n()) * bounds.velocity.asDiagonal();
  return make(start, c);
}

VectorXd ExcitationDesign::Impl::encode(const ExcitationTrajectory& motion) const {
  const Index m = at_rest.cols(), first = free_start() ? n() : 0;
  VectorXd x(first + m * n());
  if (free_start()) x.head(n()) = (motion.start - bounds.middle).cwiseQuotient(bounds.half);
  x.tail(m * n()) =
      (at_rest.transpose() * coefficients(motion) * bounds.velocity.cwiseInverse().asDiagonal()).reshaped();
  return x;
}

ExcitationDesign::ExcitationDesign(const model::Robot& robot, const MotionLimits& limits,
                                   ExcitationOptions options)
    : impl_(std::make_unique<Impl>(robot, limits, std::move(options))) {}
ExcitationDesign::~ExcitationDesign() = default;
ExcitationDesign::ExcitationDesign(ExcitationDesign&&) noexcept = default;
ExcitationDesign& ExcitationDesign::operator=(ExcitationDesign&&) noexcept = default;

const MotionLimits& ExcitationDesign::limits() const { return impl_->bounds.limits; }
const ExcitationOptions& ExcitationDesign::options() const { return impl_->options; }
int ExcitationDesign::num_parameters() const { return impl_->b(); }
const std::vector<std::string>& ExcitationDesign::names() const { return impl_->names; }
const std::vector<std::string>& ExcitationDesign::units() const { return impl_->units; }
const std::vector<std::string>& ExcitationDesign::expressions() const { return impl_->expressions; }
const VectorXd& ExcitationDesign::torque_noise() const { return impl_->noise; }
VectorXd ExcitationDesign::values() const {
  return impl_->regrouping * impl_->columns.values(impl_->columns.robot());
}
const RegressionColumns& ExcitationDesign::columns() const { return impl_->columns; }
const std::vector<int>& ExcitationDesign::kept() const { return impl_->kept; }

void ExcitationDesign::add_given(const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd, double seconds) {
  Impl& d = *impl_;
  const Index n = d.n();
  if (q.cols() != n || qd.cols() != n || qdd.cols() != n) {
    throw ModelError(fmt::format("given log: found {} joints, expected the robot's {}", q.cols(), n));
  }
  for (Index i = 0; i < q.rows(); ++i) {
    MatrixXd Y = d.columns.regressor(q.row(i), qd.row(i), qdd.row(i))(Eigen::all, d.kept);
    for (Index j = 0; j < n; ++j) {
      if (std::abs(qd(i, j)) < 0.01 * d.bounds.limits.velocity[j]) Y.row(j).setZero();
    }
    d.given_unit.noalias() += seconds * Y.transpose() * Y;
    Y = d.noise.cwiseInverse().asDiagonal() * Y;
    d.given_noise.noalias() += seconds * Y.transpose() * Y;
  }
  d.has_given = true;
}

ExcitationTrajectory ExcitationDesign::random_motion(std::uint64_t seed) const {
  return impl_->random_motion(seed);
}

ExcitationScore ExcitationDesign::score(const ExcitationTrajectory& motion) const {
  MatrixXd by_noise, by_unit;
  impl_->information(motion, by_noise, by_unit);
  return impl_->score_of(by_noise + impl_->given_noise, by_unit + impl_->given_unit);
}

std::optional<ExcitationScore> ExcitationDesign::given_score() const {
  if (!impl_->has_given) return std::nullopt;
  const ExcitationScore score = impl_->score_of(impl_->given_noise, impl_->given_unit);
  if (!std::isfinite(score.condition)) return std::nullopt;
  return score;
}

VectorXd ExcitationDesign::torque(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd) const {
  return impl_->dynamics.joint_torque(q, qd, qdd);
}

Excitation ExcitationDesign::optimize(const std::function<void(double)>& progress) const {
  return impl_->optimize(progress);
}

int ExcitationDesign::num_variables() const {
  return (impl_->free_start() ? impl_->n() : 0) + static_cast<int>(impl_->at_rest.cols()) * impl_->n();
}
VectorXd ExcitationDesign::encode(const ExcitationTrajectory& motion) const { return impl_->encode(motion); }
ExcitationTrajectory ExcitationDesign::decode(const VectorXd& variables) const {
  return impl_->decode(variables);
}
double ExcitationDesign::cost(const VectorXd& variables, double barrier, VectorXd* gradient) const {
  double value = 0.0;
  return impl_->evaluate(variables, barrier, value, gradient) ? value : kInfinity;
}

}  // namespace heft::excite
