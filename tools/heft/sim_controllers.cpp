#include "sim_controllers.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::tools {
namespace {

/// Scale of the smooth Coulomb sign in feed-forward and residual [rad/s, m/s].
constexpr double kSignWidth = 0.02;

/// Slower than this the sign of friction is not known [rad/s, m/s].
constexpr double kUncertainSpeed = 0.06;

/// Effects of a model that a controller has room for.
constexpr int kMaxEffects = 64;

/// The robot with what has a place in its actuation put there: rotor inertia, offset, motors behind elastic joints.
model::Robot with_actuation_of_effects(model::Robot robot) {
  std::vector<JointEffect<double>> others;
  for (const JointEffect<double>& effect : robot.effects) {
    JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(effect.joint)].actuation;
    if (effect.kind == joint_effect_kind<RotorInertia>()) {
      actuation.rotor_inertia += effect.parameters[0];
    } else if (effect.kind == joint_effect_kind<Offset>()) {
      actuation.friction_offset += effect.parameters[0];
    } else {
      others.push_back(effect);
    }
  }
  robot.effects = std::move(others);
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    robot.joints[static_cast<std::size_t>(elasticity.joint)].actuation.rotor_inertia +=
        elasticity.motor_inertia;
  }
  return robot;
}

template <int N>
EffectFeedForward<double, N, kMaxEffects> effects_of(const model::Robot& robot) {
  EffectFeedForward<double, N, kMaxEffects> effects;
  for (const JointEffect<double>& effect : robot.effects) {
    if (effects.add(effect) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: robot \"{}\" has {} effects on {} joints; expected at most {}, each "
                      "of a joint and with finite values",
                      robot.name, robot.effects.size(), N, kMaxEffects));
    }
  }
  return effects;
}

/// Adds the torque of gear couplings.
template <typename Vector>
void add_couplings(const std::vector<GearCoupling<double>>& couplings, const Vector& qd, const Vector& qdd,
                   Vector& tau) {
  for (const GearCoupling<double>& coupling : couplings) {
    const double shared = gear_coupling_torque(
        coupling, shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]),
        shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]), kSignWidth);
    tau[coupling.driven] += shared;
    tau[coupling.driving] += coupling.ratio * shared;
  }
}

/// What a model holds beyond rigid bodies and declared friction, along the reference: joint effects, gear couplings
/// and where the motors of elastic joints have to be for the links to follow.
template <int N>
class ModelFeedForward {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;

  /// @param friction  false leaves out declared friction, and with it what scales it
  ModelFeedForward(const model::Robot& nominal, bool friction)
      : nominal_(model::to_arm_model<N>(nominal)),
        actuation_(nominal_.model().actuation),
        couplings_(nominal.couplings),
        elasticities_(nominal.elasticities),
        effects_(effects_of<N>(nominal)) {
    if (friction) return;
    for (JointActuation<double>& actuation : actuation_) actuation = {actuation.rotor_inertia, 0, 0, 0};
  }

  bool needed() const { return effects_.count() > 0 || !couplings_.empty() || !elasticities_.empty(); }

  /// Takes the next point of the reference.
  /// @param arm  with the load that is believed to be there
  Status update(double time, double sample_time, const Arm& arm, const JointReference<double, N>& reference) {
    const Vector load = inverse_dynamics(arm, reference.q, reference.qd, reference.qdd);
    deflection = rate = acceleration = Vector::Zero();
    if (!elasticities_.empty()) {
      // θ = x + τ/K. An estimated load comes in steps: the derivatives are those of the nominal arm.
      const Vector steady = inverse_dynamics(nominal_, reference.q, reference.qd, reference.qdd);
      const Vector change =
          points_ > 0 ? Vector((steady - last_load_) / sample_time) : Vector(Vector::Zero());
      const Vector change_of_change =
          points_ > 1 ? Vector((change - last_change_) / sample_time) : Vector(Vector::Zero());
      last_load_ = steady;
      last_change_ = change;
      ++points_;
      for (const Elasticity<double>& elasticity : elasticities_) {
        const int j = elasticity.joint;
        deflection[j] = load[j] / elasticity.stiffness;
        rate[j] = change[j] / elasticity.stiffness;
        acceleration[j] = change_of_change[j] / elasticity.stiffness;
      }
    }
    const Vector q = reference.q + deflection, qd = reference.qd + rate, qdd = reference.qdd + acceleration;
    torque = Vector::Zero();
    for (const Elasticity<double>& elasticity : elasticities_) {
      const int j = elasticity.joint;
      torque[j] += actuation_[static_cast<std::size_t>(j)].rotor_inertia * acceleration[j];
    }
    add_couplings(couplings_, qd, qdd, torque);
    return effects_.add_torque(time, q, qd, qdd, load, actuation_, kSignWidth, torque);
  }

