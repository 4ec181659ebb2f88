#include "heft/sim/scenario.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "scenario_effects.hpp"

namespace heft::sim {
namespace {

using host::Range;
using host::SettingsReader;

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::shared_ptr<const Reference> read_reference(const SettingsReader& reader, int n) {
  const std::string kind = reader.word("kind", {"hold", "fourier", "quintic", "waypoints"});
  std::shared_ptr<const Reference> motion;
  if (kind == "hold") {
    motion = make_hold(reader.numbers("position", n));
  } else if (kind == "fourier") {
    FourierMotion fourier;
    fourier.q0 = reader.numbers("q0", n);
    // The names with a unit are those of published trajectory files; both are taken.
    const std::string amplitude = reader.has("amplitude_rad") ? "amplitude_rad" : "amplitude";
    const std::string phase = reader.has("phase_rad") ? "phase_rad" : "phase";
    fourier.amplitude = reader.table(amplitude, n);
    const int terms = static_cast<int>(fourier.amplitude.cols());
    fourier.frequency_hz = reader.table("frequency_hz", n, terms);
    fourier.phase = reader.table(phase, n, terms);
    motion = make_fourier(fourier);
  } else if (kind == "quintic") {
    motion = make_quintic(reader.numbers("from", n), reader.numbers("to", n),
                          reader.number("duration", Range::kPositive));
  } else {
    const VectorXd times = reader.numbers("times", -1);
    if (times.size() < 2) reader.refuse("times", "", "at least two times", "add waypoints");
    for (Eigen::Index k = 1; k < times.size(); ++k) {
      if (!(times[k] > times[k - 1])) {
        reader.refuse(fmt::format("times/{}", k), fmt::format("{} after {}", times[k], times[k - 1]),
                      "times that increase", "sort the waypoints");
      }
    }
    const MatrixXd points = reader.table("points", static_cast<int>(times.size()), n);
    const bool cubic = reader.word_or("order", "quintic", {"cubic", "quintic"}) == "cubic";
    motion = make_waypoints({times.data(), times.data() + times.size()}, points.transpose(),
                            cubic ? WaypointOrder::kCubic : WaypointOrder::kQuintic);
  }
  const double ramp = reader.number_or("ramp", 0.0, Range::kNotNegative);
  VectorXd start = reader.numbers_or_none("start", n);
  if (start.size() == 0) {
    VectorXd qd(n), qdd(n);
    start.resize(n);
    motion->evaluate(0.0, start, qd, qdd);
  } else if (ramp == 0.0) {
    reader.refuse("start", "a start position without a ramp", "a key \"ramp\" as well",
                  "add \"ramp\" [s], the time in which the motion is blended in");
  }
  reader.finish();
  return ramp_in(motion, start, ramp);
}

void without_friction(model::Robot& acting) {
  for (model::RobotJoint& joint : acting.joints) {
    joint.actuation = {joint.actuation.rotor_inertia, 0.0, 0.0, 0.0};
  }
}

/// @param acting  gets the friction that is read as its joints' actuation
std::vector<JointLoad> read_friction(const SettingsReader& reader, model::Robot& acting) {
  const int n = acting.num_joints();
  const std::string model = reader.word_or("model", "stick_slip", {"stick_slip", "smooth", "none"});
  VectorXd coulomb(n), viscous(n), offset(n);
  for (int i = 0; i < n; ++i) {
    const JointActuation<double>& a = acting.joints[static_cast<std::size_t>(i)].actuation;
    coulomb[i] = a.coulomb_friction;
    viscous[i] = a.viscous_friction;
    offset[i] = a.friction_offset;
  }
  if (reader.has("coulomb")) coulomb = reader.numbers("coulomb", n, Range::kNotNegative);
  if (reader.has("viscous")) viscous = reader.numbers("viscous", n, Range::kNotNegative);
  if (reader.has("offset")) offset = reader.numbers("offset", n);
  VectorXd breakaway =
      reader.has("breakaway") ? reader.numbers("breakaway", n, Range::kNotNegative) : coulomb;
  for (int i = 0; i < n; ++i) {
    if (breakaway[i] < coulomb[i]) {
      reader.refuse("breakaway", fmt::format("{} at joint {}", breakaway[i], i + 1),
                    fmt::format("at least the Coulomb level {}", coulomb[i]), "raise it or leave it out");
    }
  }
  if (model == "smooth" && reader.has("breakaway")) {
    reader.refuse("breakaway", "a break-away level with the smooth sign",
                  "it only with the model \"stick_slip\"", "leave it out or change the model");
  }
  const double smooth_speed = reader.number_or("smooth_speed", 1e-3, Range::kPositive);
  if (model != "smooth" && reader.has("smooth_speed")) {
    reader.refuse("smooth_speed", fmt::format("a smoothing speed with the model \"{}\"", model),
                  "it only with the model \"smooth\"", "leave it out or change the model");
  }
  reader.finish();
  std::vector<JointLoad> loads(static_cast<std::size_t>(n));
  if (model == "none") {
    without_friction(acting);
    return loads;
  }
  for (int i = 0; i < n; ++i) {
    JointActuation<double>& actuation = acting.joints[static_cast<std::size_t>(i)].actuation;
    actuation.coulomb_friction = coulomb[i];
    actuation.viscous_friction = viscous[i];
    actuation.friction_offset = offset[i];
    JointLoad& load = loads[static_cast<std::size_t>(i)];
    load.sign = model == "smooth" ? SignModel::kSmooth : SignModel::kStickSlip;
    load.smooth_speed = smooth_speed;
    if (breakaway[i] > 0.0)
      load.effects.push_back(std::make_shared<CoulombFriction>(coulomb[i], breakaway[i]));
    if (viscous[i] != 0.0 || offset[i] != 0.0) {
      load.effects.push_back(std::make_shared<ViscousFriction>(viscous[i], offset[i]));
    }
  }
  return loads;
}

SensorSettings read_sensors(const SettingsReader& reader, int n, double sample_rate) {
  SensorSettings s;
  s.encoder_quantum = reader.numbers_or_none("encoder_resolution", n, Range::kNotNegative);
  s.position_noise = reader.numbers_or_none("position_noise", n, Range::kNotNegative);
  const std::vector<std::string> sources{"exact", "differenced"};
  if (reader.word_or("velocity", "exact", sources) == "differenced")
    s.velocity = VelocitySource::kDifferenced;
  s.velocity_cutoff_hz = reader.number_or("velocity_cutoff_hz", 0.0, Range::kNotNegative);
  s.velocity_noise = reader.numbers_or_none("velocity_noise", n, Range::kNotNegative);
  if (reader.word_or("acceleration", "exact", sources) == "differenced") {
    s.acceleration = AccelerationSource::kDifferenced;
  }
  s.acceleration_cutoff_hz = reader.number_or("acceleration_cutoff_hz", 0.0, Range::kNotNegative);
  s.acceleration_noise = reader.numbers_or_none("acceleration_noise", n, Range::kNotNegative);
  s.torque_noise = reader.numbers_or_none("torque_noise", n, Range::kNotNegative);
  s.torque_quantum = reader.numbers_or_none("torque_resolution", n, Range::kNotNegative);
  s.torque_constant = reader.numbers_or_none("torque_constant", n, Range::kPositive);
  s.sampling_jitter = reader.number_or("sampling_jitter", 0.0, Range::kNotNegative);
  if (s.sampling_jitter * sample_rate >= 0.5) {
    reader.refuse("sampling_jitter", "", fmt::format("less than half a sample, {} s", 0.5 / sample_rate),
                  "lower it");
  }
  // A setting that would have no effect is a misunderstanding.
  const auto only_with = [&](const char* key, const char* channel, bool differenced, bool wanted) {
    if (reader.has(key) && differenced != wanted) {
      reader.refuse(key,
                    fmt::format("this with \"{}\": \"{}\"", channel, differenced ? "differenced" : "exact"),
                    fmt::format("it only with \"{}\": \"{}\"", channel, wanted ? "differenced" : "exact"),
                    "leave it out or change the channel");
    }
  };
  const bool velocity_differenced = s.velocity == VelocitySource::kDifferenced;
  const bool acceleration_differenced = s.acceleration == AccelerationSource::kDifferenced;
  only_with("velocity_cutoff_hz", "velocity", velocity_differenced, true);
  only_with("velocity_noise", "velocity", velocity_differenced, false);
  only_with("acceleration_cutoff_hz", "acceleration", acceleration_differenced, true);
  only_with("acceleration_noise", "acceleration", acceleration_differenced, false);
  reader.finish();
  return s;
}

std::vector<PayloadEvent> read_payload(const SettingsReader& top, int n) {
  std::vector<PayloadEvent> events;
  bool held = false;
  double last = 0.0;
  for (const SettingsReader& reader : top.objects("payload")) {
    PayloadEvent event;
    event.grasp = reader.word("event", {"grasp", "release"}) == "grasp";
    if (event.grasp == held) {
      reader.refuse("event",
                    event.grasp ? "\"grasp\" while a body is held" : "\"release\" while nothing is held",
                    "grasp and release in turn", "put the missing event in between");
    }
    held = event.grasp;
    event.time = reader.number_or("time", last, Range::kNotNegative);
    if (event.time < last) {
      reader.refuse("time", fmt::format("{} s after an event at {} s", event.time, last),
                    "times that do not fall", "sort the events");
    }
    last = event.time;
    if (reader.has("joint") || reader.has("position")) {
      event.joint = static_cast<int>(reader.whole_number("joint", 1, n)) - 1;
      event.position = reader.number("position");
    }
    if (event.grasp) event.body = read_body(reader);
    reader.finish();
    events.push_back(event);
  }
  return events;
}

SolverSettings read_solver(const SettingsReader& reader, SolverSettings solver) {
  if (reader.has("method")) {
    const std::string method = reader.word("method", {"adams", "bdf", "runge_kutta"});
    solver.method = method == "adams" ? SolverMethod::kAdams
                    : method == "bdf" ? SolverMethod::kBdf
                                      : SolverMethod::kRungeKutta;
  }
  solver.relative_tolerance =
      reader.number_or("relative_tolerance", solver.relative_tolerance, Range::kPositive);
  solver.absolute_tolerance =
      reader.number_or("absolute_tolerance", solver.absolute_tolerance, Range::kPositive);
  // Below these rounding decides, and the solver gives up.
  if (solver.relative_tolerance < 1e-14) {
    reader.refuse("relative_tolerance", "", "at least 1e-14", "loosen it");
  }
  if (solver.absolute_tolerance < 1e-15) {
    reader.refuse("absolute_tolerance", "", "at least 1e-15", "loosen it");
  }
  solver.max_step = reader.number_or("max_step", solver.max_step, Range::kNotNegative);
  solver.max_steps_per_second =
      reader.number_or("max_steps_per_second", solver.max_steps_per_second, Range::kPositive);
  reader.finish();
  return solver;
}

/// Open-loop torque: offset plus sums of sines.
std::function<void(double, Eigen::Ref<VectorXd>)> read_torque(const SettingsReader& reader, int n) {
  FourierMotion sum;
  sum.q0 = reader.has("offset") ? reader.numbers("offset", n) : VectorXd::Zero(n);
  sum.amplitude = MatrixXd::Zero(n, 1);
  sum.frequency_hz = MatrixXd::Zero(n, 1);
  sum.phase = MatrixXd::Zero(n, 1);
  if (reader.has("amplitude")) {
    sum.amplitude = reader.table("amplitude", n);
    const int terms = static_cast<int>(sum.amplitude.cols());
    sum.frequency_hz = reader.table("frequency_hz", n, terms);
    sum.phase = reader.has("phase") ? reader.table("phase", n, terms) : MatrixXd::Zero(n, terms);
  }
  reader.finish();
  return [sum](double t, Eigen::Ref<VectorXd> torque) {
    torque = sum.q0;
    for (Eigen::Index i = 0; i < torque.size(); ++i) {
      for (Eigen::Index k = 0; k < sum.amplitude.cols(); ++k) {
        torque[i] += sum.amplitude(i, k) *
                     std::sin(2.0 * std::numbers::pi * sum.frequency_hz(i, k) * t + sum.phase(i, k));
      }
    }
  };
}

/// Duration, rates and what is logged.
void read_times(const SettingsReader& top, SimulationSettings& s) {
  s.duration = top.number("duration", Range::kPositive);
  s.sample_rate = top.number_or("sample_rate", 1000.0, Range::kPositive);
  s.log_rate = top.number_or("log_rate", 0.0, Range::kPositive);
  if (s.log_rate > 0.0) {
    const double ratio = s.sample_rate / s.log_rate;
    if (std::round(ratio) < 1.0 || std::abs(ratio - std::round(ratio)) > 1e-9 * ratio) {
      top.refuse("log_rate", "",
                 fmt::format("the sample rate {} Hz divided by a whole number", s.sample_rate),
                 "choose such a rate, or leave it out to log every sample");
    }
  }
  if (s.duration * s.sample_rate > 1e8) {
    top.refuse("duration", fmt::format("{} s at {} Hz", s.duration, s.sample_rate), "at most 1e8 samples",
               "shorten it or lower the sample rate");
  }
  if (top.has("seed"))
    s.seed = static_cast<std::uint64_t>(top.whole_number("seed", 0, std::numeric_limits<long>::max()));
  s.log_truth = top.flag_or("truth", false);
}

void read_gravity(const SettingsReader& top, SimulationSettings& s) {
  if (top.has("gravity")) s.gravity = top.numbers("gravity", 3);
  if (top.has("base_tilt")) {
    const SettingsReader tilt = top.object("base_tilt");
    const double degree = std::numbers::pi / 180.0;
    const Eigen::Vector3d level =
        s.gravity ? *s.gravity : Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(s.robot.gravity.data()));
    s.gravity =
        tilted_gravity(level, tilt.number("tilt_deg") * degree, tilt.number_or("azimuth_deg", 0.0) * degree);
    tilt.finish();
  }
}

/// The reference, and where the arm is when it begins.
void read_motion(const SettingsReader& top, SimulationSettings& s) {
  const int n = s.robot.num_joints();
  if (top.has("reference")) s.reference = read_reference(top.object("reference"), n);
  if (top.has("initial")) {
    const SettingsReader initial = top.object("initial");
    s.initial_position = initial.numbers("position", n);
    s.initial_velocity = initial.numbers_or_none("velocity", n);
    initial.finish();
  } else if (s.reference != nullptr) {
    s.initial_position.resize(n);
    s.initial_velocity.resize(n);
    VectorXd qdd(n);
    s.reference->evaluate(0.0, s.initial_position, s.initial_velocity, qdd);
  } else {
    top.refuse("initial", "", "an object with \"position\"",
               "add it, or a reference whose start is then taken");
  }
}

void read_temperature(const SettingsReader& reader, std::vector<JointLoad>& loads) {
  const int n = static_cast<int>(loads.size());
  const VectorXd start = reader.numbers("start", n), end = reader.numbers("end", n);
  const double time_constant = reader.number("time_constant", Range::kPositive);
  reader.finish();
  for (int j = 0; j < n; ++j)
    loads[static_cast<std::size_t>(j)].temperature = Warming{start[j], end[j], time_constant};
}

/// Friction, payload and the other effects.
void read_forces(const SettingsReader& top, SimulationSettings& s) {
  const int n = s.robot.num_joints();
  // The robot with the friction that is simulated: some effects scale or replace it.
  model::Robot acting = s.robot;
  if (top.is_text("friction")) {
    top.word("friction", {"none"});
    without_friction(acting);
    s.loads.resize(static_cast<std::size_t>(n));
    add_joint_effects(acting, s.loads);
  } else if (top.has("friction")) {
    s.loads = read_friction(top.object("friction"), acting);
    add_joint_effects(acting, s.loads);
  } else {
    s.loads = friction_of(s.robot);
  }
  if (top.has("temperature")) read_temperature(top.object("temperature"), s.loads);
  if (top.has("payload")) s.payload_events = read_payload(top, n);
  if (top.has("effects")) read_effects(top, acting, s);
}

/// BDF where the equations of motion are stiff, unless the scenario says otherwise.
SolverSettings default_solver(const SimulationSettings& s) {
  SolverSettings solver = s.solver;
  for (const JointLoad& load : s.loads) {
    // A smooth sign is stiff: Fc/(ε M) can pass 1e5 1/s.
    if (load.sign == SignModel::kSmooth && !load.effects.empty()) solver.method = SolverMethod::kBdf;
  }
  for (const GearCoupling<double>& coupling : s.robot.couplings) {
    if (coupling.coulomb_friction > 0.0) solver.method = SolverMethod::kBdf;
  }
  // So are the springs of elastic joints: motor and link swing at tens of hertz.
  if (!s.robot.elasticities.empty()) solver.method = SolverMethod::kBdf;
  return solver;
}

void read_drive_torque(const SettingsReader& top, bool has_controller, SimulationSettings& s) {
  const int n = s.robot.num_joints();
  if (top.is_text("torque_limit")) {
    if (top.word("torque_limit", {"robot", "none"}) == "robot") s.torque_limit = effort_limits_of(s.robot);
  } else if (top.has("torque_limit")) {
    s.torque_limit = top.numbers("torque_limit", n, Range::kPositive);
  } else {
    s.torque_limit = effort_limits_of(s.robot);
  }
  if (top.has("torque")) {
    if (has_controller) {
      top.refuse("torque", "both an open-loop torque and a controller", "one of the two", "leave one out");
    }
    s.torque = read_torque(top.object("torque"), n);
  }
}

}  // namespace

