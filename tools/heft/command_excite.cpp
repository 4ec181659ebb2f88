/// @file
/// heft excite: design a motion that reveals the parameters, or strokes for friction, and make it safe.
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/log.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/file.hpp"
#include "heft/page/page.hpp"
#include "heft/report/motion.hpp"
#include "motion_safety.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct Options {
  RobotOptions robot;
  ResultOptions result;
  SafetyOptions safety;
  bool speed_given{false};
  std::string output, urscript, ros;
  std::string purpose{"parameters"};
  std::string cost{"d-optimal"};
  std::string rows{"torque-limit"};
  std::string torque_at{"motor"};
  bool rotor_inertia{false};
  bool offset{false};
  bool payload_only{false};
  bool no_rehearsal{false};
  std::vector<std::string> given;
  double band{0.0};
  std::vector<double> start, from, payload;
  double noise_percent{1.0};
  double rate{100.0};
  int compare{20};
  excite::ExcitationOptions design;
  excite::FrictionOptions friction;
};

VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

excite::Payload payload_of(const std::vector<double>& values) {
  excite::Payload payload;
  if (values.empty()) return payload;
  if (values.size() != 1 && values.size() != 4) {
    throw UsageError(fmt::format(
        "--payload: found {} numbers; expected MASS or MASS,X,Y,Z [kg, m in the tip frame]", values.size()));
  }
  payload.mass = values[0];
  if (values.size() == 4) payload.com = {values[1], values[2], values[3]};
  return payload;
}

data::Log read_motion(const std::string& path, double band, const model::Robot& robot) {
  data::LogFiles files;
  files.judge = {path};
  files.robot = robot.name;
  files.cutoff = band;
  files.torque = false;
  files.min_samples = 10;
  std::vector<std::string> notes;
  data::Log log = data::read_motion(open_logs(robot, files).judge().front(), true, &notes).log;
  for (const std::string& text : notes) note(text);
  return log;
}

/// The design's options as the command line and the limits file state them.
excite::Options design_options(const Options& options, const model::Robot& robot,
                               const excite::LimitsFile& file) {
  excite::Options design;
  design.search = options.design;
  design.search.cost =
      options.cost == "condition" ? excite::ExcitationCost::kCondition : excite::ExcitationCost::kDOptimal;
  design.search.weights =
      options.rows == "unit" ? excite::RowWeights::kUnit : excite::RowWeights::kTorqueLimit;
  const bool friction = options.torque_at == "motor";
  design.search.structure = {options.rotor_inertia, friction, friction, options.offset, {}};
  if (friction) design.search.structure.couplings = robot.couplings;
  design.search.payload_only = options.payload_only;
  design.search.start = options.start.empty() ? file.start : vector_of(options.start);
  design.search.torque_noise = file.torque_noise;
  design.noise_share = 0.01 * options.noise_percent;
  design.compare = options.compare;
  design.payload = payload_of(options.payload);
  if (!options.from.empty()) design.from = vector_of(options.from);
  design.rate = options.rate;
  design.rehearse = !options.no_rehearsal;
  for (const std::string& path : options.given) {
    design.given.push_back(excite::given_motion(path, read_motion(path, options.band, robot)));
  }
  return design;
}

/// All files of a motion; one that cannot be written does not keep the others from it.
void finish_files(const Console& console, const Options& options, const excite::Motion& motion,
                  const std::string& json, const page::Page& page) {
  const auto write = [&](const std::string& path, const auto& text) {
    if (path.empty()) return;
    host::write_file_atomically(path, text());
    if (!host::is_standard_output(path)) console.print("Program: {}\n", path);
  };
  write_each(
      {[&] { write(options.urscript, [&] { return excite::to_urscript(motion.log); }); },
       [&] { write(options.ros, [&] { return excite::to_ros_trajectory(motion.log, motion.robot); }); },
       [&] {
         finish(console, options.output, options.result, json, page,
                [&] { data::write_log(options.output, motion.log); });
       }});
}

void run_friction(const Options& options, const Console& console, const model::Robot& robot,
                  const excite::LimitsFile& file) {
  excite::FrictionOptions friction = options.friction;
  friction.pose = options.start.empty() ? file.start : vector_of(options.start);
  friction.payload = payload_of(options.payload);
  if (!options.from.empty()) friction.from = vector_of(options.from);
  friction.rate = options.rate;
  friction.rehearse = !options.no_rehearsal;
  friction.seed = options.design.seed;
  const excite::FrictionMotion motion = excite::friction_strokes(robot, file.limits, friction);
  console.print("{}", report::full(motion));
  finish_files(console, options, motion, report::json(motion), report::page(motion));
}

