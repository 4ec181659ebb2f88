/// @file
/// The joint torque regressor: torques as a linear function of the parameters, tau = Y(q, qd, qdd) x.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/link_motion.hpp"
#include "heft/core/friction/friction.hpp"

namespace heft {

/// Inertial columns of the regressor, n × 10n, ten a link in the order of InertialParameters.
template <typename Scalar, int N>
using LinkRegressor = Eigen::Matrix<Scalar, N, kParametersPerLink * N>;

/// All columns of the regressor, n × 14n: LinkRegressor, then rotor inertia, Coulomb, viscous, offset blocks.
template <typename Scalar, int N>
using FullRegressor = Eigen::Matrix<Scalar, N, kNumFullParameters<N>>;

namespace structural {

/// What joint i asks of a wrench at the origin of link j ≥ i: tau_i = z·n + k·f. For a revolute joint z is its
/// axis and k = z × p with p from joint i to the link origin; for a prismatic one z = 0 and k is the axis. Both in
/// link-j axes (Kawasaki and Nishimura, 1984, (17), (18)).
template <typename Z, typename K>
struct Probe {
  [[no_unique_address]] Z z;
  [[no_unique_address]] K k;
};

template <typename Z, typename K>
constexpr Probe<Z, K> make_probe(const Z& z, const K& k) {
  return {z, k};
}

/// The probe one link further out: z' = E z, k' = E (k + z × p).
template <typename Frame, typename P>
constexpr auto carried(const Frame& frame, const P& probe) {
  return make_probe(frame.rotation * probe.z, frame.rotation * (probe.k + cross(probe.z, frame.position)));
}

/// The part of entry I (PseudoIndex) that is made of velocities alone and so is common to all accelerations.
template <int I, typename P, typename V>
constexpr auto velocity_entry(const P& p, const V& v) {
  if constexpr (I == kPhx) {
    return -lazy_times([&] { return v.yy + v.zz; }, p.k.x);
  } else if constexpr (I == kPhy) {
    return -lazy_times([&] { return v.xx + v.zz; }, p.k.y);
  } else if constexpr (I == kPhz) {
    return -lazy_times([&] { return v.xx + v.yy; }, p.k.z);
  } else if constexpr (I == kS12) {
    return lazy_times([&] { return v.yy - v.xx; }, p.z.z);
  } else if constexpr (I == kS13) {
    return lazy_times([&] { return v.xx - v.zz; }, p.z.y);
  } else if constexpr (I == kS23) {
    return lazy_times([&] { return v.zz - v.yy; }, p.z.x);
  } else {
    return Zero{};
  }
}

/// The rest of entry I of the row of a probe: what the joint feels of a unit of that pseudo-inertia entry.
template <int I, typename P, typename U, typename A>
constexpr auto acceleration_entry(const P& p, const U& u, const A& a) {
  if constexpr (I == kPm) {
    return dot(p.k, a);
  } else if constexpr (I == kPhx) {
    return a.y * p.z.z - a.z * p.z.y + u.u21 * p.k.y + u.u31 * p.k.z;
  } else if constexpr (I == kPhy) {
    return a.z * p.z.x - a.x * p.z.z + u.u12 * p.k.x + u.u32 * p.k.z;
  } else if constexpr (I == kPhz) {
    return a.x * p.z.y - a.y * p.z.x + u.u13 * p.k.x + u.u23 * p.k.y;
  } else if constexpr (I == kS11) {
    return u.u21 * p.z.z - u.u31 * p.z.y;
  } else if constexpr (I == kS12) {
    return u.u31 * p.z.x - u.u32 * p.z.y;
  } else if constexpr (I == kS22) {
    return u.u32 * p.z.x - u.u12 * p.z.z;
  } else if constexpr (I == kS13) {
    return u.u23 * p.z.z - u.u21 * p.z.x;
  } else if constexpr (I == kS23) {
    return u.u12 * p.z.y - u.u13 * p.z.z;
  } else {
    static_assert(I == kS33);
    return u.u13 * p.z.y - u.u23 * p.z.x;
  }
}

/// The ten entries of one row and link, into Y(row, first..first+9), in the order of InertialParameters.
/// Inertia columns: Σ = ½ tr(I) E − I turned round, for instance Ixx = ½ (−S11 + S22 + S33); written out they are
/// the columns of D in (16).
template <typename Scalar, typename P, typename U, typename WD, typename A, typename Matrix>
constexpr void write_inertial_row(const P& p, const U& u, const WD& wd, const A& a, Matrix& Y, int row,
                                  int first) {
  const auto& v = u.v;
  Y(row, first + kMass) = value<Scalar>(acceleration_entry<kPm>(p, u, a));
  Y(row, first + kMcx) = value<Scalar>(velocity_entry<kPhx>(p, v) + acceleration_entry<kPhx>(p, u, a));
  Y(row, first + kMcy) = value<Scalar>(velocity_entry<kPhy>(p, v) + acceleration_entry<kPhy>(p, u, a));
  Y(row, first + kMcz) = value<Scalar>(velocity_entry<kPhz>(p, v) + acceleration_entry<kPhz>(p, u, a));
  Y(row, first + kIxx) = value<Scalar>(p.z.x * wd.x + p.z.y * v.xz - p.z.z * v.xy);
  Y(row, first + kIxy) =
      value<Scalar>(p.z.y * u.u32 - p.z.x * u.u31 - lazy_times([&] { return v.yy - v.xx; }, p.z.z));
  Y(row, first + kIyy) = value<Scalar>(p.z.y * wd.y + p.z.z * v.xy - p.z.x * v.yz);
  Y(row, first + kIxz) =
      value<Scalar>(p.z.x * u.u21 - p.z.z * u.u23 - lazy_times([&] { return v.xx - v.zz; }, p.z.y));
  Y(row, first + kIyz) =
      value<Scalar>(p.z.z * u.u13 - p.z.y * u.u12 - lazy_times([&] { return v.zz - v.yy; }, p.z.x));
  Y(row, first + kIzz) = value<Scalar>(p.z.z * wd.z + p.z.x * v.yz - p.z.y * v.xz);
}

template <typename Frame>
constexpr auto own_probe(const Frame& frame) {
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return make_probe(frame.axis, Zero3{});
    } else {
      return make_probe(Zero3{}, frame.axis);
    }
  } else {
    using S = decltype(frame.position.x);
    const S z = frame.revolute ? S(1) : S(0);
    return make_probe(vec3(Zero{}, Zero{}, z), vec3(Zero{}, Zero{}, S(1) - z));
  }
}

