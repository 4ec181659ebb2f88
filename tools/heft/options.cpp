#include "options.hpp"

#include <array>

#include <fmt/format.h>

#include "console.hpp"
#include "heft/data/read_map.hpp"
#include "heft/drive/torque_constants.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/model_file.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "heft/urdf/mounting.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::tools {

void add_threads_option(CommandLine line, int& threads) {
  line.add_option("--threads", threads, "threads (default: one a processor; the result does not depend on it)")
      .type_name("N")
      .between(1, 256);
}

void add_robot_options(CommandLine line, RobotOptions& options) {
  Option urdf = line.add_option("--urdf", options.urdf,
                                "robot: a URDF file, or a robot of heft's own by name (ur5e, panda...); a "
                                "model file that knows its robot needs none")
                    .type_name("ROBOT")
                    .names_file(FileUse::kRobot);
  line.add_option("--model", options.model,
                  "model file; its parameters replace those of the URDF, and without --urdf it is the robot")
      .type_name("MODEL.json")
      .names_file(FileUse::kInput);
  line.add_option("--base", options.base, "link where the chain begins (default: the root)")
      .type_name("LINK")
      .needs(urdf);
  line.add_option("--tip", options.tip, "link where the chain ends (default: the only leaf)")
      .type_name("LINK")
      .needs(urdf);
  line.add_option("--mount", options.mount,
                  "orientation of the base [rad]: rotation about the world's x, then y, then z axis "
                  "(default: 0,0,0; ceiling: 3.14159265358979,0,0)")
      .type_name("ROLL,PITCH,YAW")
      .delimiter(',')
      .expected(3);
}

/// @pre --mount was given
static std::array<double, 9> mount_of(const RobotOptions& options) {
  return urdf::mount_rotation(options.mount[0], options.mount[1], options.mount[2]);
}

LoadedRobot load_robot_and_fit(const RobotOptions& options) {
  if (options.urdf.empty() && options.model.empty()) {
    throw UsageError(
        "give the robot with --urdf ROBOT, or with --model MODEL.json one that a model file knows");
  }
  LoadedRobot loaded;
  std::optional<model::ModelFile> model;
  if (!options.model.empty()) {
    model = model::read_model(options.model);
    loaded.fit = model->fit;
    loaded.fitted_to = model->provenance.logs;
  }
  if (options.urdf.empty()) {
    loaded.robot = model::make_robot(*model);
    if (!options.mount.empty()) loaded.robot.gravity = urdf::gravity_in_base(mount_of(options));
    return loaded;
  }
  urdf::UrdfOptions urdf_options;
  urdf_options.base_link = options.base;
  urdf_options.tip_link = options.tip;
  if (!options.mount.empty()) urdf_options.mount_rotation = mount_of(options);
  std::vector<std::string> notes;
  loaded.robot = urdf::load_urdf(urdf::resolve_robot(options.urdf), urdf_options, &notes);
  if (model) {
    if (!options.mount.empty()) urdf::mount_like(loaded.robot, *model);
    model::apply(*model, loaded.robot, &notes);
  }
  for (const std::string& text : notes) note(text);
  return loaded;
}

model::Robot load_robot(const RobotOptions& options) { return load_robot_and_fit(options).robot; }

model::Robot as_measured(const LoadedRobot& loaded, TorqueAt at) {
  std::vector<std::string> notes;
  model::Robot robot =
      model::as_measured(loaded.robot, at == TorqueAt::kJoint, loaded.fit ? &*loaded.fit : nullptr, &notes);
  for (const std::string& text : notes) note(text);
  return robot;
}

void add_read_options(CommandLine line, ReadOptions& options) {
  line.add_option(
          "--map", options.map,
          "columns of the log that are not recognised, heft's name first: tau=effort,q=position; time=500Hz gives "
          "rows without time a rate; or a JSON file of the same")
      .type_name("NAME=COLUMN,...")
      .delimiter(',');
  line.add_option("--topic", options.topic, "of a recording with several topics, the one to be read")
      .type_name("NAME");
}

data::ReadAs read_as(const ReadOptions& options) { return {options.topic, {}, data::read_map(options.map)}; }

data::ReadAs read_as(const ReadOptions& options, const model::Robot& robot) {
  data::ReadAs as = read_as(options);
  for (const model::RobotJoint& joint : robot.joints) as.joint_names.push_back(joint.name);
  return as;
}

void add_log_options(CommandLine line, LogOptions& options) {
  line.add_option("--log", options.logs, "log, in any format that heft log reads; may be given several times")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements)
      .required();
  line.add_option("--torque-constant", options.torque_constant,
                  "torque constants [N·m/A], one value or one a joint: torque from the currents i1.. when "
                  "tau1.. are missing")
      .type_name("K,K,...")
      .delimiter(',');
  line.add_option(
          "--torque-constants", options.torque_constants,
          "the same from a file that heft torque-constants wrote; joints that it does not know have those of "
          "--torque-constant")
      .type_name("CONSTANTS.json")
      .names_file(FileUse::kInput);
  line.add_option("--torque-at", options.torque_at,
                  "where the torque was measured: motor (rotor inertia and gear friction are in it) or joint "
                  "(a sensor behind the gear)")
      .type_name("WHERE")
      .one_of({"motor", "joint"})
      .capture_default_str();
  line.add_option("--band", options.band,
                  "low-pass cut-off for derived signals [Hz] (default: chosen from the motion)")
      .type_name("HZ")
      .positive();
  add_read_options(line, options.read);
}

