#include "signal_lanes.hpp"

#include <cstddef>
#include <cstring>
#include <utility>

#include "low_pass_sections.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

constexpr int kStates = StretchFilter::kStates, kSums = SignalLanes::kSums;

using Vector2 = double __attribute__((vector_size(16)));

template <typename Vector>
constexpr Index kLanesOf = sizeof(Vector) / sizeof(double);

template <typename Vector>
[[gnu::always_inline]] inline Vector load(const double* from) {
  Vector value;
  std::memcpy(&value, from, sizeof(Vector));
  return value;
}
template <typename Vector>
[[gnu::always_inline]] inline void store(const Vector& value, double* to) {
  std::memcpy(to, &value, sizeof(Vector));
}

/// Calls f<Vector>(signal) for as many signals as fill vectors, then f<Vector2> for those left.
template <typename Vector, typename F>
[[gnu::always_inline]] inline void for_each_lanes(Index signals, const F& f) {
  constexpr Index kLanes = kLanesOf<Vector>;
  Index signal = 0;
  for (; signal + kLanes <= signals; signal += kLanes) f.template operator()<Vector>(signal);
  for (; signal < signals; signal += 2) f.template operator()<Vector2>(signal);
}

template <typename Vector>
[[gnu::always_inline]] inline Vector product(const double* row, const Vector* states) {
  return ((row[0] * states[0] + row[1] * states[1]) + row[2] * states[2]) + row[3] * states[3];
}

/// Two vectors exchange parts of kHalf lanes: the second of one with the first of the other, and so on.
template <typename Vector, std::size_t kHalf, std::size_t... kLane>
[[gnu::always_inline]] inline void exchange(Vector& first, Vector& second, std::index_sequence<kLane...>) {
  constexpr std::size_t kLanes = sizeof...(kLane);
  const Vector a = first, b = second;
  first = __builtin_shufflevector(a, b, ((kLane & kHalf) != 0 ? kLanes + kLane - kHalf : kLane)...);
  second = __builtin_shufflevector(a, b, ((kLane & kHalf) != 0 ? kLanes + kLane : kLane + kHalf)...);
}

/// A square of numbers with rows for columns: halves of the vectors change places, then quarters, ...
template <typename Vector, std::size_t kHalf = kLanesOf<Vector> / 2>
[[gnu::always_inline]] inline void transpose(Vector* rows) {
  constexpr std::size_t kLanes = kLanesOf<Vector>;
#pragma GCC unroll 8
  for (std::size_t row = 0; row < kLanes; ++row) {
    if ((row & kHalf) == 0) exchange<Vector, kHalf>(rows[row], rows[row + kHalf], std::make_index_sequence<kLanes>());
  }
  if constexpr (kHalf > 1) transpose<Vector, kHalf / 2>(rows);
}

/// Two integrators of as many signals.
template <typename Vector>
struct States {
  Vector s1, s2;
};