/// One link outward with the probes of all joints inboard of it (from joint First on).
template <int J, int First, typename Arm, typename W, typename WD, typename A, typename Vector, typename Sink,
          typename... Probes>
constexpr void static_regressor(const JointTrigonometry<Arm>& trig, const W& w_parent, const WD& wd_parent,
                                const A& at_joint, const Vector& q, const Vector& qd, const Vector& qdd,
                                Sink& sink, const Probes&... inboard) {
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto w = link_velocity(frame, w_parent, qd[J]);
  const auto spin = relative_spin(frame, w, qd[J]);
  const auto wd = link_angular_acceleration(frame, wd_parent, spin, qdd[J]);
  const auto a = link_acceleration(frame, at_joint, spin, qdd[J]);
  const auto u = u_matrix(velocity_products(w), wd);
  const auto go_on = [&](const auto&... probes) {
    sink(std::integral_constant<int, J>{}, u, wd, a, probes...);
    if constexpr (J + 1 < Arm::kNumJoints) {
      const auto next = Arm::template frame<J + 1>(trig.joint[J + 1], q[J + 1]);
      static_regressor<J + 1, First, Arm>(trig, w, wd, a + u_times(u, next.position), q, qd, qdd, sink,
                                          probes...);
    }
  };
  if constexpr (J >= First) {
    go_on(carried(frame, inboard)..., own_probe(frame));
  } else {
    go_on();
  }
}

/// Writes the block of one link: zero above its own joint's row, one row a probe.
template <typename Scalar, typename Matrix>
struct LinkRegressorSink {
  Matrix& Y;

