/// @file
/// heft dynamics: inverse dynamics, gravity torque or regressor for each row of a log.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/page/page.hpp"
#include "heft/validate/predict.hpp"
#include "heft/validate/score.hpp"
#include "host/json.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::string what{"torque"};
  std::string output;
};

/// Columns of the regressor in core's order: Y{row}_{parameter}{link or joint}, the rows of one sample side by side.
std::string regressor_header(int num_joints, bool with_actuation) {
  static constexpr std::array<const char*, 10> kLink{"m",   "mcx", "mcy", "mcz", "Ixx",
                                                     "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};
  static constexpr std::array<const char*, 4> kActuation{"rotor", "coulomb", "viscous", "offset"};
  std::string header = "time";
  for (int row = 1; row <= num_joints; ++row) {
    for (int link = 1; link <= num_joints; ++link) {
      for (const char* name : kLink) header += fmt::format(",Y{}_{}{}", row, name, link);
    }
    if (!with_actuation) continue;
    for (const char* name : kActuation) {
      for (int joint = 1; joint <= num_joints; ++joint) header += fmt::format(",Y{}_{}{}", row, name, joint);
    }
  }
  return header;
}

/// One CSV line: time, then the values, shortest form that reads back to the same number.
/// @throws DataError when a value is not finite: no reader would take it
template <typename Values>
void append_row(std::string& csv, const data::Log& log, int row, const Values& values) {
  for (const double value : values) {
    if (std::isfinite(value)) continue;
    throw DataError(fmt::format(
        "{}: row {} (time {} s): the result is not finite; expected finite torques from this motion; "
        "check position, velocity and acceleration there, and lengths, times and speeds among the "
        "model's effects",
        log.path, row + 1, log.time[row]));
  }
  csv += fmt::format("{}", log.time[row]);
  for (const double value : values) csv += fmt::format(",{}", value == 0.0 ? 0.0 : value);  // no "-0"
  csv += '\n';
}

/// What one log gives.
struct LogResult {
  data::Log log;
  Eigen::MatrixXd torque;                ///< samples × joints; empty for the regressor
  std::optional<validate::Score> score;  ///< when the log holds torque to compare with
};

/// Computes the rows of one log and appends them to `csv`, each after `prefix`.
LogResult work_on(const data::LogSource& source, const Options& options, const model::Dynamics& dynamics,
                  const std::string& prefix, std::string& csv) {
  const int n = dynamics.num_joints();
  const bool is_gravity = options.what == "gravity";
  std::vector<std::string> notes;
  data::MotionLog motion = data::read_motion(source, !is_gravity, &notes);
  for (const std::string& text : notes) note(text);
  LogResult result{std::move(motion.log), {}, {}};
  const data::Log& log = result.log;
  if (options.what == "torque") {
    // The torque of this very motion, sharp at reversals: what rests has no friction.
    result.torque = validate::predict(dynamics.robot(), log, motion.motion, {.sign_width = 0.0});
  } else if (is_gravity) {
    result.torque.resize(log.num_samples(), n);
  }
  const Eigen::Index columns =
      options.log.measured_at() == TorqueAt::kMotor ? Eigen::Index{14 * n} : Eigen::Index{10 * n};
  Progress progress(source.path);
  for (int k = 0; k < log.num_samples(); ++k) {
    progress.update(static_cast<double>(k) / log.num_samples());
    csv += prefix;
    const Eigen::VectorXd q = log.q.row(k);
    if (is_gravity) result.torque.row(k) = dynamics.gravity_torque(q);
    if (result.torque.rows() > 0) {
      append_row(csv, log, k, result.torque.row(k));
      continue;
    }
    const Eigen::MatrixXd Y = dynamics.regressor(q, log.qd.row(k), log.qdd.row(k));
    append_row(csv, log, k, Y.leftCols(columns).reshaped<Eigen::RowMajor>().eval());
  }
  if (options.what == "torque" && log.tau.cols() == n)
    result.score = validate::score(log, result.torque, options.log.band);
  return result;
}

void run(const Options& options) {
  const Console console{options.output, options.result.json};
  const model::Dynamics dynamics(as_measured(load_robot_and_fit(options.robot), options.log.measured_at()));
  const std::string& robot = dynamics.robot().name;
  const int n = dynamics.num_joints();
  data::LogFiles files = files_of(options.log, dynamics.robot());
  files.judge.swap(files.train);
  files.torque = false;
  files.min_samples = 1;  // what has to be derived asks for more
  const data::LogSet logs = open_logs(dynamics.robot(), files);
  const bool at_motor = options.log.measured_at() == TorqueAt::kMotor;
  const bool is_gravity = options.what == "gravity";
  const bool is_regressor = options.what == "regressor";
  const bool several = options.log.logs.size() > 1;
  const std::string subject = is_gravity     ? "gravity torque"
                              : is_regressor ? "regressor"
                              : at_motor     ? "torque with rotor inertia and friction"
                                             : "torque of the rigid bodies";

  std::string csv = several ? "log," : "";
  if (is_regressor) {
    csv += regressor_header(n, at_motor);
  } else {
    csv += "time";
    for (int j = 1; j <= n; ++j) csv += fmt::format(",{}{}", is_gravity ? "g" : "tau", j);
  }
  csv += '\n';

  page::Page page = new_page(fmt::format("{}: {}", robot, subject),
                             fmt::format("{} log{}", options.log.logs.size(), several ? "s" : ""));
  nlohmann::ordered_json json{{"robot", robot}, {"what", options.what}, {"torque_at", options.log.torque_at}};
  json["logs"] = nlohmann::ordered_json::array();
  std::string text;
  for (std::size_t k = 0; k < options.log.logs.size(); ++k) {
    const std::string& path = options.log.logs[k];
    const LogResult result =
        work_on(logs.judge()[k], options, dynamics, several ? fmt::format("{},", k + 1) : "", csv);
    nlohmann::ordered_json entry{{"log", path}, {"samples", result.log.num_samples()}};
    page.heading(path);
    text += fmt::format("{}: {} of {} for {} row{}\n", path, subject, robot, result.log.num_samples(),
                        result.log.num_samples() == 1 ? "" : "s");
    if (is_regressor) {
      page.paragraph(fmt::format("Regressor with {} columns a joint.", (at_motor ? 14 : 10) * n));
    } else {
      const Eigen::VectorXd largest = result.torque.cwiseAbs().colwise().maxCoeff();
      entry["max_abs"] = host::json_array(largest);
      if (result.score) {
        entry.update(score_json(*result.score));
        const page::Table table = score_table(*result.score);
        const std::string meaning = score_meaning(*result.score);
        text += "Against the torque that the log holds:\n" + table.to_text(2) + meaning + '\n';
        page.verdict(
            fmt::format("The model meets the measured torque within {} % of each joint's largest torque.",
                        page::number(result.score->percent_of_max.maxCoeff(), 2)));
        page.table(table, meaning);
      } else {
        page.verdict(fmt::format("Largest {}: {} N·m.", subject, page::number(largest.maxCoeff())));
      }
      page.plots("Torque over time", torque_plots(result.log, result.torque));
    }
    json["logs"].push_back(std::move(entry));
  }
  console.print("{}", text);
  finish(console, options.output, options.result, json, page,
         [&] { host::write_file_atomically(options.output, csv); });
}

}  // namespace

Action set_up_dynamics(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  line.add_option("--what", options->what,
                  "torque (with rotor inertia and friction; rigid bodies only with --torque-at joint), "
                  "gravity or regressor")
      .type_name("WHAT")
      .one_of({"torque", "gravity", "regressor"})
      .capture_default_str();
  add_output_option(line, options->output, "result (CSV), one line a log row; - is standard output");
  add_result_options(line, options->result);
  line.footer(
      "The log needs q1..qN; qd and qdd are derived when missing. Columns of the result after `time` (with "
      "several logs a\n"
      "column `log` with their number, from 1, comes first):\n"
      "  torque     tau1..tauN\n"
      "  gravity    g1..gN\n"
      "  regressor  Y1_m1 ... : row 1 for all links (m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz, then "
      "the next link),\n"
      "             then Y1_rotor1..N, Y1_coulomb1..N, Y1_viscous1..N, Y1_offset1..N, then row 2...\n"
      "             With --torque-at joint the columns after the links are left out.\n"
      "When the log holds torque, --what torque also compares the two.\n"
      "Example: heft dynamics --urdf ur5e --log motion.csv -o torque.csv");
  return [options] { run(*options); };
}

}  // namespace heft::tools
