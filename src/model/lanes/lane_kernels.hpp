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

/// With a compiler that inlines by the size of a whole file, calls of an addition would be left.
#if defined(__GNUC__) && !defined(HEFT_LEAVE_CALLS)
#define HEFT_ALL_INLINE [[gnu::flatten]]
#else
#define HEFT_ALL_INLINE
#endif

namespace heft::model {
namespace {

/// Writes the lanes of an entry of the regressor to its place.
template <int N, int W>
class EntryPlaces {
 public:
  struct IsZeroBelow {};
  struct ExchangesColumns {};
  static constexpr int kColumns = kParametersPerLink * N;
  struct Place {
    double* to;
    std::uint64_t sign;  ///< the bit of a sign that changes, or none
  };
  struct Entry {
    const Place& place;
    std::ptrdiff_t state;
    void operator=(const Pack<double, W>& value) const noexcept {
      value.with_bits_changed(place.sign).store(place.to + state);
    }
  };

  /// @param places  of the user's columns, n × 10n row by row
  EntryPlaces(const DynamicArm<Pack<double, W>, N>& arm, double* const* places) noexcept {
    for (int row = 0; row < N; ++row) {
      for (int link = row; link < N; ++link) {
        const ColumnExchange& exchange = arm.exchange(link);
        for (int inner = 0; inner < kParametersPerLink; ++inner) {
          const int user = exchange.exact ? exchange.column[static_cast<std::size_t>(inner)] : inner;
          const bool minus = exchange.exact && exchange.minus[static_cast<std::size_t>(inner)];
          const int first = kColumns * row + kParametersPerLink * link;
          places_[first + inner] = {places[first + user], std::uint64_t{minus} << 63};
        }
      }
    }
  }
  EntryPlaces(const EntryPlaces&) = delete;
  EntryPlaces& operator=(const EntryPlaces&) = delete;

  void set_state(std::ptrdiff_t state) noexcept { state_ = state; }
  Entry operator()(int row, int column) const noexcept { return {places_[kColumns * row + column], state_}; }

 private:
  Place places_[N * kColumns];
  std::ptrdiff_t state_{0};
};

template <int N, int W>
class SizedLaneArm final : public LaneArm {
 public:
  using P = Pack<double, W>;
  using Arm = DynamicArm<P, N>;
  using Vector = JointVector<P, N>;

  explicit SizedLaneArm(const DynamicArm<double, N>& arm) noexcept : arm_(arm) {}

  std::ptrdiff_t width() const noexcept override { return W; }

  HEFT_ALL_INLINE
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

  HEFT_ALL_INLINE
  void regressor(const LaneStates& states, double* const* places) const noexcept override {
    EntryPlaces<N, W> entries(arm_, places);
    for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      const Vector qd = load(states.qd + at, states.qd_step);
      const Vector qdd = load(states.qdd + at, states.qdd_step);
      entries.set_state(at);
      link_regressor(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, entries);
      return true;
    });
  }

  HEFT_ALL_INLINE
  void mass_matrix(const LaneStates& states, double* mass, std::ptrdiff_t step) const noexcept override {
    for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      MassMatrix<P, N> M;
      heft::mass_matrix(arm_, joint_trigonometry<Arm>(q), q, M);
      for (int c = 0; c < N * N; ++c) M(c % N, c / N).store(mass + at + c * step);
      return true;
    });
  }

  HEFT_ALL_INLINE
  std::ptrdiff_t forward_dynamics(const LaneStates& states, const double* drives, double* qdd,
                                  std::ptrdiff_t step) const noexcept override {
    return for_each_pack(states.count, [&](std::ptrdiff_t at) {
      const Vector q = load(states.q + at, states.q_step);
      const Vector qd = load(states.qd + at, states.qd_step);
      const Vector tau = load(states.qdd + at, states.qdd_step);
      const JointTrigonometry<Arm> trigonometry = joint_trigonometry<Arm>(q);
      MassMatrix<P, N> M;
      Vector none, bias, acceleration;
      heft::mass_matrix(arm_, trigonometry, q, M);
      for (int c = 0; c < N * N; ++c) M(c % N, c / N) += P(drives[c]);
      for (int j = 0; j < N; ++j) none[j] = P(0.0);
      bias_torque(arm_, trigonometry, q, qd, bias);
      if (heft::forward_dynamics<P, N>(M, bias, none, tau, acceleration) != Status::kOk) return false;
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