void add_accept_torque_option(CommandLine line, LogOptions& options) {
  line.add_flag(
      "--accept-torque", options.accept_torque,
      "continue although the torque contradicts the robot: wrong sign, unit, order of joints, mounting (the "
      "result is marked bad)");
}

data::LogFiles files_of(const LogOptions& options, const model::Robot& robot,
                        const std::vector<std::string>& judge) {
  data::LogFiles files;
  files.train = options.logs;
  files.judge = judge;
  files.torque_constant = options.torque_constant;
  if (!options.torque_constants.empty()) {
    files.torque_constant =
        drive::completed(drive::read_torque_constants(options.torque_constants), options.torque_constant);
  }
  files.torque_at = options.measured_at();
  files.cutoff = options.band;
  files.robot = robot.name;
  files.as = read_as(options.read, robot);
  return files;
}

data::LogSet open_logs(const model::Robot& robot, const data::LogFiles& files) {
  data::LogSet logs = data::open_logs(robot.joint_specs(), files);
  for (const std::string& text : logs.notes()) note(text);
  return logs;
}

namespace {

std::vector<model::Robot> known_robots() {
  std::vector<model::Robot> robots;
  for (const std::string& name : urdf::robot_names()) {
    try {
      robots.push_back(urdf::load_urdf(urdf::resolve_robot(name)));
    } catch (const InputError&) {
      // A broken file in a folder of robots is not what was asked about.
    }
  }
  return robots;
}

}  // namespace

host::Judgement judgement_of(const plausibility::TorqueCheck& check, const LogOptions& options) {
  if (!options.accept_torque) plausibility::refuse_contradictions(check);
  host::Judgement judgement = check.judgement();
  for (const std::string& reason : judgement.reasons) warn(reason);
  return judgement;
}

plausibility::Options torque_options(TorqueAt at) { return {at == TorqueAt::kMotor, known_robots}; }

host::Judgement judge_torque(const data::MotionStream& log, const model::Robot& robot,
                             const LogOptions& options, TorqueAt at) {
  return judgement_of(plausibility::check_torque(robot, log, torque_options(at)), options);
}

host::Judgement judge_torque(const data::Log& log, const model::Robot& robot, const LogOptions& options,
                             TorqueAt at) {
  return judgement_of(plausibility::check_torque(robot, log, torque_options(at)), options);
}

host::Judgement judge_torque(const data::LogSet& logs, const model::Robot& robot, const LogOptions& options) {
  host::Judgement judgement;
  for (const data::LogSource& log : logs.given())
    judgement.add(judge_torque(data::stream(log), robot, options, logs.torque_at()));
  return judgement;
}

void add_result_options(CommandLine line, ResultOptions& options) {
  line.add_option("--json", options.json, "write the results as JSON; - is standard output")
      .type_name("FILE")
      .names_file(FileUse::kOutput);
  line.add_option("--report", options.report, "write a page with tables and plots")
      .type_name("FILE.html")
      .names_file(FileUse::kOutput);
}

void write_each(std::initializer_list<std::function<void()>> files) {
  std::string failures;
  bool reader_left = false;
  for (const std::function<void()>& write : files) {
    if (!write) continue;
    try {
      write();
    } catch (const host::ReaderLeftError&) {
      reader_left = true;
    } catch (const InputError& error) {
      failures += (failures.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  if (!failures.empty()) throw InputError(failures);
  if (reader_left) throw host::ReaderLeftError("standard output: its reader left");
}

void finish(const Console& console, const std::string& output, const ResultOptions& options,
            const std::string& json, const page::Page& page, const std::function<void()>& write_output) {
  const auto announced = [&](const char* what, const std::string& path, const std::function<void()>& write) {
    return [&console, what, path, write] {
      if (path.empty() || !write) return;
      write();
      if (!host::is_standard_output(path)) console.print("{}: {}\n", what, path);
    };
  };
  write_each({announced("Written", output, write_output),
              announced("Results", options.json, [&] { write_json(options.json, json); }),
              announced("Report", options.report, [&] { page.write(options.report); })});
}

void add_output_option(CommandLine line, std::string& output, const std::string& meaning, bool required) {
  line.add_option("-o,--output", output, meaning)
      .type_name("FILE")
      .names_file(FileUse::kOutput)
      .required(required);
}

void add_payload_option(CommandLine line, std::vector<double>& payload) {
  line.add_option("--payload", payload,
                  "load on the flange, included in every torque [kg; m in the tip frame]")
      .type_name("MASS[,X,Y,Z]")
      .delimiter(',');
}

model::PointLoad payload_of(const std::vector<double>& values) {
  model::PointLoad payload;
  if (values.empty()) return payload;
  if (values.size() != 1 && values.size() != 4) {
    throw UsageError(fmt::format(
        "--payload: found {} numbers; expected MASS or MASS,X,Y,Z [kg, m in the tip frame]", values.size()));
  }
  payload.mass = values[0];
  if (values.size() == 4) payload.com = {values[1], values[2], values[3]};
  return payload;
}

void refuse_output_without(const std::vector<std::string>& sources, const std::string& output,
                           const char* what) {
  if (!sources.empty() || output.empty()) return;
  throw UsageError(fmt::format("--output writes {}; without it there is nothing to write", what));
}

}  // namespace heft::tools
