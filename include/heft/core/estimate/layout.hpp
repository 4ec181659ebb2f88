/// @file
/// Which parameters a row touches, so that the recursions skip known zeros.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

namespace heft {

/// Layout of an estimation problem whose rows touch every parameter.
///
/// A layout says, at compile time: kRows scalar rows a sample, kParameters unknowns, the first kFriction of
/// which come in pairs; row r touches the pair at friction(r) (none when kFriction is 0) and all parameters
/// from inertial(r) on. TerminalLayout is the one of the terminal-link problem.
template <int Parameters, int Rows = 1>
struct DenseLayout {
  static constexpr int kRows = Rows;
  static constexpr int kParameters = Parameters;
  static constexpr int kFriction = 0;
  static constexpr int friction(int) { return 0; }
  static constexpr int inertial(int) { return 0; }
};

/// Row that owns a friction column, in a layout with friction.
template <typename Layout>
constexpr int row_of_friction(int column) noexcept {
  for (int r = 0; r < Layout::kRows; ++r) {
    if (Layout::friction(r) == column || Layout::friction(r) + 1 == column) {
      return r;
    }
  }
  return 0;
}

/// True where an entry (i, j) of the equations is zero whatever the data, before and after elimination in this order:
/// friction pairs of different rows never meet, nor does friction of a row the inertia of links before its own.
template <typename Layout>
constexpr bool never_meet(int i, int j) noexcept {
  if constexpr (Layout::kFriction > 0) {
    const int a = i < j ? i : j;
    const int b = i < j ? j : i;
    if (a < Layout::kFriction) {
      const int r = row_of_friction<Layout>(a);
      return b < Layout::kFriction ? row_of_friction<Layout>(b) != r : b < Layout::inertial(r);
    }
  }
  return i < 0 && j < 0;
}

/// never_meet() of all entries as a table, for loops at run time.
template <typename Layout>
inline constexpr auto kNeverMeet = [] {
  constexpr std::size_t kSize = static_cast<std::size_t>(Layout::kParameters);
  std::array<std::array<bool, kSize>, kSize> table{};
  for (std::size_t i = 0; i < kSize; ++i) {
    for (std::size_t j = 0; j < kSize; ++j) {
      table[i][j] = never_meet<Layout>(static_cast<int>(i), static_cast<int>(j));
    }
  }
  return table;
}();

/// A row number as a type, so that loops over what the row touches are of known length.
template <int R>
using RowNumber = std::integral_constant<int, R>;

/// Calls f(RowNumber<r>{}) for every row, in ascending order.
template <typename Layout, typename F>
constexpr void for_rows(F f) {
  [&]<int... R>(std::integer_sequence<int, R...>) { (f(RowNumber<R>{}), ...); }
  (std::make_integer_sequence<int, Layout::kRows>{});
}

/// Calls f(RowNumber<r>{}) for one row.
template <typename Layout, typename F>
constexpr void with_row(int r, F f) {
  for_rows<Layout>([&](auto row) {
    if (row() == r) {
      f(row);
    }
  });
}

/// Calls f(index) for every parameter that row r touches, in ascending order.
template <typename Layout, typename F>
constexpr void for_support(int r, F f) {
  if constexpr (Layout::kFriction > 0) {
    f(Layout::friction(r));
    f(Layout::friction(r) + 1);
  }
  for (int i = Layout::inertial(r); i < Layout::kParameters; ++i) {
    f(i);
  }
}

/// The same with a row that the compiler knows. Written out where it is short: on a processor without vectors the counting of a loop
/// costs as much as what it does.
template <typename Layout, int R, typename F>
constexpr void for_support(RowNumber<R>, F f) {
  if constexpr (Layout::kFriction > 0) {
    f(std::size_t{Layout::friction(R)});
    f(std::size_t{Layout::friction(R) + 1});
  }
#pragma GCC unroll 16
  for (std::size_t i = Layout::inertial(R); i < std::size_t{Layout::kParameters}; ++i) {
    f(i);
  }
}

}  // namespace heft
