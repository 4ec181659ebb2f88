/// @file
/// What happens to a sample of the log: regressor, estimator, computed torque. One source for host and image.
#pragma once

#include <array>

#include <Eigen/Core>

#include "arms.hpp"
#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/status.hpp"
#include "log_table.hpp"

namespace heft::firmware {

/// The terminal-link estimator at k = 5 with the desired acceleration as instrument, and computed torque with the
/// running estimate.
template <typename Scalar>
class Replay {
  using Arm = StaticArm<Scalar, PaperArm>;
  using Vector = JointVector<Scalar, kNumJoints>;
  using Parameters = ReducedParameters<Scalar, PaperArm>;
  using Estimator = TerminalLinkEstimator<Arm, 4>;
  using Feedback = JointFeedback<Scalar, kNumJoints>;

 public:
  /// The estimate, then the torque of the last sample.
  static constexpr int kNumResults = Estimator::kParameters + kNumJoints;

  /// Starts at the nominal arm.
  Status configure() noexcept {
    parameters_ = kNominal.parameters;
    for (int joint = 0; joint < kNumJoints; ++joint) {
      friction_.coulomb[joint] = kNominal.coulomb[static_cast<std::size_t>(joint)];
    }
    typename Feedback::Config gains;
    gains.stiffness.setConstant(Scalar(400));
    gains.damping.setConstant(Scalar(40));
    if (const Status status = feedback_.configure(gains); status != Status::kOk) return status;
    return estimator_.configure({}, parameters_, friction_.coulomb, friction_.viscous);
  }

  /// One sample of the control loop.
  Status step(const LogRow& row, Scalar) noexcept {
    const JointReference<Scalar, kNumJoints> reference = {vector(row.q_ref), vector(row.qd_ref),
                                                          vector(row.qdd_ref)};
    const Vector q = vector(row.q);
    const Vector qd = vector(row.qd);
    const JointTrigonometry<Arm> trig = joint_trigonometry<Arm>(q);
    typename Estimator::Record record;
    const Status status =
        estimator_.update(trig, q, qd, vector(row.qdd), reference.qdd, vector(row.tau), record);
    if (status != Status::kOk) return status;
    if (record.new_estimate) {
      parameters_ = estimator_.reduced();
      estimator_.friction(friction_.coulomb, friction_.viscous);
    }
    ControlRecord control;
    return computed_torque<Arm>(feedback_, parameters_, friction_, Vector::Zero(), reference, trig, q, qd,
                                torque_, control);
  }

  Scalar result(int i) const noexcept {
    constexpr int kEstimates = Estimator::kParameters;
    return i < kEstimates ? estimator_.estimate()[static_cast<std::size_t>(i)] : torque_[i - kEstimates];
  }
  const char* rests_on() const noexcept { return to_string(estimator_.source()); }
  /// Numbers that nobody would use prove nothing.
  bool determined() const noexcept { return estimator_.source() == EstimateSource::kInstrumental; }

 private:
  // Converted at compile time: an image in single precision has no double arithmetic, in its setup neither.
  struct Nominal {
    Parameters parameters;
    std::array<Scalar, kNumJoints> coulomb;
  };
  static constexpr Nominal kNominal = [] {
    constexpr auto kLinks = reduced_links(PaperArm::kModel);
    Nominal nominal{};
    for (std::size_t link = 0; link < kLinks.size(); ++link) {
      for (std::size_t i = 0; i < kLinks[link].size(); ++i) {
        nominal.parameters.links[link][i] = static_cast<Scalar>(kLinks[link][i]);
      }
      nominal.coulomb[link] = static_cast<Scalar>(PaperArm::kModel.actuation[link].coulomb_friction);
    }
    return nominal;
  }();

  static Vector vector(const float* values) noexcept {
    return Eigen::Map<const Eigen::Matrix<float, kNumJoints, 1>>(values).cast<Scalar>();
  }

  Estimator estimator_;
  Feedback feedback_;
  Parameters parameters_;
  FrictionFeedForward<Scalar, kNumJoints> friction_;
  Vector torque_ = Vector::Zero();
};

}  // namespace heft::firmware
