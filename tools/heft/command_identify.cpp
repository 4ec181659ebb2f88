/// @file
/// heft identify: a model from logs, judged on logs it has not seen.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "diagnosis_result.hpp"
#include "heft/data/log_checks.hpp"
#include "heft/data/log_part.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/identify/fit.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/identify/judgement.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/page/page.hpp"
#include "heft/urdf/urdf_export.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "heft/validate/score.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

struct Options {
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

/// Longest log that is cut in two in memory.
constexpr long kLongestSplit = 100000;
/// Poses in which the mass matrix of the identified arm is looked at.
constexpr int kPoses = 10000;

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

/// "5,6" or "5,6,0.7": joint 5 also turns the motor of joint 6.
GearCoupling<double> coupling_of(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    char* end = nullptr;
    const double value = std::strtod(part.c_str(), &end);
    if (part.empty() || end != part.c_str() + part.size())
      throw UsageError(fmt::format("--coupling {}: \"{}\" is no number", text, part));
    if (!std::isfinite(value)) {
      throw UsageError(fmt::format("--coupling {}: found {}, expected finite numbers: two joints and a ratio",
                                   text, part));
    }
    numbers.push_back(value);
  }
  if (numbers.size() < 2 || numbers.size() > 3 || std::floor(numbers[0]) != numbers[0] ||
      std::floor(numbers[1]) != numbers[1]) {
    throw UsageError(
        fmt::format("--coupling {}: expected two joints and at most a ratio, as in 5,6 or 5,6,1.0 (joint 5 "
                    "also turns the motor of joint 6)",
                    text));
  }
  GearCoupling<double> coupling;
  coupling.driving = static_cast<int>(numbers[0]) - 1;
  coupling.driven = static_cast<int>(numbers[1]) - 1;
  if (numbers.size() == 3) coupling.ratio = numbers[2];
  return coupling;
}

regression::ModelStructure structure_of(const Options& options) {
  regression::ModelStructure structure;
  // A sensor behind the gear does not see the rotor; friction of bearings and seals, cables and its own zero it does.
  structure.rotor_inertia = options.log.measured_at() == TorqueAt::kMotor;
  for (const std::string& what : options.without) {
    if (what == "rotor") structure.rotor_inertia = false;
    if (what == "coulomb") structure.coulomb = false;
    if (what == "viscous") structure.viscous = false;
    if (what == "offset") structure.offset = false;
  }
  for (const std::string& text : options.couplings) structure.couplings.push_back(coupling_of(text));
  return structure;
}

/// Training and judging logs as streams.
struct Logs {
  std::vector<data::MotionStream> train, judge;
  std::string how;  ///< what was judged on, in words
  host::Judgement torque;
};

Logs open_logs(const Options& options, const model::Robot& robot) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.torque = true;
  needs.torque_constant = options.log.torque_constant;
  data::StreamOptions streaming;
  streaming.motion.cutoff = options.log.band;
  if (options.instruments == "reference") streaming.extra = {"qref"};
  const data::JointLimits limits = limits_of(robot);
  Logs logs;
  const auto checked = [&](data::MotionStream stream) {
    for (const std::string& text : stream.summary().notes) note(text);
    const std::vector<data::LogFinding> findings = stream.check(limits);
    data::refuse_errors(findings);
    for (const data::LogFinding& finding : findings) note(finding.message);
    logs.torque.add(judge_torque(stream, robot, options.log, options.log.measured_at()));
    return stream;
  };
  for (const std::string& path : options.log.logs)
    logs.train.push_back(checked(data::MotionStream(path, needs, streaming)));
  for (const std::string& path : options.validate) {
    logs.judge.push_back(checked(data::MotionStream(path, needs, streaming)));
  }
  if (!logs.judge.empty()) {
    logs.how = "judged on logs that the fit has not seen";
    return logs;
  }
  const data::StreamSummary& summary = logs.train.front().summary();
  if (logs.train.size() > 1 || options.split == 0.0) {
    logs.how = "not judged: no log was held back (--validate)";
    return logs;
  }
  if (summary.samples > kLongestSplit) {
    logs.how = "not judged: the log is too long to be cut in two; give another with --validate";
    return logs;
  }
  const data::Log whole = data::read_log(options.log.logs.front(), needs);
  const double cut = summary.moving_from + options.split * (summary.moving_to - summary.moving_from);
  data::Log first = data::part_of(whole, summary.begin, cut),
            second = data::part_of(whole, cut, summary.end + 1.0);
  // Too short a log has no part to spare; the fit says what is wrong with it.
  if (first.time.size() < 50 || second.time.size() < 50) {
    logs.how = "not judged: the log is too short to be cut in two";
    return logs;
  }
  // One cut-off for both parts.
  streaming.motion.cutoff = summary.cutoff;
  logs.train.clear();
  logs.train.emplace_back(std::move(first), streaming);
  logs.judge.emplace_back(std::move(second), streaming);
  logs.how =
      fmt::format("fitted to the first {:.0f} % of the motion, judged on the rest", 100.0 * options.split);
  return logs;
}

