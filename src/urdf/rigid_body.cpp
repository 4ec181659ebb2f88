#include "rigid_body.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/decompositions.hpp"

namespace heft::urdf {

Placement operator*(const Placement& a, const Placement& b) { return {a.R * b.R, a.R * b.p + a.p}; }

double snapped(double value, double tolerance) {
  for (const double exact : {0.0, 1.0, -1.0}) {
    if (std::abs(value - exact) <= tolerance) return exact;
  }
  return value;
}

Eigen::Matrix3d snapped(const Eigen::Matrix3d& rotation) {
  const auto snap = [&](double tolerance) -> Eigen::Matrix3d {
    return rotation.unaryExpr([tolerance](double value) { return snapped(value, tolerance); });
  };
  const Eigen::Matrix3d coarse = snap(1e-8);
  if ((coarse.transpose() * coarse - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-14)
    return coarse;
  return snap(1e-12);
}

Eigen::Vector3d snapped(const Eigen::Vector3d& position) {
  return position.unaryExpr([](double value) { return std::abs(value) < 1e-12 ? 0.0 : value; });
}

Placement placement_of(const ::urdf::Pose& pose) {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  return {snapped(Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix()),
          Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z)};
}

void Body::add(double m, const Eigen::Vector3d& c, const Eigen::Matrix3d& about_com) {
  mass += m;
  first_moment += m * c;
  inertia += about_com + m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
}

InertialParameters<double> Body::parameters() const {
  return {mass,          first_moment.x(), first_moment.y(), first_moment.z(), inertia(0, 0),
          inertia(0, 1), inertia(1, 1),    inertia(0, 2),    inertia(1, 2),    inertia(2, 2)};
}

Eigen::Matrix3d inertia_of(const ::urdf::Inertial& inertial) {
  Eigen::Matrix3d inertia;
  inertia << inertial.ixx, inertial.ixy, inertial.ixz, inertial.ixy, inertial.iyy, inertial.iyz, inertial.ixz,
      inertial.iyz, inertial.izz;
  return inertia;
}

std::string impossibility(const Eigen::Matrix3d& inertia) {
  const Eigen::Vector3d diagonal = inertia.diagonal();
  const double tolerance = 1e-6 * inertia.cwiseAbs().maxCoeff();  // published numbers are rounded
  constexpr std::array<const char*, 3> kNames{"Ixx", "Iyy", "Izz"};
  for (int largest = 0; largest < 3; ++largest) {
    const int a = largest == 0 ? 1 : 0;
    const int b = largest == 2 ? 1 : 2;
    if (diagonal[a] + diagonal[b] < diagonal[largest] - tolerance) {
      return fmt::format("{}+{}={:.6g} < {}={:.6g} kg·m²", kNames[static_cast<std::size_t>(a)],
                         kNames[static_cast<std::size_t>(b)], diagonal[a] + diagonal[b],
                         kNames[static_cast<std::size_t>(largest)], diagonal[largest]);
    }
  }
  const Eigen::Vector3d moments = eigenvalues_of(inertia);
  const std::string shown =
      fmt::format("principal moments {:.6g}, {:.6g}, {:.6g} kg·m²", moments[0], moments[1], moments[2]);
  if (!(moments[0] > 0.0)) return fmt::format("{}: expected all positive", shown);
  if (moments[0] + moments[1] < moments[2] - tolerance) {
    return fmt::format("{}: the largest exceeds the sum of the others", shown);
  }
  return {};
}

}  // namespace heft::urdf