  template <int J, typename U, typename WD, typename A, typename... Probes>
  constexpr void operator()(std::integral_constant<int, J>, const U& u, const WD& wd, const A& a,
                            const Probes&... probes) const {
    int row = 0;
    (write_inertial_row<Scalar>(probes, u, wd, a, Y, row++, kParametersPerLink * J), ...);
    for (int column = kParametersPerLink * J; column < kParametersPerLink * (J + 1); ++column) {
      for (int below = J + 1; below < static_cast<int>(Matrix::RowsAtCompileTime); ++below) {
        Y(below, column) = Scalar(0);
      }
    }
  }
};

}  // namespace structural

namespace structural {

template <typename Scalar>
constexpr Scalar negated_if(bool minus, const Scalar& value) {
  return minus ? -value : value;
}
/// Without a branch, which would be one for each entry.
template <typename T, int W>
inline Pack<T, W> negated_if(bool minus, const Pack<T, W>& value) {
  using Word = typename Pack<T, W>::Word;
  return value.with_bits_changed(static_cast<Word>(static_cast<Word>(minus) << (8 * sizeof(T) - 1)));
}

/// Takes the entries of one row and link in inner axes, as a matrix would, and writes them where the user's are.
template <typename Matrix>
struct ExchangedRow {
  Matrix& Y;
  const ColumnExchange& exchange;
  int first;  ///< column of the link in Y

  struct Entry {
    Matrix& Y;
    int row, column;
    bool minus;
    template <typename Scalar>
    constexpr void operator=(const Scalar& value) const {
      Y(row, column) = negated_if(minus, value);
    }
  };
  constexpr Entry operator()(int row, int inner) const {
    const std::size_t i = static_cast<std::size_t>(inner);
    return {Y, row, first + exchange.column[i], exchange.minus[i]};
  }
};

/// Keeps the entries of one row and link.
template <typename Scalar>
struct KeptRow {
  std::array<Scalar, kParametersPerLink> entry;

  constexpr Scalar& operator()(int, int column) { return entry[static_cast<std::size_t>(column)]; }
};

/// Entries for parameters in inner link axes into entries for parameters in user link axes: with h' = T h and
/// I' = T I Tᵀ, Y h' = (Y T) h and the six inertia columns likewise.
template <typename Scalar, typename Matrix>
inline void write_turned(const KeptRow<Scalar>& inner, const std::array<Scalar, 9>& T, Matrix& Y, int row,
                         int first) noexcept {
  constexpr std::size_t kAt[3][3] = {{kIxx, kIxy, kIxz}, {kIxy, kIyy, kIyz}, {kIxz, kIyz, kIzz}};
  Scalar h[3];
  Scalar G[3][3];
  for (std::size_t i = 0; i < 3; ++i) {
    h[i] = inner.entry[kMcx + i];
    for (std::size_t j = 0; j < 3; ++j) {
      // As a full matrix of derivatives the off-diagonal columns count twice.
      G[i][j] = inner.entry[kAt[i][j]] * (i == j ? Scalar(1) : Scalar(0.5));
    }
  }
  Y(row, first + kMass) = inner.entry[kMass];
  for (std::size_t i = 0; i < 3; ++i) {
    Scalar turned_h{0};
    for (std::size_t k = 0; k < 3; ++k) {
      turned_h += h[k] * T[3 * k + i];
    }
    Y(row, first + kMcx + static_cast<int>(i)) = turned_h;
    for (std::size_t j = i; j < 3; ++j) {
      Scalar turned{0};
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t l = 0; l < 3; ++l) {
          turned += T[3 * k + i] * G[k][l] * T[3 * l + j];
        }
      }
      Y(row, first + static_cast<int>(kAt[i][j])) = i == j ? turned : Scalar(2) * turned;
    }
  }
}

