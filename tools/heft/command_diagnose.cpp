/// @file
/// heft diagnose: what a model of rigid bodies and simple friction lacks, judged on logs it has not seen.
#include <algorithm>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "diagnosis_report.hpp"
#include "diagnosis_result.hpp"
#include "heft/data/log_checks.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/diagnose/diagnosis.hpp"
#include "heft/host/error.hpp"
#include "heft/identify/fit.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/identify/physical.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/physical_links.hpp"
#include "options.hpp"
#include "page_lines.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::vector<std::string> validate;
  double cutoff{0.0};
  std::string model;
  bool trace{false};
};

/// @param torque  gets what the torque is suspected of
data::Log read(const std::string& path, const Options& options, const model::Robot& robot,
               host::Judgement& torque) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.torque = true;
  PreparedLog prepared = prepare_log(path, options.log, needs);
  const std::vector<data::LogFinding> findings = data::check_log(prepared.log, limits_of(robot));
  data::refuse_errors(findings);
  for (const data::LogFinding& finding : findings) note(finding.message);
  torque.add(judge_torque(prepared.log, robot, options.log, options.log.measured_at()));
  return std::move(prepared.log);
}

/// Whether all rows of `part` stand one after the other in `whole`.
bool holds(const data::Log& whole, const data::Log& part) {
  const Eigen::Index rows = part.q.rows();
  const auto same_row = [&](Eigen::Index i, Eigen::Index k) {
    return whole.q.row(i) == part.q.row(k) && whole.tau.row(i) == part.tau.row(k);
  };
  for (Eigen::Index from = 0; from + rows <= whole.q.rows(); ++from) {
    Eigen::Index k = 0;
    while (k < rows && same_row(from + k, k)) ++k;
    if (k == rows) return true;
  }
  return false;
}

/// A log says nothing about a model that was fitted to it.
void refuse_seen(const std::vector<data::Log>& train, const std::vector<data::Log>& validate) {
  for (const data::Log& judged : validate) {
    for (const data::Log& trained : train) {
      std::error_code ignored;
      const bool same_file = std::filesystem::equivalent(judged.path, trained.path, ignored);
      std::string what;
      if (same_file) {
        what = "given to --log and to --validate";
      } else if (judged.q.rows() == trained.q.rows() ? holds(trained, judged) : false) {
        what = fmt::format("the same samples as {}, given to --log", trained.path);
      } else if (holds(trained, judged)) {
        what = fmt::format("a part of {}, given to --log", trained.path);
      } else if (holds(judged, trained)) {
        what = fmt::format("holds all of {}, given to --log", trained.path);
      }
      if (what.empty()) continue;
      throw DataError(
          fmt::format("{}: {}: expected a log that the fit has not seen, of another motion; record one, or "
                      "cut one log in two",
                      judged.path, what));
    }
  }
}

/// "joints 1, 2 and 4".
std::string joint_list(const std::vector<int>& joints) {
  std::string text = joints.size() == 1 ? "joint " : "joints ";
  for (std::size_t k = 0; k < joints.size(); ++k)
    text += fmt::format("{}{}", k == 0 ? "" : k + 1 == joints.size() ? " and " : ", ", joints[k] + 1);
  return text;
}

constexpr const char* kMotionToRecord =
    "record a motion of at least 20 s in which every joint turns back and forth over much of its range, at "
    "slow and "
    "at fast speeds (heft excite designs one)";

/// Effects are looked for in what rigid bodies and friction leave; without these there is nothing to look in.
void refuse_too_few_parameters(const model::Robot& robot, const std::vector<data::Log>& train,
                               double seconds) {
  constexpr double kLeastShare = 1.0 / 8.0;
  constexpr std::size_t kMostLines = 4;
  identify::FitOptions fitting;
  fitting.structure.rotor_inertia = fitting.structure.offset = false;
  std::vector<data::MotionStream> streams;
  for (const data::Log& log : train) streams.emplace_back(log);
  std::vector<const data::MotionStream*> logs;
  for (const data::MotionStream& stream : streams) logs.push_back(&stream);
  const identify::Fit fit = identify::fit(robot, logs, fitting);
  const auto determined = std::count(fit.determined.begin(), fit.determined.end(), true);
  if (static_cast<double>(determined) >= kLeastShare * static_cast<double>(fit.determined.size())) return;
  const std::vector<std::string> lines(
      fit.missing.begin(), fit.missing.begin() + static_cast<long>(std::min(kMostLines, fit.missing.size())));
  throw NotIdentifiableError(
      fmt::format("{}: {:.2g} s determine {} of {} parameters of rigid bodies and friction, too few to look "
                  "for what they lack; {}. "
                  "Missing among others: {}",
                  train.front().path, seconds, determined, fit.determined.size(), kMotionToRecord,
                  fmt::join(lines, "; ")));
}

