/// @file
/// Options that several commands share, and what they mean.
#pragma once

#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_checks.hpp"
#include "heft/data/log_set.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/point_load.hpp"
#include "heft/model/robot.hpp"
#include "heft/page/page.hpp"
#include "heft/plausibility/plausibility.hpp"

namespace heft::tools {

class Console;

/// `--threads N`: on how many threads the command works.
void add_threads_option(CommandLine line, int& threads);

/// --urdf, --model and what selects the chain. At least one of the two is given.
struct RobotOptions {
  std::string urdf;
  std::string model;
  std::string base;
  std::string tip;
  std::vector<double> mount;  ///< roll, pitch, yaw of the base in the world [rad]; empty: level
};
void add_robot_options(CommandLine line, RobotOptions& options);
/// The robot of --urdf with the parameters of --model, if given; without --urdf the robot that the model file
/// describes. Notes go to standard error.
/// @throws UsageError (wrong usage) when neither is given, ModelError when there is no --urdf and the
///         model file does not know its kinematics.
model::Robot load_robot(const RobotOptions& options);

/// The same with the record of its fit from the model file.
struct LoadedRobot {
  model::Robot robot;
  std::optional<model::FitRecord> fit;
  std::vector<std::string> fitted_to;  ///< logs
};
LoadedRobot load_robot_and_fit(const RobotOptions& options);

using data::TorqueAt;

/// The robot whose joint torque is what was measured there: a sensor behind the gears sees rigid bodies only,
/// unless the model was fitted to such a sensor; then friction that it has is friction that the sensor saw.
model::Robot as_measured(const LoadedRobot& loaded, TorqueAt at);

/// --map and --topic: what a log does not say of itself.
struct ReadOptions {
  std::vector<std::string> map;
  std::string topic;
};
void add_read_options(CommandLine line, ReadOptions& options);
/// What these options say. @throws InputError for a --map that is none
data::ReadAs read_as(const ReadOptions& options);
/// The same with the names of the robot's joints, for logs that name theirs.
data::ReadAs read_as(const ReadOptions& options, const model::Robot& robot);

/// --log, --torque-constant, --torque-at, --band, and --accept-torque where torque is compared with the robot.
struct LogOptions {
  std::vector<std::string> logs;
  std::vector<double> torque_constant;
  std::string torque_constants;  ///< file of heft torque-constants; joints that it lacks have those above
  std::string torque_at{"motor"};
  double band{0.0};           ///< [Hz]; 0: chosen from the motion
  bool accept_torque{false};  ///< torque that contradicts the robot is warned about instead of refused
  ReadOptions read{};

  TorqueAt measured_at() const { return torque_at == "joint" ? TorqueAt::kJoint : TorqueAt::kMotor; }
};
void add_log_options(CommandLine line, LogOptions& options);
/// For commands that call judge_torque.
void add_accept_torque_option(CommandLine line, LogOptions& options);

/// The logs of a robot as these options name them, and those to judge on.
data::LogFiles files_of(const LogOptions& options, const model::Robot& robot,
                        const std::vector<std::string>& judge = {});
/// data::open_logs with its notes on standard error.
data::LogSet open_logs(const model::Robot& robot, const data::LogFiles& files);

/// Compares the torque of a log with the robot (heft/plausibility): what is found goes to standard error, and into the
/// judgement of a result that rests on the log.
/// @param at  where the torque was measured
/// @throws DataError when the torque contradicts the robot and --accept-torque was not given
host::Judgement judge_torque(const data::MotionStream& log, const model::Robot& robot,
                             const LogOptions& options, TorqueAt at);
host::Judgement judge_torque(const data::Log& log, const model::Robot& robot, const LogOptions& options,
                             TorqueAt at);

/// What judge_torque makes of a check.
/// @throws DataError as judge_torque
host::Judgement judgement_of(const plausibility::TorqueCheck& check, const LogOptions& options);
/// How judge_torque compares.
plausibility::Options torque_options(TorqueAt at);

/// The same of every log that was given.
host::Judgement judge_torque(const data::LogSet& logs, const model::Robot& robot, const LogOptions& options);

/// --json and --report.
struct ResultOptions {
  std::string json;
  std::string report;
};
void add_result_options(CommandLine line, ResultOptions& options);
/// Writes the command's files and says where they are: what `write_output` writes, the JSON, the page. Called after the
/// result was printed, so that it is not lost when a file cannot be written; nor are the other files.
/// @param output  path that `write_output` writes; empty: none
/// @throws InputError naming every file that could not be written
void finish(const Console& console, const std::string& output, const ResultOptions& options,
            const std::string& json, const page::Page& page, const std::function<void()>& write_output = {});
/// Calls all of them, then reports all that failed.
/// @throws InputError with the messages of all, host::ReaderLeftError when only the reader of standard output left
void write_each(std::initializer_list<std::function<void()>> files);

/// -o/--output, a file.
void add_output_option(CommandLine line, std::string& output, const std::string& meaning,
                       bool required = true);
/// @param sources  logs that the output is made from
/// @param what     it holds, "the model that --baseline gives"
/// @throws UsageError when there is an output and nothing to make it from
void refuse_output_without(const std::vector<std::string>& sources, const std::string& output,
                           const char* what);

/// --payload, a point mass at the flange.
void add_payload_option(CommandLine line, std::vector<double>& payload);
/// @throws UsageError for a number of values that is neither 0, 1 (the mass) nor 4 (with its place)
model::PointLoad payload_of(const std::vector<double>& values);

}  // namespace heft::tools