Body read_body(const SettingsReader& reader) {
  Body body;
  body.mass = reader.number("mass", Range::kPositive);
  if (reader.has("com")) body.com = reader.numbers("com", 3);
  if (reader.has("inertia")) {
    const VectorXd i = reader.numbers("inertia", 6);
    body.inertia << i[0], i[1], i[3], i[1], i[2], i[4], i[3], i[4], i[5];
    const Eigen::Vector3d moments = eigenvalues_of(body.inertia);
    // Rounding in the file must not turn a flat or a thin body away.
    if (moments[0] < -1e-9 * moments[2] || moments[0] + moments[1] < moments[2] * (1.0 - 1e-9)) {
      reader.refuse(
          "inertia",
          fmt::format("principal moments {:.6g}, {:.6g}, {:.6g} kg·m²", moments[0], moments[1], moments[2]),
          "moments of at least 0 of which each is at most the sum of the other two",
          "check units, order [Ixx, Ixy, Iyy, Ixz, Iyz, Izz] and that it is about the centre of mass");
    }
  }
  return body;
}

Scenario parse_scenario(std::string_view json, const std::string& file, const RobotLoader& load_robot) {
  const SettingsReader top = SettingsReader::parse(json, file);
  const std::string robot_name = top.text("robot");
  const bool has_controller = top.has("controller");
  SettingsReader controller = has_controller ? top.object("controller") : SettingsReader::parse("{}", file);
  const std::string kind = has_controller ? controller.text("kind") : "none";
  if (kind == "none") controller.finish();

  Scenario scenario{file, robot_name, {}, {kind, controller}};
  SimulationSettings& s = scenario.settings;
  s.robot = load_robot(robot_name);
  const int n = s.robot.num_joints();
  if (top.has("rotor_inertia")) {
    const VectorXd rotor = top.numbers("rotor_inertia", n, Range::kNotNegative);
    for (int i = 0; i < n; ++i)
      s.robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia = rotor[i];
  }

  read_times(top, s);
  read_gravity(top, s);
  read_motion(top, s);
  read_forces(top, s);
  s.solver = default_solver(s);
  read_drive_torque(top, kind != "none", s);
  if (top.has("sensors")) s.sensors = read_sensors(top.object("sensors"), n, s.sample_rate);
  if (top.has("solver")) s.solver = read_solver(top.object("solver"), s.solver);
  top.finish();
  return scenario;
}