std::vector<const data::MotionStream*> pointers(const std::vector<data::MotionStream>& streams) {
  std::vector<const data::MotionStream*> out;
  for (const data::MotionStream& stream : streams) out.push_back(&stream);
  return out;
}

struct Judged {
  std::vector<validate::Score> scores;
  std::vector<TorqueTrace> traces;
};

Judged judge(const std::vector<data::MotionStream>& streams, const model::Robot& robot, double band,
             bool trace) {
  Judged judged;
  for (const data::MotionStream& stream : streams) {
    Progress progress("judging " + stream.summary().path);
    validate::ScoreOptions scoring;
    scoring.band = band;
    scoring.progress = [&](double done) { progress.update(done); };
    if (trace) {
      judged.traces.emplace_back(stream.summary().samples, robot.num_joints());
      scoring.rows = [&](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                         const Eigen::MatrixXd& predicted) {
        judged.traces.back().add(time, measured, predicted);
      };
    }
    judged.scores.push_back(validate::score(robot, stream, scoring));
  }
  return judged;
}

std::string physics_in_words(const identify::Fit& fit, const model::MassMatrixCheck& mass) {
  std::string text;
  const double loss = 100.0 * (std::sqrt(fit.physical_cost_ratio) - 1.0);
  if (fit.physically_consistent) {
    text = "Every link is physically possible.";
  } else {
    text = "At least one link has physically impossible inertial parameters.";
  }
  text += fmt::format(" Constraining all links to be physical raises the weighted error by {:.2g} %", loss);
  if (!fit.at_boundary.empty()) {
    text += fmt::format("; at the edge of what is possible: link{} {}", fit.at_boundary.size() > 1 ? "s" : "",
                        fmt::join(fit.at_boundary, ", "));
  }
  text += fit.method == identify::Method::kPhysical || fit.physically_consistent
              ? "."
              : " (--method physical takes them).";
  text += fmt::format(" Mass matrix not positive in {} of {} random poses (with rotor inertia: {}).",
                      mass.not_positive, mass.poses, mass.not_positive_with_rotors);
  if (!fit.repaired_prior.empty()) {
    text += fmt::format(
        " The URDF's inertia of link{} {} is none that a body can have; the nearest that can was taken as "
        "prior.",
        fit.repaired_prior.size() > 1 ? "s" : "", fmt::join(fit.repaired_prior, ", "));
  }
  return text;
}

/// The answer in one sentence: on the log and in the joint where the model does worst.
std::string answer_in_words(const std::vector<validate::Score>& scores, bool own) {
  double worst = 0.0, mean = 0.0;
  Eigen::Index joint = 0;
  for (const validate::Score& score : scores) {
    Eigen::Index at = 0;
    const double percent = score.percent_of_max.maxCoeff(&at);
    if (percent > worst) worst = percent, joint = at;
    mean += score.percent_of_max.mean() / static_cast<double>(scores.size());
  }
  return fmt::format(
      "{} the model misses the torque by {:.2g} % of the joint's largest on average and by {:.2g} % "
      "in the worst joint ({}).",
      own ? "On its own training logs" : "On logs that it has not seen", mean, worst, joint + 1);
}

void print_lines(const Console& console, const std::string& title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  console.print("{}\n", title);
  for (const std::string& line : lines) console.print("  {}\n", line);
}

