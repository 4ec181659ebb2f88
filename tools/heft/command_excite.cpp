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
#include "heft/excite/separate.hpp"
#include "heft/host/file.hpp"
#include "heft/page/page.hpp"
#include "heft/report/motion.hpp"
#include "heft/report/separating_motion.hpp"
#include "motion_safety.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct ExciteOptions {
  RobotOptions robot;
  ResultOptions result;
  SafetyOptions safety;
  bool speed_given{false};
  std::string output, urscript, ros;
  std::string purpose{"parameters"};
  std::string diagnosis;  ///< whose rivals are to be separated
  std::string cost{"d-optimal"};
  std::string rows{"torque-limit"};
  std::string torque_at{"motor"};
  bool rotor_inertia{false};
  bool offset{false};
  bool payload_only{false};
  bool no_rehearsal{false};
  std::vector<std::string> given;
  ReadOptions read;
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

/// The motion of logs already taken.
std::vector<excite::Options::Given> given_of(const ExciteOptions& options, const model::Robot& robot) {
  if (options.given.empty()) return {};
  data::LogFiles files;
  files.judge = options.given;
  files.robot = robot.name;
  files.cutoff = options.band;
  files.torque = false;
  files.as = read_as(options.read, robot);
  files.min_samples = 10;
  std::vector<std::string> notes;
  std::vector<excite::Options::Given> given = excite::given_motions(open_logs(robot, files), &notes);
  for (const std::string& text : notes) note(text);
  return given;
}

excite::Options design_options(const ExciteOptions& options, const model::Robot& robot) {
  excite::Options design;
  design.search = options.design;
  design.search.cost =
      options.cost == "condition" ? excite::ExcitationCost::kCondition : excite::ExcitationCost::kDOptimal;
  design.search.weights =
      options.rows == "unit" ? excite::RowWeights::kUnit : excite::RowWeights::kTorqueLimit;
  design.search.structure.rotor_inertia = options.rotor_inertia;
  design.search.structure.offset = options.offset;
  design.search.payload_only = options.payload_only;
  design.search.start = vector_of(options.start);
  design.torque_at = options.torque_at == "joint" ? TorqueAt::kJoint : TorqueAt::kMotor;
  design.noise_percent = options.noise_percent;
  design.compare = options.compare;
  design.payload = payload_of(options.payload);
  if (!options.from.empty()) design.from = vector_of(options.from);
  design.rate = options.rate;
  design.rehearse = !options.no_rehearsal;
  design.given = given_of(options, robot);
  return design;
}

excite::FrictionOptions friction_options(const ExciteOptions& options) {
  excite::FrictionOptions friction = options.friction;
  friction.pose = vector_of(options.start);
  friction.payload = payload_of(options.payload);
  if (!options.from.empty()) friction.from = vector_of(options.from);
  friction.rate = options.rate;
  friction.rehearse = !options.no_rehearsal;
  friction.seed = options.design.seed;
  return friction;
}

excite::SeparateOptions separate_options(const ExciteOptions& options) {
  excite::SeparateOptions separate;
  separate.duration = options.design.duration;
  separate.payload = payload_of(options.payload);
  if (!options.from.empty()) separate.from = vector_of(options.from);
  separate.rate = options.rate;
  separate.rehearse = !options.no_rehearsal;
  separate.seed = options.design.seed;
  return separate;
}

