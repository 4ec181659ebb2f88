/// @file
/// The two sources of geometry that the dynamics run on: StaticArm, whose numbers are types, and DynamicArm,
/// whose numbers are data.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/core/hinge.hpp"
#include "heft/core/inertia.hpp"
#include "heft/core/structural.hpp"
#include "heft/core/trigonometry.hpp"

namespace heft {

/// Joint-space vector.
template <typename Scalar, int N>
using JointVector = Eigen::Matrix<Scalar, N, 1>;

namespace structural {

/// Rotation from parent axes into link axes as a function of the joint angle:
/// E(q) = M₀ + cos(q) M₁ + sin(q) M₂, row-major, from Rodrigues' formula for the axis a and the placement R:
/// M₀ = a aᵀ Rᵀ, M₁ = (E − a aᵀ) Rᵀ, M₂ = −[a]× Rᵀ.
template <typename Scalar>
struct RotationTables {
  std::array<Scalar, 9> m0{}, m1{}, m2{};
};

template <typename Scalar>
constexpr RotationTables<Scalar> rotation_tables(const Joint<Scalar>& joint) noexcept {
  const auto& a = joint.axis;
  const auto& R = joint.rotation;
  const std::array<Scalar, 9> skew = {Scalar(0), -a[2], a[1], a[2], Scalar(0), -a[0], -a[1], a[0], Scalar(0)};
  RotationTables<Scalar> t;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      Scalar along{0};
      Scalar turned{0};
      for (std::size_t k = 0; k < 3; ++k) {
        along = along + a[i] * a[k] * R[3 * j + k];
        turned = turned + skew[3 * i + k] * R[3 * j + k];
      }
      t.m0[3 * i + j] = along;
      t.m1[3 * i + j] = R[3 * j + i] - along;
      t.m2[3 * i + j] = -turned;
    }
  }
  return t;
}

/// One joint at one instant: E turns parent components into link components, p is the link origin in the
/// parent frame, axis the joint axis in link axes.
template <JointType kType, typename E, typename P, typename A>
struct JointFrame {
  static constexpr JointType type = kType;
  [[no_unique_address]] E rotation;
  [[no_unique_address]] P position;
  [[no_unique_address]] A axis;
};

/// Static storage for the tables of a compile-time description, one variable a joint.
template <typename Description, int J>
inline constexpr RotationTables<double> kRotationTables =
    rotation_tables(Description::kModel.joints[static_cast<std::size_t>(J)]);
template <typename Description, int J>
inline constexpr std::array<double, 9> kM0 = kRotationTables<Description, J>.m0;
template <typename Description, int J>
inline constexpr std::array<double, 9> kM1 = kRotationTables<Description, J>.m1;
template <typename Description, int J>
inline constexpr std::array<double, 9> kM2 = kRotationTables<Description, J>.m2;
template <typename Description, int J>
inline constexpr std::array<double, 3> kPosition =
    Description::kModel.joints[static_cast<std::size_t>(J)].position;
template <typename Description, int J>
inline constexpr std::array<double, 3> kAxis = Description::kModel.joints[static_cast<std::size_t>(J)].axis;
template <typename Description>
inline constexpr std::array<double, 3> kGravity = Description::kModel.gravity;
template <typename Description>
inline constexpr auto kReducedLinks = reduced_links(Description::kModel);
template <typename Description, int J>
inline constexpr PseudoInertia<double> kReducedLink = kReducedLinks<Description>[static_cast<std::size_t>(J)];

/// Axis times travel in parent axes, for a prismatic joint: R a.
template <typename Description, int J>
inline constexpr std::array<double, 3> kTravel = [] {
  const auto& joint = Description::kModel.joints[static_cast<std::size_t>(J)];
  std::array<double, 3> t{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      t[i] += joint.rotation[3 * i + k] * joint.axis[k];
    }
  }
  return t;
}();

/// Coordinate axis (0, 1, 2) that a constexpr unit vector lies on, or -1.
constexpr int coordinate_axis(const std::array<double, 3>& a) noexcept {
  for (int i = 0; i < 3; ++i) {
    const double v = a[static_cast<std::size_t>(i)];
    if (v > 1 - kSnap || v < -1 + kSnap) {
      return i;
    }
  }
  return -1;
}