void run(const Options& options) {
  const Console console{options.result.json, options.model, options.write_urdf};
  const regression::ModelStructure structure = structure_of(options);  // wrong usage comes before bad files
  const model::Robot robot = load_robot(options.robot);
  if (!options.write_urdf.empty() && options.robot.urdf.empty()) {
    throw ModelError("--write-urdf needs the URDF to write into: give it with --urdf");
  }
  const Logs logs = open_logs(options, robot);

  identify::FitOptions fitting;
  fitting.method = method_of(options.method);
  fitting.structure = structure;
  fitting.observation.cutoff = options.log.band;
  fitting.observation.standstill_speed = options.standstill;
  fitting.instruments = instruments_of(options.instruments);
  fitting.ridge_from_condition = options.ridge;
  identify::Fit fit;
  {
    Progress progress("fitting");
    fitting.progress = [&](double done) { progress.update(done); };
    fit = identify::fit(robot, pointers(logs.train), fitting);
  }
  const model::MassMatrixCheck mass = model::check_mass_matrix(fit.robot, kPoses, 1);

  double band = options.log.band;
  for (const auto* streams : {&logs.train, &logs.judge}) {
    for (const data::MotionStream& stream : *streams) {
      if (options.log.band == 0.0) band = std::max(band, validate::default_band(stream.summary().bandwidth));
    }
  }
  const bool trace = !options.result.report.empty();
  const Judged train = judge(logs.train, fit.robot, band, trace);
  const Judged held_out = judge(logs.judge, fit.robot, band, trace);
  const validate::Score trained = validate::pool(train.scores);
  host::Judgement judgement = identify::judge(fit, mass, held_out.scores, train.scores);
  judgement.add(logs.torque);
  const std::string meaning = score_meaning(trained) + validation_meaning();

  const model::FitRecord record = identify::fit_record(fit, options.log.torque_at, &trained);
  model::ModelFile file = fit.model_file();
  file.fit = record;
  for (const std::string& path : options.log.logs) file.provenance.logs.push_back(path);
  file.provenance.notes = fit.notes;

  const auto determined = std::count(fit.determined.begin(), fit.determined.end(), true);
  const std::string summary = fmt::format(
      "{} base parameters, {} determined; {} samples of {} in {} rows; torque and regressor behind {:.3g} "
      "Hz; condition number {} "
      "(weighted base regressor, columns of norm 1){}; 95 % intervals from {} blocks of {:.2g} s",
      fit.base.count(), determined, fit.samples,
      logs.train.size() == 1 ? "1 log" : fmt::format("{} logs", logs.train.size()), fit.rows.sum(),
      fit.cutoff, page::number(fit.condition, 3), fit.ridge ? ", steadied by a ridge towards the URDF" : "",
      fit.blocks, fit.block_length);

  nlohmann::ordered_json json{
      {"robot", robot.name}, {"method", options.method}, {"torque_at", options.log.torque_at}};
  put_verdict(json, judgement);
  json["train"] = validation_json(trained);
  // The judged figures stand at the top where there are any: the error on logs not seen is the model's error.
  json.update(validation_json(held_out.scores.empty() ? trained : validate::pool(held_out.scores)));
  json["judged_on"] = held_out.scores.empty() ? "train" : "held_out";
  json["held_out"] = nlohmann::ordered_json::array();
  for (const validate::Score& score : held_out.scores) {
    nlohmann::ordered_json entry{{"log", score.log}};
    entry.update(validation_json(score));
    json["held_out"].push_back(std::move(entry));
  }
  json.update(fit_json(record));
  json["null_space"] = fit.base.null_space;
  json["condition_number_unscaled"] = fit.condition_unscaled;
  json["ridge"] = fit.ridge;
  json["mass_matrix_not_positive"] = {
      {"poses", mass.poses}, {"links", mass.not_positive}, {"with_rotors", mass.not_positive_with_rotors}};
  if (fit.bias) {
    json["bias_test"] = {
        {"statistic", fit.bias->statistic}, {"degrees_of_freedom", fit.bias->degrees_of_freedom},
        {"p_value", fit.bias->p_value},     {"torque_difference", fit.bias->torque_difference},
        {"biased", fit.bias->biased},       {"verdict", fit.bias->verdict}};
  }
  json["notes"] = fit.notes;

  const std::string answer =
      answer_in_words(held_out.scores.empty() ? train.scores : held_out.scores, held_out.scores.empty());
  console.print("{}\n{}\n{}: {}.\n", answer, verdict_text(judgement), robot.name, summary);
  console.print("\nTraining\n{}", validation_text(trained));
  for (const validate::Score& score : held_out.scores) {
    console.print("\nHeld out: {}, {} samples\n{}", score.log, score.samples, validation_text(score));
  }
  console.print("{} {}.\n\nBase parameters (* with others, see expression)\n{}", meaning, capital(logs.how),
                base_parameter_table(record).to_text(2));
  const std::string physics = physics_in_words(fit, mass);
  console.print("\n{}\n", physics);
  if (fit.bias) console.print("Noise in the motion: {}\n", fit.bias->verdict);
  print_lines(console, "\nNot determined by these logs:", fit.missing);
  print_lines(console, "Notes:", fit.notes);

  page::Page page = new_page(fmt::format("{}: identified model", robot.name),
                             fmt::format("{} on {}", options.method, file_names_of(options.log.logs)));
  for (const auto* streams : {&logs.train, &logs.judge}) {
    for (const data::MotionStream& stream : *streams) add_log_line(page, log_line(stream));
  }
  const validate::Score& judged = held_out.scores.empty() ? trained : held_out.scores.front();
  page.verdict(answer, judgement);
  page.facts(
      {{"base parameters", fmt::format("{}", fit.base.count()), fmt::format("{} determined", determined)},
       {"condition number", page::number(fit.condition, 3), "weighted, columns of norm 1"},
       {"physical", fit.physically_consistent ? "yes" : "no", "every link a body that can exist"},
       {"mean R²", fmt::format("{:.3f}", judged.r2.mean()),
        held_out.scores.empty() ? "training" : "held out"}});
  page.paragraph(summary + ".");
  page.paragraph(physics);
  if (fit.bias) page.note("Noise in the motion: " + fit.bias->verdict);
  page.heading("Torque");
  page.table(validation_table(trained), "Training. " + meaning + moving_line(trained));
  for (std::size_t k = 0; k < held_out.scores.size(); ++k) {
    page.table(validation_table(held_out.scores[k]),
               "Held out: " + file_name_of(held_out.scores[k].log) + "." + moving_line(held_out.scores[k]));
    if (k < held_out.traces.size()) {
      page.plots("Torque on the held-out log", small(held_out.traces[k].torque_plots()));
      page.plots("What is left", small(held_out.traces[k].residual_plots()));
    }
  }
  if (held_out.scores.empty()) {
    for (const TorqueTrace& t : train.traces) {
      page.plots("Torque on the training log", small(t.torque_plots()));
      page.plots("What is left", small(t.residual_plots()));
    }
  }
  page.heading("Parameters");
  page.table(base_parameter_table(record),
             "Base parameters with 95 % intervals for residuals correlated in time");
  if (!fit.missing.empty()) {
    page.heading("What these logs do not tell");
    for (const std::string& line : fit.missing) page.note(line);
  }
  page.heading("What no motion of this arm tells");
  page.preformatted(fmt::format("{}", fmt::join(fit.base.null_space, "\n")));
  for (const std::string& line : fit.notes) page.note(line);
  const auto write_robot = [&] {
    if (options.write_urdf.empty()) return;
    urdf::UrdfExportOptions exporting;
    exporting.allow_impossible = options.allow_impossible;
    exporting.model = file;
    urdf::UrdfExportReport written;
    urdf::write_urdf(urdf::resolve_robot(options.robot.urdf), fit.robot, options.write_urdf, exporting,
                     &written);
    print_lines(console, "Notes on the URDF:", written.notes);
    if (!host::is_standard_output(options.write_urdf)) console.print("Robot: {}\n", options.write_urdf);
  };
  write_each({write_robot, [&] {
                finish(console, options.model, options.result, json, page,
                       [&] { model::write_model(options.model, file); });
              }});
}

}  // namespace