/// The row of a probe and link j of a run-time geometry, in the user's axes, into Y(row, first..first+9).
template <typename Scalar, int N, typename P, typename U, typename WD, typename A, typename Matrix>
inline void write_user_row(const DynamicArm<Scalar, N>& arm, int j, const P& probe, const U& u, const WD& wd,
                           const A& a, Matrix& Y, int row, int first) noexcept {
  if constexpr (requires { typename Matrix::ExchangesColumns; }) {
    if (arm.exchange(j).exact) {
      write_inertial_row<Scalar>(probe, u, wd, a, Y, row, first);
      return;
    }
  } else if (arm.exchange(j).exact) {
    ExchangedRow<Matrix> entries{Y, arm.exchange(j), first};
    write_inertial_row<Scalar>(probe, u, wd, a, entries, row, 0);
    return;
  }
  KeptRow<Scalar> inner;
  write_inertial_row<Scalar>(probe, u, wd, a, inner, row, 0);
  write_turned(inner, arm.turn(j), Y, row, first);
}

}  // namespace structural

/// Inertial columns of the regressor with compile-time geometry: tau = Y x with x the ten parameters of every
/// link about its link frame.
///
/// @tparam Matrix  LinkRegressor, or FullRegressor, whose first 10n columns are then written
/// @param Y  n × 10n; row i is the torque of joint i [N·m, N] per unit of each parameter
template <typename Arm, typename Matrix>
requires(Arm::kIsStatic) inline void link_regressor(const JointTrigonometry<Arm>& trig,
                                                    const typename Arm::Vector& q,
                                                    const typename Arm::Vector& qd,
                                                    const typename Arm::Vector& qdd, Matrix& Y) noexcept {
  using namespace structural;
  LinkRegressorSink<typename Arm::Scalar, Matrix> sink{Y};
  static_regressor<0, 0, Arm>(trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q, qd, qdd, sink);
}

/// The same with run-time geometry. Cost: 6 joints 1227 multiplications, 1020 additions.
/// @tparam Matrix  as above, or anything that Y(row, column) = value can be written to. If it has a type IsZeroBelow, the
///                 zeros of links inboard of a joint are not written; if it has a type ExchangesColumns, columns of links
///                 that only exchange them are given as in inner axes, for it to do what DynamicArm::exchange says.
template <typename Scalar, int N, typename Matrix>
inline void link_regressor(const DynamicArm<Scalar, N>& arm,
                           const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                           const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                           const JointVector<Scalar, N>& qdd, Matrix& Y) noexcept {
  using namespace structural;
  using V = Dense3<Scalar>;
  std::array<Probe<V, V>, N> probes;
  V w = {Scalar(0), Scalar(0), Scalar(0)};
  V wd = w;
  V at_joint = arm.base_acceleration();
  auto frame = arm.frame(0, trig.joint[0], q[0]);
  for (int j = 0; j < N; ++j) {
    V a = frame.rotation * at_joint;
    w = frame.rotation * w;
    wd = frame.rotation * wd;
    add_joint_motion(frame.revolute, qd[j], qdd[j], w, wd, a);
    const auto u = u_matrix(velocity_products(w), wd);
    for (std::size_t i = 0; i < static_cast<std::size_t>(j); ++i) {
      probes[i] = carried(frame, probes[i]);
    }
    for (int i = 0; i < j; ++i) {
      write_user_row(arm, j, probes[static_cast<std::size_t>(i)], u, wd, a, Y, i, kParametersPerLink * j);
    }
    const auto add_own = [&](const auto& own) {
      write_user_row(arm, j, own, u, wd, a, Y, j, kParametersPerLink * j);
      probes[static_cast<std::size_t>(j)] = {dense<Scalar>(own.z), dense<Scalar>(own.k)};
    };
    // Two calls, so that either has its zeros and ones as types.
    if (frame.revolute) {
      add_own(make_probe(frame.axis, Zero3{}));
    } else {
      add_own(make_probe(Zero3{}, frame.axis));
    }
    if constexpr (!requires { typename Matrix::IsZeroBelow; }) {
      for (int below = j + 1; below < N; ++below) {
        for (int column = 0; column < kParametersPerLink; ++column) {
          Y(below, kParametersPerLink * j + column) = Scalar(0);
        }
      }
    }
    if (j + 1 < N) {
      arm.put_frame(j + 1, trig.joint[static_cast<std::size_t>(j + 1)], q[j + 1], frame);
      at_joint = a + u_times(u, frame.position);
    }
  }
}

