#include "link_body.hpp"

#include <algorithm>

#include "rigid_body.hpp"

namespace heft::urdf {

LinkBody to_body(const InertialParameters<double>& p) {
  LinkBody body;
  body.mass = p[kMass];
  body.about_com << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
  if (p[kMass] == 0.0) return body;
  const Eigen::Vector3d first_moment(p[kMcx], p[kMcy], p[kMcz]);
  // c = h / m,   I_c = I_o - m (|c|² E - c cᵀ)
  body.com = snapped(Eigen::Vector3d(first_moment / p[kMass]));
  const Eigen::Vector3d& c = body.com;
  body.about_com -= body.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  return body;
}

bool is_zero(const InertialParameters<double>& p) {
  return std::all_of(p.begin(), p.end(), [](double value) { return value == 0.0; });
}

}  // namespace heft::urdf
