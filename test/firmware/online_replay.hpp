/// @file
/// What happens to a sample of the log in a loop that follows its load: observer, and computed torque of the whole model. One
/// source for host and image.
#pragma once

#include <array>

#include <Eigen/Core>

#include "arms.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/status.hpp"
#include "log_table.hpp"

namespace heft::firmware {

/// LoadObserver, one row of its update a sample, and ArmTorque with effects and the observed load at the acceleration that
/// feedback asks for.
template <typename Scalar>
class OnlineReplay {
  using Observer = LoadObserver<EffectsArm, Scalar>;
  using Torque = ArmTorque<EffectsArm, Scalar>;
  using Vector = typename Torque::Vector;
  using Feedback = JointFeedback<Scalar, kNumJoints>;

 public:
  /// Mass and first moment, the mass's standard deviation, then the torque of the last sample.
  static constexpr int kNumResults = 5 + kNumJoints;

  Status configure() noexcept {
    typename Observer::Config settings;
    settings.rows_per_sample = 1;
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
    typename Observer::Record record;
    if (const Status status = observer_.update(q, qd, vector(row.tau), dt, record); status != Status::kOk) {
      return status;
    }
    // The sample that finishes an update has enough to do.
    if (new_load_) {
      if (const Status status = torque_.set_payload(observer_.load()); status != Status::kOk) return status;
    }
    new_load_ = record.estimated;
    const Vector command = commanded_acceleration<Scalar, kNumJoints>(feedback_, reference, q, qd);
    return torque_.update(dt, reference.q, reference.qd, command, tau_);
  }

  Scalar result(int i) const noexcept {
    if (i >= 5) return tau_[i - 5];
    const LoadEstimate<Scalar> found = observer_.estimate();
    return i < 4 ? found.value[static_cast<std::size_t>(i)] : found.std[0];
  }
  const char* rests_on() const noexcept { return to_string(observer_.state()); }
  /// Numbers that nobody would use prove nothing.
  bool determined() const noexcept { return observer_.state() == LoadState::kKnown; }

 private:
  static Vector vector(const float* values) noexcept {
    return Eigen::Map<const Eigen::Matrix<float, kNumJoints, 1>>(values).cast<Scalar>();
  }

  Observer observer_;
  Torque torque_;
  Feedback feedback_;
  Vector tau_ = Vector::Zero();
  bool new_load_{false};
};

}  // namespace heft::firmware
