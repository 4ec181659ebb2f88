/// @file
/// Whether innovations still are noise, or another load.
#pragma once

#include <cstdint>

namespace heft::detail {

/// Means of innovations over updates.
template <typename Scalar>
class ChangeWatch {
 public:
  /// Starts again with a new load.
  void restart() noexcept {
    updates_ = 0;
    surprise_ = Scalar(1);
    unexplained_ = whole_ = Scalar(0);
  }

  /// One update.
  /// @param ratio        mean of squared innovations over their variances, each at most kLargestRatio
  /// @param unexplained  sum of squared innovations over the residual's variance
  /// @param whole        the same of the residual as it is without load
  /// @return true: another load
  bool look(const Scalar& ratio, const Scalar& unexplained, const Scalar& whole) noexcept {
    surprise_ += static_cast<Scalar>(0.2) * (ratio - surprise_);
    unexplained_ += static_cast<Scalar>(0.02) * (unexplained - unexplained_);
    whole_ += static_cast<Scalar>(0.02) * (whole - whole_);
    updates_ = updates_ < 1'000'000 ? updates_ + 1 : updates_;
    uncalm_ = surprise_ < static_cast<Scalar>(kSmall) ? 0 : uncalm_ <= kPatience ? uncalm_ + 1 : uncalm_;
    const bool sudden = surprise_ > static_cast<Scalar>(kSurprise);
    return (sudden || uncalm_ == kLasting) && updates_ > kBetweenChanges;
  }

  /// Innovations are noise. Others are another load rather than noise, unless they last.
  bool calm() const noexcept { return surprise_ < static_cast<Scalar>(kCalm) || uncalm_ > kPatience; }
  /// The load takes away more than half of the residual.
  bool explained() const noexcept { return !(unexplained_ > static_cast<Scalar>(0.5) * whole_); }
  /// Since the start.
  std::int32_t updates() const noexcept { return updates_; }

  /// Innovations of one row count as up to this many variances, so that one row alone does not decide.
  static constexpr double kLargestRatio = 200;

 private:
  /// Mean squared innovation, over some ten updates and all rows, that another load gives and noise does not [variances].
  static constexpr double kSurprise = 12;
  static constexpr double kCalm = 4;     ///< and below this it is noise
  static constexpr double kSmall = 3;    ///< above this for long it is a small change of load
  static constexpr int kLasting = 100;   ///< in a row [updates]
  static constexpr int kPatience = 500;  ///< updates after which it is noise nevertheless
  /// Loads do not come and go several times a second: what does is something that no load explains [updates].
  static constexpr int kBetweenChanges = 100;

  Scalar surprise_{1}, unexplained_{0}, whole_{0};
  std::int32_t updates_{0}, uncalm_{0};
};

}  // namespace heft::detail