/// kCount vectors of signals.
template <typename Vector, int kCount>
[[gnu::always_inline]] inline void filter_vectors(const LowPass& low_pass, double* first, Index rows, Index step,
                                                  bool backward, double* states, Index state_step) {
  constexpr Index kLanes = kLanesOf<Vector>;
  const LowPassSection a = low_pass.first(), b = low_pass.second();
  const auto row_of = [&](int vector, Index row) __attribute__((always_inline)) {
    Vector values;
    for (Index lane = 0; lane < kLanes; ++lane) values[lane] = first[(vector * kLanes + lane) * step + row];
    return values;
  };
  const auto state = [&](int vector, int s) __attribute__((always_inline)) { return states + s * state_step + vector * kLanes; };
  States<Vector> before[kCount], behind[kCount];
  for (int v = 0; v < kCount; ++v) {
    if (states != nullptr) {
      before[v] = {load<Vector>(state(v, 0)), load<Vector>(state(v, 1))};
      behind[v] = {load<Vector>(state(v, 2)), load<Vector>(state(v, 3))};
    } else {
      before[v] = behind[v] = {Vector{}, row_of(v, backward ? rows - 1 : 0)};
    }
  }
  const auto output = [&](int v, const Vector& input) __attribute__((always_inline)) {
    return b.step(behind[v].s1, behind[v].s2, a.step(before[v].s1, before[v].s2, input));
  };
  // As many rows at a time as there are signals in a vector; rows that are left one by one, last.
  const Index left = rows % kLanes;
  for (Index done = 0; done + kLanes <= rows; done += kLanes) {
    const Index row = backward ? rows - kLanes - done : done;
    Vector square[kCount][kLanes];
    for (int v = 0; v < kCount; ++v) {
#pragma GCC unroll 8
      for (Index lane = 0; lane < kLanes; ++lane) square[v][lane] = load<Vector>(first + (v * kLanes + lane) * step + row);
      transpose(square[v]);
    }
#pragma GCC unroll 8
    for (Index k = 0; k < kLanes; ++k) {
      for (int v = 0; v < kCount; ++v) {
        Vector& values = square[v][backward ? kLanes - 1 - k : k];
        values = output(v, values);
      }
    }
    for (int v = 0; v < kCount; ++v) {
      transpose(square[v]);
#pragma GCC unroll 8
      for (Index lane = 0; lane < kLanes; ++lane) store(square[v][lane], first + (v * kLanes + lane) * step + row);
    }
  }
  for (Index k = 0; k < left; ++k) {
    const Index row = backward ? left - 1 - k : rows - left + k;
    for (int v = 0; v < kCount; ++v) {
      const Vector values = output(v, row_of(v, row));
      for (Index lane = 0; lane < kLanes; ++lane) first[(v * kLanes + lane) * step + row] = values[lane];
    }
  }
  if (states == nullptr) return;
  for (int v = 0; v < kCount; ++v) {
    store(before[v].s1, state(v, 0)), store(before[v].s2, state(v, 1));
    store(behind[v].s1, state(v, 2)), store(behind[v].s2, state(v, 3));
  }
}

/// Vectors of signals that the registers hold.
template <typename Vector>
constexpr int kVectorsAtOnce = kLanesOf<Vector> == 2 ? 3 : 8 / kLanesOf<Vector>;

// The functions of SignalLanes, for vectors of any width.

struct Filter {
  template <typename Vector, int kMost = kVectorsAtOnce<Vector>>
  [[gnu::always_inline]] static void run(const LowPass& low_pass, double* first, Index rows, Index step, Index signals,
                                         bool backward, double* states, Index state_step) {
    if (signals >= kMost * kLanesOf<Vector>) {
      if (backward) {
        filter_vectors<Vector, kMost>(low_pass, first, rows, step, true, states, state_step);
      } else {
        filter_vectors<Vector, kMost>(low_pass, first, rows, step, false, states, state_step);
      }
    } else if constexpr (kMost > 1) {
      run<Vector, kMost - 1>(low_pass, first, rows, step, signals, backward, states, state_step);
    }
  }
};

struct SideBySide {
  template <typename Widest>
  [[gnu::always_inline]] static void run(const double* const* columns, double* to, Index signals, Index rows) {
    for_each_lanes<Widest>(signals, [&]<typename Vector>(Index signal) __attribute__((always_inline)) {
      constexpr Index kLanes = kLanesOf<Vector>;
      const double* const* const from = columns + signal;
      Index row = 0;
      for (; row + kLanes <= rows; row += kLanes) {
        Vector square[kLanes];
#pragma GCC unroll 8
        for (Index lane = 0; lane < kLanes; ++lane) square[lane] = load<Vector>(from[lane] + row);
        transpose(square);
#pragma GCC unroll 8
        for (Index k = 0; k < kLanes; ++k) store(square[k], to + (row + k) * signals + signal);
      }
      for (; row < rows; ++row) {
        for (Index lane = 0; lane < kLanes; ++lane) to[row * signals + signal + lane] = from[lane][row];
      }
    });
  }
};

struct AddRows {
  template <typename Widest>
  [[gnu::always_inline]] static void run(double* sums, const double* rows, const double* factors, Index signals, Index count) {
    for_each_lanes<Widest>(signals, [&]<typename Vector>(Index signal) __attribute__((always_inline)) {
      Vector sum[kSums];
      for (int s = 0; s < kSums; ++s) sum[s] = load<Vector>(sums + s * signals + signal);
      const double* row = rows + signal;
      const double* factor = factors;
      for (Index k = 0; k < count; ++k, row += signals, factor += kSums) {
        const Vector value = load<Vector>(row);
#pragma GCC unroll 9
        for (int s = 0; s < kSums; ++s) sum[s] += factor[s] * value;
      }
      for (int s = 0; s < kSums; ++s) store(sum[s], sums + s * signals + signal);
    });
  }
};