/// Largest travel of each joint in one of the logs, and the length of all of them [s].
struct Extent {
  Eigen::VectorXd travel;  ///< [rad, m]
  double seconds{0.0};
};

Extent extent_of(const std::vector<data::Log>& logs) {
  Extent extent{Eigen::VectorXd::Zero(logs.front().q.cols())};
  for (const data::Log& log : logs) {
    extent.travel =
        extent.travel.cwiseMax((log.q.colwise().maxCoeff() - log.q.colwise().minCoeff()).transpose());
    extent.seconds += log.time[log.time.size() - 1] - log.time[0];
  }
  return extent;
}

/// Below it nothing but noise moves [rad, m].
constexpr double kResting = 5e-3;

/// Nothing can be said about an arm that stands still, or that moves for a moment.
void refuse_too_little_motion(const model::Robot& robot, const std::vector<data::Log>& train) {
  // A joint below these never leaves one posture.
  constexpr double kHardlyTurns = 0.05, kHardlySlides = 0.005;  // [rad, m]
  constexpr double kShort = 10.0;                               // [s]
  const int n = robot.num_joints();
  const Extent extent = extent_of(train);
  if (extent.travel.maxCoeff() < kResting) {
    throw NotIdentifiableError(fmt::format(
        "{}: no joint moves by more than {:.2g} rad or m: no parameter and no effect can be found; {}",
        train.front().path, extent.travel.maxCoeff(), kMotionToRecord));
  }
  std::vector<int> hardly;
  for (int j = 0; j < n; ++j) {
    const bool slides = robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
    if (extent.travel[j] < (slides ? kHardlySlides : kHardlyTurns)) hardly.push_back(j);
  }
  if (2 * static_cast<int>(hardly.size()) > n) {
    throw NotIdentifiableError(fmt::format(
        "{}: {} of {} hardly move (by less than {} rad or {} m): their parameters, and what the arm lacks, "
        "cannot be told; {}",
        train.front().path, joint_list(hardly), n, kHardlyTurns, kHardlySlides, kMotionToRecord));
  }
  if (extent.seconds < kShort) refuse_too_few_parameters(robot, train, extent.seconds);
}

/// An effect is judged where the arm moves.
void refuse_nothing_to_judge(const std::vector<data::Log>& validate) {
  constexpr double kShortest = 2.0;  // [s]
  const Extent extent = extent_of(validate);
  if (extent.travel.maxCoeff() >= kResting && extent.seconds >= kShortest) return;
  throw NotIdentifiableError(fmt::format(
      "{}: {} s in which no joint moves by more than {:.2g} rad or m: too little to judge an effect on; {}",
      validate.front().path, page::number(extent.seconds, 2), extent.travel.maxCoeff(), kMotionToRecord));
}

/// The line that gives the same result, without the files to write.
std::string command_line(const Options& options) {
  std::string line = "heft diagnose";
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) line += fmt::format(" {} {}", name, shell_word(value));
  };
  add("--urdf", options.robot.urdf);
  add("--model", options.robot.model);
  add("--base", options.robot.base);
  add("--tip", options.robot.tip);
  add("--mount", fmt::format("{}", fmt::join(options.robot.mount, ",")));
  for (const std::string& log : options.log.logs) add("--log", log);
  for (const std::string& log : options.validate) add("--validate", log);
  add("--torque-constant", fmt::format("{}", fmt::join(options.log.torque_constant, ",")));
  if (options.log.torque_at != "motor") add("--torque-at", options.log.torque_at);
  if (options.log.band > 0.0) add("--band", fmt::format("{}", options.log.band));
  if (options.cutoff > 0.0) add("--cutoff", fmt::format("{}", options.cutoff));
  return line;
}

