/// @file
/// Rows k..n of the regressor in the parameters they can see, for the terminal-link estimator.
///
/// Kawasaki and Nishimura, (46)-(50): row i touches links j ≥ i only, so rows k..n are a closed sub-problem.
/// Columns are those of the reduced pseudo-inertias (see reduce()), seven a revolute link for k ≥ 2, and
/// Coulomb and viscous friction of joints k..n: 18 for k = 5 on an arm with six revolute joints, exactly as
/// many as are identifiable. Numbers of joints and rows in the code count from 0.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/link_motion.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/friction/friction.hpp"

namespace heft {

/// Place of each parameter of rows First..n-1 in the estimator's vector.
///
/// Order: friction pairs (Coulomb, viscous), **last joint first**, then the inertial parameters link by link,
/// first link first. Row r then uses its own friction pair and every inertial parameter from its link on, so
/// that eliminating friction first fills nothing in.
///
/// @tparam Arm    StaticArm
/// @tparam First  first joint k-1 ≥ 0
template <typename Arm, int First>
struct TerminalLayout {
  static_assert(First >= 0 && First < Arm::kNumJoints, "k runs from 1 to the number of joints");
  using Description = typename Arm::Description;
  static constexpr int kFirstJoint = First;
  static constexpr int kRows = Arm::kNumJoints - First;
  static constexpr int kFriction = 2 * kRows;

 private:
  template <int J>
  static constexpr int count() {
    int n = 0;
    for (const bool keep : structural::kReducedPattern<Description, J>) {
      n += keep ? 1 : 0;
    }
    return n;
  }
  template <int... R>
  static constexpr std::array<int, kRows + 1> starts(std::integer_sequence<int, R...>) {
    std::array<int, kRows + 1> start{};
    const int counts[] = {count<First + R>()...};
    start[0] = kFriction;
    for (std::size_t r = 0; r < static_cast<std::size_t>(kRows); ++r) {
      start[r + 1] = start[r] + counts[r];
    }
    return start;
  }
  static constexpr std::array<int, kRows + 1> kStart = starts(std::make_integer_sequence<int, kRows>{});

 public:
  static constexpr int kParameters = kStart[static_cast<std::size_t>(kRows)];
  /// Column of the Coulomb coefficient of row r; the viscous one follows.
  static constexpr int friction(int r) { return 2 * (kRows - 1 - r); }
  /// First column of the inertial parameters of link First + r; row r uses all from here on.
  static constexpr int inertial(int r) { return kStart[static_cast<std::size_t>(r)]; }
};

/// Rows First..n-1, each over all parameters of the layout, zero where a row does not reach.
template <typename Scalar, typename Layout>
using TerminalRows = std::array<std::array<Scalar, Layout::kParameters>, Layout::kRows>;

namespace structural {

/// One acceleration of a link.
template <typename WD, typename A>
struct Acceleration {
  [[no_unique_address]] WD wd;
  [[no_unique_address]] A a;
};

template <typename WD, typename A>
constexpr Acceleration<WD, A> make_acceleration(const WD& wd, const A& a) {
  return {wd, a};
}

/// A function of each element, as an array of what it returns.
template <typename F, typename T>
constexpr auto mapped(const std::array<T, 1>& in, F f) {
  return std::array{f(in[0], std::size_t{0})};
}
template <typename F, typename T>
constexpr auto mapped(const std::array<T, 2>& in, F f) {
  return std::array{f(in[0], std::size_t{0}), f(in[1], std::size_t{1})};
}

// Joints whose axes are parallel turn the links between them in one plane. Seen from the frame before the
// first of them the angular velocity has the same part across the axis in every link, and one rotation at the
// end replaces one a joint.

/// Placement of link J (its axes at zero angles, row-major) in the axes of link G0 at zero angle.
template <typename Description>
constexpr std::array<double, 9> group_placement(int g0, int j) {
  std::array<double, 9> c = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (int m = g0 + 1; m <= j; ++m) {
    const auto& R = Description::kModel.joints[static_cast<std::size_t>(m)].rotation;
    std::array<double, 9> next{};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        for (std::size_t k = 0; k < 3; ++k) {
          next[3 * a + b] += c[3 * a + k] * R[3 * k + b];
        }
      }
    }
    c = next;
  }
  return c;
}