std::shared_ptr<Controller> make_controller(const Scenario& scenario, const ControllerFactory& factory) {
  const ControllerRequest& request = scenario.controller;
  if (request.kind == "none") return nullptr;
  const SimulationSettings& s = scenario.settings;
  if (request.kind == "pd" || request.kind == "pd_gravity") {
    if (s.reference == nullptr) {
      request.settings.refuse("kind", fmt::format("\"{}\" without a reference", request.kind),
                              "a key \"reference\" in the scenario",
                              "add one, for instance {\"kind\": \"hold\", ...}");
    }
    const int n = s.robot.num_joints();
    const VectorXd kp = request.settings.numbers("kp", n, Range::kNotNegative);
    const VectorXd kd = request.settings.numbers("kd", n, Range::kNotNegative);
    request.settings.finish();
    std::shared_ptr<ForwardDynamics> gravity_model;
    if (request.kind == "pd_gravity") {
      gravity_model = std::make_shared<ForwardDynamics>(s.robot);
      if (s.gravity) gravity_model->set_gravity(*s.gravity);
    }
    return std::make_shared<PdController>(kp, kd, gravity_model);
  }
  std::shared_ptr<Controller> made = factory ? factory(request, s) : nullptr;
  if (made == nullptr) {
    request.settings.refuse(
        "kind", fmt::format("\"{}\"", request.kind), "a controller that is known here",
        "use \"none\", \"pd\", \"pd_gravity\" or a kind of the program that runs the scenario");
  }
  return made;
}

SimulationResult simulate_scenario(const Scenario& scenario, const ControllerFactory& factory) {
  SimulationSettings settings = scenario.settings;
  settings.controller = make_controller(scenario, factory);
  SimulationResult result = simulate(settings);
  result.log.path = scenario.file;
  return result;
}

data::Log run_scenario(const Scenario& scenario, const ControllerFactory& factory) {
  return simulate_scenario(scenario, factory).log;
}

}  // namespace heft::sim
