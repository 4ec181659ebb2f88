#include "heft/sim/simulator.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "integrator.hpp"
#include "plant.hpp"
#include "sensors.hpp"

namespace heft::sim {
namespace {

using Eigen::VectorXd;

[[noreturn]] void refuse(const std::string& what, const std::string& found, const std::string& expected,
                         const std::string& advice) {
  throw ModelError(fmt::format("simulation: {}: found {}, expected {}; {}", what, found, expected, advice));
}

void check_size(const char* what, Eigen::Index size, int n, bool may_be_empty) {
  if (size == n || (may_be_empty && size == 0)) return;
  refuse(what, fmt::format("{} values", size), fmt::format("{}, one per joint", n),
         "give one value per joint");
}

/// Largest entry of a setting beyond which it is no robot's.
void check_scale(const char* what, const Eigen::Ref<const VectorXd>& values, double largest,
                 const char* unit) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (std::abs(values[i]) <= largest) continue;
    refuse(fmt::format("{}, entry {}", what, i + 1), fmt::format("{:.6g} {}", values[i], unit),
           fmt::format("at most {:.6g} {}", largest, unit), "check the unit");
  }
}

/// The log is kept in memory.
void check_memory(const SimulationSettings& s) {
  constexpr double kMostValues = 2.5e8;  // 2 GB
  const double n = s.robot.num_joints();
  const double columns = 1 + 4 * n + (s.reference != nullptr ? 2 * n : 0) +
                         (s.sensors.torque_constant.size() > 0 ? n : 0) + (s.log_truth ? 8 * n + 2 : 0);
  const double rows = s.duration * (s.log_rate > 0.0 ? s.log_rate : s.sample_rate);
  if (rows * columns <= kMostValues) return;
  refuse("duration",
         fmt::format("{:.6g} s with {:.6g} rows a second: {:.3g} GB", s.duration, rows / s.duration,
                     8e-9 * rows * columns),
         "a log of at most 2 GB", "shorten it or lower log_rate");
}

void check_settings(const SimulationSettings& s) {
  const int n = s.robot.num_joints();
  check_size("initial_position", s.initial_position.size(), n, false);
  check_size("initial_velocity", s.initial_velocity.size(), n, true);
  check_size("loads", static_cast<Eigen::Index>(s.loads.size()), n, true);
  check_size("torque_limit", s.torque_limit.size(), n, true);
  check_size("sensors.encoder_quantum", s.sensors.encoder_quantum.size(), n, true);
  check_size("sensors.position_noise", s.sensors.position_noise.size(), n, true);
  check_size("sensors.velocity_noise", s.sensors.velocity_noise.size(), n, true);
  check_size("sensors.acceleration_noise", s.sensors.acceleration_noise.size(), n, true);
  check_size("sensors.torque_noise", s.sensors.torque_noise.size(), n, true);
  check_size("sensors.torque_quantum", s.sensors.torque_quantum.size(), n, true);
  check_size("sensors.torque_constant", s.sensors.torque_constant.size(), n, true);
  if (s.reference != nullptr) check_size("reference", s.reference->num_joints(), n, false);
  if (!(s.duration > 0.0)) {
    refuse("duration", fmt::format("{} s", s.duration), "a positive time", "set how long to simulate");
  }
  if (!(s.sample_rate > 0.0)) {
    refuse("sample_rate", fmt::format("{} Hz", s.sample_rate), "a positive rate",
           "set the controller's rate");
  }
  if (s.log_rate != 0.0) {
    const double ratio = s.sample_rate / s.log_rate;
    if (!(s.log_rate > 0.0) || std::abs(ratio - std::round(ratio)) > 1e-9 * ratio ||
        std::round(ratio) < 1.0) {
      refuse("log_rate", fmt::format("{} Hz at a sample rate of {} Hz", s.log_rate, s.sample_rate),
             "the sample rate divided by a whole number",
             "choose such a rate, or leave it out to log every sample");
    }
  }
  if (s.sensors.sampling_jitter < 0.0 || s.sensors.sampling_jitter * s.sample_rate >= 0.5) {
    refuse("sensors.sampling_jitter", fmt::format("{} s", s.sensors.sampling_jitter),
           "at least 0 and less than half a sample", "lower it");
  }
  if (!(s.robot.torque_delay >= 0.0)) {
    refuse("robot.torque_delay", fmt::format("{} s", s.robot.torque_delay), "at least 0", "correct it");
  }
  check_memory(s);
  check_scale("initial_position", s.initial_position, 1e4, "rad or m");
  check_scale("initial_velocity", s.initial_velocity, 1e4, "rad/s or m/s");
  check_scale("gravity", s.gravity ? *s.gravity : Eigen::Map<const Eigen::Vector3d>(s.robot.gravity.data()),
              1e4, "m/s²");
  if (s.solver.max_step != 0.0 && !(s.solver.max_step >= 1e-7)) {
    refuse("solver.max_step", fmt::format("{:.6g} s", s.solver.max_step), "0 or at least 1e-7 s",
           "raise it, or leave it out");
  }
  if (!(s.solver.max_steps_per_second > 0.0)) {
    refuse("solver.max_steps_per_second", fmt::format("{:.6g}", s.solver.max_steps_per_second),
           "a positive number", "raise it, or leave it out");
  }
  bool held = false;
  double last = 0.0;
  for (const PayloadEvent& event : s.payload_events) {
    if (event.grasp == held) {
      refuse("payload_events",
             event.grasp ? "a grasp while a body is held" : "a release while nothing is held",
             "grasp and release in turn", "put the missing event in between");
    }
    if (event.time < last) {
      refuse("payload_events", fmt::format("time {} s after {} s", event.time, last),
             "times that do not fall", "sort the events");
    }
    if (event.joint && (*event.joint < 0 || *event.joint >= n)) {
      refuse("payload_events", fmt::format("joint {}", *event.joint + 1), fmt::format("1 to {}", n),
             "name a joint of the arm");
    }
    held = event.grasp;
    last = event.time;
  }
}

