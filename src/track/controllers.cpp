#include "heft/track/controllers.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/control/arm_controllers.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/run_time_arm.hpp"
#include "heft/model/sized.hpp"
#include "heft/sim/core_controller.hpp"
#include "load_trace.hpp"

namespace heft::track {
namespace {

/// Scale of the smooth Coulomb sign in feed-forward and residual [rad/s, m/s].
constexpr double kSignWidth = 0.02;
/// Where a property is taken along a reference.
constexpr int kPoints = 50;
/// Least of ControllerSettings::load_response that a gain is made for, 1 kg at 0.2 m on a joint of 1 kg·m² [m²/s⁴/kg]: what is
/// felt less needs no faster adaptation.
constexpr double kLeastResponse = 4.0;

/// A configured controller, with everything that the robot's model holds.
/// @param refused  says what the settings should have been
template <int N, typename Core, typename Refused>
std::shared_ptr<sim::CoreController<Core>> configured(std::shared_ptr<sim::CoreController<Core>> controller,
                                                      const typename Core::Config& config,
                                                      const model::Robot& robot, const Refused& refused) {
  const Status status = controller->core().configure(model::to_arm_model<N>(robot), config);
  if (status == Status::kNonFiniteInput) {
    throw ModelError(fmt::format("tracking: robot \"{}\": links, friction and rotors: expected finite values",
                                 robot.name));
  }
  if (status != Status::kOk) throw ModelError(refused());
  model::add_parts(robot, controller->core());
  return controller;
}

/// Computed torque with the load that is estimated, and the estimate over time.
template <int N>
class TracedController final : public sim::CoreController<LoadEstimatingController<model::ModelOf<N>, double>> {
  using Base = sim::CoreController<LoadEstimatingController<model::ModelOf<N>, double>>;

 public:
  explicit TracedController(std::shared_ptr<LoadTrace> trace) : trace_(std::move(trace)) {}

  void control(double t, const sim::Measurement& m, Eigen::Ref<Eigen::VectorXd> torque) override {
    Base::control(t, m, torque);
    if (trace_) note_load(this->core().observer(), this->core().observed(), m.time, *trace_);
  }

 private:
  std::shared_ptr<LoadTrace> trace_;
};

/// The controllers of an arm with N joints.
template <int N>
class Workshop {
 public:
  using Arm = model::ModelOf<N>;
  using Vector = JointVector<double, N>;
  using Product = std::shared_ptr<sim::Controller>;

  Workshop(const model::Robot& robot, const ControllerSettings& settings)
      : robot_(robot), settings_(settings), w_(2 * std::numbers::pi * settings.bandwidth_hz) {
    if (settings.torque_limit.size() == N) limit_ = settings.torque_limit.cwiseMin(1e30);
    if (!(limit_.array() > 0).all() || !(w_ > 0) || !(settings.damping_ratio >= 0)) {
      throw ModelError(fmt::format(
          "tracking: bandwidth {} Hz, damping ratio {}: expected positive values and torque limits "
          "above zero",
          settings.bandwidth_hz, settings.damping_ratio));
    }
  }

  Product make(Method method, std::shared_ptr<LoadTrace> trace) const {
    switch (method) {
      case Method::kPd: return pd(false);
      case Method::kPdGravity: return pd(true);
      case Method::kComputedTorque:
      case Method::kIdentified: return plain<ComputedTorqueController<Arm, double>>(gains());
      case Method::kEstimated: return with_load(std::move(trace));
      case Method::kArmEstimated: return with_arm();
      case Method::kAdaptive: return adaptive();
    }
    throw ModelError("tracking: unknown method");
  }

 private:
  /// What a configuration has in common, gains of accelerations.
  ControllerConfig<double, N> gains() const {
    ControllerConfig<double, N> config;
    config.stiffness = Vector::Ones() * (w_ * w_);
    config.damping = Vector::Ones() * (2 * settings_.damping_ratio * w_);
    config.torque_limit = limit_;
    config.friction = settings_.friction_feed_forward;
    config.sign_width = kSignWidth;
    return config;
  }