/// Which entries of a link's reduced pseudo-inertia can be different from zero, whatever the parameters.
template <typename Description, int J>
inline constexpr std::array<bool, 10> kReducedPattern = [] {
  const auto& model = Description::kModel;
  const auto& joint = model.joints[static_cast<std::size_t>(J)];
  std::array<bool, 10> keep{};
  const int a = coordinate_axis(joint.axis);
  if (joint.type == JointType::kPrismatic) {
    for (std::size_t i = 0; i < 4; ++i) {
      keep[i] = true;
    }
    return keep;
  }
  if (J == 0 && first_axis_is_vertical(model)) {
    if (a < 0) {
      for (std::size_t i = 4; i < 10; ++i) {
        keep[i] = true;
      }
    } else {
      keep[static_cast<std::size_t>(a == 0 ? kS22 : kS11)] = true;
    }
    return keep;
  }
  for (std::size_t i = 1; i < 10; ++i) {
    keep[i] = true;
  }
  if (a >= 0) {
    keep[static_cast<std::size_t>(1 + a)] = false;
    keep[static_cast<std::size_t>(a == 0 ? kS11 : a == 1 ? kS22 : kS33)] = false;
  }
  return keep;
}();

/// Entry I of a run-time pseudo-inertia, or the known zero.
template <typename Scalar, const auto& kPattern, int I>
constexpr auto masked(const PseudoInertia<Scalar>& link) {
  if constexpr (kPattern[I]) {
    return link[I];
  } else {
    return Zero{};
  }
}

}  // namespace structural

/// An arm whose geometry is known at compile time.
///
/// @tparam Scalar       float, double, or a counting scalar
/// @tparam Description  a type with `static constexpr ArmModel<double, N> kModel`, as `heft export` writes it
///
/// Joint axes along a coordinate axis of their link frame, quarter turns and zero offsets cost nothing.
/// Gravity is that of the description.
template <typename Scalar_, typename Description_>
class StaticArm {
 public:
  using Scalar = Scalar_;
  using Description = Description_;
  static constexpr int kNumJoints = Description::kModel.kNumJoints;
  static constexpr bool kIsStatic = true;
  using Vector = JointVector<Scalar, kNumJoints>;

  /// True when no torque depends on the first joint angle, whose sine and cosine are then not needed.
  static constexpr bool kFirstAngleIsFree = first_axis_is_vertical(Description::kModel);

  template <int J>
  static constexpr JointType joint_type() {
    return Description::kModel.joints[static_cast<std::size_t>(J)].type;
  }

  /// Joint J at the angle whose sine and cosine are given, or at the travel q of a prismatic joint.
  template <int J>
  static constexpr auto frame(const SinCos<Scalar>& sc, const Scalar& q) {
    using namespace structural;
    constexpr auto type = joint_type<J>();
    const auto axis = constant3<Scalar, kAxis<Description, J>, 0>();
    if constexpr (type == JointType::kRevolute) {
      const auto rotation = mat3(row<J, 0>(sc), row<J, 3>(sc), row<J, 6>(sc));
      return make_frame<type>(rotation, constant3<Scalar, kPosition<Description, J>, 0>(), axis);
    } else {
      const auto rotation = mat3(fixed_row<J, 0>(), fixed_row<J, 3>(), fixed_row<J, 6>());
      const auto position = constant3<Scalar, kPosition<Description, J>, 0>() +
                            structural::scale(constant3<Scalar, kTravel<Description, J>, 0>(), q);
      return make_frame<type>(rotation, position, axis);
    }
  }

  /// Acceleration of the base frame that represents gravity, −g.
  static constexpr auto base_acceleration() {
    return -structural::constant3<Scalar, structural::kGravity<Description>, 0>();
  }

 private:
  template <JointType kType, typename E, typename P, typename A>
  static constexpr structural::JointFrame<kType, E, P, A> make_frame(const E& e, const P& p, const A& a) {
    return {e, p, a};
  }

  template <int J, int I>
  static constexpr auto entry(const SinCos<Scalar>& sc) {
    using namespace structural;
    return constant<Scalar, kM0<Description, J>, I>() + constant<Scalar, kM1<Description, J>, I>() * sc.cos +
           constant<Scalar, kM2<Description, J>, I>() * sc.sin;
  }
  template <int J, int I>
  static constexpr auto row(const SinCos<Scalar>& sc) {
    return structural::vec3(entry<J, I>(sc), entry<J, I + 1>(sc), entry<J, I + 2>(sc));
  }
  template <int J, int I>
  static constexpr auto fixed_entry() {
    using namespace structural;
    // q = 0 of Rodrigues' formula: M₀ + M₁ = Rᵀ.
    return constant<Scalar, kFixed<J>, I>();
  }
  template <int J, int I>
  static constexpr auto fixed_row() {
    return structural::vec3(fixed_entry<J, I>(), fixed_entry<J, I + 1>(), fixed_entry<J, I + 2>());
  }
  template <int J>
  static constexpr std::array<double, 9> kFixed = [] {
    std::array<double, 9> r{};
    for (std::size_t i = 0; i < 9; ++i) {
      r[i] = structural::kM0<Description, J>[i] + structural::kM1<Description, J>[i];
    }
    return r;
  }();
};

