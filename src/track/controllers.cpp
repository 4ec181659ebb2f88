#include "heft/track/controllers.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/control/adaptive_controller.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/sized.hpp"
#include "load_observer.hpp"
#include "model_feed_forward.hpp"

namespace heft::track {
namespace {

/// Where a property is taken along a reference.
constexpr int kPoints = 50;
/// Least of ControllerSettings::load_response that a gain is made for, 1 kg at 0.2 m on a joint of 1 kg·m² [m²/s⁴/kg]: what is
/// felt less needs no faster adaptation.
constexpr double kLeastResponse = 4.0;

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
class TrackingController final : public sim::Controller {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;

  TrackingController(Method method, const model::Robot& nominal, const ControllerSettings& settings,
                     std::shared_ptr<LoadTrace> trace)
      : method_(method),
        nominal_(model::to_arm_model<N>(nominal)),
        arm_(nominal_),
        beyond_(nominal, settings.friction_feed_forward) {
    const double w = 2 * std::numbers::pi * settings.bandwidth_hz;
    typename JointFeedback<double, N>::Config config;
    const bool scaled = method == Method::kPd || method == Method::kPdGravity;
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
    if (method == Method::kEstimated) {
      observer_ = std::make_unique<LoadObserver<N>>(nominal, settings, std::move(trace));
    }
    if (method == Method::kAdaptive) set_up_adaptation(settings, config.torque_limit);
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
    if (method_ == Method::kAdaptive) {
      status = adaptive(t, m.sample_time, reference, q, qd, tau);
    } else if (method_ == Method::kPd || method_ == Method::kPdGravity) {
      Vector wanted = feedback_.feedback(reference, q, qd);
      if (method_ == Method::kPdGravity) {
        Vector gravity;
        gravity_torque(arm_, joint_trigonometry<Arm>(q), q, gravity);
        wanted += gravity;
      }
      status = feedback_.limit(wanted, tau, record);
    } else {
      if (observer_) {
        // A refused sample leaves the load as it was.
        static_cast<void>(observer_->sample(m));
        carry(observer_->load());
      }
      status = beyond_.needed() ? extended(t, m.sample_time, reference, q, qd, tau, record)
                                : computed_torque(feedback_, arm_, friction_, reference, q, qd, tau, record);
    }
    // A measurement that is not finite leaves the torque as it was.
    if (status == Status::kOk) torque = tau;
  }

 private:
  /// Poles of the error as computed torque has them. They are real, so that a damping ratio below 1 counts as 1.
  void set_up_adaptation(const ControllerSettings& settings, const Vector& torque_limit) {
    const double w = 2 * std::numbers::pi * settings.bandwidth_hz;
    const double damping = std::max(1.0, settings.damping_ratio);
    const double apart = std::sqrt(damping * damping - 1);
    typename AdaptiveController<double, N>::Config config;
    config.position_rate.setConstant(w * (damping - apart));
    config.damping_rate = w * (damping + apart);
    config.torque_limit = torque_limit;
    // The fastest that brings the mass in without overshoot.
    config.mass_gain =
        config.damping_rate * config.damping_rate / (4 * std::max(kLeastResponse, settings.load_response));
    if (adaptation_.configure(config, nominal_) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: adaptive control with bandwidth {} Hz, damping ratio {}: expected positive "
                      "values and a model with finite numbers",
                      settings.bandwidth_hz, settings.damping_ratio));
    }
  }

  /// Puts a load on the last link of the arm that the model is.
  void carry(const InertialParameters<double>& load) {
    InertialParameters<double> last = nominal_.links[N - 1];
    for (std::size_t i = 0; i < last.size(); ++i) last[i] += load[i];
    arm_.set_link(N - 1, last);
  }

  /// Adaptive control of the links, everything else that the model holds fed forward.
  Status adaptive(double t, double sample_time, const JointReference<double, N>& reference, const Vector& q,
                  const Vector& qd, Vector& tau) {
    if (beyond_.needed()) {
      carry(adaptation_.load());
      if (const Status status = beyond_.update(t, sample_time, arm_, reference); status != Status::kOk)
        return status;
    }
    typename AdaptiveController<double, N>::Record record;
    return adaptation_.update(reference, q - beyond_.deflection, qd - beyond_.rate,
                              friction_.torque(reference.qd + beyond_.rate) + beyond_.torque, sample_time,
                              tau, record);
  }

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

  Method method_;
  ArmModel<double, N> nominal_;
  Arm arm_;
  ModelFeedForward<N> beyond_;
  JointFeedback<double, N> feedback_;
  FrictionFeedForward<double, N> friction_;
  std::unique_ptr<LoadObserver<N>> observer_;
  AdaptiveController<double, N> adaptation_;
};

}  // namespace

const char* to_string(Method method) {
  switch (method) {
    case Method::kPd: return "PD";
    case Method::kPdGravity: return "PD + gravity";
    case Method::kComputedTorque: return "computed torque, nominal";
    case Method::kEstimated: return "computed torque, estimated";
    case Method::kAdaptive: return "adaptive";
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
  for (int k = 0; k < kPoints; ++k) {
    reference.evaluate(duration * k / kPoints, q, qd, qdd);
    sum += dynamics.mass_matrix(q).diagonal();
  }
  sum /= kPoints;
  for (int i = 0; i < n; ++i) sum[i] += robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  return sum;
}

double load_response(const model::Robot& robot, const sim::Reference& reference, double duration) {
  model::Robot loaded = robot;
  loaded.joints.back().link[kMass] += 1.0;
  const model::Dynamics bare(robot), carrying(loaded);
  const int n = robot.num_joints();
  Eigen::VectorXd q(n), qd(n), qdd(n), rotor(n);
  for (int i = 0; i < n; ++i) rotor[i] = robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  double largest = 0;
  for (int k = 0; k < kPoints; ++k) {
    reference.evaluate(duration * k / kPoints, q, qd, qdd);
    const Eigen::VectorXd felt = carrying.inverse_dynamics(q, qd, qdd) - bare.inverse_dynamics(q, qd, qdd);
    const Eigen::VectorXd inertia = bare.mass_matrix(q).diagonal() + rotor;
    largest = std::max(largest, (felt.array().square() / inertia.array()).sum());
  }
  return largest;
}

std::shared_ptr<sim::Controller> make_controller(Method method, const model::Robot& nominal,
                                                 const ControllerSettings& settings,
                                                 std::shared_ptr<LoadTrace> trace) {
  const model::Robot arm = with_actuation_of_effects(nominal);
  return model::with_joint_count(
      arm.num_joints(), arm.name, [&](auto joints) -> std::shared_ptr<sim::Controller> {
        return std::make_shared<TrackingController<decltype(joints)::value>>(method, arm, settings, trace);
      });
}

}  // namespace heft::track
