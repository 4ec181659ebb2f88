#include "heft/model/point_load.hpp"

#include <cmath>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::model {

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
  const double m = load.mass;
  const Eigen::Matrix3d inertia = m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  InertialParameters<double>& link = robot.joints.back().link;
  link[kMass] += m;
  link[kMcx] += m * c.x();
  link[kMcy] += m * c.y();
  link[kMcz] += m * c.z();
  link[kIxx] += inertia(0, 0);
  link[kIxy] += inertia(0, 1);
  link[kIyy] += inertia(1, 1);
  link[kIxz] += inertia(0, 2);
  link[kIyz] += inertia(1, 2);
  link[kIzz] += inertia(2, 2);
  return robot;
}

}  // namespace heft::model
