#include "heft/stiffness/stiffness_effects.hpp"

#include <numbers>

#include <Eigen/Geometry>

#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

using Poses = std::vector<LoadedPose>;

constexpr double kDegree = std::numbers::pi / 180.0;

/// The reading's row when it is taken along u.
void point_along(LoadedPose& pose, Index reading, const Vector3d& u) {
  pose.rows.row(reading) << u.transpose(), pose.point.cross(u).transpose();
}

/// `count` values from one to another, both included.
std::vector<double> steps(double from, double to, int count) {
  std::vector<double> values;
  for (int k = 0; k < count; ++k) values.push_back(from + (to - from) * k / (count - 1));
  return values;
}

/// One value for each reading.
template <typename Value>
VectorXd column_of(const Poses& poses, Value value) {
  Index count = 0;
  for (const LoadedPose& pose : poses) count += pose.values.size();
  VectorXd column(count);
  Index row = 0;
  for (const LoadedPose& pose : poses) {
    for (Index r = 0; r < pose.values.size(); ++r) column[row++] = value(pose, r);
  }
  return column;
}

StiffnessEffect complementary() {
  return {.id = "complementary", .meaning = "the load turns with the arm (K_C)", .complementary = true};
}

StiffnessEffect sensor_offset() {
  return {.id = "sensor_offset",
          .meaning = "a constant in every displacement",
          .unit = "m",
          .column = [](const Poses& poses) {
            return column_of(
                poses, [](const LoadedPose& pose, Index r) { return is_rotation(pose, r) ? 0.0 : 1.0; });
          }};
}

StiffnessEffect tool_bending() {
  return {.id = "tool_bending",
          .meaning = "the bracket that carries load and target turns with the moment on it",
          .unit = "rad/(N m)",
          .column = [](const Poses& poses) {
            return column_of(poses, [](const LoadedPose& pose, Index r) {
              return pose.rows.row(r).tail<3>().dot(pose.wrench.tail<3>());
            });
          }};
}

/// All around: a sign that was lost is half a turn.
std::vector<double> turns() { return steps(-175.0 * kDegree, 180.0 * kDegree, 72); }

StiffnessEffect measuring_direction() {
  return {.id = "measuring_direction",
          .meaning = "read along another direction than stated, turned about the tool's z axis",
          .unit = "rad",
          .change =
              [](Poses poses, double angle) {
                for (LoadedPose& pose : poses) {
                  const Eigen::AngleAxisd turn(angle, pose.tool.rotation.col(2));
                  for (Index r = 0; r < pose.values.size(); ++r) {
                    if (is_rotation(pose, r)) continue;
                    point_along(pose, r, turn * Vector3d(pose.rows.row(r).head<3>().transpose()));
                  }
                }
                return poses;
              },
          .values = turns()};
}

StiffnessEffect load_direction() {
  return {.id = "load_direction",
          .meaning = "the force points elsewhere than stated, turned about the tool's z axis",
          .unit = "rad",
          .change =
              [](Poses poses, double angle) {
                for (LoadedPose& pose : poses) {
                  const Eigen::AngleAxisd turn(angle, pose.tool.rotation.col(2));
                  pose.wrench.head<3>() = turn * Vector3d(pose.wrench.head<3>());
                }
                return poses;
              },
          .values = turns()};
}

StiffnessEffect arm_of_load() {
  return {.id = "arm_of_load",
          .meaning = "the moment is this many times what is stated",
          .unit = "times",
          .change =
              [](Poses poses, double factor) {
                for (LoadedPose& pose : poses) pose.wrench.tail<3>() *= factor;
                return poses;
              },
          .values = steps(-2.0, 2.0, 41)};
}

/// @param down  unit vector, base frame
StiffnessEffect load_is_weight(const Vector3d& down) {
  return {.id = "load_is_weight",
          .meaning = "the force points down, whatever is stated",
          .change = [down](Poses poses, double) {
            for (LoadedPose& pose : poses) {
              const Vector3d stated = pose.wrench.head<3>();
              pose.wrench.head<3>() = stated.norm() * down;
              // Lever of the stated load, at right angles to it, carried over to the weight.
              if (stated.norm() > 0.0) {
                const Vector3d lever = stated.cross(Vector3d(pose.wrench.tail<3>())) / stated.squaredNorm();
                pose.wrench.tail<3>() = lever.cross(Vector3d(pose.wrench.head<3>()));
              }
              pose.follows = WrenchFrame::kBase;
            }
            return poses;
          }};
}

}  // namespace

std::vector<StiffnessEffect> known_stiffness_effects(const model::Robot& robot) {
  const Vector3d down = Vector3d(robot.gravity.data()).normalized();
  return {complementary(),  sensor_offset(), tool_bending(),      measuring_direction(),
          load_direction(), arm_of_load(),   load_is_weight(down)};
}

}  // namespace heft::stiffness
