#include "heft/track/track.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"
#include "heft/host/settings_reader.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/model/without_effects.hpp"
#include "heft/validate/judgement.hpp"
#include "wrong_model.hpp"

namespace heft::track {
namespace {

/// The last two where the controllers' arm is wrong.
constexpr std::array<Method, 7> kMethods = {Method::kPd,          Method::kPdGravity, Method::kComputedTorque,
                                            Method::kEstimated,   Method::kAdaptive,  Method::kIdentified,
                                            Method::kArmEstimated};
constexpr std::size_t kMethodsOfAKnownArm = 5;
/// After a load event the estimate gets this long before errors count [s].
constexpr double kSettling = 1.0;

/// Nobody knows an arm better.
constexpr double kLeastDoubt = 0.01;

void check(const WrongModel& wrong) {
  if (!(wrong.least >= 0) || !(wrong.most >= wrong.least) || !(wrong.most < 1)) {
    throw ModelError(fmt::format(
        "wrong model: found shares from {} to {}; expected 0 ≤ least ≤ most < 1, 0.1 and 0.3 for 10 to 30 %",
        wrong.least, wrong.most));
  }
}

/// Friction values that the scenario states for the arm belong to what the controllers know; the load does not.
void take_friction(const std::string& path, model::Robot& robot) {
  const host::SettingsReader top = host::SettingsReader::parse(host::read_file(path, "scenario"), path);
  if (!top.has("friction") || top.is_text("friction")) return;
  const host::SettingsReader friction = top.object("friction");
  const int n = robot.num_joints();
  const Eigen::VectorXd coulomb = friction.numbers_or_none("coulomb", n),
                        viscous = friction.numbers_or_none("viscous", n),
                        offset = friction.numbers_or_none("offset", n);
  for (int i = 0; i < n; ++i) {
    JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(i)].actuation;
    if (coulomb.size() > 0) actuation.coulomb_friction = coulomb[i];
    if (viscous.size() > 0) actuation.viscous_friction = viscous[i];
    if (offset.size() > 0) actuation.friction_offset = offset[i];
  }
}

/// Reference less position; for elastic joints that of the link, which the motor's encoder does not see.
Eigen::MatrixXd tracking_error(const data::Log& log, const model::Robot& robot) {
  Eigen::MatrixXd error = log.qref - log.q;
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    const std::string name = fmt::format("qlink{}", elasticity.joint + 1);
    for (const auto& [column, values] : log.extra) {
      if (column == name) error.col(elasticity.joint) = log.qref.col(elasticity.joint) - values;
    }
  }
  return error;
}

/// Distance between the tool and where the reference has it, sample by sample.
Eigen::VectorXd tool_error(const model::Robot& robot, const Eigen::MatrixXd& reference,
                           const Eigen::MatrixXd& error) {
  const model::Kinematics kinematics(robot);
  Eigen::VectorXd distance(error.rows());
  for (Eigen::Index k = 0; k < error.rows(); ++k) {
    const Eigen::VectorXd wanted = reference.row(k).transpose(), q = wanted - error.row(k).transpose();
    distance[k] = (kinematics.tip(wanted).position - kinematics.tip(q).position).norm();
  }
  return distance;
}

/// Settings from the scenario's controller of kind "track"; defaults with any other kind.
ControllerSettings read_settings(const sim::Scenario& scenario, std::vector<std::string>& notes) {
  ControllerSettings settings;
  if (scenario.controller.kind == "track") {
    const host::SettingsReader& reader = scenario.controller.settings;
    settings.bandwidth_hz = reader.number_or("bandwidth_hz", settings.bandwidth_hz, host::Range::kPositive);
    settings.damping_ratio =
        reader.number_or("damping_ratio", settings.damping_ratio, host::Range::kPositive);
    settings.friction_feed_forward = reader.flag_or("friction_feed_forward", true);
    const int n = scenario.settings.robot.num_joints();
    if (reader.has("rows")) settings.rows = static_cast<int>(reader.whole_number("rows", 1, n));
    settings.filter_hz = reader.number_or("filter_hz", settings.filter_hz, host::Range::kPositive);
    settings.mass_prior = reader.number_or("mass_prior", 0.0, host::Range::kNotNegative);
    settings.noise = reader.numbers_or_none("torque_residual", n, host::Range::kPositive);
    reader.finish();
  } else if (scenario.controller.kind != "none") {
    notes.push_back(
        fmt::format("{}: its own controller \"{}\" is not used here; a controller of kind \"track\" sets "
                    "what the compared ones share",
                    scenario.file, scenario.controller.kind));
  }
  return settings;
}