/// True when the parent of joint g0 never turns along its axis, whatever the posture: the base, or a first link whose
/// axis is perpendicular to it.
template <typename Description>
constexpr bool parent_turns_across_only(int g0) {
  if (g0 != 1) {
    return g0 == 0;
  }
  const auto& model = Description::kModel;
  const auto& R = model.joints[1].rotation;
  double along = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      along += model.joints[0].axis[i] * R[3 * i + k] * model.joints[1].axis[k];
    }
  }
  return model.joints[0].type == JointType::kPrismatic || (along < kSnap && along > -kSnap);
}

/// Last joint before `limit` of the run of parallel, equally directed revolute axes that starts at joint g0; g0 itself
/// where there is no such run.
template <typename Description>
constexpr int parallel_run_end(int g0, int limit) {
  const auto& model = Description::kModel;
  const auto& first = model.joints[static_cast<std::size_t>(g0)];
  if (first.type != JointType::kRevolute || coordinate_axis(first.axis) < 0 ||
      !parent_turns_across_only<Description>(g0)) {
    return g0;
  }
  int last = g0;
  for (int j = g0 + 1; j < limit; ++j) {
    const auto& joint = model.joints[static_cast<std::size_t>(j)];
    const auto c = group_placement<Description>(g0, j);
    double along = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        along += first.axis[a] * c[3 * a + b] * joint.axis[b];
      }
    }
    if (joint.type != JointType::kRevolute || along < 1 - kSnap) {
      break;
    }
    last = j;
  }
  return last;
}

/// First joint of the run that joint j belongs to when the links before `limit` are passed.
template <typename Description>
constexpr int parallel_run_start(int j, int limit) {
  int g0 = 0;
  while (parallel_run_end<Description>(g0, limit) < j) {
    g0 = parallel_run_end<Description>(g0, limit) + 1;
  }
  return g0;
}

/// Parent axes into axes of link G0 at zero angle: Rᵀ.
template <typename Description, int G0>
inline constexpr std::array<double, 9> kGroupEntry = [] {
  const auto& R = Description::kModel.joints[static_cast<std::size_t>(G0)].rotation;
  return std::array<double, 9>{R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]};
}();

/// The run G0..G1 as one joint that turns by the sum of the angles.
template <typename Description, int G0, int G1>
inline constexpr RotationTables<double> kGroupTables = [] {
  Joint<double> joint;
  joint.rotation = group_placement<Description>(G0, G1);
  joint.axis = Description::kModel.joints[static_cast<std::size_t>(G1)].axis;
  return rotation_tables(joint);
}();
template <typename Description, int G0, int G1>
inline constexpr std::array<double, 9> kGroupM0 = kGroupTables<Description, G0, G1>.m0;
template <typename Description, int G0, int G1>
inline constexpr std::array<double, 9> kGroupM1 = kGroupTables<Description, G0, G1>.m1;
template <typename Description, int G0, int G1>
inline constexpr std::array<double, 9> kGroupM2 = kGroupTables<Description, G0, G1>.m2;

/// The vector from joint J to joint J + 1 in group axes as r = v0 + v1 cos θ + v2 sin θ: nine numbers.
template <typename Description, int G0, int J>
inline constexpr std::array<double, 9> kGroupArm = [] {
  const auto c = group_placement<Description>(G0, J);
  const auto& p = Description::kModel.joints[static_cast<std::size_t>(J + 1)].position;
  const auto& a = Description::kModel.joints[static_cast<std::size_t>(G0)].axis;
  std::array<double, 3> r{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      r[i] += c[3 * i + k] * p[k];
    }
  }
  const double along = a[0] * r[0] + a[1] * r[1] + a[2] * r[2];
  std::array<double, 9> out{};
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = a[i] * along;
    out[3 + i] = r[i] - a[i] * along;
    out[6 + i] = a[(i + 1) % 3] * r[(i + 2) % 3] - a[(i + 2) % 3] * r[(i + 1) % 3];
  }
  return out;
}();

template <typename Scalar, const auto& kA, const auto& kB, const auto& kC, int I>
constexpr auto rotation_entry(const SinCos<Scalar>& sc) {
  return constant<Scalar, kA, I>() + constant<Scalar, kB, I>() * sc.cos + constant<Scalar, kC, I>() * sc.sin;
}

