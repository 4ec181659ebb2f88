/// @file
/// The rigid bodies of an arm with a payload and with gravity from anywhere, for both kinds of description.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <utility>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/dynamics/drive_torque.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/loaded_torque.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/dynamics/run_time_arm.hpp"

namespace heft {

namespace detail {

/// What an arm says of itself, converted at compile time.
template <typename Description>
struct ArmSource {
  static constexpr bool kIsStatic = true;
  static constexpr int kNumJoints = Description::kModel.kNumJoints;
  static constexpr int kEffects = [] {
    if constexpr (requires { Description::kEffects; }) {
      return static_cast<int>(Description::kEffects.size());
    } else {
      return 0;
    }
  }();
  static constexpr int kCouplings = [] {
    if constexpr (requires { Description::kCouplings; }) {
      return static_cast<int>(Description::kCouplings.size());
    } else {
      return 0;
    }
  }();
  static constexpr int kCables = [] {
    if constexpr (requires { Description::kCables; }) {
      return static_cast<int>(Description::kCables.size());
    } else {
      return 0;
    }
  }();
  template <typename Scalar>
  static constexpr ArmModel<Scalar, kNumJoints> kModel = converted<Scalar>(Description::kModel);

  /// Its drives, with everything that an exported header holds.
  template <typename Scalar, typename Drive>
  static Status configure(Drive& drive, Scalar sign_width) noexcept {
    const Status status = drive.configure(kModel<Scalar>.actuation, sign_width);
    return status == Status::kOk ? add_parts<Scalar>(drive) : status;
  }

  /// Couplings, cables, effects and elastic joints alone.
  template <typename Scalar, typename Drive>
  static Status add_parts(Drive& drive) noexcept {
    Status status = Status::kOk;
    const auto add_all = [&](const auto& entries) {
      for (const auto& entry : entries) {
        status = status == Status::kOk ? drive.add(entry) : status;
      }
    };
    if constexpr (kCouplings > 0) {
      static constexpr auto kAll = converted_all<Scalar>(Description::kCouplings);
      add_all(kAll);
    }
    if constexpr (kCables > 0) {
      static constexpr auto kAll = converted_all<Scalar>(Description::kCables);
      add_all(kAll);
    }
    if constexpr (kEffects > 0) {
      static constexpr auto kAll = converted_all<Scalar>(Description::kEffects);
      add_all(kAll);
    }
    if constexpr (requires { Description::kElasticities; }) {
      if constexpr (Description::kElasticities.size() > 0) {
        static constexpr auto kAll = converted_all<Scalar>(Description::kElasticities);
        add_all(kAll);
      }
    }
    return status;
  }
};

template <int N, int MaxEffects, int MaxCouplings>
struct ArmSource<RunTimeArm<N, MaxEffects, MaxCouplings>> {
  static constexpr bool kIsStatic = false;
  static constexpr int kNumJoints = N;
  static constexpr int kEffects = MaxEffects;
  static constexpr int kCouplings = MaxCouplings;
  static constexpr int kCables = MaxCouplings;
};

/// DriveTorque with the room that a description needs.
template <typename Description, typename Scalar>
using DriveOf = DriveTorque<Scalar, ArmSource<Description>::kNumJoints, ArmSource<Description>::kEffects,
                            ArmSource<Description>::kCouplings, ArmSource<Description>::kCables>;

/// Torque per unit of each inertial parameter of the last link, n × 10.
template <typename Scalar, int N>
using LoadColumns = Eigen::Matrix<Scalar, N, kParametersPerLink>;

/// The description with gravity along no axis, so that nothing is folded that a tilted base brings back.
template <typename Description>
struct TiltedDescription {
  static constexpr auto kModel = [] {
    auto model = Description::kModel;
    model.gravity = {1.0, 0.0, 0.0};
    if (first_axis_is_vertical(model)) {
      model.gravity = {0.0, 1.0, 0.0};
    }
    return model;
  }();
};

/// Carries the probes of all joints outward along with the inverse dynamics and writes the columns of the last link.
template <typename Arm, typename... Probes>
struct LoadColumnsVisitor {
  using Scalar = typename Arm::Scalar;
  LoadColumns<Scalar, Arm::kNumJoints>& columns;
  std::tuple<Probes...> probes;

