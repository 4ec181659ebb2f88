/// @file
/// Gradient of a weighted sum of the entries of the links' regressor, by one pass outward and one back.
/// Derivation: src/excite/excitation.md
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "heft/core/arm_model.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::excite {

/// Two instants side by side in one register of every x86-64 and aarch64 processor: operations entry by entry, so that an
/// instant has the same numbers on either side.
using Pair = double __attribute__((vector_size(16)));

/// Σ_ij Σ_k H_ijk Y_i,10j+k of an arm: row i, link j ≥ i, parameter k of the link.
class RegressorSlope {
 public:
  static constexpr std::size_t kMost = model::kMaxJoints;

  struct Motion {
    std::array<Pair, kMost> q, qd, qdd;
  };
  /// Weights [row][link][parameter in the order of InertialParameters]; those with link < row are not read.
  using Weights = std::array<std::array<std::array<Pair, kParametersPerLink>, kMost>, kMost>;

  explicit RegressorSlope(const model::Robot& robot);

  /// Gradient at two instants.
  /// @param by  out, ∂/∂q, ∂/∂q̇, ∂/∂q̈, n each
  /// Cost: 6 joints about 8000 operations, that is three times the regressor.
  void gradient(const Motion& at, const Weights& weights, Motion& by) const;

 private:
  /// Turns of a joint: R = fixed + cosine cos q + sine sin q, row-major, link axes in the parent's.
  struct Geometry {
    bool revolute;
    std::array<double, 9> fixed, cosine, sine;
    std::array<double, 3> position, axis, slide;  ///< of the parent: position and direction of sliding; of the link: axis
  };
  struct Link;
  /// Motion and probes of every link.
  void go_outward(const Motion& at, std::array<Link, kMost>& links) const;

  std::vector<Geometry> joints_;
  std::array<double, 3> up_;  ///< acceleration of the base that stands for gravity
};

}  // namespace heft::excite