/// Collects rows; the matrices are made once, for the number of rows that will come.
class Recorder {
 public:
  Recorder(const SimulationSettings& settings, Eigen::Index rows, int n) : settings_(settings), n_(n) {
    log_.time.resize(rows);
    log_.q.resize(rows, n);
    log_.qd.resize(rows, n);
    log_.qdd.resize(rows, n);
    log_.tau.resize(rows, n);
    if (settings.sensors.torque_constant.size() > 0) log_.current.resize(rows, n);
    if (std::any_of(settings.loads.begin(), settings.loads.end(),
                    [](const JointLoad& load) { return load.temperature.has_value(); }))
      log_.temperature.setConstant(rows, n, std::numeric_limits<double>::quiet_NaN());
    if (settings.reference != nullptr) {
      log_.qref.resize(rows, n);
      log_.qdref.resize(rows, n);
    }
    if (settings.log_truth) {
      for (const char* name : {"q_true", "qd_true", "qdd_true", "tau_true", "friction_true"}) {
        for (int i = 1; i <= n; ++i) log_.extra.emplace_back(fmt::format("{}{}", name, i), VectorXd(rows));
      }
      log_.extra.emplace_back("kinetic_energy", VectorXd(rows));
      log_.extra.emplace_back("potential_energy", VectorXd(rows));
      if (!settings.robot.elasticities.empty()) {
        for (const char* name : {"qlink", "qdlink", "qddlink"}) {
          for (int i = 1; i <= n; ++i) log_.extra.emplace_back(fmt::format("{}{}", name, i), VectorXd(rows));
        }
      }
    }
  }

  void add(double time, const Sensors& sensors, const VectorXd& qdd_measured, const VectorXd& tau_reported,
           const Measurement& m) {
    log_.time[row_] = time;
    log_.q.row(row_) = sensors.position();
    log_.qd.row(row_) = sensors.velocity();
    log_.qdd.row(row_) = qdd_measured;
    log_.tau.row(row_) = tau_reported;
    if (log_.current.cols() > 0) {
      log_.current.row(row_) = tau_reported.cwiseQuotient(settings_.sensors.torque_constant);
    }
    for (Eigen::Index j = 0; j < log_.temperature.cols(); ++j) {
      const std::optional<Warming>& warming = settings_.loads[static_cast<std::size_t>(j)].temperature;
      if (warming) log_.temperature(row_, j) = warming->at(time);
    }
    if (settings_.reference != nullptr) {
      log_.qref.row(row_) = m.q_ref;
      log_.qdref.row(row_) = m.qd_ref;
    }
  }

