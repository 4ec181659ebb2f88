/// @file
/// Controllers of one interface: PD, PD with gravity, computed torque with a model as it is or with the load that is found on the
/// way, and adaptive control.
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/adaptive_controller.hpp"
#include "heft/core/control/arm_controller.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/control/reference_drive.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/dynamics/detail/usable_model.hpp"
#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/estimate/arm_estimator.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/status.hpp"

namespace heft {

namespace detail {

/// A controller that knows the arm: links with a load, gravity, and what its drives spend. Derived has, besides what
/// ControllerFrame asks for, begin(config, model).
template <typename Derived, typename Config_, typename Description, typename Scalar_>
class ModelController : public ControllerFrame<Derived, Scalar_, ArmSource<Description>::kNumJoints> {
  using Source = ArmSource<Description>;
  using Frame = ControllerFrame<Derived, Scalar_, Source::kNumJoints>;

 public:
  using Scalar = Scalar_;
  using Config = Config_;
  using typename Frame::Measurement;
  using typename Frame::Reference;
  using typename Frame::Step;
  using typename Frame::Vector;
  using Model = ArmModel<Scalar, Source::kNumJoints>;
  using Load = InertialParameters<Scalar>;

  /// Takes the described arm, without load.
  /// @return kOutOfRange (settings), kNonFiniteInput (numbers of the arm): state kept
  Status configure(const Config& config = {}) noexcept requires(Source::kIsStatic) {
    return set_up(config, Body::model());
  }
  /// The same for an arm known at run time; add() brings the rest.
  Status configure(const Model& model, const Config& config = {}) noexcept requires(!Source::kIsStatic) {
    return set_up(config, model);
  }

  /// A joint effect, a gear coupling or an elastic joint more. Before the first step.
  /// @return see ReferenceDrive; kNotConfigured; state kept unless kOk
  template <typename Part>
  Status add(const Part& part) noexcept requires(!Source::kIsStatic) {
    return known_ ? static_cast<Derived*>(this)->add_part(part) : Status::kNotConfigured;
  }

  /// Replaces what the arm is believed to carry; all zero for nothing.
  /// @param load  about the last link frame
  /// @return kNonFiniteInput, kNotPositiveDefinite (no body has these): the old load is kept; kNotConfigured
  Status set_load(const Load& load) noexcept {
    if (!known_) {
      return Status::kNotConfigured;
    }
    const Status status = check_physical(load);
    if (status == Status::kOk) {
      carry(load);
    }
    return status;
  }
  const Load& load() const noexcept { return load_; }

  /// Replaces gravity, in the base frame [m/s²]: a tilted or moving base.
  /// @return kNonFiniteInput: the old one is kept; kNotConfigured
  Status set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    if (!known_ || !all_usable(gravity)) {
      return known_ ? Status::kNonFiniteInput : Status::kNotConfigured;
    }
    body_.set_gravity(gravity);
    drive_.set_gravity(gravity);
    static_cast<Derived*>(this)->tilt(gravity);
    return Status::kOk;
  }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept {
    drive_.set_temperature(temperature);
    static_cast<Derived*>(this)->warm(temperature);
  }

 protected:
  friend Frame;
  using Body = RigidArm<Description, Scalar>;
  using Drive = ReferenceDrive<Description, Scalar>;

  /// No reference is known while another controller is in charge.
  void see(const Measurement& m) noexcept { drive_.skip(m.dt); }
  /// Nobody else wants to know.
  void tilt(const std::array<Scalar, 3>&) noexcept {}
  void warm(const Vector&) noexcept {}
  template <typename Part>
  Status add_part(const Part& part) noexcept {
    return drive_.add(part);
  }
  bool holds(const Vector& q, Vector& tau) const noexcept {
    body_.gravity(q, tau);
    return true;
  }

  /// Settings and model of all. What may be refused is looked at before anything is replaced; nothing in Derived may fail
  /// afterwards.
  /// @param own  status = own(): configures what Derived has besides, or keeps it
  template <typename Own>
  Status begin_model(const ControllerConfig<Scalar, Source::kNumJoints>& config, const Model& model,
                     Own&& own) noexcept {
    if (!Frame::in_range(config)) {
      return Status::kOutOfRange;
    }
    if (const Status status = own(); status != Status::kOk) {
      return status;
    }
    // Refuses what a description brings along, if anything: the same each time, so that there is no older state to keep.
    if (const Status status = drive_.configure(model, config.friction, config.sign_width);
        status != Status::kOk) {
      return status;
    }
    Frame::start(config);
    if constexpr (Source::kIsStatic) {
      body_ = Body{};
    } else {
      body_.set_model(model);
    }
    load_ = {};
    known_ = true;
    return Status::kOk;
  }
  Status begin_model(const ControllerConfig<Scalar, Source::kNumJoints>& config,
                     const Model& model) noexcept {
    return begin_model(config, model, [] { return Status::kOk; });
  }

