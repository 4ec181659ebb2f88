#include "load_follower.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "causal_signals.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/error.hpp"
#include "heft/model/run_time_arm.hpp"
#include "heft/model/sized.hpp"
#include "load_geometry.hpp"

namespace heft::payload {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Poles of the filter where nothing says which one the model's residual was measured behind [Hz].
constexpr double kCutoff = 5.0;
/// Updates a period of the low-pass that the model's residual was measured behind. The residual is correlated over longer than that; more
/// updates would only make the observer certain too early.
constexpr double kUpdatesPerPeriod = 3.0;
/// Of the Coulomb sign [rad/s, m/s].
constexpr double kSignWidth = 0.02;
/// The prior of the intervals over that of the observer [1]: a load near the flange, as the observer assumes it, is no knowledge.
constexpr double kWider = 10.0;
/// A rest longer than this teaches nothing: the observer's `longest_rest` [s].
constexpr double kRest = 5.0;
/// Residual of a model from elsewhere, in parts of a joint's largest torque: what fits usually leave [1].
constexpr double kUsualResidual = 0.01;

double cutoff_of(const PayloadRunOptions& options) {
  return options.cutoff > 0.0 ? options.cutoff : options.residual ? options.residual->cutoff : kCutoff;
}

VectorXd noise_of(const model::Robot& arm, const PayloadRunOptions& options) {
  if (options.residual) return options.residual->std;
  VectorXd noise(arm.num_joints());
  for (Index i = 0; i < noise.size(); ++i) {
    const double limit = arm.joints[static_cast<std::size_t>(i)].effort_limit;
    noise[i] = std::isfinite(limit) && limit > 0.0 ? kUsualResidual * limit : 1.0;
  }
  return noise;
}

}  // namespace

class LoadFollower::Sized {
 public:
  virtual ~Sized() = default;
  virtual Status update(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, double step,
                        Taken& taken) = 0;
  virtual LoadState state() const = 0;
  /// About the last link frame.
  virtual InertialParameters<double> load() const = 0;
  /// Of the parameters, residuals correlated in time: 10 of the load, 2 of each joint's friction.
  virtual MatrixXd covariance() const = 0;
  /// Behind the filter.
  virtual void motion(VectorXd& q, VectorXd& qd, VectorXd& qdd) const = 0;
};

namespace {

template <int N>
class SizedFollower final : public LoadFollower::Sized {
  using Core = LoadObserver<model::ModelOf<N>, double, N>;
  using Vector = JointVector<double, N>;

 public:
  SizedFollower(const model::Robot& arm, const PayloadRunOptions& options, const VectorXd& noise,
                double period) {
    typename Core::Config config;
    config.first_row = options.first_joint - 1;
    // The torque of the arm behind a filter is not that of the motion behind it: off by 3 (q̇/ω)²/2 of the whole torque. So the filter
    // is fast; its noise is learnt.
    config.filter_hz = fast_pole(cutoff_of(options), 1.0 / period);
    config.update_rate = kUpdatesPerPeriod * cutoff_of(options);
    config.friction_prior = friction_prior(arm, config.first_row, noise, options.torque_at_joint);
    config.noise_std = noise;
    config.noise_known = true;
    config.sign_width = kSignWidth;
    config.transition_time = 0.0;
    config.longest_rest = kRest;
    if (core_.configure(model::to_arm_model<N>(arm), config) != Status::kOk ||
        motion_.configure(config.filter_hz) != Status::kOk) {
      throw ModelError(fmt::format(
          "robot \"{}\": the load observer refuses it, behind a low-pass of {:g} Hz; expected finite "
          "numbers, masses above 0 and 1e-6 to 1e6 Hz",
          arm.name, config.filter_hz));
    }
    model::add_parts(arm, core_);
  }

  Status update(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, double step,
                LoadFollower::Taken& taken) override {
    const Vector q_now = q;
    const Vector qd_now = qd, tau_now = tau;
    typename Core::Record record;
    const Status status = core_.update(q_now, qd_now, tau_now, step, record);
    if (status != Status::kOk) return status;
    // The observer's own filter, of which it does not tell.
    if (started_) static_cast<void>(motion_.update(0.5 * (q_now + previous_), step));
    previous_ = q_now;
    started_ = true;
    taken.estimated = record.estimated;
    taken.changed = record.changed;
    return status;
  }
  LoadState state() const override { return core_.state(); }
  InertialParameters<double> load() const override { return core_.estimator().payload(); }
  MatrixXd covariance() const override {
    constexpr int kSize = Core::Estimator::kParameters;
    MatrixXd covariance(kSize, kSize);
    for (int i = 0; i < kSize; ++i) {
      for (int j = 0; j <= i; ++j)
        covariance(i, j) = covariance(j, i) = core_.estimator().estimator().covariance(i, j);
    }
    return covariance * (core_.widening() * core_.widening());
  }
  void motion(VectorXd& q, VectorXd& qd, VectorXd& qdd) const override {
    q = motion_.value();
    qd = motion_.derivative();
    qdd = motion_.second_derivative();
  }

 private:
  Core core_;
  StateVariableFilter<double, N> motion_;
  Vector previous_ = Vector::Zero();
  bool started_{false};
};

}  // namespace