void run(const Options& options) {
  const Console console{options.output, options.urscript, options.ros, options.result.json};
  const model::Robot robot = load_robot(options.robot);
  if (!options.urscript.empty() && robot.num_joints() != 6) {
    throw UsageError(fmt::format("--write-urscript: robot \"{}\" has {} joints; URScript drives six",
                                 robot.name, robot.num_joints()));
  }
  if (!options.urscript.empty() && options.rate > 500.0) {
    throw UsageError(fmt::format("--write-urscript: --rate {:g} Hz is more than the 500 Hz of the controller",
                                 options.rate));
  }
  const excite::LimitsFile file = load_limits(options.robot, robot, options.safety, options.speed_given);
  if (options.purpose == "friction") return run_friction(options, console, robot, file);
  excite::Options design = design_options(options, robot, file);
  excite::ExcitingMotion motion;
  {
    Progress progress("designing");
    design.progress = [&](double done) { progress.update(done); };
    motion = excite::design(robot, file.limits, design);
  }
  console.print("{}", report::full(motion));
  finish_files(console, options, motion, report::json(motion), report::page(motion));
}

/// What is below the table of options.
constexpr const char* kFooter =
    "A finite Fourier series per joint, at rest at both ends, inside all limits: joints, torque with the "
    "payload,\n"
    "speed of the tool and of every link origin, distance of the links (capsules around the collision "
    "shapes of the\n"
    "URDF, or fitted where it has none) from one another, from floor, box and obstacles. The result is run "
    "on the\n"
    "simulated arm and checked there. Where no safe motion is found, exit code 4 and the limit that stops "
    "it.\n"
    "LIMITS.json; one number holds for all joints, what is left out comes from the URDF:\n"
    "  lower, upper    [rad, m]     velocity, acceleration, torque   [rad/s, rad/s², N·m; m, N]\n"
    "  margin          fraction of every limit that is kept free (0.05)\n"
    "  tool_speed      [m/s] as --tool-speed\n"
    "  floor           [m] above the base origin that the arm stays above, or \"none\" (0; none for a base "
    "that hangs or\n"
    "                  leans by more than 45°)\n"
    "  clearance       [m] kept between links, from floor, box and obstacles (2 % of the arm's length)\n"
    "  box             [[x, y, z], [x, y, z]] corners of a box in the base frame that the arm stays in\n"
    "  obstacles       [{\"name\": \"table\", \"lower\": [x, y, z], \"upper\": [x, y, z]}, ...] boxes that "
    "it stays out of\n"
    "  tool            [x, y, z] a point in the tip frame    tool_radius  [m] of the tool around the line "
    "to it (0.05)\n"
    "  start           position at both ends                 torque_noise standard deviation [N·m, N]\n"
    "The JSON holds the coefficients of the motion, and the same as \"reference\" of a scenario of heft "
    "simulate;\n"
    "heft simulate --urdf R --replay exciting.csv -o log.csv runs the CSV.\n"
    "Example: heft excite --urdf ur10e --duration 20 --report exciting.html -o exciting.csv\n"
    "Example: heft excite --urdf ur10e --for friction --from 0,-1.57,1.57,0,0,0 -o strokes.csv "
    "--write-urscript strokes.script";

}  // namespace