  template <int J, typename Frame, typename U, typename WD, typename A>
  constexpr auto step(const Frame& frame, const U& u, const WD& wd, const A& a) const {
    auto next = std::apply(
        [&](const auto&... inboard) {
          return std::make_tuple(structural::carried(frame, inboard)..., structural::own_probe(frame));
        },
        probes);
    if constexpr (J + 1 == Arm::kNumJoints) {
      std::apply(
          [&](const auto&... all) {
            int row = 0;
            (structural::write_inertial_row<Scalar>(all, u, wd, a, columns, row++, 0), ...);
          },
          next);
    }
    return make(next);
  }

 private:
  template <typename... Next>
  constexpr LoadColumnsVisitor<Arm, Next...> make(const std::tuple<Next...>& next) const {
    return {columns, next};
  }
};

/// Compile-time geometry.
template <typename Description, typename Scalar>
class RigidArm {
 public:
  static constexpr int kN = ArmSource<Description>::kNumJoints;
  using Vector = JointVector<Scalar, kN>;

  /// The arm without payload, as described. Geometry and links are the description's; the rest may be asked for.
  static constexpr const ArmModel<Scalar, kN>& model() noexcept {
    return ArmSource<Description>::template kModel<Scalar>;
  }

  RigidArm() noexcept { set_payload({}); }

  /// @param payload  about the last link frame, finite
  /// Cost: a multiplication for each entry of the reduction (see reduce()) that is not zero, some 20 a joint.
  void set_payload(const InertialParameters<Scalar>& payload) noexcept {
    const PseudoInertia<Scalar> body = to_pseudo_inertia(payload);
    parameters_.links = kBare;
    for (const Share& share : kShares) {
      parameters_.links[share.link][share.entry] += share.factor * body[share.from];
    }
  }

  /// @param gravity  in the base frame [m/s²]
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept { gravity_ = gravity; }

  void torque(const Vector& q, const Vector& qd, const Vector& qdd, Vector& tau) const noexcept {
    run(q, qd, qdd, tau, structural::NoVisitor{});
  }

  /// The torque without acceleration.
  void bias(const Vector& q, const Vector& qd, Vector& tau) const noexcept {
    run(q, qd, structural::ZeroVector{}, tau, structural::NoVisitor{});
  }

  /// The torque at rest.
  void gravity(const Vector& q, Vector& tau) const noexcept {
    run(q, structural::ZeroVector{}, structural::ZeroVector{}, tau, structural::NoVisitor{});
  }

  /// bias(), and the torque at qdd with another body on the last link, see loaded_torque.
  void bias_and_loaded(const Vector& q, const Vector& qd, const Vector& qdd,
                       const InertialParameters<Scalar>& body, Vector& bias, Vector& loaded) const noexcept {
    loaded_torque<Arm>(parameters_, joint_trigonometry<Arm>(q), base_acceleration(), q, qd, qdd, body, bias,
                       loaded);
  }

  void torque_and_columns(const Vector& q, const Vector& qd, const Vector& qdd, Vector& tau,
                          LoadColumns<Scalar, kN>& columns) const noexcept {
    run(q, qd, qdd, tau, LoadColumnsVisitor<Arm>{columns, {}});
  }