template <typename Scalar, const auto& kA, const auto& kB, const auto& kC>
constexpr auto rotation_matrix(const SinCos<Scalar>& sc) {
  return mat3(vec3(rotation_entry<Scalar, kA, kB, kC, 0>(sc), rotation_entry<Scalar, kA, kB, kC, 1>(sc),
                   rotation_entry<Scalar, kA, kB, kC, 2>(sc)),
              vec3(rotation_entry<Scalar, kA, kB, kC, 3>(sc), rotation_entry<Scalar, kA, kB, kC, 4>(sc),
                   rotation_entry<Scalar, kA, kB, kC, 5>(sc)),
              vec3(rotation_entry<Scalar, kA, kB, kC, 6>(sc), rotation_entry<Scalar, kA, kB, kC, 7>(sc),
                   rotation_entry<Scalar, kA, kB, kC, 8>(sc)));
}

/// Sums over the joints of a parallel run, in group axes: Σ r, Σ s² r⊥, Σ s r⊥, and for each acceleration
/// Σ s̈ a × r. Handed to the continuation `then`, since their types grow with the run.
template <int J, int G0, int G1, typename Arm, typename Trig, typename Axis, typename Velocity,
          typename Accelerations, typename S, typename SDD, typename R, typename Q, typename D, typename X,
          typename Then>
constexpr auto group_sums(const Trig& trig, const Axis& axis, const Velocity& qd, const Accelerations& qdd,
                          const S& s_in, const SDD& sdd_in, const R& r_in, const Q& q_in, const D& d_in,
                          const X& x_in, Then then) {
  using Scalar = typename Arm::Scalar;
  using Description = typename Arm::Description;
  constexpr const auto& kArm = kGroupArm<Description, G0, J>;
  const auto s = s_in + component<J>(qd);
  const auto sdd =
      mapped(sdd_in, [&](const auto& before, std::size_t c) { return before + component<J>(qdd[c]); });
  const auto across = scale(constant3<Scalar, kArm, 3>(), trig.joint[J].cos) +
                      scale(constant3<Scalar, kArm, 6>(), trig.joint[J].sin);
  const auto r = r_in + (constant3<Scalar, kArm, 0>() + across);
  const auto q = [&] {
    if constexpr (kIsZero<decltype(across.x)> && kIsZero<decltype(across.y)> && kIsZero<decltype(across.z)>) {
      return q_in;
    } else {
      return q_in + scale(across, s * s);
    }
  }();
  // For 2 a s (w⊥·r) the sum of s r is enough, w⊥ is common.
  const auto d = d_in + scale(across, s);
  const auto turned = cross(axis, across);
  const auto x =
      mapped(x_in, [&](const auto& before, std::size_t c) { return before + scale(turned, sdd[c]); });
  if constexpr (J < G1) {
    return group_sums<J + 1, G0, G1, Arm>(trig, axis, qd, qdd, s, sdd, r, q, d, x, then);
  } else {
    return then(s, sdd, r, q, d, x);
  }
}

/// Passes the parallel run G0..G1 in one step. Ends with the motion of link G1 and the acceleration of joint
/// G1 + 1, both in axes of link G1.
///
/// With ω = w⊥ + a s (w⊥ common, s the sum of joint velocities) the acceleration from joint m to joint m + 1 is
/// w⊥ × (w⊥ × r) + 2 a s (w⊥·r) − s² r⊥ + ẇ⊥ × r + s̈ a × r, where the velocity part of ω̇ is already in the
/// factor 2. Holds when the parent does not turn along the axis: parent_turns_across_only().
template <int G0, int G1, typename Arm, typename Trig, typename W, typename Acc, std::size_t C,
          typename Velocity, typename Accelerations, typename Then>
