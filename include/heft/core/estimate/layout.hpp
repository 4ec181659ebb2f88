/// @file
/// Which parameters a row touches: what lets the recursions skip known zeros.
#pragma once

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

}  // namespace heft
