/// @file
/// How large a load may be, and how well a model of the arm fits, where nobody says so.
#pragma once

#include <cmath>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/arm_model.hpp"

namespace heft::detail {

template <typename Scalar, int N>
struct LoadPriors {
  using Vector = JointVector<Scalar, N>;

  Scalar mass{0};      ///< standard deviation [kg]: a third of the arm's mass
  Scalar length{0};    ///< that scales first moment and inertia [m]: a tenth of the arm's length
  Scalar farthest{0};  ///< centre of mass of a load [m]: half the arm's length
  Scalar friction{0};  ///< of the last joint, that a load may change [N·m, N]: half of what it has
  Vector noise = Vector::Zero();  ///< standard deviation of the residual [N·m, N]: from friction and weight

  template <typename Actuation>
  LoadPriors(const ArmModel<Scalar, N>& model, const Actuation& actuation) noexcept {
    using std::sqrt;
    Scalar weight(0), reach(0);
    for (std::size_t j = 0; j < model.links.size(); ++j) {
      weight += model.links[j][kMass];
      const auto& p = model.joints[j].position;
      reach += sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    }
    mass = at_least(weight / Scalar(3), 0.01);
    length = at_least(static_cast<Scalar>(0.1) * reach, 0.02);
    farthest = at_least(static_cast<Scalar>(0.5) * reach, 0.1);
    friction = at_least(static_cast<Scalar>(0.5) * actuation[N - 1].coulomb_friction, 1e-6);
    for (int i = 0; i < N; ++i) {
      noise[i] = static_cast<Scalar>(0.05) * actuation[static_cast<std::size_t>(i)].coulomb_friction +
                 static_cast<Scalar>(2e-4 * 9.81) * weight;
    }
  }

  static Scalar at_least(const Scalar& value, double least) noexcept {
    return value > static_cast<Scalar>(least) ? value : static_cast<Scalar>(least);
  }
};

}  // namespace heft::detail