constexpr auto pass_group(const Trig& trig, const W& w_parent, const std::array<Acc, C>& acc_parent,
                          const Velocity& qd, const Accelerations& qdd, Then then) {
  using Scalar = typename Arm::Scalar;
  using Description = typename Arm::Description;
  const auto into = mat3(constant3<Scalar, kGroupEntry<Description, G0>, 0>(),
                         constant3<Scalar, kGroupEntry<Description, G0>, 3>(),
                         constant3<Scalar, kGroupEntry<Description, G0>, 6>());
  const auto axis = constant3<Scalar, kAxis<Description, G0>, 0>();
  const auto w_in = into * w_parent;
  const auto zero_sdd = mapped(acc_parent, [](const auto&, std::size_t) { return Zero{}; });
  const auto zero_x = mapped(acc_parent, [](const auto&, std::size_t) { return Zero3{}; });
  return group_sums<G0, G0, G1, Arm>(
      trig, axis, qd, qdd, Zero{}, zero_sdd, Zero3{}, Zero3{}, Zero3{}, zero_x,
      [&](const auto& s, const auto& sdd, const auto& r, const auto& q, const auto& d, const auto& x) {
        const auto u = u_matrix(velocity_products(w_in), Zero3{});
        const auto twice = dot(w_in, d);
        const auto centripetal = u_times(u, r) + scale(axis, twice + twice) - q;
        const auto spin = scale(cross(w_in, axis), s);
        const auto out = rotation_matrix<Scalar, kGroupM0<Description, G0, G1>, kGroupM1<Description, G0, G1>,
                                         kGroupM2<Description, G0, G1>>(trig.joint[G1]);
        const auto acc = mapped(acc_parent, [&](const auto& parent, std::size_t c) {
          const auto wd_in = into * parent.wd;
          const auto at = into * parent.a + centripetal + cross(wd_in, r) + x[c];
          return make_acceleration(out * (wd_in + spin + scale(axis, sdd[c])), out * at);
        });
        return then(out * (w_in + scale(axis, s)), acc);
      });
}

/// Writes the entries of one row for link J into all channels.
template <typename Scalar, typename Layout, int J, std::size_t C, typename P, typename Products, typename U,
          typename Acc, std::size_t... I>
constexpr void write_reduced_row(const P& probe, const Products& products, const std::array<U, C>& u,
                                 const std::array<Acc, C>& acc,
                                 std::array<TerminalRows<Scalar, Layout>, C>& rows, int r,
                                 std::index_sequence<I...>) {
  constexpr const auto& kPattern = kReducedPattern<typename Layout::Description, J>;
  std::size_t column = static_cast<std::size_t>(Layout::inertial(J - Layout::kFirstJoint));
  (
      [&] {
        if constexpr (kPattern[I]) {
          const auto shared = velocity_entry<static_cast<int>(I)>(probe, products);
          for (std::size_t c = 0; c < C; ++c) {
            rows[c][static_cast<std::size_t>(r)][column] =
                value<Scalar>(shared + acceleration_entry<static_cast<int>(I)>(probe, u[c], acc[c].a));
          }
          ++column;
        }
      }(),
      ...);
}

/// Takes what a link gives and writes its entries into the rows of all joints from First to the link's own.
template <typename Scalar, typename Layout, std::size_t C>
struct TerminalRowSink {
  std::array<TerminalRows<Scalar, Layout>, C>& rows;

  template <int J, typename U, typename Acc, typename... Probes>
  constexpr void link(const std::array<U, C>& u, const std::array<Acc, C>& acc,
                      const Probes&... probes) const {
    int row = 0;
    (write_reduced_row<Scalar, Layout, J>(probes, u[0].v, u, acc, rows, row++,
                                          std::make_index_sequence<10>{}),
     ...);
  }
};

/// Links First..n-1: their motion and the probes of all joints from First on go to the sink.
template <int J, typename Arm, typename Trig, typename W, typename Acc, std::size_t C, typename Accelerations,
          typename Sink, typename... Probes>
