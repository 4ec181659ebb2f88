#include "load.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/physical_body.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

namespace heft::exchange {

Load load_of(const InertialParameters<double>& p, const std::string& where) {
  switch (check_physical(p)) {
    case Status::kOk: break;
    case Status::kNonFiniteInput:
      throw ModelError(fmt::format("{}: found parameters that are not finite; expected numbers", where));
    default:
      throw ModelError(fmt::format(
          "{}: found physically impossible parameters (mass {:.4g} kg); expected those of a body; fit "
          "with --method physical",
          where, p[kMass]));
  }
  Load load;
  load.mass = p[kMass];
  if (load.mass > 0.0) {
    load.com = Eigen::Vector3d(p[kMcx], p[kMcy], p[kMcz]) / load.mass;
    Eigen::Matrix3d about_origin;
    about_origin << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
    // Steiner: I_o = I_c + m (cᵀc E - c cᵀ)
    load.inertia = about_origin - load.mass * (load.com.squaredNorm() * Eigen::Matrix3d::Identity() -
                                               load.com * load.com.transpose());
    // Of a point the shift leaves rounding, which a form would carry as an inertia.
    const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * about_origin.cwiseAbs().maxCoeff();
    load.inertia = (load.inertia.array().abs() < rounding).select(0.0, load.inertia.array());
  }
  refuse_impossible(load, where);
  return load;
}

void refuse_impossible(const Load& load, const std::string& where) {
  if (!std::isfinite(load.mass) || !load.com.allFinite() || !load.inertia.allFinite()) {
    throw ModelError(fmt::format("{}: found numbers that are not finite; expected finite ones", where));
  }
  if (!(load.mass > 0.0)) {
    throw ModelError(fmt::format("{}: found a mass of {:.4g} kg; expected one above zero", where, load.mass));
  }
  if (!load.inertia.isApprox(load.inertia.transpose(), 1e-12) && !load.inertia.isZero()) {
    throw ModelError(
        fmt::format("{}: found an inertia that is not symmetric; expected a symmetric one", where));
  }
  // Second moments about the centre of mass, Σ = ½ tr(I) E - I, must not be negative; rounding of the shift from the
  // flange is let pass.
  const double shifted = load.mass * load.com.squaredNorm();
  const double rounding = 1e-12 * (load.inertia.cwiseAbs().maxCoeff() + shifted);
  const Eigen::Vector3d moments = eigenvalues_of(load.inertia);
  if (moments[0] < -rounding || moments[0] + moments[1] < moments[2] - rounding) {
    throw ModelError(
        fmt::format("{}: found principal moments of inertia {:.4g}, {:.4g}, {:.4g} kg·m² about the centre of "
                    "mass; expected none below zero nor above the sum of the others: physically impossible",
                    where, moments[0], moments[1], moments[2]));
  }
}

void refuse_negative(const std::string& joint, const char* what, double value) {
  if (value >= 0.0 && std::isfinite(value)) return;
  throw ModelError(fmt::format(
      "joint \"{}\": found {} {:.4g}; expected a finite number, not below zero; fit with --method physical", joint, what,
      value));
}

}  // namespace heft::exchange
