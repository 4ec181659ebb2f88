/// @file
/// Joints of a run-time arm in frames of its own choice: z along the joint axis and x along the common normal of this axis and
/// the next. What leads from one link to the next is then two turns in a plane, of four products each, where a rotation
/// matrix takes nine and has to be made first. (J. Denavit, R. S. Hartenberg, A kinematic notation for lower-pair
/// mechanisms, J. Appl. Mech. 22 (1955) 215; here only the directions of the axes are theirs. Origins remain where they
/// were: the common normal of two axes that are nearly parallel is far away.)
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/core/inertia.hpp"
#include "heft/core/structural.hpp"
#include "heft/core/trigonometry.hpp"

namespace heft::structural {

/// One turn after another.
template <typename Scalar>
constexpr SinCos<Scalar> sum_of_turns(const SinCos<Scalar>& a, const SinCos<Scalar>& b) {
  return {a.sin * b.cos + a.cos * b.sin, a.cos * b.cos - a.sin * b.sin};
}

/// From parent axes into link axes: E = Rz(q)ᵀ Rx(α)ᵀ, with α the twist. A view of both: a copy is stored and loaded again.
template <typename Scalar>
struct HingeRotation {
  const SinCos<Scalar>& twist;
  const SinCos<Scalar>& angle;
};

/// E v. Cost: 8 multiplications, 4 additions.
template <typename Scalar, typename X, typename Y, typename Z>
constexpr auto operator*(const HingeRotation<Scalar>& E, const Vec3<X, Y, Z>& v) {
  const auto& [sa, ca] = E.twist;
  const auto& [s, c] = E.angle;
  const auto y = ca * v.y + sa * v.z;
  return vec3(c * v.x + s * y, c * y - s * v.x, ca * v.z - sa * v.y);
}

/// Eᵀ v.
template <typename Scalar, typename X, typename Y, typename Z>
constexpr auto transpose_times(const HingeRotation<Scalar>& E, const Vec3<X, Y, Z>& v) {
  const auto& [sa, ca] = E.twist;
  const auto& [s, c] = E.angle;
  const auto y = s * v.x + c * v.y;
  return vec3(c * v.x - s * v.y, ca * y - sa * v.z, sa * y + ca * v.z);
}

/// Turns a symmetric matrix in the plane of the axes a and b, c the third: R Σ Rᵀ with R = [cos, −sin; sin, cos]. With
/// k = sin (Σaa − Σbb) + 2 cos Σab: Σaa − sin k, Σbb + sin k, cos k − Σab.
template <typename Scalar>
constexpr void turn_in_plane(const SinCos<Scalar>& turn, Scalar& aa, Scalar& ab, Scalar& bb, Scalar& ac, Scalar& bc) {
  const auto& [s, c] = turn;
  const Scalar k = s * (aa - bb) + (c + c) * ab;
  const Scalar sk = s * k;
  aa = aa - sk;
  bb = bb + sk;
  ab = c * k - ab;
  const Scalar turned = c * ac - s * bc;
  bc = s * ac + c * bc;
  ac = turned;
}

/// add_outboard of inertia.hpp.
template <typename Scalar, typename P, typename Child, typename Parent>
constexpr void add_outboard(const HingeRotation<Scalar>& E, const P& p, const Child& child, Parent& parent) {
  const auto half = scale(p, child.m * Scalar(0.5));
  const auto u = transpose_times(E, child.h) + half;
  Scalar s11 = child.s11, s12 = child.s12, s22 = child.s22, s13 = child.s13, s23 = child.s23, s33 = child.s33;
  turn_in_plane(E.angle, s11, s12, s22, s13, s23);
  turn_in_plane(E.twist, s22, s23, s33, s12, s13);
  const auto xx = u.x * p.x;
  const auto yy = u.y * p.y;
  const auto zz = u.z * p.z;
  parent.m = parent.m + child.m;
  parent.h = parent.h + u + half;
  parent.s11 = parent.s11 + s11 + (xx + xx);
  parent.s12 = parent.s12 + s12 + (u.x * p.y + u.y * p.x);
  parent.s22 = parent.s22 + s22 + (yy + yy);
  parent.s13 = parent.s13 + s13 + (u.x * p.z + u.z * p.x);
  parent.s23 = parent.s23 + s23 + (u.y * p.z + u.z * p.y);
  parent.s33 = parent.s33 + s33 + (zz + zz);
}

/// The joints and links of an arm whose joint axes are z, in frames turned about z.
template <typename Scalar, int N>
class HingedArm {
 public:
  HingedArm() = default;
  /// The same arm in another scalar.
  template <typename Other>
  explicit HingedArm(const HingedArm<Other, N>& arm) noexcept {
    const auto turn = [](const SinCos<Other>& from) {
      return SinCos<Scalar>{static_cast<Scalar>(from.sin), static_cast<Scalar>(from.cos)};
    };
    for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
      types_[j] = arm.types_[j];
      about_[j] = turn(arm.about_[j]);
      twist_[j] = turn(arm.twist_[j]);
      offset_[j] = turn(arm.offset_[j]);
      const auto& p = arm.position_[j];
      position_[j] = {static_cast<Scalar>(p.x), static_cast<Scalar>(p.y), static_cast<Scalar>(p.z)};
      for (std::size_t i = 0; i < 10; ++i) links_[j][i] = static_cast<Scalar>(arm.links_[j][i]);
    }
    for (std::size_t i = 0; i < 3; ++i) lift_[i] = static_cast<Scalar>(arm.lift_[i]);
  }