Action set_up_identify(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.add_option("--validate", options->validate,
                  "log to judge the model on, not used for the fit; may be given several times")
      .type_name("LOG.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--split", options->split,
                  "share of a single log that the fit gets when there is no --validate; the rest judges "
                  "(0: fit to all of it)")
      .type_name("SHARE")
      .from_to_below(0.0, 1.0)
      .capture_default_str();
  line.add_option("--method", options->method,
                  "ols, wls (joints weighted by their noise), irls (robust), iv (instruments), tls, physical "
                  "(links that can exist)")
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
  line.add_option(
          "--coupling", options->couplings,
          "known gear coupling: joint I also turns the motor of joint J (ratio: J's turn for one of I)")
      .type_name("I,J[,RATIO]");
  line.add_option("--ridge", options->ridge,
                  "condition number from which a ridge towards the URDF steadies the fit; 0: never")
      .type_name("NUMBER")
      .not_negative()
      .capture_default_str();
  line.add_option("--standstill", options->standstill,
                  "leave out rows of joints slower than this [rad/s, m/s]")
      .type_name("SPEED")
      .not_negative()
      .capture_default_str();
  add_output_option(line, options->model, "model file", false);
  line.add_option("--write-urdf", options->write_urdf, "copy of the URDF with the identified parameters")
      .type_name("OUT.urdf")
      .names_file(FileUse::kOutput);
  line.add_flag("--allow-impossible", options->allow_impossible,
                "write links into the URDF that no body can be");
  add_result_options(line, options->result);
  line.footer(
      "Example: heft identify --urdf ur10e --log a.csv --log b.csv --validate c.csv -o arm.json --report "
      "arm.html\n"
      "A single log is cut in two, so that the error is always one on data not seen.");
  return [options] { run(*options); };
}

}  // namespace heft::tools