  void carry(const Load& load) noexcept {
    if (load != load_) {
      load_ = load;
      body_.set_payload(load);
    }
  }

  /// M(q) (q̈_r + Kd ė + Kp e) + h(q, q̇), rotors and drives, of the links where joints are elastic.
  Status computed(const Reference& reference, const Measurement& m, Vector& tau) noexcept {
    if (const Status status = drive_.update(body_, reference, m.dt); status != Status::kOk) {
      return status;
    }
    const Vector q = m.q - drive_.deflection(), qd = m.qd - drive_.rate();
    const Vector qdd = commanded_acceleration<Scalar, Source::kNumJoints>(this->feedback_, reference, q, qd);
    body_.torque(q, qd, qdd, tau);
    for (int i = 0; i < Source::kNumJoints; ++i) {
      tau[i] += drive_.friction()[i] + drive_.torque()[i] + drive_.rotor(i) * qdd[i];
    }
    return Status::kOk;
  }

  Body body_;
  Drive drive_;

 private:
  Status set_up(const Config& config, const Model& model) noexcept {
    return is_usable_model(model) ? static_cast<Derived*>(this)->begin(config, model)
                                  : Status::kNonFiniteInput;
  }

  Load load_{};
  bool known_{false};
};

}  // namespace detail

template <typename Scalar, int N>
struct PdConfig : ControllerConfig<Scalar, N> {
  bool gravity{true};  ///< false: nothing of the arm is known, and a refused sample keeps the torque
};

/// Position-velocity feedback with gravity: τ = Kp e + Kd ė + g(q), gains in N·m/rad and N·m·s/rad.
/// @tparam Description  as of ArmTorque
template <typename Description, typename Scalar>
class PdController final
    : public detail::ModelController<PdController<Description, Scalar>,
                                     PdConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                                     Description, Scalar> {
  using Base =
      detail::ModelController<PdController, PdConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                              Description, Scalar>;

 public:
  using typename Base::Config;
  using typename Base::Measurement;
  using typename Base::Model;
  using typename Base::Reference;
  using typename Base::Step;
  using typename Base::Vector;

 private:
  friend Base;
  friend detail::ControllerFrame<PdController, Scalar, Base::kNumJoints>;

  Status begin(const Config& config, const Model& model) noexcept {
    const Status status = this->begin_model(config, model);
    gravity_ = status == Status::kOk ? config.gravity : gravity_;
    return status;
  }
  Status wanted(const Reference& reference, const Measurement& m, std::uint32_t, Vector& tau,
                Step&) noexcept {
    tau = this->feedback_.feedback(reference, m.q, m.qd);
    if (gravity_) {
      Vector gravity;
      this->body_.gravity(m.q, gravity);
      tau += gravity;
    }
    return Status::kOk;
  }
  bool holds(const Vector& q, Vector& tau) const noexcept { return gravity_ && Base::holds(q, tau); }

  bool gravity_{true};
};

/// Computed torque: τ = M(q) (q̈_r + Kd ė + Kp e) + h(q, q̇) + rotors + friction(q̇_r) + couplings and effects along the
/// reference, gains in 1/s² and 1/s. The model is that of a data sheet or of an identification; set_load() brings a known load.
template <typename Description, typename Scalar>
class ComputedTorqueController final
    : public detail::ModelController<ComputedTorqueController<Description, Scalar>,
                                     ControllerConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                                     Description, Scalar> {
  using Base = detail::ModelController<ComputedTorqueController,
                                       ControllerConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                                       Description, Scalar>;

 public:
  using typename Base::Config;
  using typename Base::Measurement;
  using typename Base::Model;
  using typename Base::Reference;
  using typename Base::Step;
  using typename Base::Vector;

 private:
  friend Base;
  friend detail::ControllerFrame<ComputedTorqueController, Scalar, Base::kNumJoints>;

  Status begin(const Config& config, const Model& model) noexcept { return this->begin_model(config, model); }
  Status wanted(const Reference& reference, const Measurement& m, std::uint32_t, Vector& tau,
                Step&) noexcept {
    return this->computed(reference, m, tau);
  }
};