struct EndStretch {
  template <typename Widest>
  [[gnu::always_inline]] static void run(const StretchFilter& filter, double* sums, double* forward, double* output, double* behind, Index signals) {
    for_each_lanes<Widest>(signals, [&]<typename Vector>(Index signal) __attribute__((always_inline)) {
      Vector before[kStates];
      for (int s = 0; s < kStates; ++s) before[s] = load<Vector>(forward + s * signals + signal);
      const auto sum = [&](int s) __attribute__((always_inline)) { return load<Vector>(sums + s * signals + signal); };
      store<Vector>(sum(2 * kStates) + product(filter.e, before), output + signal);
      for (int s = 0; s < kStates; ++s) {
        store<Vector>(sum(kStates + s) + product(filter.H + s * kStates, before), behind + s * signals + signal);
        store<Vector>(product(filter.A + s * kStates, before) + sum(s), forward + s * signals + signal);
      }
      for (int s = 0; s < kSums; ++s) store(Vector{}, sums + s * signals + signal);
    });
  }
};

struct StepBack {
  template <typename Widest>
  [[gnu::always_inline]] static void run(const StretchFilter& filter, double* output, const double* behind, double* backward, Index signals) {
    for_each_lanes<Widest>(signals, [&]<typename Vector>(Index signal) __attribute__((always_inline)) {
      Vector states[kStates];
      for (int s = 0; s < kStates; ++s) states[s] = load<Vector>(backward + s * signals + signal);
      store<Vector>(product(filter.C, states) + filter.D * load<Vector>(output + signal), output + signal);
      if (behind == nullptr) return;
      for (int s = 0; s < kStates; ++s) {
        store<Vector>(product(filter.A + s * kStates, states) + load<Vector>(behind + s * signals + signal),
                      backward + s * signals + signal);
      }
    });
  }
};

// One of them for an instruction set.

template <typename Function, typename... Arguments>
void in_twos(Arguments... arguments) {
  Function::template run<Vector2>(arguments...);
}
#ifdef __x86_64__
using Vector4 = double __attribute__((vector_size(32)));
using Vector8 = double __attribute__((vector_size(64)));

template <typename Function, typename... Arguments>
[[gnu::target("avx2")]] void in_fours(Arguments... arguments) {
  Function::template run<Vector4>(arguments...);
}
template <typename Function, typename... Arguments>
[[gnu::target("avx512f")]] void in_eights(Arguments... arguments) {
  Function::template run<Vector8>(arguments...);
}
#endif

template <typename Vector>
constexpr Index kMostSignals = kVectorsAtOnce<Vector> * kLanesOf<Vector>;

constexpr SignalLanes kTwos{kLanesOf<Vector2>, kMostSignals<Vector2>, in_twos<Filter>, in_twos<SideBySide>,
                            in_twos<AddRows>, in_twos<EndStretch>, in_twos<StepBack>};
#ifdef __x86_64__
constexpr SignalLanes kFours{kLanesOf<Vector4>, kMostSignals<Vector4>, in_fours<Filter>, in_fours<SideBySide>,
                             in_fours<AddRows>, in_fours<EndStretch>, in_fours<StepBack>};
constexpr SignalLanes kEights{kLanesOf<Vector8>, kMostSignals<Vector8>, in_eights<Filter>, in_eights<SideBySide>,
                              in_eights<AddRows>, in_eights<EndStretch>, in_eights<StepBack>};
#endif

}  // namespace

std::vector<const SignalLanes*> available_signal_lanes() {
  std::vector<const SignalLanes*> lanes{&kTwos};
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) lanes.push_back(&kFours);
  if (__builtin_cpu_supports("avx512f")) lanes.push_back(&kEights);
#endif
  return lanes;
}

const SignalLanes& signal_lanes() {
  static const SignalLanes& widest = *available_signal_lanes().back();
  return widest;
}

}  // namespace heft::data