Run part_of(const Run& run, double from) {
  Eigen::Index first = 0;
  while (first < run.time.size() && run.time[first] < from) ++first;
  const Eigen::Index rows = run.time.size() - first;
  return {run.name, run.time.tail(rows), run.error.bottomRows(rows), run.torque.bottomRows(rows),
          run.tool_error.tail(rows)};
}

/// The arm that the controllers believe in.
model::Robot believed_arm(const sim::Scenario& scenario, const Options& options,
                          std::vector<std::string>& notes) {
  // The undeclared effects of the scenario are what controllers do not know, unless a model has them.
  model::Robot nominal = model::without_effects(scenario.settings.robot);
  take_friction(scenario.file, nominal);
  if (options.model) model::apply(*options.model, nominal, &notes);
  const Eigen::Vector3d believed = Eigen::Map<const Eigen::Vector3d>(nominal.gravity.data());
  if (scenario.settings.gravity && !scenario.settings.gravity->isApprox(believed, 1e-6)) {
    // The controllers believe the base to be as the scenario's robot has it; a tilt is for the plant alone.
    notes.push_back(fmt::format("{}: gravity differs from the {}; the controllers do not know it",
                                scenario.file, options.model ? "model's" : "robot's"));
  }
  return nominal;
}

/// Simulates the scenario under every controller.
std::vector<sim::SimulationEvent> simulate(const sim::SimulationSettings& base, const model::Robot& nominal,
                                           const model::Robot& identified, const Options& options,
                                           Tracking& result) {
  const auto trace = std::make_shared<LoadTrace>();
  std::vector<sim::SimulationEvent> events;
  result.runs.resize(options.wrong ? kMethods.size() : kMethodsOfAKnownArm);
  const auto run = [&](std::size_t i) {
    sim::SimulationSettings own = base;
    own.controller = make_controller(kMethods[i], kMethods[i] == Method::kIdentified ? identified : nominal,
                                     result.settings, kMethods[i] == Method::kEstimated ? trace : nullptr);
    own.log_truth = own.log_truth || !base.robot.elasticities.empty();
    sim::SimulationResult simulated = sim::simulate(own);
    const Eigen::MatrixXd error = tracking_error(simulated.log, base.robot);
    result.runs[i] = {to_string(kMethods[i]), simulated.log.time, error, simulated.log.tau,
                      tool_error(base.robot, simulated.log.qref, error)};
    if (kMethods[i] == Method::kEstimated) events = std::move(simulated.events);
  };
  host::for_each_parallel(result.runs.size(), run, options.progress);
  result.load = *trace;
  return events;
}

void take_load_events(const sim::SimulationSettings& base, const std::vector<sim::SimulationEvent>& events,
                      Tracking& result) {
  std::size_t next = 0;
  for (const sim::SimulationEvent& event : events) {
    if (event.joint >= 0) continue;
    const bool grasp = event.kind == sim::SimulationEvent::Kind::kGrasp;
    result.events.push_back({event.time, grasp});
    result.true_mass = grasp ? base.payload_events[next].body.mass : 0.0;
    ++next;
  }
  for (const sim::PayloadEvent& event : base.payload_events) {
    if (event.grasp) result.largest_mass = std::max(result.largest_mass, event.body.mass);
  }
}

/// The mass is judged by the truth, the tracking by what it is without the estimate.
host::Judgement judge(const Tracking& result) {
  host::Judgement judgement;
  // An arm that is wrong goes into the load of an observer that takes it for right.
  if (std::isfinite(result.mass_half_width()) && !result.wrong) {
    judgement.add(validate::judge_against_truth("the estimated mass", result.mass(), result.mass_half_width(),
                                                result.true_mass));
  }
  std::string what = result.wrong ? "the tracking error with the estimated arm"
                                  : "the tracking error with the estimated load";
  if (!result.after.empty()) what += fmt::format(", from {:.6g} s on,", result.settled);
  judgement.add(validate::judge_improvement(what, result.judged(result.estimating()).rms(),
                                            "that with nominal values",
                                            result.judged(Method::kComputedTorque).rms()));
  return judgement;
}

}  // namespace