 private:
  using Tilted = TiltedDescription<Description>;
  using Arm = StaticArm<Scalar, Tilted>;
  /// What an entry of the last link's pseudo-inertia adds to an entry of a reduced one.
  struct Share {
    std::uint8_t link, entry, from;
    Scalar factor;
  };
  using Links = std::array<PseudoInertia<double>, static_cast<std::size_t>(kN)>;
  /// Reduction is linear: that of unit bodies is its matrix.
  static constexpr std::array<Links, 10> kReductions = [] {
    std::array<Links, 10> all{};
    for (std::size_t from = 0; from < all.size(); ++from) {
      all[from][kN - 1][from] = 1.0;
      reduce(Tilted::kModel, all[from]);
    }
    return all;
  }();
  /// Below this a factor is the rounding of a rotation.
  static constexpr bool counts(double factor) { return factor > 1e-13 || factor < -1e-13; }
  static constexpr std::size_t kNumShares = [] {
    std::size_t count = 0;
    for (const Links& links : kReductions) {
      for (const PseudoInertia<double>& link : links) {
        for (const double factor : link) {
          count += counts(factor) ? 1 : 0;
        }
      }
    }
    return count;
  }();
  static constexpr std::array<Share, kNumShares> kShares = [] {
    std::array<Share, kNumShares> shares{};
    std::size_t at = 0;
    for (std::size_t from = 0; from < kReductions.size(); ++from) {
      for (std::size_t link = 0; link < static_cast<std::size_t>(kN); ++link) {
        for (std::size_t entry = 0; entry < 10; ++entry) {
          const double factor = kReductions[from][link][entry];
          if (counts(factor)) {
            shares[at++] = {static_cast<std::uint8_t>(link), static_cast<std::uint8_t>(entry),
                            static_cast<std::uint8_t>(from), static_cast<Scalar>(factor)};
          }
        }
      }
    }
    return shares;
  }();
  static constexpr std::array<PseudoInertia<Scalar>, kN> kBare = [] {
    constexpr auto kReduced = reduced_links(Tilted::kModel);
    std::array<PseudoInertia<Scalar>, kN> out{};
    for (std::size_t j = 0; j < kReduced.size(); ++j) {
      out[j] = converted<Scalar>(kReduced[j]);
    }
    return out;
  }();

  template <typename Velocity, typename Acceleration, typename Visitor>
  void run(const Vector& q, const Velocity& qd, const Acceleration& qdd, Vector& tau,
           const Visitor& visitor) const noexcept {
    using namespace structural;
    static_newton_euler<0, Arm>(parameters_, joint_trigonometry<Arm>(q), Zero3{}, Zero3{}, base_acceleration(), q,
                                qd, qdd, tau, visitor);
  }

  structural::Dense3<Scalar> base_acceleration() const noexcept {
    return {-gravity_[0], -gravity_[1], -gravity_[2]};
  }

  ReducedParameters<Scalar, Tilted> parameters_{};
  std::array<Scalar, 3> gravity_ = model().gravity;
};

/// Run-time geometry.
template <int N, int MaxEffects, int MaxCouplings, typename Scalar>
class RigidArm<RunTimeArm<N, MaxEffects, MaxCouplings>, Scalar> {
 public:
  using Vector = JointVector<Scalar, N>;
  using Arm = DynamicArm<Scalar, N>;

  void set_model(const ArmModel<Scalar, N>& model) noexcept {
    model_ = model;
    arm_.set_model(model);
  }
  const ArmModel<Scalar, N>& model() const noexcept { return model_; }

  void set_payload(const InertialParameters<Scalar>& payload) noexcept {
    InertialParameters<Scalar> last = model_.links[N - 1];
    for (std::size_t i = 0; i < last.size(); ++i) {
      last[i] += payload[i];
    }
    arm_.set_link(N - 1, last);
  }

  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept { arm_.set_gravity(gravity); }

  void torque(const Vector& q, const Vector& qd, const Vector& qdd, Vector& tau) const noexcept {
    inverse_dynamics(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, tau);
  }

  void bias(const Vector& q, const Vector& qd, Vector& tau) const noexcept {
    bias_torque(arm_, joint_trigonometry<Arm>(q), q, qd, tau);
  }

  void gravity(const Vector& q, Vector& tau) const noexcept {
    gravity_torque(arm_, joint_trigonometry<Arm>(q), q, tau);
  }

  void bias_and_loaded(const Vector& q, const Vector& qd, const Vector& qdd,
                       const InertialParameters<Scalar>& body, Vector& bias, Vector& loaded) const noexcept {
    loaded_torque(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, body, bias, loaded);
  }

  void torque_and_columns(const Vector& q, const Vector& qd, const Vector& qdd, Vector& tau,
                          LoadColumns<Scalar, N>& columns) const noexcept {
    const JointTrigonometry<Arm> trig = joint_trigonometry<Arm>(q);
    inverse_dynamics(arm_, trig, q, qd, qdd, tau);
    last_link_regressor(arm_, trig, q, qd, qdd, columns);
  }

 private:
  ArmModel<Scalar, N> model_{};
  Arm arm_;
};

}  // namespace detail
}  // namespace heft