/// All files of a motion; one that cannot be written does not keep the others from it.
void finish_files(const Console& console, const ExciteOptions& options, const excite::Motion& motion,
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

template <typename Motion>
void print_and_write(const Console& console, const ExciteOptions& options, const Motion& motion) {
  console.print("{}", report::full(motion));
  finish_files(console, options, motion, report::json(motion), report::page(motion));
}

void run_separate(const Console& console, const ExciteOptions& options, const model::Robot& robot,
                  const excite::LimitsFile& limits) {
  const excite::Questions questions = excite::read_questions(robot, options.diagnosis);
  excite::SeparateOptions asked = separate_options(options);
  excite::SeparatingMotion motion;
  {
    Progress progress("designing");
    asked.progress = [&](double done) { progress.update(done); };
    motion = excite::separate(robot, limits, questions, asked);
  }
  print_and_write(console, options, motion);
}

void run(const ExciteOptions& options) {
  const Console console{options.output, options.urscript, options.ros, options.result.json};
  const model::Robot robot = load_robot(options.robot);
  if (!options.urscript.empty()) {
    const std::string objection = excite::urscript_objection(robot, options.rate);
    if (!objection.empty()) throw UsageError("--write-urscript: " + objection);
  }
  const excite::LimitsFile limits = load_limits(options.robot, robot, options.safety, options.speed_given);
  if (options.purpose == "friction") {
    return print_and_write(console, options,
                           excite::friction_strokes(robot, limits, friction_options(options)));
  }
  if (!options.diagnosis.empty()) return run_separate(console, options, robot, limits);
  excite::Options asked = design_options(options, robot);
  excite::ExcitingMotion motion;
  {
    Progress progress("designing");
    asked.progress = [&](double done) { progress.update(done); };
    motion = excite::design(robot, limits, asked);
  }
  print_and_write(console, options, motion);
}

/// What is below the table of options.
constexpr const char* kExciteFooter =
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
    "Example: heft excite --model extended.json --separate diagnosis.json -o next.csv\n"
    "Example: heft excite --urdf ur10e --for friction --from 0,-1.57,1.57,0,0,0 -o strokes.csv "
    "--write-urscript strokes.script";

void add_motion_options(CommandLine line, ExciteOptions& options) {
  line.add_option("--for", options.purpose,
                  "parameters (a Fourier motion that reveals them) or friction (strokes at constant speed, "
                  "both ways, at several speeds, joint by joint)")
      .type_name("WHAT")
      .one_of({"parameters", "friction"})
      .capture_default_str();
  line.add_option(
          "--separate", options.diagnosis,
          "JSON of heft diagnose: the motion that separates the rivals which it left open, or finds whether the "
          "unexplained part goes with position, velocity or load")
      .type_name("DIAGNOSIS.json")
      .names_file(FileUse::kInput);
  line.add_option("--duration", options.design.duration, "length of the motion [s]")
      .type_name("S")
      .positive()
      .capture_default_str();
  line.add_option("--period", options.design.period,
                  "period of the first harmonic [s] (default: the duration)")
      .type_name("S")
      .positive();
  line.add_option("--harmonics", options.design.harmonics, "harmonics a joint")
      .type_name("N")
      .between(1, 40)
      .capture_default_str();
}

/// What is asked of the motion, and for which fit.
void add_fit_options(CommandLine line, ExciteOptions& options) {
  line.add_option("--cost", options.cost,
                  "d-optimal (smallest standard deviations) or condition (smallest condition number)")
      .type_name("COST")
      .one_of({"d-optimal", "condition"})
      .capture_default_str();
  line.add_option("--rows", options.rows,
                  "weight of a joint's rows: torque-limit (1 over its torque noise) or unit")
      .type_name("WEIGHT")
      .one_of({"torque-limit", "unit"})
      .capture_default_str();
  line.add_option(
          "--torque-at", options.torque_at,
          "where torque will be measured: motor (with friction columns) or joint (a sensor behind the gear: "
          "rigid bodies only)")
      .type_name("WHERE")
      .one_of({"motor", "joint"})
      .capture_default_str();
  line.add_flag("--rotor-inertia", options.rotor_inertia, "for a fit that includes rotor inertias");
  line.add_flag("--offset", options.offset, "for a fit that includes torque offsets");
  line.add_flag("--payload-only", options.payload_only,
                "for a fit of the last link's ten parameters only, the arm being known");
  line.add_option("--given", options.given,
                  "log already recorded; the motion is designed to complement it; may be given several times")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements);
  line.add_option("--band", options.band, "low-pass for derived motion of given logs [Hz] (default: chosen)")
      .type_name("HZ")
      .positive();
  add_read_options(line, options.read);
}