  template <typename Core>
  Product plain(const typename Core::Config& config) const {
    return configured<N, Core>(std::make_shared<sim::CoreController<Core>>(), config, robot_,
                               [] { return std::string("tracking: expected settings within their ranges"); });
  }

  Product pd(bool gravity) const {
    PdConfig<double, N> config{gains(), gravity};
    const Vector inertia = settings_.inertia;
    config.stiffness = inertia * (w_ * w_);
    config.damping = inertia * (2 * settings_.damping_ratio * w_);
    return plain<PdController<Arm, double>>(config);
  }

  Product with_load(std::shared_ptr<LoadTrace> trace) const {
    using Core = LoadEstimatingController<Arm, double>;
    typename Core::Config config{gains(), {}};
    config.observer.first_row = settings_.rows - 1;
    config.observer.filter_hz = settings_.filter_hz;
    config.observer.update_rate = settings_.update_rate;
    config.observer.mass_prior = settings_.mass_prior;
    if (settings_.noise.size() == N) config.observer.noise_std = settings_.noise;
    config.observer.sign_width = kSignWidth;
    config.observer.transition_time = 0.0;
    return configured<N, Core>(std::make_shared<TracedController<N>>(std::move(trace)), config, robot_, [&] {
      return fmt::format(
          "tracking: estimator settings k = {}, filter {} Hz, mass prior {} kg: expected k from "
          "1 to {} and positive values",
          settings_.rows, settings_.filter_hz, settings_.mass_prior, N);
    });
  }

  Product with_arm() const {
    using Core = ArmEstimatingController<Arm, double>;
    typename Core::Config config{gains(), {}};
    config.estimator.doubt = settings_.doubt;
    config.estimator.filter_hz = settings_.filter_hz;
    config.estimator.update_rate = settings_.update_rate;
    config.estimator.mass_prior = settings_.mass_prior;
    if (settings_.noise.size() == N) config.estimator.noise_std = settings_.noise;
    config.estimator.sign_width = kSignWidth;
    return configured<N, Core>(std::make_shared<sim::CoreController<Core>>(), config, robot_, [&] {
      return fmt::format("tracking: filter {} Hz, mass prior {} kg, doubt {}: expected positive values",
                         settings_.filter_hz, settings_.mass_prior, settings_.doubt);
    });
  }

  /// Poles of the error as computed torque has them. They are real, so that a damping ratio below 1 counts as 1.
  Product adaptive() const {
    using Core = AdaptiveArmController<Arm, double>;
    const double damping = std::max(1.0, settings_.damping_ratio);
    const double apart = std::sqrt(damping * damping - 1);
    typename Core::Config config{gains(), {}};
    config.law.position_rate.setConstant(w_ * (damping - apart));
    config.law.damping_rate = w_ * (damping + apart);
    config.law.torque_limit = limit_;
    // The fastest that brings the mass in without overshoot.
    config.law.mass_gain = config.law.damping_rate * config.law.damping_rate /
                           (4 * std::max(kLeastResponse, settings_.load_response));
    return configured<N, Core>(std::make_shared<sim::CoreController<Core>>(), config, robot_, [&] {
      return fmt::format(
          "tracking: adaptive control with bandwidth {} Hz, damping ratio {}: expected positive "
          "values and a model with finite numbers",
          settings_.bandwidth_hz, settings_.damping_ratio);
    });
  }

  const model::Robot& robot_;
  const ControllerSettings& settings_;
  double w_;  ///< [1/s]
  Vector limit_ = Vector::Constant(1e30);
};

}  // namespace

const char* to_string(Method method) {
  switch (method) {
    case Method::kPd: return "PD";
    case Method::kPdGravity: return "PD + gravity";
    case Method::kComputedTorque: return "computed torque, nominal";
    case Method::kEstimated: return "computed torque, estimated";
    case Method::kAdaptive: return "adaptive";
    case Method::kIdentified: return "computed torque, identified";
    case Method::kArmEstimated: return "computed torque, arm estimated";
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
  return model::with_joint_count(nominal.num_joints(), nominal.name, [&](auto joints) {
    return Workshop<decltype(joints)::value>(nominal, settings).make(method, std::move(trace));
  });
}

}  // namespace heft::track