  void add_truth(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, const VectorXd& tau,
                 const Plant& plant) {
    std::size_t column = 0;
    for (const VectorXd* channel : {&q, &qd, &qdd, &tau}) {
      for (int i = 0; i < n_; ++i) log_.extra[column++].second[row_] = (*channel)[i];
    }
    for (int i = 0; i < n_; ++i) log_.extra[column++].second[row_] = plant.effect_torque(i);
    log_.extra[column++].second[row_] = plant.kinetic_energy(q, qd);
    log_.extra[column++].second[row_] = plant.potential_energy(q);
    if (settings_.robot.elasticities.empty()) return;
    for (const VectorXd* channel : {&q, &qd, &qdd}) {
      const VectorXd links = plant.link_side(*channel);
      for (int i = 0; i < n_; ++i) log_.extra[column++].second[row_] = links[i];
    }
  }

  void next_row() { ++row_; }
  data::Log take() { return std::move(log_); }

 private:
  const SimulationSettings& settings_;
  int n_;
  data::Log log_;
  Eigen::Index row_{0};
};

/// Largest slope of a joint's friction over its velocity, slow and fast [N·m·s/rad, N·s/m].
double steepest_friction(const JointLoad& load, double position) {
  double steepest = 0.0;
  for (const double speed : {0.01, 1.0}) {
    double slope = 0.0;
    for (const auto& effect : load.effects) {
      std::vector<double> state(static_cast<std::size_t>(effect->num_states()) + 1, 0.0);
      const JointPoint at{0.0, position, speed, 1.0};
      JointPoint faster = at;
      faster.velocity *= 1.001;
      effect->initial_state(at, state.data());
      slope += (effect->torque(faster, state.data()) - effect->torque(at, state.data())) /
               (faster.velocity - at.velocity);
    }
    steepest = std::max(steepest, slope);
  }
  return steepest;
}

/// The fastest rate at which friction brakes a joint, the others free, where the arm begins [1/s].
double fastest_decay(const SimulationSettings& s) {
  const int n = s.robot.num_joints();
  const ForwardDynamics dynamics(s.robot);
  const VectorXd rest = VectorXd::Zero(n);
  const VectorXd falling = dynamics.acceleration(s.initial_position, rest, rest);
  double fastest = 0.0;
  for (int i = 0; i < static_cast<int>(s.loads.size()); ++i) {
    const double inverse_inertia =
        dynamics.acceleration(s.initial_position, rest, VectorXd::Unit(n, i))[i] - falling[i];
    fastest = std::max(fastest, inverse_inertia * steepest_friction(s.loads[static_cast<std::size_t>(i)],
                                                                    s.initial_position[i]));
  }
  return fastest;
}

/// Whether something decays much faster than the controller samples, so that an explicit step would have to follow it.
bool is_stiff(const SimulationSettings& s) {
  const auto smooth = [](const JointLoad& load) {
    return load.sign == SignModel::kSmooth && !load.effects.empty();
  };
  const auto rubs = [](const GearCoupling<double>& coupling) { return coupling.coulomb_friction != 0.0; };
  // Fixed-point iteration follows what decays as an explicit step does. A UR10e along an exciting motion: at 7.4 Runge-Kutta
  // takes 0.6 of the time of Adams, at 37 half of it; at 150 still, where BDF is as fast as it.
  constexpr double kMostDecay = 50.0;  // over a sample
  return !s.robot.elasticities.empty() || std::any_of(s.loads.begin(), s.loads.end(), smooth) ||
         std::any_of(s.robot.couplings.begin(), s.robot.couplings.end(), rubs) ||
         !(fastest_decay(s) <= kMostDecay * s.sample_rate);
}

std::unique_ptr<Integrator> make_integrator(Plant& plant, const SimulationSettings& s) {
  SolverSettings solver = s.solver;
  if (solver.method == SolverMethod::kAutomatic) {
    solver.method =
        s.controller != nullptr && !is_stiff(s) ? SolverMethod::kRungeKutta : SolverMethod::kAdams;
  }
  return solver.method == SolverMethod::kRungeKutta ? make_runge_kutta(plant, solver)
                                                    : make_multistep(plant, solver);
}