Action set_up_excite(CommandLine line) {
  auto options = std::make_shared<Options>();
  excite::ExcitationOptions& design = options->design;
  add_robot_options(line, options->robot);
  add_safety_options(line, options->safety);
  line.add_option("--for", options->purpose,
                  "parameters (a Fourier motion that reveals them) or friction (strokes at constant speed, "
                  "both ways, at several speeds, joint by joint)")
      .type_name("WHAT")
      .one_of({"parameters", "friction"})
      .capture_default_str();
  line.add_option("--duration", design.duration, "length of the motion [s]")
      .type_name("S")
      .positive()
      .capture_default_str();
  line.add_option("--period", design.period, "period of the first harmonic [s] (default: the duration)")
      .type_name("S")
      .positive();
  line.add_option("--harmonics", design.harmonics, "harmonics a joint")
      .type_name("N")
      .between(1, 40)
      .capture_default_str();
  line.add_option("--cost", options->cost,
                  "d-optimal (smallest standard deviations) or condition (smallest condition number)")
      .type_name("COST")
      .one_of({"d-optimal", "condition"})
      .capture_default_str();
  line.add_option("--rows", options->rows,
                  "weight of a joint's rows: torque-limit (1 over its torque noise) or unit")
      .type_name("WEIGHT")
      .one_of({"torque-limit", "unit"})
      .capture_default_str();
  line.add_option(
          "--torque-at", options->torque_at,
          "where torque will be measured: motor (with friction columns) or joint (a sensor behind the gear: "
          "rigid bodies only)")
      .type_name("WHERE")
      .one_of({"motor", "joint"})
      .capture_default_str();
  line.add_flag("--rotor-inertia", options->rotor_inertia, "for a fit that includes rotor inertias");
  line.add_flag("--offset", options->offset, "for a fit that includes torque offsets");
  line.add_flag("--payload-only", options->payload_only,
                "for a fit of the last link's ten parameters only, the arm being known");
  line.add_option("--given", options->given,
                  "log already recorded; the motion is designed to complement it; may be given several times")
      .type_name("LOG.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--band", options->band, "low-pass for derived motion of given logs [Hz] (default: chosen)")
      .type_name("HZ")
      .positive();
  line.add_option(
          "--start", options->start,
          "position at both ends (default: free); with --for friction the pose around which joints move")
      .type_name("Q,Q,...")
      .delimiter(',');
  line.add_option("--from", options->from,
                  "present pose of the arm: a safe way from there to the motion and back is added")
      .type_name("Q,Q,...")
      .delimiter(',');
  line.add_option("--payload", options->payload,
                  "load on the flange, included in every torque [kg; m in the tip frame]")
      .type_name("MASS[,X,Y,Z]")
      .delimiter(',');
  line.add_option("--speeds", options->friction.speeds, "--for friction: number of speeds of each joint")
      .type_name("N")
      .between(1, 50)
      .capture_default_str();
  line.add_option("--stroke", options->friction.longest_stroke,
                  "--for friction: longest time at constant speed [s]")
      .type_name("S")
      .positive()
      .capture_default_str();
  line.add_flag("--no-rehearsal", options->no_rehearsal,
                "leave out the run on the simulated arm (the verdict is then doubtful)");
  line.add_option("--noise", options->noise_percent, "torque noise [% of the torque limit]")
      .type_name("PERCENT")
      .positive()
      .capture_default_str();
  line.add_option("--rate", options->rate, "rows a second of the output [Hz]")
      .type_name("HZ")
      .positive()
      .capture_default_str();
  line.add_option("--starts", design.starts, "random motions to search from")
      .type_name("N")
      .between(1, 10000)
      .capture_default_str();
  line.add_option("--seed", design.seed, "seed of the random motions").type_name("N").capture_default_str();
  line.add_option("--threads", design.threads,
                  "threads (default: one a processor; the result does not depend on it)")
      .type_name("N")
      .between(1, 256);
  line.add_option("--compare", options->compare, "random motions inside the same limits to compare with")
      .type_name("N")
      .between(0, 100000)
      .capture_default_str();
  line.add_option("--write-urscript", options->urscript,
                  "the motion as a program of Universal Robots' controllers, a servoj each row")
      .type_name("FILE.script")
      .names_file(FileUse::kOutput);
  line.add_option("--write-ros", options->ros,
                  "the motion as a ROS 2 trajectory_msgs/msg/JointTrajectory (YAML)")
      .type_name("FILE.yaml")
      .names_file(FileUse::kOutput);
  add_output_option(line, options->output,
                    "motion (CSV): time, q*, qd*, qdd*, tau* (predicted torque); - is standard output");
  add_result_options(line, options->result);
  line.parse_complete_callback([options, line] {
    options->speed_given = line.count("--tool-speed") > 0;
    const bool friction = options->purpose == "friction";
    const auto only_for = [&](bool mine, const char* purpose, std::initializer_list<const char*> names) {
      for (const char* name : names) {
        if (!mine && line.count(name) > 0)
          throw UsageError(fmt::format("{} is for --for {} only; leave one of them out", name, purpose));
      }
    };
    only_for(friction, "friction", {"--speeds", "--stroke"});
    only_for(!friction, "parameters",
             {"--duration", "--period", "--harmonics", "--cost", "--rows", "--rotor-inertia", "--offset",
              "--payload-only", "--given", "--noise", "--starts", "--compare"});
  });
  line.footer(kFooter);
  return [options] { run(*options); };
}

}  // namespace heft::tools
