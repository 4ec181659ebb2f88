/// @file
/// What happens to a sample of the log in a loop that follows its load and feels contacts: observer, monitor, and computed
/// torque of the whole model. One source for host and image.
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "arms.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/core/status.hpp"
#include "log_table.hpp"

namespace heft::firmware {

/// LoadObserver, one row of its update a sample; ContactMonitor on the torque that the observer's pass explains; ArmTorque with
/// effects and the observed load at the acceleration that feedback asks for. The log has no contact in it: for a fifth of a
/// second something pushes the elbow.
template <typename Scalar>
class OnlineReplay {
  using Observer = LoadObserver<EffectsArm, Scalar>;
  using Monitor = ContactMonitor<Scalar, kNumJoints>;
  using Torque = ArmTorque<EffectsArm, Scalar>;
  using Vector = typename Torque::Vector;
  using Feedback = JointFeedback<Scalar, kNumJoints>;

 public:
  /// Mass and first moment, the mass's standard deviation, the torque of the last sample; contacts, the sample that found
  /// the first, the largest deviation of the elbow.
  static constexpr int kNumResults = 8 + kNumJoints;

  Status configure() noexcept {
    typename Observer::Config settings;
    settings.rows_per_sample = 1;
    settings.explains = true;
    typename Monitor::Config watched;
    watched.thresholds.joints.fill(JointThreshold<Scalar>::uniform(static_cast<Scalar>(kThreshold),
                                                                   static_cast<Scalar>(0.5 * kThreshold)));
    if (const Status status = monitor_.configure(watched); status != Status::kOk) return status;
    typename Feedback::Config gains;
    gains.stiffness.setConstant(Scalar(400));
    gains.damping.setConstant(Scalar(40));
    if (const Status status = feedback_.configure(gains); status != Status::kOk) return status;
    if (const Status status = torque_.configure(); status != Status::kOk) return status;
    return observer_.configure(settings);
  }

  /// One sample of the control loop.
  Status step(const LogRow& row, Scalar dt) noexcept {
    const JointReference<Scalar, kNumJoints> reference = {vector(row.q_ref), vector(row.qd_ref),
                                                          vector(row.qdd_ref)};
    const Vector q = vector(row.q), qd = vector(row.qd);
    Vector measured = vector(row.tau);
    if (samples_ >= kPushBegins && samples_ < kPushEnds) measured[kElbow] -= static_cast<Scalar>(kPush);
    typename Observer::Record record;
    if (const Status status = observer_.update(q, qd, measured, dt, record); status != Status::kOk) {
      return status;
    }
    if (const Status status = watch(measured, record); status != Status::kOk) return status;
    ++samples_;
    // The sample that finishes an update has enough to do.
    if (new_load_) {
      if (const Status status = torque_.set_payload(observer_.load()); status != Status::kOk) return status;
    }
    new_load_ = record.estimated;
    const Vector command = commanded_acceleration<Scalar, kNumJoints>(feedback_, reference, q, qd);
    return torque_.update(dt, reference.q, reference.qd, command, tau_);
  }

  Scalar result(int i) const noexcept {
    if (i >= 5 + kNumJoints) {
      return i == 5 + kNumJoints   ? static_cast<Scalar>(contacts_)
             : i == 6 + kNumJoints ? static_cast<Scalar>(first_contact_)
                                   : largest_;
    }
    if (i >= 5) return tau_[i - 5];
    const LoadEstimate<Scalar> found = observer_.estimate();
    return i < 4 ? found.value[static_cast<std::size_t>(i)] : found.std[0];
  }
  const char* rests_on() const noexcept { return to_string(observer_.state()); }
  /// Numbers that nobody would use prove nothing.
  bool determined() const noexcept { return observer_.state() == LoadState::kKnown; }

 private:
  static constexpr int kElbow = 2;
  static constexpr std::int32_t kPushBegins = 12'000, kPushEnds = 12'200;  ///< samples
  static constexpr double kPush = 3.0, kThreshold = 0.5;                   ///< [N·m]

  Status watch(const Vector& measured, const typename Observer::Record& seen) noexcept {
    if (seen.changed) monitor_.reset();
    if (!observer_.explained().valid) return Status::kOk;
    const Status status = monitor_.update(observer_.explained(), measured, contact_);
    if (status != Status::kOk) return status;
    if (contact_.event == ContactEvent::kContact) {
      first_contact_ = contacts_ == 0 ? samples_ : first_contact_;
      ++contacts_;
    }
    if (contact_.judged && contact_.deviation[kElbow] > largest_) largest_ = contact_.deviation[kElbow];
    return Status::kOk;
  }

  static Vector vector(const float* values) noexcept {
    return Eigen::Map<const Eigen::Matrix<float, kNumJoints, 1>>(values).cast<Scalar>();
  }

  Observer observer_;
  Monitor monitor_;
  typename Monitor::Record contact_;
  Torque torque_;
  Feedback feedback_;
  Vector tau_ = Vector::Zero();
  Scalar largest_{0};
  std::int32_t samples_{0}, contacts_{0}, first_contact_{0};
  bool new_load_{false};
};

}  // namespace heft::firmware