LoadFollower::LoadFollower(const model::Robot& arm, const PayloadRunOptions& options, double period)
    : options_(options),
      dynamics_(arm),
      limits_(arm),
      to_flange_(to_flange(arm)),
      noise_(noise_of(arm, options)),
      period_(period),
      rate_(std::min(kUpdatesPerPeriod * cutoff_of(options), 1.0 / period)),
      late_(arm.torque_delay) {
  together_ = VectorXd::Ones(arm.num_joints());
  if (options.residual) together_ = (rate_ * options.residual->correlation_time).cwiseMax(1.0);
  core_ = model::with_joint_count(arm.num_joints(), arm.name, [&](auto joints) -> std::unique_ptr<Sized> {
    return std::make_unique<SizedFollower<decltype(joints)::value>>(arm, options_, noise_, period_);
  });
  error_ = std::make_unique<ArmError>(kWider * kWider * core_->covariance().diagonal(),
                                      options_.model_covariance, options_.drive_scale);
}
LoadFollower::~LoadFollower() = default;

VectorXd LoadFollower::scaled(const VectorXd& q, const VectorXd& qd, const VectorXd& tau) const {
  if (options_.drive_scale.empty()) return tau;
  // The filter's acceleration is late, but only the few percent that the scale is off are taken of its torque.
  VectorXd filtered, rate, qdd;
  core_->motion(filtered, rate, qdd);
  const VectorXd own = dynamics_.joint_torque(q, qd, qdd, kSignWidth);
  VectorXd result(tau.size());
  for (Index i = 0; i < tau.size(); ++i)
    result[i] = own[i] + (tau[i] - own[i]) / options_.drive_scale[static_cast<std::size_t>(i)].value;
  return result;
}

LoadFollower::Taken LoadFollower::take(const data::LiveRow& row) {
  Taken taken;
  const double step = started_ ? row.time - last_.time : period_;
  const VectorXd moved = started_ ? VectorXd(row.q - last_.q) : VectorXd(VectorXd::Zero(row.q.size()));
  taken.joint = limits_.implausible_joint(row.q, row.qd, row.tau, moved, started_ ? step : 0.0);
  taken.refused = taken.joint >= 0;
  if (taken.refused) return taken;
  VectorXd qd = row.qd;
  if (qd.size() != row.q.size()) qd = moved / step;
  VectorXd q = row.q;
  late_.take(row.time, q, qd);
  // The observer takes a torque as that of the time since the row before, at motion half-way; a row's torque is of the row. Half-way points
  // of rows that jitter are further apart, or less, than the rows: timed like these, motion would get a noise of its own.
  const double spacing = last_step_ > 0.0 ? 0.5 * (step + last_step_) : step;
  const VectorXd tau = scaled(q, qd, row.tau);
  const VectorXd between = started_ ? VectorXd(0.5 * (tau + last_tau_)) : tau;
  taken.refused = core_->update(q, qd, between, spacing, taken) != Status::kOk;
  if (taken.refused) return taken;
  last_tau_ = tau;
  last_step_ = started_ ? step : 0.0;
  last_ = row;
  started_ = true;
  if (taken.estimated) add_rows();
  restart_due_ = restart_due_ || taken.changed;
  return taken;
}

void LoadFollower::add_rows() {
  if (restart_due_) error_->restart();
  restart_due_ = false;
  VectorXd q, qd, qdd;
  core_->motion(q, qd, qdd);
  const Index n = q.size();
  MatrixXd Y = dynamics_.regressor(q, qd, qdd);
  for (Index i = options_.first_joint - 1; i < n; ++i) {
    const double sign = velocity_sign(qd[i], kSignWidth);
    Y(i, 11 * n + i) = sign;  // smooth
    // Around a reversal and at rest friction is anything between its two levels, as the observer says, too; but what it is at rest
    // it remains, so that all rows of a rest say as much as one.
    const bool slow = std::abs(sign) < 1.0;
    const double unsure =
        slow ? 0.5 * dynamics_.robot().joints[static_cast<std::size_t>(i)].actuation.coulomb_friction : 0.0;
    const double together = slow ? std::max(together_[i], kRest * rate_) : together_[i];
    error_->add(static_cast<int>(i), Y.row(i).transpose(), Y.row(i).segment(10 * (n - 1), 10).transpose(),
                sign, qd[i], noise_[i] * noise_[i] + unsure * unsure, together);
  }
}

LoadState LoadFollower::state() const { return core_->state(); }

LoadValue LoadFollower::load() const {
  const InertialParameters<double> parameters = core_->load();
  const VectorXd x = Eigen::Map<const VectorXd>(parameters.data(), 10);
  // The residual's share: as the innovations of this stream show it, or as the fit of the arm did, whose residual was seen for long
  // enough to know how long it stays.
  MatrixXd covariance = core_->covariance().topLeftCorner(10, 10);
  const MatrixXd as_fitted = error_->residual();
  if (as_fitted(0, 0) > covariance(0, 0)) covariance = as_fitted;
  covariance += error_->covariance(x);
  covariance(0, 0) += options_.zero_mass_std * options_.zero_mass_std;
  const VectorXd at_flange = to_flange_ * x;
  const MatrixXd of_flange = to_flange_ * covariance * to_flange_.transpose();
  LoadValue load;
  load.mass = statistics::Interval::around(x[0], std::sqrt(covariance(0, 0)));
  for (std::size_t a = 0; a < 3; ++a)
    load.com[a] = centre_of_mass(at_flange, of_flange, 1 + static_cast<Index>(a), load.mass);
  return load;
}

}  // namespace heft::payload