/// One run.
class Run {
 public:
  explicit Run(const SimulationSettings& settings)
      : s_(settings),
        n_(settings.robot.num_joints()),
        plant_(settings),
        integrator_(make_integrator(plant_, settings)),
        sensors_(settings.sensors, n_, settings.seed) {
    const int positions = plant_.num_positions();
    q_.setZero(positions);
    qd_.setZero(positions);
    q_.head(n_) = s_.initial_position;
    if (s_.initial_velocity.size() > 0) qd_.head(n_) = s_.initial_velocity;
    z_.setZero(std::max(1, plant_.num_extra()));
    plant_.initial_extra(0.0, q_.data(), qd_.data(), z_.data());
    qdd_before_.setZero(positions);
    qdd_.setZero(positions);
    rate_.setZero(z_.size());
    tau_.setZero(n_);
  }

  SimulationResult run() {
    const double sample_time = 1.0 / s_.sample_rate;
    const auto samples = static_cast<long>(std::floor(s_.duration * s_.sample_rate * (1.0 + 1e-12)));
    const long stride = s_.log_rate > 0.0 ? std::lround(s_.sample_rate / s_.log_rate) : 1;
    Recorder recorder(s_, samples / stride + 1, n_);
    if (s_.controller != nullptr) s_.controller->start(n_, sample_time);
    Measurement m;
    m.tau = VectorXd::Zero(n_);
    m.qdd = VectorXd::Zero(n_);
    m.q_ref = q_.head(n_);
    m.qd_ref = VectorXd::Zero(n_);
    m.qdd_ref = VectorXd::Zero(n_);
    VectorXd reported = VectorXd::Zero(n_);
    end_ = (static_cast<double>(samples) + 0.5) * sample_time;
    double previous = 0.0;
    for (long k = 0; k <= samples; ++k) {
      const double nominal = static_cast<double>(k) / s_.sample_rate;
      integrator_->grant(s_.solver.max_steps_per_second * std::max(sample_time, 1e-3));
      const double time = k == 0 ? 0.0 : nominal + sensors_.jitter();
      if (k == 0) {
        apply_due_payload();
        plant_.settle_links(0.0, q_.data(), qd_.data());
      } else {
        advance_to(time);
      }
      const double dt = k == 0 ? 0.0 : time - previous;
      previous = time;
      sensors_.read_motion(dt, q_.head(n_), qd_.head(n_));
      sensors_.read_acceleration(dt);
      m.time = nominal;
      m.sample_time = k == 0 ? sample_time : dt;
      m.q = sensors_.position();
      m.qd = sensors_.velocity();
      if (s_.reference != nullptr) {
        s_.reference->evaluate(nominal, m.q_ref, m.qd_ref, m.qdd_ref);
      } else {
        m.q_ref = m.q;
      }
      if (s_.controller != nullptr) {
        // The arm is taken to be held until the first sample: no acceleration before it.
        if (k > 0) {
          accelerate_before();
          m.qdd = sensors_.acceleration(qdd_before_.head(n_));
        }
        m.tau = reported;
        command(m);
      }
      settle(k == 0);
      reported = sensors_.torque(torque_on_record());
      if (k % stride == 0) {
        recorder.add(time, sensors_, sensors_.acceleration(qdd_.head(n_)), reported, m);
        if (s_.log_truth) recorder.add_truth(q_, qd_, qdd_, plant_.motor_torque(t_), plant_);
        recorder.next_row();
      }
    }
    integrator_->add_counts(result_.counts);
    result_.log = recorder.take();
    result_.log.path = "simulation";
    return std::move(result_);
  }

 private:
  /// The acceleration that the torque of until now brings about.
  void accelerate_before() {
    const double* known = integrator_->acceleration();
    if (known != nullptr) {
      std::copy(known, known + qdd_before_.size(), qdd_before_.data());
    } else {
      plant_.evaluate(t_, q_.data(), qd_.data(), z_.data(), qdd_before_.data(), rate_.data());
    }
  }

