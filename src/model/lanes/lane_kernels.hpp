/// @file
/// Core's dynamics over packs of states. Included once for each instruction set, see lane_arm.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/pack.hpp"
#include "heft/model/dynamics.hpp"
#include "lane_arm.hpp"

namespace heft::model {
namespace {

/// Writes the lanes of an entry to its place.
template <typename P>
class EntryPlaces {
 public:
  struct IsZeroBelow {};
  /// Entries that nobody wants go to one place that stays: a store costs less than asking.
  struct Place {
    double* to;
    std::uintptr_t moves;  ///< all bits, or none
  };
  struct Entry {
    double* to;
    void operator=(const P& value) const noexcept { value.store(to); }
  };

  EntryPlaces(const Place* places, int columns, std::ptrdiff_t state) noexcept
      : places_(places), columns_(columns), state_(static_cast<std::uintptr_t>(state)) {}
  Entry operator()(int row, int column) const noexcept {
    const Place& place = places_[row * columns_ + column];
    return {place.to + (state_ & place.moves)};
  }

 private:
  const Place* places_;
  int columns_;
  std::uintptr_t state_;
};

template <int N, int W>
class SizedLaneArm final : public LaneArm {
 public:
  using P = Pack<double, W>;
  using Arm = DynamicArm<P, N>;
  using Vector = JointVector<P, N>;

  explicit SizedLaneArm(const DynamicArm<double, N>& arm) noexcept : arm_(arm) {}

  std::ptrdiff_t width() const noexcept override { return W; }

  void inverse_dynamics(const LaneStates& states, double* tau, std::ptrdiff_t step) const noexcept override {
    for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      const Vector qd = load(states.qd + at, states.qd_step);
      const Vector qdd = load(states.qdd + at, states.qdd_step);
      Vector torque;
      heft::inverse_dynamics(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, torque);
      store(torque, tau + at, step);
      return true;
    });
  }

  void regressor(const LaneStates& states, double* const* places) const noexcept override {
    using Place = typename EntryPlaces<P>::Place;
    constexpr int kColumns = kParametersPerLink * N;
    alignas(P) double unwanted[W];
    Place table[N * kColumns];
    for (int k = 0; k < N * kColumns; ++k) {
      table[k] = places[k] == nullptr ? Place{unwanted, 0} : Place{places[k], ~std::uintptr_t{0}};
    }
    for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      const Vector qd = load(states.qd + at, states.qd_step);
      const Vector qdd = load(states.qdd + at, states.qdd_step);
      EntryPlaces<P> entries(table, kColumns, at);
      link_regressor(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, entries);
      return true;
    });
  }

  void mass_matrix(const LaneStates& states, double* mass, std::ptrdiff_t step) const noexcept override {
    for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      MassMatrix<P, N> M;
      heft::mass_matrix(arm_, joint_trigonometry<Arm>(q), q, M);
      for (int c = 0; c < N * N; ++c) M(c % N, c / N).store(mass + at + c * step);
      return true;
    });
  }

  std::ptrdiff_t forward_dynamics(const LaneStates& states, const double* rotor, double* qdd,
                                  std::ptrdiff_t step) const noexcept override {
    Vector inertia;
    for (int j = 0; j < N; ++j) inertia[j] = P(rotor[j]);
    return for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      const Vector qd = load(states.qd + at, states.qd_step);
      const Vector tau = load(states.qdd + at, states.qdd_step);
      const JointTrigonometry<Arm> trigonometry = joint_trigonometry<Arm>(q);
      MassMatrix<P, N> M;
      Vector bias, acceleration;
      heft::mass_matrix(arm_, trigonometry, q, M);
      bias_torque(arm_, trigonometry, q, qd, bias);
      if (heft::forward_dynamics<P, N>(M, bias, inertia, tau, acceleration) != Status::kOk) return false;
      store(acceleration, qdd + at, step);
      return true;
    });
  }

 private:
  /// Calls f with the first state of each pack. The last pack ends where the states do: some states are computed twice,
  /// to the same result.
  /// @return count, or the first state of the pack where f said false
  template <typename F>
  static std::ptrdiff_t for_each_pack(std::ptrdiff_t count, F&& f) noexcept {
    for (std::ptrdiff_t at = 0; at < count; at += W) {
      const std::ptrdiff_t first = at + W <= count ? at : count - W;
      if (!f(first)) return first;
    }
    return count;
  }

  static Vector load(const double* from, std::ptrdiff_t step) noexcept {
    Vector v;
    for (int j = 0; j < N; ++j) v[j] = P::load(from + j * step);
    return v;
  }
  static void store(const Vector& v, double* to, std::ptrdiff_t step) noexcept {
    for (int j = 0; j < N; ++j) v[j].store(to + j * step);
  }

  Arm arm_;
};

/// MakeLaneArm for packs of W.
template <int W, int N = 1>
LaneArm* make_lane_arm(int joints, const void* arm) {
  if (joints == N) return new SizedLaneArm<N, W>(*static_cast<const DynamicArm<double, N>*>(arm));
  if constexpr (N < kMaxJoints) {
    return make_lane_arm<W, N + 1>(joints, arm);
  } else {
    return nullptr;
  }
}

}  // namespace
}  // namespace heft::model