namespace detail {

/// Computed torque with what an estimator finds on the way. Derived has adopt(): takes the estimator's last answer into the model.
/// A sample that the estimator refuses does not stop the loop: ControlStep::measurement.
template <typename Derived, typename Config_, typename Description, typename Scalar, typename Estimating>
class EstimatingController : public ModelController<Derived, Config_, Description, Scalar> {
  using Base = ModelController<Derived, Config_, Description, Scalar>;

 public:
  using typename Base::Config;
  using typename Base::Measurement;
  using typename Base::Model;
  using typename Base::Reference;
  using typename Base::Step;
  using typename Base::Vector;

  /// The load is the estimator's affair.
  Status set_load(const InertialParameters<Scalar>&) = delete;
  /// What the estimator did with the last sample.
  const typename Estimating::Record& observed() const noexcept { return record_; }

 protected:
  Estimating estimating_;
  typename Estimating::Record record_{};

 private:
  friend Base;
  friend ControllerFrame<Derived, Scalar, Base::kNumJoints>;

  Status begin(const Config& config, const Model& model) noexcept {
    typename Estimating::Config settings = config.settings();
    settings.torque_limit = settings.torque_limit.cwiseMin(config.torque_limit);
    return this->begin_model(config, model, [&] {
      if constexpr (ArmSource<Description>::kIsStatic) {
        return estimating_.configure(settings);
      } else {
        return estimating_.configure(model, settings);
      }
    });
  }
  template <typename Part>
  Status add_part(const Part& part) noexcept {
    // The stricter one first: what the reference drive takes, the estimator takes.
    const Status status = Base::add_part(part);
    return status == Status::kOk ? estimating_.add(part) : status;
  }
  void tilt(const std::array<Scalar, 3>& gravity) noexcept {
    static_cast<void>(estimating_.set_gravity(gravity));
  }
  void warm(const Vector& temperature) noexcept { estimating_.set_temperature(temperature); }
  void see(const Measurement& m) noexcept {
    Base::see(m);
    static_cast<void>(estimate(m));
  }
  Status wanted(const Reference& reference, const Measurement& m, std::uint32_t, Vector& tau,
                Step& step) noexcept {
    step.measurement = estimate(m);
    return this->computed(reference, m, tau);
  }
  Status estimate(const Measurement& m) noexcept {
    const Status status = estimating_.update(m.q, m.qd, m.tau, m.dt, record_, m.cut);
    static_cast<Derived*>(this)->adopt();
    return status;
  }
};

}  // namespace detail

template <typename Description, typename Scalar>
struct LoadEstimatingConfig : ControllerConfig<Scalar, detail::ArmSource<Description>::kNumJoints> {
  /// Its torque_limit is the smaller one of its own and the controller's.
  typename LoadObserver<Description, Scalar>::Config observer{};
  const auto& settings() const noexcept { return observer; }
};

/// Computed torque with the load that a LoadObserver finds on the way.
template <typename Description, typename Scalar>
class LoadEstimatingController final
    : public detail::EstimatingController<LoadEstimatingController<Description, Scalar>,
                                          LoadEstimatingConfig<Description, Scalar>, Description, Scalar,
                                          LoadObserver<Description, Scalar>> {
  using Base =
      detail::EstimatingController<LoadEstimatingController, LoadEstimatingConfig<Description, Scalar>,
                                   Description, Scalar, LoadObserver<Description, Scalar>>;

 public:
  using Observer = LoadObserver<Description, Scalar>;

  const Observer& observer() const noexcept { return this->estimating_; }
  /// attach() and detach() declare a change of load.
  Observer& observer() noexcept { return this->estimating_; }

 private:
  friend Base;

  void adopt() noexcept { this->carry(this->estimating_.load()); }
};

template <typename Description, typename Scalar>
struct ArmEstimatingConfig : ControllerConfig<Scalar, detail::ArmSource<Description>::kNumJoints> {
  /// Its torque_limit is the smaller one of its own and the controller's.
  typename ArmEstimator<Description, Scalar>::Config estimator{};
  const auto& settings() const noexcept { return estimator; }
};