  // Of the last point.
  Vector torque = Vector::Zero();      ///< beyond rigid bodies, rotors and declared friction
  Vector deflection = Vector::Zero();  ///< motor before link [rad, m]
  Vector rate = Vector::Zero();        ///< its derivatives
  Vector acceleration = Vector::Zero();

 private:
  Arm nominal_;
  std::array<JointActuation<double>, static_cast<std::size_t>(N)> actuation_;
  std::vector<GearCoupling<double>> couplings_;
  std::vector<Elasticity<double>> elasticities_;
  EffectFeedForward<double, N, kMaxEffects> effects_;
  Vector last_load_ = Vector::Zero(), last_change_ = Vector::Zero();
  int points_{0};
};

/// The load, sample by sample: filters, residual of the nominal arm, recursion, change detection.
///
/// Motion comes from encoder positions through the state-variable filter; the torque, with the friction that the
/// nominal arm predicts taken off, passes the same filter and keeps the same delay. Friction is taken off before
/// the filter because a filtered sign is not the sign of a filtered velocity.
template <int N>
class LoadObserver {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;
  using Estimator = PayloadEstimator<double, N>;

  LoadObserver(const model::Robot& nominal, const TrackingSettings& settings,
               std::shared_ptr<LoadTrace> trace)
      : settings_(settings),
        arm_(model::to_arm_model<N>(nominal)),
        trace_(std::move(trace)),
        couplings_(nominal.couplings),
        effects_(effects_of<N>(nominal)) {
    double weight = 0, reach = 0;
    for (const model::RobotJoint& joint : nominal.joints) {
      weight += joint.link[kMass];
      reach += std::hypot(joint.joint.position[0], joint.joint.position[1], joint.joint.position[2]);
    }
    const double mass_prior = settings.mass_prior > 0 ? settings.mass_prior : std::max(0.01, weight / 3);
    typename Estimator::Config config;
    config.first_row = settings.rows - 1;
    config.mass_prior = mass_prior;
    config.length_prior = std::max(0.02, 0.1 * reach);
    farthest_ = std::max(0.1, 0.5 * reach);
    config.gate = 0;
    config.forgetting_factor = 1.0;  // a change starts it afresh
    config.sign_width = kSignWidth;
    // What friction of the last joint a load may change: half of what it has.
    const auto& last = nominal.joints.back().actuation;
    config.friction_prior = std::max(1e-6, 0.5 * last.coulomb_friction);
    for (int i = 0; i < N; ++i) {
      const auto& actuation = nominal.joints[static_cast<std::size_t>(i)].actuation;
      const double guess = settings.noise.size() == N
                               ? settings.noise[i]
                               : 0.05 * actuation.coulomb_friction + 2e-4 * 9.81 * weight;
      noise_[i] = std::max(guess, 1e-9);
      config.noise_std[i] = noise_[i];
    }
    variance_ = noise_.cwiseAbs2();
    if (estimator_.configure(config) != Status::kOk || motion_.configure(settings.filter_hz) != Status::kOk ||
        torque_.configure(settings.filter_hz) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: estimator settings k = {}, filter {} Hz, mass prior {} kg: expected k from "
                      "1 to {} and positive values",
                      settings.rows, settings.filter_hz, mass_prior, N));
    }
    // As configured, for starting afresh: the factors are diagonal still.
    for (int i = 0; i < Estimator::kParameters; ++i) {
      prior_variance_[static_cast<std::size_t>(i)] = estimator_.estimator().variance(i);
    }
    settle_time_ = 10.0 / (2.0 * std::numbers::pi * settings.filter_hz);
    quiet_until_ = 2 * settle_time_;
  }

  /// The load to be carried by the model, in the last link frame.
  const InertialParameters<double>& load() const { return carried_; }

  void sample(const sim::Measurement& m) {
    const Vector q = m.q, qd = m.qd, tau = m.tau;
    if (!started_) {
      previous_q_ = q;
      previous_qd_ = qd;
      started_ = true;
      decimation_ = std::max(1, static_cast<int>(std::lround(1.0 / (m.sample_time * settings_.update_rate))));
      return;
    }
    // The reported torque acted between the two samples: everything is taken half-way.
    const Vector middle_q = 0.5 * (q + previous_q_);
    const Vector middle_qd = 0.5 * (qd + previous_qd_);
    previous_q_ = q;
    previous_qd_ = qd;
    Vector rigid = tau;
    const double forget = std::exp(-m.sample_time * 2 * std::numbers::pi * settings_.filter_hz / 3);
    for (int i = 0; i < N; ++i) {
      // Around a reversal and at rest friction is anything between its two levels; the filter remembers that.
      doubt_[i] = std::abs(middle_qd[i]) < kUncertainSpeed ? 1.0 : doubt_[i] * forget;
      rigid[i] -=
          friction_torque(arm_.model().actuation[static_cast<std::size_t>(i)], middle_qd[i], kSignWidth);
    }
    if (effects_.count() > 0 || !couplings_.empty()) {
      const Vector zero = Vector::Zero();
      Vector known = zero;
      add_couplings(couplings_, middle_qd, zero, known);
      const Vector load = inverse_dynamics(arm_, middle_q, middle_qd, zero);
      if (effects_.add_torque(m.time, middle_q, middle_qd, zero, load, arm_.model().actuation, kSignWidth,
                              known) != Status::kOk)
        return;
      rigid -= known;
    }
    if (motion_.update(middle_q, m.sample_time) != Status::kOk ||
        torque_.update(rigid, m.sample_time) != Status::kOk)
      return;
    if (++count_ % decimation_ != 0) return;
    estimate(m.time);
  }

 private:
  void estimate(double time) {
    const Vector& q = motion_.value();
    const Vector& qd = motion_.derivative();
    const Vector& qdd = motion_.second_derivative();
    Vector residual = torque_.value() - inverse_dynamics(arm_, q, qd, qdd);
    for (int i = 0; i < N; ++i) {
      residual[i] -= arm_.model().actuation[static_cast<std::size_t>(i)].rotor_inertia * qdd[i];
    }
    for (const GearCoupling<double>& coupling : couplings_) {
      const double shared =
          coupling.rotor_inertia * shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
      residual[coupling.driven] -= shared;
      residual[coupling.driving] -= coupling.ratio * shared;
    }
    if (time < quiet_until_) return record(time);
    if (reset_due_) {
      // The filters hold the new load only from here on. Nothing is known of it; the model keeps the old one until
      // something is.
      (void)estimator_.estimator().configure({}, {}, prior_variance_);
      reset_due_ = false;
      since_reset_ = 0;
      surprise_ = 1;
      unexplained_ = whole_ = 0;
    }
    LinkRegressor<double, N> Y;
    link_regressor(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, Y);
    double ratio = 0, unexplained = 0, whole = 0;
    for (int i = settings_.rows - 1; i < N; ++i) {
      const typename Estimator::Estimator::Row row = estimator_.row(Y, qd, i);
      typename Estimator::Estimator::Record taken;
      const double friction =
          0.5 * doubt_[i] * arm_.model().actuation[static_cast<std::size_t>(i)].coulomb_friction;
      if (estimator_.estimator().update(row, residual[i], variance_[i] + friction * friction, taken) !=
          Status::kOk)
        return;
      unexplained += taken.innovation * taken.innovation / (variance_[i] + friction * friction);
      whole += residual[i] * residual[i] / (variance_[i] + friction * friction);
      // Cut, so that one outlier alone cannot look like another load.
      ratio += std::min(200.0, taken.innovation * taken.innovation / taken.innovation_variance);
      if (doubt_[i] < 0.1) learn_noise(i, taken);
    }
    ratio /= N - settings_.rows + 1;
    // Innovations several times their size over some updates: another load.
    surprise_ += 0.2 * (ratio - surprise_);
    ++since_reset_;
    unexplained_ += 0.02 * (unexplained - unexplained_);
    whole_ += 0.02 * (whole - whole_);
    // Loads do not come and go several times a second: what does is something that no load explains.
    if (surprise_ > 20 && since_reset_ > 100) {
      quiet_until_ = time + settle_time_;
      reset_due_ = true;
      if (trace_) trace_->change.push_back(time);
    }
    carry();
    record(time);
  }

  /// The residual's size and correlation, slowly, from innovations cut at three deviations.
  void learn_noise(int i, const typename Estimator::Estimator::Record& taken) {
    if (since_reset_ < 20) return;
    const double size = std::sqrt(taken.innovation_variance);
    const double cut = std::clamp(taken.innovation, -3 * size, 3 * size);
    const double share = std::max(1.0 / (1.0 + learned_[i]), 0.01);
    learned_[i] += 1;
    power_[i] += share * (cut * cut - power_[i]);
    product_[i] += share * (cut * last_innovation_[i] - product_[i]);
    last_innovation_[i] = cut;
    if (learned_[i] > 30) variance_[i] = std::max(power_[i], 0.25 * noise_[i] * noise_[i]);
  }

  /// How much wider the intervals are than those of white residuals: (1 + ρ)/(1 − ρ) of a first-order process.
  double widening() const {
    double factor = 0;
    for (int i = settings_.rows - 1; i < N; ++i) {
      const double rho = power_[i] > 0 ? std::clamp(product_[i] / power_[i], 0.0, 0.95) : 0.0;
      factor = std::max(factor, (1 + rho) / (1 - rho));
    }
    return std::sqrt(factor);
  }

  /// Takes the estimate over into the model, softly, once it has been fed for a while; a load whose mass cannot be
  /// told from nothing is none.
  void carry() {
    if (since_reset_ < 12) return;
    InertialParameters<double> load = estimator_.payload();
    if (load[kMass] < 4 * widening() * estimator_.standard_deviation(0) || unexplained_ > 0.5 * whole_)
      load = {};
    make_physical(load);
    for (std::size_t i = 0; i < load.size(); ++i) carried_[i] += 0.2 * (load[i] - carried_[i]);
  }

  /// A body that can be: centre of mass within reach, inertia about it with moments that a body can have. Early estimates
  /// need not be one, and feedback through an inertia that cannot be is unstable.
  void make_physical(InertialParameters<double>& p) const {
    const double m = p[kMass];
    if (!(m > 0)) {
      p = {};
      return;
    }
    Eigen::Vector3d c(p[kMcx] / m, p[kMcy] / m, p[kMcz] / m);
    const bool far = c.norm() > farthest_;
    if (far) c *= farthest_ / c.norm();
    const Eigen::Matrix3d steiner = m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
    Eigen::Matrix3d about;
    about << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
    const Eigen::Matrix3d central = about - steiner;
    // Second moments ½ tr(I) E − I: none below zero, none beyond the farthest point.
    const Eigen::Matrix3d second = 0.5 * central.trace() * Eigen::Matrix3d::Identity() - central;
    const Eigensystem principal = eigensystem_of(second);
    const Eigen::Vector3d moments = principal.values.cwiseMax(0.0).cwiseMin(m * farthest_ * farthest_ / 4);
    const Eigen::Matrix3d axes = principal.vectors;
    const Eigen::Matrix3d cleaned = axes * moments.asDiagonal() * axes.transpose();
    const Eigen::Matrix3d inertia = cleaned.trace() * Eigen::Matrix3d::Identity() - cleaned + steiner;
    p = {m,
         m * c[0],
         m * c[1],
         m * c[2],
         inertia(0, 0),
         inertia(0, 1),
         inertia(1, 1),
         inertia(0, 2),
         inertia(1, 2),
         inertia(2, 2)};
  }

  void record(double time) {
    if (!trace_) return;
    const InertialParameters<double> load = estimator_.payload();
    const double wide = statistics::kNormal95 * widening();
    const bool unclear = reset_due_ || time < quiet_until_;
    const double half = unclear ? kNaN : wide * estimator_.standard_deviation(0);
    trace_->time.push_back(time);
    trace_->mass.push_back(unclear ? kNaN : load[kMass]);
    trace_->mass_half_width.push_back(half);
    std::array<double, 3> com{kNaN, kNaN, kNaN}, com_half{kNaN, kNaN, kNaN};
    if (std::abs(load[kMass]) > 3 * half) {
      for (std::size_t a = 0; a < 3; ++a) {
        com[a] = load[kMcx + a] / load[kMass];
        typename Estimator::Estimator::Row row{};
        row[kMass] = -com[a] / load[kMass];
        row[kMcx + a] = 1 / load[kMass];
        com_half[a] = wide * std::sqrt(estimator_.estimator().variance(row));
      }
    }
    trace_->com.push_back(com);
    trace_->com_half_width.push_back(com_half);
  }

  TrackingSettings settings_;
  Arm arm_;
  std::shared_ptr<LoadTrace> trace_;
  std::vector<GearCoupling<double>> couplings_;
  EffectFeedForward<double, N, kMaxEffects> effects_;
  Estimator estimator_;
  StateVariableFilter<double, N> motion_, torque_;
  typename Estimator::Row prior_variance_{};
  Vector noise_ = Vector::Ones(), variance_ = Vector::Ones();
  Vector power_ = Vector::Zero(), product_ = Vector::Zero(), last_innovation_ = Vector::Zero(),
         learned_ = Vector::Zero();
  Vector doubt_ = Vector::Ones();
  Vector previous_q_ = Vector::Zero(), previous_qd_ = Vector::Zero();
  InertialParameters<double> carried_{};
  double settle_time_{0}, quiet_until_{0}, surprise_{1}, unexplained_{0}, whole_{0}, farthest_{0.5};
  long count_{0};
  int decimation_{1}, since_reset_{0};
  bool started_{false}, reset_due_{false};
};