void add_arm_options(CommandLine line, ExciteOptions& options) {
  line.add_option(
          "--start", options.start,
          "position at both ends (default: free); with --for friction the pose around which joints move")
      .type_name("Q,Q,...")
      .delimiter(',');
  line.add_option("--from", options.from,
                  "present pose of the arm: a safe way from there to the motion and back is added")
      .type_name("Q,Q,...")
      .delimiter(',');
  add_payload_option(line, options.payload);
  line.add_option("--speeds", options.friction.speeds, "--for friction: number of speeds of each joint")
      .type_name("N")
      .between(1, 50)
      .capture_default_str();
  line.add_option("--stroke", options.friction.longest_stroke,
                  "--for friction: longest time at constant speed [s]")
      .type_name("S")
      .positive()
      .capture_default_str();
  line.add_flag("--no-rehearsal", options.no_rehearsal,
                "leave out the run on the simulated arm (the verdict is then doubtful)");
  line.add_option("--noise", options.noise_percent, "torque noise [% of the torque limit]")
      .type_name("PERCENT")
      .positive()
      .capture_default_str();
}

void add_search_options(CommandLine line, ExciteOptions& options) {
  line.add_option("--rate", options.rate, "rows a second of the output [Hz]")
      .type_name("HZ")
      .positive()
      .capture_default_str();
  line.add_option("--starts", options.design.starts, "random motions to search from")
      .type_name("N")
      .between(1, 10000)
      .capture_default_str();
  line.add_option("--seed", options.design.seed, "seed of the random motions")
      .type_name("N")
      .capture_default_str();
  line.add_option("--compare", options.compare, "random motions inside the same limits to compare with")
      .type_name("N")
      .between(0, 100000)
      .capture_default_str();
}

void add_file_options(CommandLine line, ExciteOptions& options) {
  line.add_option("--write-urscript", options.urscript,
                  "the motion as a program of Universal Robots' controllers, a servoj each row")
      .type_name("FILE.script")
      .names_file(FileUse::kOutput);
  line.add_option("--write-ros", options.ros,
                  "the motion as a ROS 2 trajectory_msgs/msg/JointTrajectory (YAML)")
      .type_name("FILE.yaml")
      .names_file(FileUse::kOutput);
  add_output_option(line, options.output,
                    "motion (CSV): time, q*, qd*, qdd*, tau* (predicted torque); - is standard output");
}

void refuse_options_of_the_other_purpose(const ExciteOptions& options, const CommandLine& line) {
  const bool friction = options.purpose == "friction";
  const auto only_for = [&](bool mine, const char* purpose, std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (!mine && line.count(name) > 0)
        throw UsageError(fmt::format("{} is for --for {} only; leave one of them out", name, purpose));
    }
  };
  only_for(friction, "friction", {"--speeds", "--stroke"});
  only_for(!friction, "parameters",
           {"--duration", "--period", "--harmonics", "--cost", "--rows", "--rotor-inertia", "--offset",
            "--payload-only", "--given", "--noise", "--starts", "--compare", "--separate"});
  for (const char* name :
       {"--period", "--harmonics", "--cost", "--rows", "--torque-at", "--rotor-inertia", "--offset",
        "--payload-only", "--given", "--band", "--noise", "--starts", "--compare", "--start"}) {
    if (!options.diagnosis.empty() && line.count(name) > 0)
      throw UsageError(fmt::format(
          "{} does not go with --separate, whose motion is designed for its rivals; leave it out", name));
  }
}

}  // namespace

Action set_up_excite(CommandLine line) {
  auto options = std::make_shared<ExciteOptions>();
  add_robot_options(line, options->robot);
  add_safety_options(line, options->safety);
  add_motion_options(line, *options);
  add_fit_options(line, *options);
  add_arm_options(line, *options);
  add_search_options(line, *options);
  add_file_options(line, *options);
  add_result_options(line, options->result);
  line.parse_complete_callback([options, line] {
    options->speed_given = line.count("--tool-speed") > 0;
    refuse_options_of_the_other_purpose(*options, line);
  });
  line.footer(kExciteFooter);
  return [options] { run(*options); };
}

}  // namespace heft::tools