  void command(const Measurement& m) {
    s_.controller->control(m.time, m, tau_);
    for (int i = 0; i < n_; ++i) {
      if (!std::isfinite(tau_[i])) {
        throw SimulationError(fmt::format(
            "simulation: joint {} at t = {:.6g} s: found {} as the controller's torque; expected a "
            "finite one; check its gains and what it does with the measurement",
            i + 1, m.time, tau_[i]));
      }
    }
    if (s_.torque_limit.size() > 0) tau_ = tau_.cwiseMin(s_.torque_limit).cwiseMax(-s_.torque_limit);
    plant_.hold_torque(tau_);
  }

  /// Motor torque as the drive's channel has it at t_: late by the robot's torque_delay. A held torque is
  /// read by straight lines between the samples; before the first sample it is the first one's.
  VectorXd torque_on_record() {
    const double delay = s_.robot.torque_delay;
    if (delay == 0.0) return plant_.motor_torque(t_);
    if (s_.controller == nullptr) return plant_.motor_torque(std::max(0.0, t_ - delay));
    past_.emplace_back(t_, plant_.motor_torque(t_));
    while (past_.size() > 2 && past_[1].first <= t_ - delay) past_.pop_front();
    const auto& [before, first] = past_.front();
    if (past_.size() == 1 || t_ - delay <= before) return first;
    const auto& [after, second] = past_[1];
    return first + (second - first) * ((t_ - delay - before) / (after - before));
  }

  /// After a sample's new torque: modes, acceleration, and the integrator is notified.
  void settle(bool first) {
    const std::vector<int> before = plant_.modes();
    const bool changed = plant_.resolve_modes(t_, q_.data(), qd_.data(), z_.data());
    plant_.evaluate(t_, q_.data(), qd_.data(), z_.data(), qdd_.data(), rate_.data());
    if (first || changed) {
      if (!first) note_modes(before);
      restart();
    } else if (s_.controller != nullptr) {
      integrator_->kick(qdd_before_.data(), qdd_.data(), rate_.data());
    }
  }

  void restart() {
    arm_next_trigger();
    integrator_->start(t_, q_.data(), qd_.data(), z_.data());
  }

  void read_state() {
    t_ = integrator_->time();
    std::copy(integrator_->q(), integrator_->q() + q_.size(), q_.data());
    std::copy(integrator_->qd(), integrator_->qd() + qd_.size(), qd_.data());
    std::copy(integrator_->z(), integrator_->z() + plant_.num_extra(), z_.data());
  }

  void advance_to(double time) {
    int events_here = 0;
    while (true) {
      const double before = t_;
      // A payload event that is due by the clock is a hard stop, as is the time at which a position starts to count.
      const double due = next_payload_time();
      const double limit = s_.controller != nullptr ? std::min(time, due) : std::min(end_, due);
      const Integrator::Stop stop = s_.controller != nullptr
                                        ? integrator_->advance(limit)
                                        : integrator_->advance_freely(std::min(time, due), limit);
      read_state();
      if (stop == Integrator::Stop::kEvent) {
        events_here = t_ > before ? 0 : events_here + 1;
        if (events_here > 100) {
          const std::vector<int>& happened = integrator_->events();
          const auto root =
              std::find_if(happened.begin(), happened.end(), [](int event) { return event != 0; });
          throw SimulationError(fmt::format(
              "simulation: joint {} at t = {:.9g} s: found 100 changes between sticking and slipping at one "
              "time; expected a few; check that friction levels and torques are finite and within reason",
              plant_.joint_of_root(static_cast<int>(root - happened.begin())) + 1, t_));
        }
        const std::vector<int>& events = integrator_->events();
        if (events[static_cast<std::size_t>(plant_.num_roots()) - 1] != 0) {
          plant_.disarm_trigger();
          apply_payload();
        }
        change_modes();
        continue;
      }
      if (t_ >= due) {
        apply_due_payload();
        change_modes();
        if (t_ < time) continue;
      }
      if (t_ >= time) return;
    }
  }

  void change_modes() {
    const std::vector<int> before = plant_.modes();
    plant_.resolve_modes(t_, q_.data(), qd_.data(), z_.data());
    note_modes(before);
    restart();
  }

  void note_modes(const std::vector<int>& before) {
    for (int i = 0; i < n_; ++i) {
      const int now = plant_.modes()[static_cast<std::size_t>(i)];
      if (now == before[static_cast<std::size_t>(i)] || !plant_.is_dry(i)) continue;
      result_.events.push_back(
          {t_, now == 0 ? SimulationEvent::Kind::kStick : SimulationEvent::Kind::kSlip, i});
    }
  }