  /// @param joints  axes z; orthonormal rotations. Links and gravity are to be set after it.
  void set_joints(const std::array<Joint<Scalar>, N>& joints) noexcept {
    using std::sqrt;
    for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
      // R = Rz(φ) Rx(α) Rz(θ), whose third column is (sin φ sin α, −cos φ sin α, cos α).
      const auto& R = joints[j].rotation;
      const auto& p = joints[j].position;
      const Scalar across = sqrt(R[2] * R[2] + R[5] * R[5]);
      const bool parallel = !(across > Eigen::NumTraits<Scalar>::epsilon());
      about_[j] = parallel ? kNoTurn : SinCos<Scalar>{R[2] / across, -R[5] / across};
      const Scalar length = sqrt(across * across + R[8] * R[8]);
      twist_[j] = parallel ? SinCos<Scalar>{Scalar(0), R[8] > Scalar(0) ? Scalar(1) : Scalar(-1)}
                           : SinCos<Scalar>{across / length, R[8] / length};
      const auto& [s, c] = about_[j];
      const auto& [sa, ca] = twist_[j];
      const Scalar x = c * R[0] + s * R[3], y = ca * (c * R[3] - s * R[0]) + sa * R[6];
      const Scalar size = sqrt(x * x + y * y);
      offset_[j] = {y / size, x / size};
      position_[j] = {c * p[0] + s * p[1], c * p[1] - s * p[0], p[2]};
      types_[j] = joints[j].type;
      // The frame before is turned by φ: so is what its own joint turns.
      if (j > 0) offset_[j - 1] = sum_of_turns(offset_[j - 1], about_[j]);
    }
  }

  /// @param link  of link j, in axes with z along the joint
  void set_link(int j, const PseudoInertia<Scalar>& link) noexcept {
    PseudoInertia<Scalar>& turned = links_[static_cast<std::size_t>(j)];
    turned = link;
    if (j + 1 == N) return;
    const auto& [s, c] = about_[static_cast<std::size_t>(j + 1)];
    turned[kPhx] = c * link[kPhx] + s * link[kPhy];
    turned[kPhy] = c * link[kPhy] - s * link[kPhx];
    turn_in_plane(SinCos<Scalar>{-s, c}, turned[kS11], turned[kS12], turned[kS22], turned[kS13], turned[kS23]);
  }

  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    const auto& [s, c] = about_[0];
    lift_ = {-(c * gravity[0] + s * gravity[1]), -(c * gravity[1] - s * gravity[0]), -gravity[2]};
  }

  /// The angle of frame j at the joint angle whose sine and cosine are given; those of a prismatic joint are not looked at.
  SinCos<Scalar> angle(int j, const SinCos<Scalar>& q) const noexcept {
    const std::size_t i = static_cast<std::size_t>(j);
    return types_[i] == JointType::kRevolute ? sum_of_turns(q, offset_[i]) : offset_[i];
  }
  /// @param angle  of angle(), to be kept as long as the rotation
  HingeRotation<Scalar> rotation(int j, const SinCos<Scalar>& angle) const noexcept {
    return {twist_[static_cast<std::size_t>(j)], angle};
  }
  bool is_revolute(int j) const noexcept { return types_[static_cast<std::size_t>(j)] == JointType::kRevolute; }

  /// Origin of link frame j in its parent's axes, at travel q of a prismatic joint.
  Dense3<Scalar> position(int j, const Scalar& q) const noexcept {
    const std::size_t i = static_cast<std::size_t>(j);
    const Dense3<Scalar>& p = position_[i];
    if (types_[i] == JointType::kRevolute) return p;
    return {p.x, p.y - twist_[i].sin * q, p.z + twist_[i].cos * q};
  }

  /// The parameters of a link: a view, good until the next set_link().
  auto link(int j) const noexcept { return link_view(links_[static_cast<std::size_t>(j)]); }

  /// Of the base at rest: gravity, subtracted.
  Dense3<Scalar> base_acceleration() const noexcept { return {lift_[0], lift_[1], lift_[2]}; }

 private:
  template <typename, int>
  friend class HingedArm;

  static constexpr SinCos<Scalar> kNoTurn{Scalar(0), Scalar(1)};

  std::array<JointType, N> types_{};
  std::array<SinCos<Scalar>, N> about_{};   ///< φ, by which the frame before joint j is turned about its z
  std::array<SinCos<Scalar>, N> twist_{};   ///< α
  std::array<SinCos<Scalar>, N> offset_{};  ///< what is added to q: θ, and φ of the joint after
  std::array<Dense3<Scalar>, N> position_{};
  std::array<PseudoInertia<Scalar>, N> links_{};
  std::array<Scalar, 3> lift_{};
};

}  // namespace heft::structural
