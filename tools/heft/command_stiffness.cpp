/// @file
/// heft stiffness: joint stiffness from load and deflection measurements or from the encoders of a log, and what follows
/// from it for the tool.
#include <charconv>
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {

namespace {

void add_measurement_options(CommandLine line, StiffnessCommandOptions& options) {
  line.add_option("--measurements", options.measurements,
                  "loads and deflections (CSV, see below); may be given several times")
      .type_name("M.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option(
          "--groups", options.groups,
          "joints that share one stiffness, as where gears are of one size; joints left out count as rigid")
      .type_name("1-3,4-6");
  line.add_flag("--complementary", options.complementary,
                "with the complementary stiffness: the load turns with the arm as it gives way");
  line.add_flag("--keep-singular", options.keep_singular,
                "fit singular poses, too (the direct method leaves them out)");
  line.add_flag(
      "--missing-is-zero", options.missing_is_zero,
      "direct method: components of the deflection that were not read are zero in axes of the tool");
}

void add_encoder_options(CommandLine line, StiffnessCommandOptions& options) {
  add_log_options(line, options.log);
  add_accept_torque_option(line, options.log);
  line.get_option("--log").required(false).description(
      "log with link-side encoders qlink1.. in addition to q1.. (stiffness, hysteresis), or of the motor "
      "side alone (then with --validate); may be given several times");
  line.add_option("--validate", options.validate, "motor side alone: log to judge the elasticity on")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements);
  line.add_option(
          "--rotor-inertia", options.rotor_inertia,
          "link-side encoders: rotor inertias on the link side of the gear, ratio² times the rotor's [kg·m²] "
          "(default: the model's); torque that the gear never carries")
      .type_name("J,J,...")
      .delimiter(',');
}

/// Springs that are known, and the tool under load.
void add_tool_options(CommandLine line, StiffnessCommandOptions& options) {
  line.add_option("--stiffness", options.stiffness,
                  "stiffnesses known already [N·m/rad, N/m], one a joint, for --payload")
      .type_name("K,K,...")
      .infinity_too()
      .delimiter(',');
  line.add_option("--payload", options.payload.mass, "mass on the tool [kg]: how far the tool sags")
      .type_name("KG")
      .positive();
  line.add_option("--com", options.payload.com, "where it hangs, in the tool frame [m] (default: at the tip)")
      .type_name("X,Y,Z")
      .delimiter(',')
      .expected(3);
  line.add_option("--path", options.path, "log whose positions q1.. the loaded tool is to keep to")
      .type_name("LOG")
      .names_file(FileUse::kInput);
  line.add_option("--compensated", options.compensated,
                  "write that log with positions that compensate for the sag")
      .type_name("LOG.csv")
      .names_file(FileUse::kOutput);
}

void add_plan_options(CommandLine line, StiffnessCommandOptions& options) {
  line.add_option("--plan", options.plan,
                  "choose this many poses to measure at under --pull; -o writes a file to be filled in")
      .type_name("N")
      .between(1, 200);
  line.get_option("--map").description(
      "columns of the log that are not recognised, heft's name first: tau=effort,q=position; time=500Hz gives rows without "
      "time a rate; or a JSON file of the same. With --plan: two joints J,K of the map of dexterity in the report (default: "
      "2,3)");
  line.add_option(
          "--pull", options.pull,
          "force on the tool [N], base axes, at --com (a weight alone never loads an upright first axis)")
      .type_name("X,Y,Z")
      .delimiter(',')
      .expected(3);
  add_pose_options(line, options.safety);
}

/// --map J,K of --plan.
void take_joints_of_map(StiffnessCommandOptions& options) {
  std::vector<std::string>& words = options.log.read.map;
  if (options.plan == 0 || words.empty()) return;
  options.map.clear();
  for (const std::string& word : words) {
    int joint = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), joint);
    if (error == std::errc() && end == word.data() + word.size()) options.map.push_back(joint);
  }
  if (options.map.size() != 2 || words.size() != 2)
    throw UsageError("--map of --plan: expected two joints, such as 2,3");
  words.clear();
}

void refuse_options_that_do_not_go_together(const StiffnessCommandOptions& options) {
  const int jobs = (options.measurements.empty() ? 0 : 1) + (options.log.logs.empty() ? 0 : 1) +
                   (options.stiffness.empty() ? 0 : 1) + (options.plan > 0 ? 1 : 0);
  if (jobs != 1) {
    throw UsageError(
        "give one of --measurements M.csv (loads and deflections), --log LOG.csv (encoders), "
        "--stiffness K,K,... (known stiffnesses) or --plan N (poses to measure at)");
  }
  if (!options.path.empty() && options.payload.mass <= 0.0) {
    throw UsageError("--path needs --payload KG: without a load nothing sags");
  }
  if (!options.compensated.empty() && options.path.empty()) {
    throw UsageError("--compensated needs --path LOG.csv: the positions to be compensated");
  }
  if (options.plan > 0 && options.pull.empty()) {
    throw UsageError("--plan needs --pull X,Y,Z: the force [N] that will load the tool, base axes");
  }
  if (!options.log.logs.empty() && options.payload.mass > 0.0) {
    throw UsageError(
        "--payload goes with --measurements or --stiffness; give the stiffnesses of the log's fit "
        "with --stiffness K,K,...");
  }
}

/// What is below the table of options.
constexpr const char* kStiffnessFooter =
    "M.csv has one row a reading, SI units: q1..qN; the load fx fy fz [N] mx my mz [N·m about the tip];\n"
    "what moved: dx dy dz [m], rx ry rz [rad], or d [m] along ux uy uz (a wire, a dial gauge); an empty\n"
    "field was not measured. Also: pose (name; same name, same pose), frame (base or tool: axes of load "
    "and\n"
    "deflection), px py pz (measured point from the tip, axes of the tool), sigma, sigma_r (standard "
    "deviations).\n"
    "Examples:\n"
    "  heft stiffness --urdf ur5 --measurements deflections.csv --report stiffness.html -o elastic.json\n"
    "  heft stiffness --urdf robot.urdf --log a.csv --log b.csv --rotor-inertia 607,844,751,83,98,40\n"
    "  heft stiffness --urdf ur5 --plan 20 --pull 30,20,-40 --com 0.3,0,0 -o poses.csv\n"
    "  heft stiffness --urdf ur5 --stiffness 9e3,9e3,9e3,4e3,4e3,4e3 --payload 5 --path path.csv "
    "--compensated command.csv";

}  // namespace

Action set_up_stiffness(CommandLine line) {
  auto options = std::make_shared<StiffnessCommandOptions>();
  add_robot_options(line, options->robot);
  add_measurement_options(line, *options);
  add_encoder_options(line, *options);
  add_tool_options(line, *options);
  add_plan_options(line, *options);
  add_output_option(line, options->model,
                    "model file with the stiffnesses as elastic joints (--plan: the poses)", false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    refuse_options_that_do_not_go_together(*options);
    take_joints_of_map(*options);
  });
  line.footer(kStiffnessFooter);
  return [options] {
    if (!options->measurements.empty()) return stiffness_from_deflections(*options);
    if (!options->log.logs.empty()) return stiffness_from_motion(*options);
    if (options->plan > 0) return plan_stiffness_measurements(*options);
    stiffness_forward(*options);
  };
}

}  // namespace heft::tools