double Run::rms() const {
  return std::sqrt(error.squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, error.size())));
}

double Run::peak() const { return error.size() == 0 ? kNaN : error.cwiseAbs().maxCoeff(); }

double Run::tool_rms() const {
  return std::sqrt(tool_error.squaredNorm() / static_cast<double>(tool_error.size()));
}

double Run::tool_peak() const { return tool_error.size() == 0 ? kNaN : tool_error.maxCoeff(); }

double WrongModel::doubt() const { return std::sqrt((least * least + least * most + most * most) / 3.0); }

double Tracking::mass() const { return load.mass.empty() ? kNaN : load.mass.back(); }

double Tracking::mass_half_width() const { return load.mass.empty() ? kNaN : load.mass_half_width.back(); }

Tracking track(const sim::Scenario& scenario, const Options& options) {
  const sim::SimulationSettings& base = scenario.settings;
  if (base.reference == nullptr) {
    throw ModelError(fmt::format(
        "{}: /reference: found none, expected a motion to be tracked; add \"reference\"", scenario.file));
  }
  if (options.from >= base.duration) {
    throw ModelError(
        fmt::format("{}: /duration: found {} s, expected more than the {} s of --from; lower --from",
                    scenario.file, base.duration, options.from));
  }
  Tracking result;
  result.scenario = scenario.file;
  result.robot = base.robot.name;
  result.duration = base.duration;
  result.sample_rate = base.sample_rate;
  result.from = options.from;
  const model::Robot identified = believed_arm(scenario, options, result.notes);
  if (options.wrong) check(*options.wrong);
  const model::Robot nominal = options.wrong ? wrong_model(identified, *options.wrong) : identified;
  result.wrong = options.wrong;
  result.model_effects =
      static_cast<int>(nominal.effects.size() + nominal.elasticities.size() + nominal.couplings.size() +
                       nominal.cables.size());
  result.settings = read_settings(scenario, result.notes);
  result.settings.torque_limit = base.torque_limit;
  result.settings.inertia = mean_inertia(nominal, *base.reference, base.duration);
  result.settings.load_response = load_response(nominal, *base.reference, base.duration);

  if (options.wrong) result.settings.doubt = std::max(kLeastDoubt, options.wrong->doubt());

  take_load_events(base, simulate(base, nominal, identified, options, result), result);

  for (const Run& run : result.runs) result.counted.push_back(part_of(run, options.from));
  result.settled = (result.events.empty() ? 0.0 : result.events.back().time) + kSettling;
  if (!result.events.empty() && result.settled < base.duration && result.settled > options.from) {
    for (const Run& run : result.runs) result.after.push_back(part_of(run, result.settled));
  }
  result.judgement = judge(result);
  return result;
}

LoadComparison compare_loads(const sim::Scenario& scenario, const std::vector<double>& masses,
                             const Options& options) {
  const auto& events = scenario.settings.payload_events;
  if (std::none_of(events.begin(), events.end(), [](const auto& event) { return event.grasp; })) {
    throw ModelError(fmt::format(
        "{}: /payload: found no grasp, expected a load whose mass is to be varied; add an event \"grasp\"",
        scenario.file));
  }
  if (masses.empty()) throw ModelError("loads: found no mass, expected at least one [kg]");
  LoadComparison result;
  result.masses = masses;
  for (std::size_t k = 0; k < masses.size(); ++k) {
    const double mass = masses[k];
    if (!(mass >= 0) || !std::isfinite(mass)) {
      throw ModelError(fmt::format("loads: found {} kg, expected masses from zero on", mass));
    }
    sim::Scenario loaded = scenario;
    auto& own = loaded.settings.payload_events;
    for (sim::PayloadEvent& event : own) {
      if (!event.grasp) continue;
      const double scale = event.body.mass > 0 ? mass / event.body.mass : 0.0;
      event.body.mass = mass;
      event.body.inertia *= scale;
    }
    if (mass <= 0) own.clear();
    Options of_load = options;
    if (options.progress) {
      const double first = static_cast<double>(k), all = static_cast<double>(masses.size());
      of_load.progress = [&options, first, all](double done) { options.progress((first + done) / all); };
    }
    result.tracking.push_back(track(loaded, of_load));
    result.judgement.add(result.tracking.back().judgement, fmt::format("load of {:.6g} kg: ", mass));
  }
  return result;
}

}  // namespace heft::track