  /// Time of the next payload event that the clock decides about; infinite when a position decides.
  double next_payload_time() const {
    if (next_payload_ >= s_.payload_events.size() || plant_.trigger_armed()) {
      return std::numeric_limits<double>::infinity();
    }
    return s_.payload_events[next_payload_].time;
  }

  void apply_due_payload() {
    while (next_payload_ < s_.payload_events.size() && s_.payload_events[next_payload_].time <= t_ &&
           !s_.payload_events[next_payload_].joint) {
      apply_payload();
    }
  }

  void apply_payload() {
    const PayloadEvent& event = s_.payload_events[next_payload_++];
    if (event.grasp) {
      plant_.attach(event.body);
    } else {
      plant_.detach();
    }
    result_.events.push_back(
        {t_, event.grasp ? SimulationEvent::Kind::kGrasp : SimulationEvent::Kind::kRelease, -1});
  }

  /// Arms the position trigger of the next payload event once its time has come.
  void arm_next_trigger() {
    if (plant_.trigger_armed() || next_payload_ >= s_.payload_events.size()) return;
    const PayloadEvent& event = s_.payload_events[next_payload_];
    if (event.joint && event.time <= t_) plant_.arm_trigger(*event.joint, event.position, q_[*event.joint]);
  }

  const SimulationSettings& s_;
  int n_;
  Plant plant_;
  std::unique_ptr<Integrator> integrator_;
  Sensors sensors_;
  double t_{0.0};
  double end_{0.0};
  VectorXd q_, qd_, z_, qdd_before_, qdd_, rate_, tau_;
  std::deque<std::pair<double, VectorXd>> past_;  ///< sample times and held torques, for the delay
  std::size_t next_payload_{0};
  SimulationResult result_;
};

}  // namespace

std::vector<JointLoad> friction_of(const model::Robot& robot, SignModel sign) {
  std::vector<JointLoad> loads;
  for (const model::RobotJoint& joint : robot.joints) {
    JointLoad load;
    load.sign = sign;
    const JointActuation<double>& a = joint.actuation;
    if (a.coulomb_friction != 0.0) {
      load.effects.push_back(std::make_shared<CoulombFriction>(a.coulomb_friction, a.coulomb_friction));
    }
    if (a.viscous_friction != 0.0 || a.friction_offset != 0.0) {
      load.effects.push_back(std::make_shared<ViscousFriction>(a.viscous_friction, a.friction_offset));
    }
    if (joint.joint.type == JointType::kPrismatic) load.smooth_speed = 5e-4;
    loads.push_back(load);
  }
  add_joint_effects(robot, loads);
  return loads;
}

void add_joint_effects(const model::Robot& robot, std::vector<JointLoad>& loads) {
  for (const heft::JointEffect<double>& effect : robot.effects) {
    if (effect.joint < 0 || effect.joint >= robot.num_joints()) {
      refuse("effects", fmt::format("joint {}", effect.joint + 1), fmt::format("1 to {}", robot.num_joints()),
             "name a joint of the arm");
    }
    if (effect.kind == joint_effect_kind<RotorInertia>()) continue;
    const auto i = static_cast<std::size_t>(effect.joint);
    loads[i].effects.push_back(make_joint_effect(effect, robot.joints[i].actuation));
  }
}

VectorXd effort_limits_of(const model::Robot& robot) {
  VectorXd limits(robot.num_joints());
  for (int i = 0; i < robot.num_joints(); ++i)
    limits[i] = robot.joints[static_cast<std::size_t>(i)].effort_limit;
  return limits;
}

Eigen::Vector3d tilted_gravity(const Eigen::Vector3d& gravity, double tilt, double azimuth) {
  // Turns −z towards the azimuth.
  const Eigen::Vector3d axis(std::sin(azimuth), -std::cos(azimuth), 0.0);
  return Eigen::AngleAxisd(tilt, axis) * gravity;
}

SimulationResult simulate(const SimulationSettings& settings) {
  check_settings(settings);
  return Run(settings).run();
}

}  // namespace heft::sim