constexpr void pass_terminal_links(const Trig& trig, const W& w_parent, const std::array<Acc, C>& acc_parent,
                                   const typename Arm::Vector& q, const typename Arm::Vector& qd,
                                   const Accelerations& qdd, const Sink& sink, const Probes&... inboard) {
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto w = link_velocity(frame, w_parent, qd[J]);
  const auto spin = relative_spin(frame, w, qd[J]);
  const auto acc = mapped(acc_parent, [&](const auto& parent, std::size_t c) {
    return make_acceleration(link_angular_acceleration(frame, parent.wd, spin, component<J>(qdd[c])),
                             link_acceleration(frame, parent.a, spin, component<J>(qdd[c])));
  });
  const auto products = velocity_products(w);
  const auto u =
      mapped(acc, [&](const auto& channel, std::size_t) { return u_matrix(products, channel.wd); });
  const auto go_on = [&](const auto&... probes) {
    sink.template link<J>(u, acc, probes...);
    if constexpr (J + 1 < Arm::kNumJoints) {
      const auto next = Arm::template frame<J + 1>(trig.joint[J + 1], q[J + 1]);
      const auto at_next = mapped(acc, [&](const auto& channel, std::size_t c) {
        return make_acceleration(channel.wd, channel.a + u_times(u[c], next.position));
      });
      pass_terminal_links<J + 1, Arm>(trig, w, at_next, q, qd, qdd, sink, probes...);
    }
  };
  go_on(carried(frame, inboard)..., own_probe(frame));
}

/// Links before First: only their motion is wanted.
template <int J, int First, typename Arm, typename Trig, typename W, typename Acc, std::size_t C,
          typename Accelerations, typename Sink>
constexpr void pass_inboard_links(const Trig& trig, const W& w_parent, const std::array<Acc, C>& acc_parent,
                                  const typename Arm::Vector& q, const typename Arm::Vector& qd,
                                  const Accelerations& qdd, const Sink& sink) {
  using Description = typename Arm::Description;
  if constexpr (J >= First) {
    pass_terminal_links<J, Arm>(trig, w_parent, acc_parent, q, qd, qdd, sink);
  } else {
    constexpr int kEnd = parallel_run_end<Description>(J, First);
    if constexpr (kEnd > J) {
      pass_group<J, kEnd, Arm>(trig, w_parent, acc_parent, qd, qdd, [&](const auto& w, const auto& acc) {
        pass_inboard_links<kEnd + 1, First, Arm>(trig, w, acc, q, qd, qdd, sink);
      });
    } else {
      const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
      const auto next = Arm::template frame<J + 1>(trig.joint[J + 1], q[J + 1]);
      const auto w = link_velocity(frame, w_parent, qd[J]);
      const auto spin = relative_spin(frame, w, qd[J]);
      const auto centripetal = u_times(u_matrix(velocity_products(w), Zero3{}), next.position);
      const auto acc = mapped(acc_parent, [&](const auto& parent, std::size_t c) {
        const auto wd = link_angular_acceleration(frame, parent.wd, spin, component<J>(qdd[c]));
        const auto a = link_acceleration(frame, parent.a, spin, component<J>(qdd[c]));
        return make_acceleration(wd, a + (centripetal + cross(wd, next.position)));
      });
      pass_inboard_links<J + 1, First, Arm>(trig, w, acc, q, qd, qdd, sink);
    }
  }
}

/// The whole pass, base to tip.
template <typename Arm, int First, std::size_t C, typename Trig, typename Accelerations, typename Sink>
constexpr void pass_links(const Trig& trig, const typename Arm::Vector& q, const typename Arm::Vector& qd,
                          const Accelerations& qdd, const Sink& sink) {
  const auto base = make_acceleration(Zero3{}, Arm::base_acceleration());
  std::array<std::remove_cv_t<decltype(base)>, C> start;
  start.fill(base);
  pass_inboard_links<0, First, Arm>(trig, Zero3{}, start, q, qd, qdd, sink);
}

}  // namespace structural

namespace structural {

/// Joints that continue a run of parallel axes when the links before First are passed.
template <typename Arm, int First>
inline constexpr std::array<bool, static_cast<std::size_t>(Arm::kNumJoints)> kContinuesRun = [] {
  std::array<bool, static_cast<std::size_t>(Arm::kNumJoints)> in_run{};
  for (int j = 1; j < First; ++j) {
    in_run[static_cast<std::size_t>(j)] = parallel_run_start<typename Arm::Description>(j, First) < j;
  }
  return in_run;
}();

}  // namespace structural

/// Sines and cosines for terminal_rows: joints before First in a run of parallel axes carry the sum of the
/// angles of the run up to them, all others their own angle.
template <typename Arm, int First>
struct TerminalTrigonometry {
  std::array<SinCos<typename Arm::Scalar>, Arm::kNumJoints> joint;
};

