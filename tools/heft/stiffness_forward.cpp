#include "stiffness_forward.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "console.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"

namespace heft::tools {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// The log with other positions.
data::Log with_positions(data::Log log, const MatrixXd& compensated) {
  log.q = compensated;
  // Velocities and accelerations belong to the positions that were.
  log.qd.resize(log.q.rows(), 0);
  log.qdd.resize(log.q.rows(), 0);
  return log;
}

Vector3d at_tool(const std::vector<double>& point) {
  return point.empty() ? Vector3d(Vector3d::Zero()) : Vector3d(point.data());
}

VectorXd known_stiffness(const StiffnessCommandOptions& options, const model::Robot& robot) {
  const int n = robot.num_joints();
  if (static_cast<int>(options.stiffness.size()) != n) {
    throw InputError(
        fmt::format("--stiffness: found {} values, robot '{}' has {} joints; expected one a joint (inf for a "
                    "rigid one)",
                    options.stiffness.size(), robot.name, n));
  }
  return Eigen::Map<const VectorXd>(options.stiffness.data(), n);
}

}  // namespace

data::Log read_path(const StiffnessCommandOptions& options, const model::Robot& robot) {
  if (options.path.empty()) return {};
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  return data::read_log(options.path, needs);
}

void finish_stiffness(const StiffnessCommandOptions& options, report::StiffnessReport answer,
                      const std::vector<stiffness::NamedPose>& poses) {
  const Console console{options.result.json, options.model, options.compensated};
  stiffness::SagLoad load;
  load.payload_mass = options.payload.mass;
  load.payload_com = at_tool(options.payload.com);
  answer.tool = stiffness::tool_use(answer.stiffness, poses, load, answer.path.q);
  console.print("{}", report::full(answer));
  const bool has_model = !answer.stiffness.deflections || answer.stiffness.found_any();
  const auto write_model = [&] {
    model::ModelFile file = answer.stiffness.model_file();
    file.provenance.notes = report::notes(answer.stiffness);
    model::write_model(options.model, file);
  };
  const auto write_path = [&] {
    if (options.compensated.empty() || !answer.tool.path) return;
    data::write_log(options.compensated, with_positions(answer.path, answer.tool.path->compensated));
    if (!host::is_standard_output(options.compensated))
      console.print("Compensated positions: {}\n", options.compensated);
  };
  write_each({write_path, [&] {
                finish(console, has_model ? options.model : "", options.result, report::json(answer),
                       report::page(answer), write_model);
              }});
}

void stiffness_forward(const StiffnessCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  report::StiffnessReport answer;
  answer.stiffness = stiffness::given(robot, known_stiffness(options, robot));
  answer.path = read_path(options, robot);
  std::vector<stiffness::NamedPose> poses;
  if (answer.path.num_samples() == 0) {
    // No pose is named: the middle of the joint ranges.
    VectorXd q = VectorXd::Zero(robot.num_joints());
    for (int j = 0; j < robot.num_joints(); ++j) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      if (std::isfinite(joint.lower + joint.upper)) q[j] = 0.5 * (joint.lower + joint.upper);
    }
    poses.push_back({"middle of the ranges", q});
  } else {
    poses.push_back({"first of the path", answer.path.q.row(0).transpose()});
  }
  finish_stiffness(options, std::move(answer), poses);
}

void plan_stiffness_measurements(const StiffnessCommandOptions& options) {
  const Console console{options.result.json, options.model};
  model::Robot robot = load_robot(options.robot);
  const int n = robot.num_joints();
  excite::MotionLimits limits = load_limits(options.robot, robot, options.safety, false).limits;
  // Poses are held, not run through: speeds and torques do not matter.
  limits.velocity.setOnes(n);
  limits.torque.setConstant(n, kInfinity);
  const excite::PoseCheck safe(robot, limits);
  for (int j = 0; j < n; ++j) {
    robot.joints[static_cast<std::size_t>(j)].lower = limits.lower[j];
    robot.joints[static_cast<std::size_t>(j)].upper = limits.upper[j];
  }
  stiffness::PlanOptions asked;
  asked.poses = options.plan;
  asked.force = Vector3d(options.pull.data());
  asked.point = at_tool(options.payload.com);
  asked.map = {options.map[0] - 1, options.map[1] - 1};
  asked.refuse = [&](const VectorXd& q) {
    std::string missed;
    return safe.slack(q, &missed) > 0.0 ? std::string() : missed;
  };
  const stiffness::MeasurementPlan plan = stiffness::plan_measurements(robot, asked);
  console.print("{}", report::full(plan));
  finish(console, options.model, options.result, report::json(plan), report::page(plan),
         [&] { host::write_file_atomically(options.model, stiffness::measurement_form(plan)); });
}

}  // namespace heft::tools