model::ModelFile extended_model(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context) {
  model::ModelFile file = model::make_model(diagnosis.after);
  model::FitRecord fit;
  fit.method = "diagnose";
  fit.torque_at = context.torque_at;
  fit.condition_number = std::numeric_limits<double>::quiet_NaN();
  fit.physically_consistent = model::has_physical_links(diagnosis.after);
  identify::put_training(diagnosis.train_after, fit);
  fit.samples = diagnosis.train_after.samples;
  fit.cutoff_hz = diagnosis.cutoff;
  fit.sign_width = diagnosis.sign_width;
  file.fit = fit;
  file.provenance.method = "diagnose";
  file.provenance.logs = context.train;
  file.provenance.notes.push_back(diagnosis_verdict(diagnosis));
  for (const diagnose::Finding& finding : diagnosis.findings) {
    file.provenance.notes.push_back(fmt::format("{}: {}; {}", finding_in_place(diagnosis, finding),
                                                parameters_in_words(finding, diagnosis.after),
                                                evidence_in_words(finding)));
  }
  for (const std::string& line : diagnosis.notes) file.provenance.notes.push_back(line);
  return file;
}

void run(const Options& options) {
  const Console console{options.result.json, options.model};
  const model::Robot robot = load_robot(options.robot);
  std::vector<data::Log> train, validate;
  host::Judgement torque;
  for (const std::string& path : options.log.logs) train.push_back(read(path, options, robot, torque));
  for (const std::string& path : options.validate) validate.push_back(read(path, options, robot, torque));
  refuse_seen(train, validate);
  refuse_too_little_motion(robot, train);
  refuse_nothing_to_judge(validate);

  diagnose::DiagnoseOptions asked;
  asked.band = options.log.band;
  asked.cutoff = options.cutoff;
  asked.joint_sensor = options.log.measured_at() == TorqueAt::kJoint;
  if (options.trace) asked.trace = [](const std::string& line) { print_to(stderr, line + "\n"); };
  diagnose::Diagnosis diagnosis;
  {
    Progress progress("diagnosing");
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    diagnosis = diagnose::diagnose(robot, train, validate, asked);
  }

  const DiagnosisContext context{options.log.logs, options.validate, options.log.torque_at,
                                 command_line(options), torque};
  console.print("{}", diagnosis_text(diagnosis, context));
  finish(console, options.model, options.result, diagnosis_json(diagnosis, context),
         diagnosis_page(diagnosis, context),
         [&] { model::write_model(options.model, extended_model(diagnosis, context)); });
}

}  // namespace

Action set_up_diagnose(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.add_option(
          "--validate", options->validate,
          "log to judge every effect on, of another motion than the training logs; may be given several "
          "times")
      .type_name("LOG.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--cutoff", options->cutoff,
                  "low-pass on the positions [Hz] (default: the one that leaves the smallest residual)")
      .type_name("HZ")
      .positive();
  line.get_option("--band").description(
      "low-pass of the errors in band [Hz] (default: chosen from the motion); that of the positions is no "
      "lower");
  line.add_flag("--trace", options->trace, "tell on standard error what the search sees");
  add_output_option(line, options->model, "model file with the effects found", false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    if (!options->validate.empty()) return;
    throw UsageError(
        "give a log that the fit does not see with --validate LOG.csv: no effect is taken on the word of the "
        "log it "
        "was found in. With one log only, cut it in two, each part with the header line: "
        "(head -n 1 LOG.csv; tail -n +K LOG.csv) > second.csv");
  });
  line.footer(
      "Rigid bodies, Coulomb and viscous friction are fitted; what is left is traced to the effects that "
      "they lack.\n"
      "An effect is taken when it lowers the error on data not used for its fit by more than chance and by "
      "enough\n"
      "to matter.\n"
      "Example: heft diagnose --urdf ur10e --log a.csv --validate b.csv -o extended.json --report "
      "diagnosis.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