/// @param q  joint positions, n
template <typename Arm, int First>
inline TerminalTrigonometry<Arm, First> terminal_trigonometry(const typename Arm::Vector& q) noexcept {
  using Scalar = typename Arm::Scalar;
  constexpr int kN = Arm::kNumJoints;
  constexpr int kSkip = Arm::kFirstAngleIsFree ? 1 : 0;
  std::array<Scalar, kN> angles;
  // A first angle that no torque depends on is taken as zero, in the sums as well.
  angles[0] = Arm::kFirstAngleIsFree ? Scalar(0) : q[0];
  for (int j = 1; j < kN; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    angles[i] = structural::kContinuesRun<Arm, First>[i] ? angles[i - 1] + q[j] : q[j];
  }
  TerminalTrigonometry<Arm, First> trig;
  trig.joint[0] = {Scalar(0), Scalar(1)};
  sin_cos(angles.data() + kSkip, trig.joint.data() + kSkip, kN - kSkip);
  return trig;
}

/// The same from the joints' own sines and cosines, where something else of the sample needs these: sums of angles by
/// sin(a + b) = sin a cos b + cos a sin b, four multiplications each.
template <typename Arm, int First>
inline TerminalTrigonometry<Arm, First> terminal_trigonometry(const JointTrigonometry<Arm>& own) noexcept {
  using Scalar = typename Arm::Scalar;
  TerminalTrigonometry<Arm, First> trig;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    (
        [&] {
          const SinCos<Scalar>& b = own.joint[I];
          if constexpr (structural::kContinuesRun<Arm, First>[I] && !(I == 1 && Arm::kFirstAngleIsFree)) {
            const SinCos<Scalar>& a = trig.joint[I - 1];
            trig.joint[I] = {a.sin * b.cos + a.cos * b.sin, a.cos * b.cos - a.sin * b.sin};
          } else {
            trig.joint[I] = b;
          }
        }(),
        ...);
  }
  (std::make_index_sequence<static_cast<std::size_t>(Arm::kNumJoints)>{});
  return trig;
}

/// The friction entries of the rows: Coulomb and viscous column of each row's own joint.
template <typename Arm, typename Layout>
inline void friction_rows(const typename Arm::Vector& qd, typename Arm::Scalar sign_width,
                          TerminalRows<typename Arm::Scalar, Layout>& rows) noexcept {
  for (int r = 0; r < Layout::kRows; ++r) {
    auto& row = rows[static_cast<std::size_t>(r)];
    const std::size_t column = static_cast<std::size_t>(Layout::friction(r));
    row[column] = velocity_sign(qd[Layout::kFirstJoint + r], sign_width);
    row[column + 1] = qd[Layout::kFirstJoint + r];
  }
}

/// Two accelerations where they are, for terminal_rows without a copy.
template <typename Vector>
struct AccelerationPair {
  const Vector& measured;
  const Vector& instrument;
  constexpr const Vector& operator[](std::size_t c) const noexcept { return c == 0 ? measured : instrument; }
};

/// Rows First..n-1 for one or two accelerations at the same q and qd: the measured one, and the one the
/// instruments are made of. What depends on velocities alone is computed once.
///
/// @tparam C     1 or 2
/// @param qdd    C accelerations, n each [rad/s²]: an array, or an AccelerationPair
/// @param rows   C results. Entries a row does not reach are not written: start from zeros.
/// Cost, Kawasaki and Nishimura's arm, k = 5, C = 2: bench/operation_count prints it.
template <typename Arm, int First, std::size_t C,
          typename Accelerations = std::array<typename Arm::Vector, C>>
requires(Arm::kIsStatic && (C == 1 || C == 2)) inline void terminal_rows(
    const TerminalTrigonometry<Arm, First>& trig, const typename Arm::Vector& q,
    const typename Arm::Vector& qd, const Accelerations& qdd, typename Arm::Scalar sign_width,
    std::array<TerminalRows<typename Arm::Scalar, TerminalLayout<Arm, First>>, C>& rows) noexcept {
  using Layout = TerminalLayout<Arm, First>;
  structural::pass_links<Arm, First, C>(trig, q, qd, qdd,
                                        structural::TerminalRowSink<typename Arm::Scalar, Layout, C>{rows});
  for (std::size_t c = 0; c < C; ++c) {
    friction_rows<Arm, Layout>(qd, sign_width, rows[c]);
  }
}

}  // namespace heft
