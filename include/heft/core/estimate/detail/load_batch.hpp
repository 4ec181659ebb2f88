/// @file
/// An update of a load's estimate under way.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"

namespace heft::detail {

/// Rows of one instant, taken all at once or one after the other.
template <typename Scalar, int N>
struct LoadBatch {
  enum class Stage : std::uint8_t { kIdle, kBegun, kLearn, kRows, kFinish };
  using Vector = JointVector<Scalar, N>;

  Stage stage{Stage::kIdle};
  LoadColumns<Scalar, N> columns = LoadColumns<Scalar, N>::Zero();
  Vector qd = Vector::Zero(), residual = Vector::Zero();
  Vector doubt = Vector::Zero();                             ///< variance of the level of friction
  std::array<bool, static_cast<std::size_t>(N)> left_out{};  ///< clipped
  int next{0};                                               ///< row
  int rows{0};                                               ///< taken so far
  Scalar ratio{0}, unexplained{0}, whole{0};                 ///< sums for ChangeWatch
};

}  // namespace heft::detail
