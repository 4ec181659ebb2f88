#include "stiffness_forward.hpp"

#include "console.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/stiffness/stiffness.hpp"

namespace heft::tools {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// The log of --path; without samples when there is none.
data::Log read_path(const StiffnessCommandOptions& options, const model::Robot& robot) {
  if (options.path.empty()) return {};
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.as = read_as(options.log.read, robot);
  return data::read_log(options.path, needs);
}

}  // namespace

void finish_stiffness(const StiffnessCommandOptions& options, const model::Robot& robot,
                      report::StiffnessReport answer) {
  const Console console{options.result.json, options.model, options.compensated};
  answer.path = read_path(options, robot);
  const stiffness::SagLoad load{options.payload.mass, Vector3d(options.payload.com.data())};
  answer.tool = stiffness::tool_use(
      answer.stiffness, stiffness::poses_to_look_at(answer.stiffness, answer.path.q), load, answer.path.q);
  console.print("{}", report::full(answer));
  const auto write_path = [&] {
    if (options.compensated.empty() || !answer.tool.path) return;
    data::write_log(options.compensated, stiffness::compensated(answer.path, *answer.tool.path));
    if (!host::is_standard_output(options.compensated))
      console.print("Compensated positions: {}\n", options.compensated);
  };
  const auto write_rest = [&] {
    finish(console, answer.stiffness.has_model() ? options.model : "", options.result, report::json(answer),
           report::page(answer),
           [&] { model::write_model(options.model, report::model_file(answer.stiffness)); });
  };
  write_each({write_path, write_rest});
}

void stiffness_forward(const StiffnessCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  const auto joints = static_cast<Eigen::Index>(options.stiffness.size());
  report::StiffnessReport answer;
  answer.stiffness = stiffness::given(robot, Eigen::Map<const VectorXd>(options.stiffness.data(), joints));
  finish_stiffness(options, robot, std::move(answer));
}

void plan_stiffness_measurements(const StiffnessCommandOptions& options) {
  const Console console{options.result.json, options.model};
  const model::Robot robot = load_robot(options.robot);
  const excite::MotionLimits limits = load_limits(options.robot, robot, options.safety, false).limits;
  const excite::PoseCheck safe(robot, limits);
  stiffness::PlanOptions asked;
  asked.poses = options.plan;
  asked.force = Vector3d(options.pull.data());
  asked.point = Vector3d(options.payload.com.data());
  asked.map = {options.map[0] - 1, options.map[1] - 1};
  asked.refuse = [&](const VectorXd& q) { return safe.objection(q); };
  const stiffness::MeasurementPlan plan = stiffness::plan_measurements(excite::within(robot, limits), asked);
  console.print("{}", report::full(plan));
  finish(console, options.model, options.result, report::json(plan), report::page(plan),
         [&] { host::write_file_atomically(options.model, stiffness::measurement_form(plan)); });
}

}  // namespace heft::tools