/// The last ten columns of link_regressor alone, with run-time geometry: what the joints feel of a body at the last link.
/// @param Y  n × 10
/// Cost: 6 joints about 900 multiplications.
template <typename Scalar, int N>
inline void last_link_regressor(const DynamicArm<Scalar, N>& arm,
                                const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                                const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                                const JointVector<Scalar, N>& qdd,
                                Eigen::Matrix<Scalar, N, kParametersPerLink>& Y) noexcept {
  using namespace structural;
  using V = Dense3<Scalar>;
  std::array<Probe<V, V>, N> probes;
  V w = {Scalar(0), Scalar(0), Scalar(0)};
  V wd = w;
  V at_joint = arm.base_acceleration();
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    const auto frame = arm.frame(j, trig.joint[i], q[j]);
    V a = frame.rotation * at_joint;
    w = frame.rotation * w;
    wd = frame.rotation * wd;
    add_joint_motion(frame.revolute, qd[j], qdd[j], w, wd, a);
    const auto u = u_matrix(velocity_products(w), wd);
    for (std::size_t inboard = 0; inboard < i; ++inboard) {
      probes[inboard] = carried(frame, probes[inboard]);
    }
    const auto own = own_probe(frame);
    probes[i] = {dense<Scalar>(own.z), dense<Scalar>(own.k)};
    if (j + 1 < N) {
      at_joint = a + u_times(u, arm.frame(j + 1, trig.joint[i + 1], q[j + 1]).position);
    } else {
      for (int row = 0; row < N; ++row) {
        write_user_row(arm, j, probes[static_cast<std::size_t>(row)], u, wd, a, Y, row, 0);
      }
    }
  }
}

/// Columns of the actuation: rotor inertia q̈_i, Coulomb sign(q̇_i), viscous q̇_i, offset 1, each in row i only.
/// @param sign_width  velocity scale of a smooth sign [rad/s, m/s]; 0 takes the sharp sign with sign(0) = 0
template <typename Scalar, int N>
inline void actuation_regressor(const JointVector<Scalar, N>& qd, const JointVector<Scalar, N>& qdd,
                                Scalar sign_width, FullRegressor<Scalar, N>& Y) noexcept {
  constexpr int kFirst = kParametersPerLink * N;
  Y.template rightCols<4 * N>().setZero();
  for (int i = 0; i < N; ++i) {
    Y(i, kFirst + i) = qdd[i];
    Y(i, kFirst + N + i) = velocity_sign(qd[i], sign_width);
    Y(i, kFirst + 2 * N + i) = qd[i];
    Y(i, kFirst + 3 * N + i) = Scalar(1);
  }
}

/// The full regressor with run-time geometry: link_regressor and actuation_regressor side by side.
template <typename Scalar, int N>
inline void full_regressor(const DynamicArm<Scalar, N>& arm, const JointVector<Scalar, N>& q,
                           const JointVector<Scalar, N>& qd, const JointVector<Scalar, N>& qdd,
                           Scalar sign_width, FullRegressor<Scalar, N>& Y) noexcept {
  link_regressor(arm, joint_trigonometry<DynamicArm<Scalar, N>>(q), q, qd, qdd, Y);
  actuation_regressor<Scalar, N>(qd, qdd, sign_width, Y);
}

/// The full regressor with compile-time geometry.
template <typename Arm>
requires(Arm::kIsStatic) inline void full_regressor(
    const typename Arm::Vector& q, const typename Arm::Vector& qd, const typename Arm::Vector& qdd,
    typename Arm::Scalar sign_width, FullRegressor<typename Arm::Scalar, Arm::kNumJoints>& Y) noexcept {
  link_regressor<Arm>(joint_trigonometry<Arm>(q), q, qd, qdd, Y);
  actuation_regressor<typename Arm::Scalar, Arm::kNumJoints>(qd, qdd, sign_width, Y);
}

}  // namespace heft
