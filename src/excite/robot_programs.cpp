/// Motions in the languages of robots.
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "heft/excite/excite.hpp"
#include "heft/host/error.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;

/// Of the robots that run URScript.
constexpr int kScriptJoints = 6;
/// Rows a second that their controllers take: one a cycle of the e-Series [Hz].
constexpr double kFastestRows = 500.0;

template <typename Row>
std::string list_of(const Row& row) {
  std::string text = "[";
  for (Index j = 0; j < row.size(); ++j) text += fmt::format("{}{:.6f}", j == 0 ? "" : ", ", row[j]);
  return text + "]";
}

/// @throws ModelError unless rows are evenly spaced
double even_step(const data::Log& log) {
  const Index rows = log.num_samples();
  if (rows < 2) throw ModelError("motion: found fewer than two rows");
  const double step = (log.time[rows - 1] - log.time[0]) / static_cast<double>(rows - 1);
  for (Index i = 1; i < rows; ++i) {
    if (std::abs(log.time[i] - log.time[i - 1] - step) > 1e-3 * step) {
      throw ModelError(
          fmt::format("motion: row {}: found {:.6g} s after the row before, expected {:.6g} s as on average",
                      i + 1, log.time[i] - log.time[i - 1], step));
    }
  }
  return step;
}

}  // namespace

std::string urscript_objection(const model::Robot& robot, double rate) {
  if (robot.num_joints() != kScriptJoints) {
    return fmt::format("robot \"{}\" has {} joints; URScript drives six", robot.name, robot.num_joints());
  }
  if (rate > kFastestRows) {
    return fmt::format("--rate {:g} Hz is more than the {:g} Hz of the controller", rate, kFastestRows);
  }
  return {};
}

std::string to_urscript(const data::Log& log, const std::string& name) {
  constexpr double kShortestStep = 1.0 / kFastestRows;  // [s]
  if (log.num_joints() != kScriptJoints) {
    throw ModelError(
        fmt::format("URScript: found a robot of {} joints, expected six; write a ROS trajectory or the CSV",
                    log.num_joints()));
  }
  const double step = even_step(log);
  if (step < kShortestStep * (1.0 - 1e-6)) {
    throw ModelError(fmt::format(
        "URScript: found rows {:.4g} s apart, expected at least {} s; lower the rate", step, kShortestStep));
  }
  std::string text = fmt::format(
      "# {} rows, one every {:g} s, {:.4g} s. Written by heft; look at its report before running it.\n"
      "def {}():\n"
      "  start = {}\n"
      "  now = get_actual_joint_positions()\n"
      "  i = 0\n"
      "  while i < 6:\n"
      "    if norm(now[i] - start[i]) > 0.01:\n"
      "      popup(\"The arm is not at the motion's first row. Move it there first.\", \"heft\", "
      "error=True, blocking=True)\n"
      "      halt\n"
      "    end\n"
      "    i = i + 1\n"
      "  end\n",
      log.num_samples(), step, step * static_cast<double>(log.num_samples() - 1), name,
      list_of(log.q.row(0)));
  for (Index i = 0; i < log.num_samples(); ++i) {
    fmt::format_to(std::back_inserter(text), "  servoj({}, t={:g}, lookahead_time=0.1, gain=300)\n",
                   list_of(log.q.row(i)), step);
  }
  text += fmt::format("  stopj(2.0)\nend\n{}()\n", name);
  return text;
}

std::string to_ros_trajectory(const data::Log& log, const model::Robot& robot) {
  std::string text = "joint_names: [";
  for (int j = 0; j < robot.num_joints(); ++j) {
    text += fmt::format("{}\"{}\"", j == 0 ? "" : ", ", robot.joints[static_cast<std::size_t>(j)].name);
  }
  text += "]\npoints:\n";
  for (Index i = 0; i < log.num_samples(); ++i) {
    const auto nanoseconds = static_cast<long long>(std::llround((log.time[i] - log.time[0]) * 1e9));
    fmt::format_to(
        std::back_inserter(text),
        "- {{positions: {}, velocities: {}, accelerations: {}, time_from_start: {{sec: {}, nanosec: {}}}}}\n",
        list_of(log.q.row(i)), list_of(log.qd.row(i)), list_of(log.qdd.row(i)), nanoseconds / 1'000'000'000,
        nanoseconds % 1'000'000'000);
  }
  return text;
}

}  // namespace heft::excite
