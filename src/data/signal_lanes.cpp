#include "signal_lanes.hpp"

#include <cstring>

namespace heft::data {
namespace {

using Eigen::Index;

constexpr int kStates = StretchFilter::kStates, kSums = SignalLanes::kSums;

using Vector2 = double __attribute__((vector_size(16)));

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
  constexpr Index kLanes = sizeof(Vector) / sizeof(double);
  Index signal = 0;
  for (; signal + kLanes <= signals; signal += kLanes) f.template operator()<Vector>(signal);
  for (; signal < signals; signal += 2) f.template operator()<Vector2>(signal);
}

template <typename Vector>
[[gnu::always_inline]] inline Vector product(const double* row, const Vector* states) {
  return ((row[0] * states[0] + row[1] * states[1]) + row[2] * states[2]) + row[3] * states[3];
}

/// One second-order section, as LowPassSection::step.
template <typename Vector>
struct Section {
  double a1, a2, a3;
  Vector s1{}, s2;

  [[gnu::always_inline]] Vector step(const Vector& input) {
    const Vector v3 = input - s2;
    const Vector v1 = a1 * s1 + a2 * v3;
    const Vector v2 = s2 + a2 * s1 + a3 * v3;
    s1 = 2.0 * v1 - s1;
    s2 = 2.0 * v2 - s2;
    return v2;
  }
};

template <typename Vector, int kCount>
[[gnu::always_inline]] inline void filter_vectors(const SignalLanes::Sections& a, double* row, Index rows, Index step) {
  constexpr Index kLanes = sizeof(Vector) / sizeof(double);
  Section<Vector> first[kCount], second[kCount];
  for (int v = 0; v < kCount; ++v) {
    const Vector start = load<Vector>(row + v * kLanes);
    first[v] = {a[0], a[1], a[2], Vector{}, start};
    second[v] = {a[3], a[4], a[5], Vector{}, start};
  }
  for (Index k = 0; k < rows; ++k, row += step) {
#pragma GCC unroll 4
    for (int v = 0; v < kCount; ++v)
      store(second[v].step(first[v].step(load<Vector>(row + v * kLanes))), row + v * kLanes);
  }
}

/// @param kMost  vectors at once
template <typename Vector, int kMost>
[[gnu::always_inline]] inline void filter_rows(const SignalLanes::Sections& a, double* row, Index rows, Index step,
                                               Index signals) {
  if (signals >= static_cast<Index>(kMost * sizeof(Vector) / sizeof(double))) {
    filter_vectors<Vector, kMost>(a, row, rows, step);
  } else if constexpr (kMost > 1) {
    filter_rows<Vector, kMost - 1>(a, row, rows, step, signals);
  }
}

template <typename Widest>
[[gnu::always_inline]] inline void add_rows(double* sums, const double* rows, const double* factors, Index signals,
                                            Index count) {
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

template <typename Widest>
[[gnu::always_inline]] inline void end_stretch(const StretchFilter& filter, double* sums, double* forward, double* output,
                                               double* behind, Index signals) {
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

template <typename Widest>
[[gnu::always_inline]] inline void step_back(const StretchFilter& filter, double* output, const double* behind,
                                             double* backward, Index signals) {
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

void filter_twos(const SignalLanes::Sections& a, double* row, Index rows, Index step, Index signals) {
  filter_rows<Vector2, 3>(a, row, rows, step, signals);
}
void add_twos(double* sums, const double* rows, const double* factors, Index signals, Index count) {
  add_rows<Vector2>(sums, rows, factors, signals, count);
}
void end_twos(const StretchFilter& filter, double* sums, double* forward, double* output, double* behind,
           Index signals) {
  end_stretch<Vector2>(filter, sums, forward, output, behind, signals);
}
void back_twos(const StretchFilter& filter, double* output, const double* behind, double* backward, Index signals) {
  step_back<Vector2>(filter, output, behind, backward, signals);
}
constexpr SignalLanes kTwos{2, 6, filter_twos, add_twos, end_twos, back_twos};

#ifdef __x86_64__
using Vector4 = double __attribute__((vector_size(32)));
using Vector8 = double __attribute__((vector_size(64)));

[[gnu::target("avx2")]] void filter_fours(const SignalLanes::Sections& a, double* row, Index rows, Index step, Index signals) {
  filter_rows<Vector4, 2>(a, row, rows, step, signals);
}
[[gnu::target("avx2")]] void add_fours(double* sums, const double* rows, const double* factors, Index signals, Index count) {
  add_rows<Vector4>(sums, rows, factors, signals, count);
}
[[gnu::target("avx2")]] void end_fours(const StretchFilter& filter, double* sums, double* forward, double* output, double* behind,
                                   Index signals) {
  end_stretch<Vector4>(filter, sums, forward, output, behind, signals);
}
[[gnu::target("avx2")]] void back_fours(const StretchFilter& filter, double* output, const double* behind, double* backward, Index signals) {
  step_back<Vector4>(filter, output, behind, backward, signals);
}
constexpr SignalLanes kFours{4, 8, filter_fours, add_fours, end_fours, back_fours};

[[gnu::target("avx512f")]] void filter_eights(const SignalLanes::Sections& a, double* row, Index rows, Index step, Index signals) {
  filter_rows<Vector8, 1>(a, row, rows, step, signals);
}
[[gnu::target("avx512f")]] void add_eights(double* sums, const double* rows, const double* factors, Index signals, Index count) {
  add_rows<Vector8>(sums, rows, factors, signals, count);
}
[[gnu::target("avx512f")]] void end_eights(const StretchFilter& filter, double* sums, double* forward, double* output, double* behind,
                                      Index signals) {
  end_stretch<Vector8>(filter, sums, forward, output, behind, signals);
}
[[gnu::target("avx512f")]] void back_eights(const StretchFilter& filter, double* output, const double* behind, double* backward, Index signals) {
  step_back<Vector8>(filter, output, behind, backward, signals);
}
constexpr SignalLanes kEights{8, 8, filter_eights, add_eights, end_eights, back_eights};

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