template <int N>
class TrackingController final : public sim::Controller {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;

  TrackingController(TrackingMethod method, const model::Robot& nominal, const TrackingSettings& settings,
                     std::shared_ptr<LoadTrace> trace)
      : method_(method),
        nominal_(model::to_arm_model<N>(nominal)),
        arm_(nominal_),
        beyond_(nominal, settings.friction_feed_forward) {
    const double w = 2 * std::numbers::pi * settings.bandwidth_hz;
    typename JointFeedback<double, N>::Config config;
    const bool scaled = method == TrackingMethod::kPd || method == TrackingMethod::kPdGravity;
    const Vector inertia = scaled ? Vector(settings.inertia) : Vector(Vector::Ones());
    config.stiffness = inertia * (w * w);
    config.damping = inertia * (2 * settings.damping_ratio * w);
    if (settings.torque_limit.size() == N) config.torque_limit = settings.torque_limit.cwiseMin(1e30);
    if (feedback_.configure(config) != Status::kOk) {
      throw ModelError(fmt::format(
          "tracking: bandwidth {} Hz, damping ratio {}: expected positive values and torque limits "
          "above zero",
          settings.bandwidth_hz, settings.damping_ratio));
    }
    friction_.sign_width = kSignWidth;
    if (settings.friction_feed_forward) {
      for (int i = 0; i < N; ++i) {
        const auto& actuation = nominal_.actuation[static_cast<std::size_t>(i)];
        friction_.coulomb[i] = actuation.coulomb_friction;
        friction_.viscous[i] = actuation.viscous_friction;
        friction_.offset[i] = actuation.friction_offset;
      }
    }
    if (method == TrackingMethod::kEstimated) {
      observer_ = std::make_unique<LoadObserver<N>>(nominal, settings, std::move(trace));
    }
  }

