#include "heft/model/point_load.hpp"

#include <cmath>
#include <cstddef>

#include <fmt/format.h>

#include "heft/core/denavit_hartenberg.hpp"
#include "heft/host/error.hpp"

namespace heft::model {

InertialParameters<double> point_body(double mass, const Eigen::Vector3d& com) {
  return make_inertial_parameters<double>(mass, {com.x(), com.y(), com.z()}, {});
}

Robot with_load(Robot robot, const PointLoad& load) {
  if (!(load.mass >= 0.0) || !std::isfinite(load.mass) || !load.com.allFinite()) {
    throw ModelError(
        fmt::format("payload: found a mass of {} kg and a centre at ({}, {}, {}) m, expected finite numbers "
                    "and at least 0 kg",
                    load.mass, load.com.x(), load.com.y(), load.com.z()));
  }
  if (load.mass == 0.0 || robot.joints.empty()) return robot;
  using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Vector3d c = Eigen::Map<const Eigen::Vector3d>(robot.tip_position.data()) +
                            Eigen::Map<const Rotation>(robot.tip_rotation.data()) * load.com;
  const InertialParameters<double> point = point_body(load.mass, c);
  InertialParameters<double>& link = robot.joints.back().link;
  for (std::size_t i = 0; i < link.size(); ++i) link[i] += point[i];
  return robot;
}

}  // namespace heft::model