/// Link parameters known at compile time: the description's own, reduced (see reduce()).
template <typename Scalar, typename Description>
struct ConstantParameters {
  template <int J>
  static constexpr auto link() {
    using namespace structural;
    constexpr const auto& k = kReducedLink<Description, J>;
    return link_parameters(constant<Scalar, k, kPm>(), constant3<Scalar, k, kPhx>(),
                           constant<Scalar, k, kS11>(), constant<Scalar, k, kS12>(),
                           constant<Scalar, k, kS22>(), constant<Scalar, k, kS13>(),
                           constant<Scalar, k, kS23>(), constant<Scalar, k, kS33>());
  }
};

/// Reduced link parameters that may change at run time, on a compile-time geometry whose zero pattern they share.
template <typename Scalar, typename Description>
struct ReducedParameters {
  static constexpr int kNumJoints = Description::kModel.kNumJoints;
  std::array<PseudoInertia<Scalar>, kNumJoints> links{};

  template <int J>
  constexpr auto link() const {
    using namespace structural;
    constexpr const auto& k = kReducedPattern<Description, J>;
    const auto& p = links[J];
    return link_parameters(
        masked<Scalar, k, kPm>(p),
        vec3(masked<Scalar, k, kPhx>(p), masked<Scalar, k, kPhy>(p), masked<Scalar, k, kPhz>(p)),
        masked<Scalar, k, kS11>(p), masked<Scalar, k, kS12>(p), masked<Scalar, k, kS22>(p),
        masked<Scalar, k, kS13>(p), masked<Scalar, k, kS23>(p), masked<Scalar, k, kS33>(p));
  }
};

/// Where the inertial columns of a link in inner axes are found among those in the user's: turns that exchange axes, as
/// most do, exchange columns, and some change their sign.
struct ColumnExchange {
  bool exact{false};  ///< the turn does no more than that
  std::array<std::uint8_t, kParametersPerLink> column{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  std::array<bool, kParametersPerLink> minus{};
};

namespace structural {

/// One joint of a run-time geometry at one instant, with inner frames on both sides; see JointFrame.
template <typename Scalar>
struct DynamicFrame {
  static constexpr Vec3<Int<0>, Int<0>, Int<1>> axis{};
  Mat3<Dense3<Scalar>, Dense3<Scalar>, Dense3<Scalar>> rotation;
  Dense3<Scalar> position;
  bool revolute;
};

}  // namespace structural

/// An arm whose geometry and parameters are data.
///
/// Link frames are turned inside so that every joint axis is z; arguments and results are in the user's
/// frames throughout. Where nothing is given or asked in link axes, hinged() has frames that cost less.
template <typename Scalar_, int N>
class DynamicArm {
 public:
  using Scalar = Scalar_;
  static constexpr int kNumJoints = N;
  static constexpr bool kIsStatic = false;
  using Vector = JointVector<Scalar, N>;

  DynamicArm() = default;
  /// @param arm  finite numbers, orthonormal rotations, unit axes
  explicit DynamicArm(const ArmModel<Scalar, N>& arm) noexcept { set_model(arm); }
  /// The same arm in another scalar: in every lane of a Pack, for one.
  template <typename Other>
  explicit DynamicArm(const DynamicArm<Other, N>& arm) noexcept
      : turned_(arm.turned_), exchanges_(arm.exchanges_), hinged_(arm.hinged_) {
    const auto copy = [](const auto& from, auto& to) {
      for (std::size_t i = 0; i < from.size(); ++i) to[i] = static_cast<Scalar>(from[i]);
    };
    const auto copy_joint = [&](const Joint<Other>& from, Joint<Scalar>& to) {
      to.type = from.type;
      copy(from.rotation, to.rotation), copy(from.position, to.position), copy(from.axis, to.axis);
    };
    for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
      copy_joint(arm.model_.joints[j], model_.joints[j]);
      copy(arm.model_.links[j], model_.links[j]);
      const JointActuation<Other>& drive = arm.model_.actuation[j];
      model_.actuation[j] = {
          static_cast<Scalar>(drive.rotor_inertia), static_cast<Scalar>(drive.coulomb_friction),
          static_cast<Scalar>(drive.viscous_friction), static_cast<Scalar>(drive.friction_offset)};
      copy_joint(arm.joints_[j], joints_[j]);
      copy(arm.links_[j], links_[j]);
      copy(arm.turn_[j], turn_[j]);
    }
    copy(arm.model_.gravity, model_.gravity);
  }