  void control(double t, const sim::Measurement& m, Eigen::Ref<Eigen::VectorXd> torque) override {
    JointReference<double, N> reference;
    reference.q = m.q_ref;
    reference.qd = m.qd_ref;
    reference.qdd = m.qdd_ref;
    const Vector q = m.q, qd = m.qd;
    Vector tau = Vector::Zero();
    ControlRecord record;
    Status status = Status::kOk;
    if (method_ == TrackingMethod::kPd || method_ == TrackingMethod::kPdGravity) {
      Vector wanted = feedback_.feedback(reference, q, qd);
      if (method_ == TrackingMethod::kPdGravity) {
        Vector gravity;
        gravity_torque(arm_, joint_trigonometry<Arm>(q), q, gravity);
        wanted += gravity;
      }
      status = feedback_.limit(wanted, tau, record);
    } else {
      if (observer_) {
        observer_->sample(m);
        InertialParameters<double> last = nominal_.links[N - 1];
        for (std::size_t i = 0; i < last.size(); ++i) last[i] += observer_->load()[i];
        arm_.set_link(N - 1, last);
      }
      status = beyond_.needed() ? extended(t, m.sample_time, reference, q, qd, tau, record)
                                : computed_torque(feedback_, arm_, friction_, reference, q, qd, tau, record);
    }
    // A measurement that is not finite leaves the torque as it was.
    if (status == Status::kOk) torque = tau;
  }

