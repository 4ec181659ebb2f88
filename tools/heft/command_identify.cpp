/// @file
/// heft identify: a model from logs, judged on logs it has not seen.
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "coupling_option.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/identify/identify.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/identification.hpp"
#include "heft/urdf/urdf_export.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct IdentifyOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::vector<std::string> validate;
  double split{0.7};  ///< share of a single log that is trained on; 0: all of it
  std::string method{"wls"};
  std::string instruments{"simulated"};
  std::vector<std::string> without;
  std::vector<std::string> couplings;
  double ridge{1000.0};
  double standstill{0.0};
  std::string model;
  std::string write_urdf;
  bool allow_impossible{false};
};

identify::Method method_of(const std::string& name) {
  for (const auto method : {identify::Method::kOls, identify::Method::kWls, identify::Method::kIrls,
                            identify::Method::kIv, identify::Method::kTls, identify::Method::kPhysical}) {
    if (name == to_string(method)) return method;
  }
  return identify::Method::kWls;
}

identify::Instruments instruments_of(const std::string& name) {
  if (name == "delayed") return identify::Instruments::kDelayed;
  if (name == "reference") return identify::Instruments::kReference;
  return identify::Instruments::kSimulated;
}

regression::ModelStructure structure_of(const IdentifyOptions& options) {
  regression::ModelStructure structure;
  for (const std::string& what : options.without) {
    if (what == "rotor") structure.rotor_inertia = false;
    if (what == "coulomb") structure.coulomb = false;
    if (what == "viscous") structure.viscous = false;
    if (what == "offset") structure.offset = false;
  }
  structure.couplings = couplings_of(options.couplings);
  return structure;
}

identify::FitOptions fit_options_of(const IdentifyOptions& options) {
  identify::FitOptions fitting;
  fitting.method = method_of(options.method);
  fitting.structure = structure_of(options);
  fitting.observation.standstill_speed = options.standstill;
  fitting.instruments = instruments_of(options.instruments);
  fitting.ridge_from_condition = options.ridge;
  return fitting;
}

void write_robot(const IdentifyOptions& options, const identify::Identification& found, const Console& console) {
  if (options.write_urdf.empty()) return;
  urdf::UrdfExportOptions exporting;
  exporting.allow_impossible = options.allow_impossible;
  exporting.model = found.model_file();
  urdf::UrdfExportReport written;
  urdf::write_urdf(urdf::resolve_robot(options.robot.urdf), found.fit.robot, options.write_urdf, exporting,
                   &written);
  console.print("{}", report::urdf_notes(written.notes));
  if (!host::is_standard_output(options.write_urdf)) console.print("Robot: {}\n", options.write_urdf);
}

void run(const IdentifyOptions& options) {
  const Console console{options.result.json, options.model, options.write_urdf};
  identify::Options asked;
  asked.fit = fit_options_of(options);  // wrong usage comes before bad files
  asked.band = options.log.band;
  asked.traces = !options.result.report.empty();
  const model::Robot robot = load_robot(options.robot);
  if (!options.write_urdf.empty() && options.robot.urdf.empty()) {
    throw ModelError("--write-urdf needs the URDF to write into: give it with --urdf");
  }
  data::LogFiles files = files_of(options.log, robot, options.validate);
  files.split = options.split;
  const data::LogSet logs = open_logs(robot, files);
  asked.torque = judge_torque(logs, robot, options.log);
  identify::Identification found;
  {
    Progress progress("identifying");
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    found = identify::identify(robot, logs, asked);
  }
  for (const std::string& text : found.notes) note(text);
  console.print("{}", report::full(found));
  write_each({[&] { write_robot(options, found, console); },
              [&] {
                finish(console, options.model, options.result, report::json(found), report::page(found),
                       [&] { model::write_model(options.model, found.model_file()); });
              }});
}

}  // namespace

Action set_up_identify(CommandLine line) {
  auto options = std::make_shared<IdentifyOptions>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.add_option("--validate", options->validate,
                  "log to judge the model on, not used for the fit; may be given several times")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements);
  line.add_option("--split", options->split,
                  "fraction of a single log used for fitting when --validate is missing; the rest is used "
                  "for validation (0: fit to all of it)")
      .type_name("SHARE")
      .from_to_below(0.0, 1.0)
      .capture_default_str();
  line.add_option("--method", options->method,
                  "ols, wls (joints weighted by their noise), irls (robust), iv (instruments), tls, "
                  "physical (physically possible links)")
      .one_of({"ols", "wls", "irls", "iv", "tls", "physical"})
      .capture_default_str();
  line.add_option("--instruments", options->instruments,
                  "for iv and the test for bias: simulated along the smoothed motion, delayed, or reference "
                  "(simulated along the commanded positions qref1.. of the log)")
      .one_of({"simulated", "delayed", "reference"})
      .capture_default_str();
  line.add_option("--without", options->without, "leave columns out: rotor, coulomb, viscous, offset")
      .type_name("WHAT,...")
      .delimiter(',')
      .one_of({"rotor", "coulomb", "viscous", "offset"});
  add_coupling_option(line, options->couplings, "known gear coupling");
  line.add_option("--ridge", options->ridge,
                  "condition number from which a ridge towards the URDF steadies the fit; 0: never")
      .type_name("NUMBER")
      .not_negative()
      .capture_default_str();
  line.add_option("--standstill", options->standstill,
                  "leave out all rows of joints slower than this [rad/s, m/s]; rests are left out anyway")
      .type_name("SPEED")
      .not_negative()
      .capture_default_str();
  add_output_option(line, options->model, "model file", false);
  line.add_option("--write-urdf", options->write_urdf, "copy of the URDF with the identified parameters")
      .type_name("OUT.urdf")
      .names_file(FileUse::kOutput);
  line.add_flag("--allow-impossible", options->allow_impossible,
                "write links to the URDF even if their inertia is physically impossible");
  add_result_options(line, options->result);
  line.footer(
      "Example: heft identify --urdf ur10e --log a.csv --log b.csv --validate c.csv -o arm.json --report "
      "arm.html\n"
      "A single log is cut in two, so that the error is always one on unseen data.");
  return [options] { run(*options); };
}

}  // namespace heft::tools