  /// Takes geometry, gravity and link parameters from a model.
  void set_model(const ArmModel<Scalar, N>& arm) noexcept {
    model_ = arm;
    std::array<Scalar, 9> inboard_turn = {Scalar(1), Scalar(0), Scalar(0), Scalar(0), Scalar(1),
                                          Scalar(0), Scalar(0), Scalar(0), Scalar(1)};
    for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
      const auto& joint = arm.joints[j];
      turn_[j] = turn_to_z(joint.axis);
      turned_[j] = !(joint.axis[2] > Scalar(1) - Scalar(4) * Eigen::NumTraits<Scalar>::epsilon());
      exchanges_[j] = exchange_of(turn_[j]);
      Joint<Scalar> inner;
      inner.type = joint.type;
      // Parent axes turned by T_p, link axes by T: R' = T_p R Tᵀ, p' = T_p p.
      std::array<Scalar, 9> half{};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) {
          Scalar sum{0};
          for (std::size_t k = 0; k < 3; ++k) {
            sum += inboard_turn[3 * r + k] * joint.rotation[3 * k + c];
          }
          half[3 * r + c] = sum;
        }
      }
      for (std::size_t r = 0; r < 3; ++r) {
        Scalar p{0};
        for (std::size_t c = 0; c < 3; ++c) {
          p += inboard_turn[3 * r + c] * joint.position[c];
          Scalar sum{0};
          for (std::size_t k = 0; k < 3; ++k) {
            sum += half[3 * r + k] * turn_[j][3 * c + k];
          }
          inner.rotation[3 * r + c] = sum;
        }
        inner.position[r] = p;
      }
      joints_[j] = inner;
      inboard_turn = turn_[j];
    }
    hinged_.set_joints(joints_);
    hinged_.set_gravity(arm.gravity);
    for (int j = 0; j < N; ++j) set_link(j, arm.links[static_cast<std::size_t>(j)]);
  }

  /// Replaces the inertial parameters of one link (about its user frame).
  void set_link(int j, const InertialParameters<Scalar>& parameters) noexcept {
    const std::size_t i = static_cast<std::size_t>(j);
    model_.links[i] = parameters;
    links_[i] = moved(to_pseudo_inertia(parameters), turn_[i], {Scalar(0), Scalar(0), Scalar(0)});
    hinged_.set_link(j, links_[i]);
  }

  /// Replaces the gravity vector, in the base frame [m/s²]: a tilted base.
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    model_.gravity = gravity;
    hinged_.set_gravity(gravity);
  }

  /// The model as given, in user frames.
  const ArmModel<Scalar, N>& model() const noexcept { return model_; }

  /// True where link frame j was turned inside because its joint axis is not z.
  bool is_turned(int j) const noexcept { return turned_[static_cast<std::size_t>(j)]; }
  /// Turns components in user link axes into components in inner link axes, row-major.
  const std::array<Scalar, 9>& turn(int j) const noexcept { return turn_[static_cast<std::size_t>(j)]; }

  /// What turn() does to inertial columns, where it only exchanges axes.
  const ColumnExchange& exchange(int j) const noexcept { return exchanges_[static_cast<std::size_t>(j)]; }

  /// Placement of joint j with inner frames on both sides (axis z).
  const Joint<Scalar>& inner_joint(int j) const noexcept { return joints_[static_cast<std::size_t>(j)]; }

  JointType joint_type(int j) const noexcept { return joints_[static_cast<std::size_t>(j)].type; }

  /// Joint j at the angle whose sine and cosine are given, or at travel q.
  structural::DynamicFrame<Scalar> frame(int j, const SinCos<Scalar>& sc, const Scalar& q) const noexcept {
    structural::DynamicFrame<Scalar> frame;
    put_frame(j, sc, q, frame);
    return frame;
  }
  /// The same, written where it is to be: a copy of it is a dozen numbers.
  void put_frame(int j, const SinCos<Scalar>& sc, const Scalar& q,
                 structural::DynamicFrame<Scalar>& frame) const noexcept {
    using namespace structural;
    const Joint<Scalar>& joint = joints_[static_cast<std::size_t>(j)];
    const auto& R = joint.rotation;
    frame.revolute = joint.type == JointType::kRevolute;
    if (frame.revolute) {
      // E = Rz(q)ᵀ Rᵀ.
      const Scalar& c = sc.cos;
      const Scalar& s = sc.sin;
      frame.rotation.row0 = vec3(c * R[0] + s * R[1], c * R[3] + s * R[4], c * R[6] + s * R[7]);
      frame.rotation.row1 = vec3(c * R[1] - s * R[0], c * R[4] - s * R[3], c * R[7] - s * R[6]);
    } else {
      frame.rotation.row0 = vec3(R[0], R[3], R[6]);
      frame.rotation.row1 = vec3(R[1], R[4], R[7]);
    }
    frame.rotation.row2 = vec3(R[2], R[5], R[8]);
    frame.position = joint_position(j, q);
  }

  /// Origin of link frame j in its parent's inner axes.
  structural::Dense3<Scalar> joint_position(int j, const Scalar& q) const noexcept {
    const Joint<Scalar>& joint = joints_[static_cast<std::size_t>(j)];
    const auto& R = joint.rotation;
    const auto& p = joint.position;
    if (joint.type == JointType::kRevolute) return {p[0], p[1], p[2]};
    return {p[0] + R[2] * q, p[1] + R[5] * q, p[2] + R[8] * q};
  }

  /// The parameters of a link in inner axes: a view, good until the next set_link().
  auto link(int j) const noexcept { return structural::link_view(links_[static_cast<std::size_t>(j)]); }

  /// The same arm for torques alone.
  const structural::HingedArm<Scalar, N>& hinged() const noexcept { return hinged_; }

  structural::Dense3<Scalar> base_acceleration() const noexcept {
    return {-model_.gravity[0], -model_.gravity[1], -model_.gravity[2]};
  }

 private:
  template <typename, int>
  friend class DynamicArm;

  /// Found by exact zeros and ones in T, the turn of a link: h' = T h and I' = T I Tᵀ.
  static ColumnExchange exchange_of(const std::array<Scalar, 9>& T) noexcept {
    constexpr std::uint8_t kAt[3][3] = {{kIxx, kIxy, kIxz}, {kIxy, kIyy, kIyz}, {kIxz, kIyz, kIzz}};
    std::size_t from[3]{};  // of inner axis k
    bool minus[3]{};
    for (std::size_t k = 0; k < 3; ++k) {
      int ones = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        const Scalar& t = T[3 * k + i];
        if (t == Scalar(1) || t == Scalar(-1)) {
          from[k] = i;
          minus[k] = t == Scalar(-1);
          ++ones;
        } else if (!(t == Scalar(0))) {
          return {};
        }
      }
      if (ones != 1) return {};
    }
    ColumnExchange exchange;
    exchange.exact = true;
    for (std::size_t k = 0; k < 3; ++k) {
      exchange.column[kMcx + k] = static_cast<std::uint8_t>(kMcx + from[k]);
      exchange.minus[kMcx + k] = minus[k];
      for (std::size_t l = k; l < 3; ++l) {
        exchange.column[kAt[k][l]] = kAt[from[k]][from[l]];
        exchange.minus[kAt[k][l]] = minus[k] != minus[l];
      }
    }
    return exchange;
  }

  /// Rotation (row-major) that takes the unit vector a to z by the shortest way.
  static std::array<Scalar, 9> turn_to_z(const std::array<Scalar, 3>& a) noexcept {
    if (a[2] < Scalar(-0.9999)) {
      // Half a turn about x first, then the small rest.
      const std::array<Scalar, 9> rest = turn_to_z({a[0], -a[1], -a[2]});
      return {rest[0], -rest[1], -rest[2], rest[3], -rest[4], -rest[5], rest[6], -rest[7], -rest[8]};
    }
    const Scalar f = Scalar(1) / (Scalar(1) + a[2]);
    return {Scalar(1) - a[0] * a[0] * f,
            -a[0] * a[1] * f,
            -a[0],
            -a[0] * a[1] * f,
            Scalar(1) - a[1] * a[1] * f,
            -a[1],
            a[0],
            a[1],
            a[2]};
  }

  ArmModel<Scalar, N> model_{};
  std::array<Joint<Scalar>, N> joints_{};  ///< inner frames, axis z
  std::array<PseudoInertia<Scalar>, N> links_{};
  std::array<std::array<Scalar, 9>, N> turn_{};
  std::array<bool, N> turned_{};
  std::array<ColumnExchange, N> exchanges_{};
  structural::HingedArm<Scalar, N> hinged_;
};

}  // namespace heft