 private:
  /// Computed torque for the links of elastic joints, everything else that the model holds fed forward.
  Status extended(double t, double sample_time, const JointReference<double, N>& reference, const Vector& q,
                  const Vector& qd, Vector& tau, ControlRecord& record) {
    if (const Status status = beyond_.update(t, sample_time, arm_, reference); status != Status::kOk)
      return status;
    // The encoders sit on the motors; the links are where the reference's torque bends the joints to.
    const Vector link_q = q - beyond_.deflection, link_qd = qd - beyond_.rate;
    const Vector qdd = commanded_acceleration<double, N>(feedback_, reference, link_q, link_qd);
    Vector wanted = inverse_dynamics(arm_, link_q, link_qd, qdd) +
                    friction_.torque(reference.qd + beyond_.rate) + beyond_.torque;
    for (int i = 0; i < N; ++i) {
      wanted[i] += nominal_.actuation[static_cast<std::size_t>(i)].rotor_inertia * qdd[i];
    }
    return feedback_.limit(wanted, tau, record);
  }

  TrackingMethod method_;
  ArmModel<double, N> nominal_;
  Arm arm_;
  ModelFeedForward<N> beyond_;
  JointFeedback<double, N> feedback_;
  FrictionFeedForward<double, N> friction_;
  std::unique_ptr<LoadObserver<N>> observer_;
};