/// Computed torque with links, friction and load as an ArmEstimator finds them on the way: for a model that is roughly right.
/// @tparam Description  RunTimeArm<N, ...>
template <typename Description, typename Scalar>
class ArmEstimatingController final
    : public detail::EstimatingController<ArmEstimatingController<Description, Scalar>,
                                          ArmEstimatingConfig<Description, Scalar>, Description, Scalar,
                                          ArmEstimator<Description, Scalar>> {
  using Base = detail::EstimatingController<ArmEstimatingController, ArmEstimatingConfig<Description, Scalar>,
                                            Description, Scalar, ArmEstimator<Description, Scalar>>;

 public:
  using Estimator = ArmEstimator<Description, Scalar>;

  const Estimator& estimator() const noexcept { return this->estimating_; }
  /// attach() and detach() declare a change of load.
  Estimator& estimator() noexcept { return this->estimating_; }

 private:
  friend Base;

  void adopt() noexcept {
    if (this->record_.new_estimate) {
      this->body_.set_model(this->estimating_.model());
      this->drive_.set_friction(this->estimating_.model().actuation);
    }
  }
};

/// Of ControllerConfig the gains are not used; the torque limits are those of `law`.
template <typename Scalar, int N>
struct AdaptiveArmConfig : ControllerConfig<Scalar, N> {
  typename AdaptiveController<Scalar, N>::Config law{};
};

/// Slotine and Li's law for an unknown load, see AdaptiveController, with the friction and effects of the model fed forward. It
/// needs no measured torque.
template <typename Description, typename Scalar>
class AdaptiveArmController final
    : public detail::ModelController<AdaptiveArmController<Description, Scalar>,
                                     AdaptiveArmConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                                     Description, Scalar> {
  using Base = detail::ModelController<AdaptiveArmController,
                                       AdaptiveArmConfig<Scalar, detail::ArmSource<Description>::kNumJoints>,
                                       Description, Scalar>;

 public:
  using typename Base::Load;
  using typename Base::Measurement;
  using typename Base::Model;
  using typename Base::Reference;
  using typename Base::Step;
  using typename Base::Vector;
  using Law = AdaptiveController<Scalar, Base::kNumJoints>;
  using typename Base::Config;

  /// See AdaptiveController::set_load.
  Status set_load(const Load& load) noexcept { return law_.set_load(load); }
  const Load& load() const noexcept { return law_.load(); }
  const Law& law() const noexcept { return law_; }
  /// What the law did in the last cycle.
  const typename Law::Record& adaptation() const noexcept { return record_; }

 private:
  friend Base;
  friend detail::ControllerFrame<AdaptiveArmController, Scalar, Base::kNumJoints>;

  Status begin(Config config, const Model& model) noexcept {
    config.torque_limit = config.law.torque_limit;
    const Status status = this->begin_model(config, model, [&] { return law_.configure(config.law, model); });
    if (status == Status::kOk) {
      take_rotors();
    }
    return status;
  }
  template <typename Part>
  Status add_part(const Part& part) noexcept {
    const Status status = Base::add_part(part);
    take_rotors();
    return status;
  }
  /// Effects and elastic joints bring motors of their own.
  void take_rotors() noexcept {
    Vector rotors;
    for (int i = 0; i < Base::kNumJoints; ++i) {
      rotors[i] = this->drive_.rotor(i);
    }
    law_.set_rotors(rotors);
  }
  Status wanted(const Reference& reference, const Measurement& m, std::uint32_t cut, Vector& tau,
                Step& step) noexcept {
    if (this->drive_.needed()) {
      this->carry(law_.load());
    }
    if (const Status status = this->drive_.update(this->body_, reference, m.dt); status != Status::kOk) {
      return status;
    }
    const Status status =
        law_.update(reference, m.q - this->drive_.deflection(), m.qd - this->drive_.rate(),
                    this->drive_.friction() + this->drive_.torque(), m.dt, tau, record_, cut);
    step.limited = record_.limited;
    return status;
  }
  void tilt(const std::array<Scalar, 3>& gravity) noexcept { law_.set_gravity(gravity); }
  bool holds(const Vector& q, Vector& tau) noexcept {
    this->carry(law_.load());
    return Base::holds(q, tau);
  }

  Law law_;
  typename Law::Record record_{};
};

}  // namespace heft
