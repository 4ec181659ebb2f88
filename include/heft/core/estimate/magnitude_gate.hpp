/// @file
/// Keeps numbers out that are far larger than those of late: glitches of a sensor or of a differentiation.
#pragma once

#include <cstdint>

namespace heft {

/// Refuses magnitudes above a multiple of the largest of late. It needs no model, so it works from the first samples on
/// and guards what no innovation shows (an instrument). Costs comparisons, and an addition in 512
/// numbers; two multiplications where the largest changes.
///
/// The limit falls by half in 512 numbers while these are less than half as large, and doubles after every ten refusals more than a
/// quarter of the acceptances in between: what lasts is let in, what comes and goes stays out.
template <typename Scalar>
class MagnitudeGate {
 public:
  enum class Verdict : std::uint8_t {
    kAccept,
    kRefuse,
    /// Accepted; and what was accepted before was far too large: sums that hold it should be reset.
    kAcceptAfresh
  };

  void reset() noexcept { *this = MagnitudeGate{}; }

  /// Decides about one magnitude.
  /// @param magnitude  ≥ 0; zero says nothing and is accepted
  /// @param factor     multiple of the largest of late that is accepted, > 1
  Verdict look(const Scalar& magnitude, const Scalar& factor) noexcept {
    // Most numbers are smaller than the largest of late, and the last was not refused.
    if (magnitude <= largest_ && score_ == 0 && count_ + 1 < block_ && magnitude > Scalar(0)) {
      ++count_;
      return Verdict::kAccept;
    }
    return look_closely(magnitude, factor);
  }

 private:
  Verdict look_closely(const Scalar& magnitude, const Scalar& factor) noexcept {
    if (!(magnitude > Scalar(0))) {
      return Verdict::kAccept;
    }
    const bool first_block = !(limit_ > Scalar(0));
    if (!first_block && magnitude > limit_) {
      score_ += kRefusalScore;
      if (score_ >= kLasting) {
        score_ = 0;
        scale_ += scale_;
        limit_ += limit_;
      }
      return Verdict::kRefuse;
    }
    score_ -= score_ > 0 ? 1 : 0;
    if (magnitude > largest_) {
      largest_ = magnitude;
      if (!first_block && magnitude > scale_) {
        set_scale(magnitude, factor);
      }
    }
    return ++count_ < block_ ? Verdict::kAccept : end_block(first_block, factor);
  }

  void set_scale(const Scalar& scale, const Scalar& factor) noexcept {
    scale_ = scale;
    limit_ = factor * scale;
  }

  // Blocks of 16, 16, 32, 64, ... 512 numbers, so that a start with wild numbers is seen soon.
  Verdict end_block(bool first_block, const Scalar& factor) noexcept {
    const bool was_wild = !first_block && block_ < kLongestBlock && scale_ > factor * largest_;
    if (first_block || was_wild) {
      set_scale(largest_, factor);
    } else if (largest_ + largest_ < scale_) {
      set_scale(static_cast<Scalar>(0.5) * scale_, factor);
    }
    largest_ = Scalar(0);
    count_ = 0;
    block_ = first_block || block_ == kLongestBlock ? block_ : 2 * block_;
    return was_wild ? Verdict::kAcceptAfresh : Verdict::kAccept;
  }

  static constexpr std::int32_t kRefusalScore = 4, kLasting = 40, kFirstBlock = 16, kLongestBlock = 512;

  Scalar scale_{0};    ///< largest of late
  Scalar limit_{0};    ///< 0 during the first block
  Scalar largest_{0};  ///< accepted in this block
  std::int32_t count_{0}, block_{kFirstBlock}, score_{0};
};

}  // namespace heft