template <int N>
std::shared_ptr<sim::Controller> make_sized(TrackingMethod method, const model::Robot& nominal,
                                            const TrackingSettings& settings,
                                            std::shared_ptr<LoadTrace> trace) {
  if constexpr (N > model::kMaxJoints) {
    throw ModelError(fmt::format("robot \"{}\" has {} joints; heft handles 1 to {}", nominal.name,
                                 nominal.num_joints(), model::kMaxJoints));
  } else {
    if (nominal.num_joints() == N) {
      return std::make_shared<TrackingController<N>>(method, nominal, settings, std::move(trace));
    }
    return make_sized<N + 1>(method, nominal, settings, std::move(trace));
  }
}

}  // namespace

const char* to_string(TrackingMethod method) {
  switch (method) {
    case TrackingMethod::kPd: return "PD";
    case TrackingMethod::kPdGravity: return "PD + gravity";
    case TrackingMethod::kComputedTorque: return "computed torque, nominal";
    case TrackingMethod::kEstimated: return "computed torque, estimated";
  }
  return "unknown";
}

double LoadTrace::settled_at() const {
  const double from = change.empty() ? 0.0 : change.back();
  double last = kNaN;
  for (std::size_t k = mass.size(); k-- > 0 && time[k] > from;) {
    if (!std::isfinite(mass[k])) break;
    if (!std::isfinite(last)) last = mass[k];
    if (std::abs(mass[k] - last) > 0.05 * std::abs(last)) return k + 1 < time.size() ? time[k + 1] : kNaN;
    if (k == 0 || time[k - 1] <= from || !std::isfinite(mass[k - 1])) return time[k];
  }
  return kNaN;
}

Eigen::VectorXd mean_inertia(const model::Robot& robot, const sim::Reference& reference, double duration) {
  const model::Dynamics dynamics(robot);
  const int n = robot.num_joints();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n), q(n), qd(n), qdd(n);
  constexpr int kPoints = 50;
  for (int k = 0; k < kPoints; ++k) {
    reference.evaluate(duration * k / kPoints, q, qd, qdd);
    sum += dynamics.mass_matrix(q).diagonal();
  }
  sum /= kPoints;
  for (int i = 0; i < n; ++i) sum[i] += robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  return sum;
}

std::shared_ptr<sim::Controller> make_tracking_controller(TrackingMethod method, const model::Robot& nominal,
                                                          const TrackingSettings& settings,
                                                          std::shared_ptr<LoadTrace> trace) {
  return make_sized<1>(method, with_actuation_of_effects(nominal), settings, std::move(trace));
}

}  // namespace heft::tools
