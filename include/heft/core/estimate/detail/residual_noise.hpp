/// @file
/// Size and correlation of a residual, learnt from what an estimate leaves unexplained.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft::detail {

/// How much more the residuals of all joints add up than their weights say: correlation in time, and weights that were
/// learnt from little. A sum over a block shows every correlation shorter than the block, the filter's own included; the
/// correlation of neighbours alone would take every residual for a process of first order (2.6 times too much behind
/// three equal poles).
///
/// This one factor follows the noise; the weights hardly do, because data that were weighted highly while their noise was
/// believed small count for ever.
template <typename Scalar>
class ResidualScale {
 public:
  /// @param white  factor by which the filter correlates white noise: neighbours worth one independent residual, ≥ 1
  void start(const Scalar& white) noexcept {
    *this = ResidualScale{};
    white_ = of_blocks_ = white;
  }

  /// The sum of a block.
  /// @param n            residuals in it
  /// @param weight       variance of one by its weight, correlation left out
  /// @param information  variance of what the parameters predict, whose errors are alike in the whole block
  void learn(const Scalar& sum, const Scalar& n, const Scalar& weight, const Scalar& information) noexcept {
    const Scalar noise = n * of_blocks_ * weight;
    const Scalar all = noise + n * n * information;
    const Scalar most = static_cast<Scalar>(kLargest) * all;
    const Scalar squared = sum * sum < most ? sum * sum : most;
    const Scalar worth = noise / all;
    learnt_ += learnt_ < static_cast<Scalar>(kMost) ? worth : Scalar(0);
    const Scalar blocks = learnt_ + static_cast<Scalar>(kBefore);
    of_blocks_ += worth / blocks * (squared / all - Scalar(1)) * of_blocks_;
    length_ += worth / blocks * (n - length_);
    // A sum over n lacks what is correlated across its ends: of w, w² / 2n where the correlation decays exponentially.
    using std::sqrt;
    const Scalar left = Scalar(1) - Scalar(2) * of_blocks_ / length_;
    const Scalar least = static_cast<Scalar>(0.04);
    const Scalar whole = length_ * (Scalar(1) - sqrt(left > least ? left : least));
    // Of few blocks: the variance of Student's distribution; of half as many, since joints do not show equally much.
    value_ = (whole > of_blocks_ ? whole : of_blocks_) / white_ * (Scalar(1) + Scalar(4) / blocks);
  }

  /// Factor on the recursion's variances.
  const Scalar& value() const noexcept { return value_; }
  /// Neighbours that a weight in the recursion counts as one.
  const Scalar& white() const noexcept { return white_; }

 private:
  static constexpr double kBefore = 4;    ///< blocks that the filter's own correlation counts as
  static constexpr double kMost = 200;    ///< blocks that are remembered, those of all joints together
  static constexpr double kLargest = 16;  ///< squared sum of a block, in variances: four standard deviations
  Scalar value_{1}, white_{1}, of_blocks_{1}, length_{50}, learnt_{0};
};

/// The residual of one joint.
template <typename Scalar>
class ResidualNoise {
 public:
  /// @param guess  standard deviation, > 0
  /// @param known  a model's own residual: a short calm stretch does not make it smaller
  void start(const Scalar& guess, bool known) noexcept {
    *this = ResidualNoise{};
    variance_ = weight_ = guess_ = guess * guess;
    least_ = known ? guess_ : static_cast<Scalar>(kLeast) * guess_;
  }

  /// One more residual, slowly and limited to three standard deviations.
  /// @param innovation   what the parameters did not predict
  /// @param information  variance of what they predicted
  /// @param error        what they did not predict as they were before the block: an estimate follows what is correlated
  ///                     in time, and what it has followed is missing from its innovations
  void learn(const Scalar& innovation, const Scalar& information, const Scalar& error) noexcept {
    using std::sqrt;
    const Scalar all = variance_ + information;
    const Scalar most = Scalar(3) * sqrt(all);
    const Scalar cut = innovation > most ? most : innovation < -most ? -most : innovation;
    const Scalar mean = Scalar(1) / (Scalar(1) + learnt_);
    const Scalar share = mean > static_cast<Scalar>(kShare) ? mean : static_cast<Scalar>(kShare);
    // Beyond 1000 nothing depends on the number any more.
    learnt_ += learnt_ < Scalar(1000) ? Scalar(1) : Scalar(0);
    power_ += share * (cut * cut * variance_ / all - power_);
    if (learnt_ > Scalar(30)) {
      variance_ = limited(power_);
    }
    information_ = in_block_ > Scalar(0) ? information_ : information;
    sum_ += error;
    in_block_ += Scalar(1);
  }

  /// The block is over.
  void end_block(ResidualScale<Scalar>& scale) noexcept {
    if (in_block_ >= static_cast<Scalar>(kShortest)) {
      scale.learn(sum_, in_block_, weight_, information_);
    }
    forget_block();
  }
  void forget_block() noexcept { sum_ = information_ = in_block_ = Scalar(0); }

  /// Learnt variance over the guess, and how many residuals say so.
  Scalar over_guess() const noexcept { return power_ / guess_; }
  const Scalar& learnt() const noexcept { return learnt_; }

  /// Takes up what has been learnt as the weight; as long as that is little, all joints together rather than this one.
  /// @param usual  over_guess() of all joints
  void weigh(const Scalar& usual) noexcept {
    const Scalar guess = usual * guess_;
    const Scalar mean = guess + learnt_ / (learnt_ + static_cast<Scalar>(kOthers)) * (power_ - guess);
    weight_ = limited(mean);
  }

  /// Of one residual.
  const Scalar& variance() const noexcept { return variance_; }
  /// The same that it has in the recursion.
  const Scalar& weight() const noexcept { return weight_; }
  /// More than a guess.
  bool known() const noexcept { return learnt_ > Scalar(100); }

 private:
  Scalar limited(const Scalar& variance) const noexcept {
    const Scalar most = static_cast<Scalar>(kMost) * guess_;
    return variance > most ? most : variance > least_ ? variance : least_;
  }

  static constexpr int kShortest = 12;    ///< errors in a block that says something
  static constexpr double kLeast = 0.25;  ///< of the guess: a model is never much better than that
  /// Of the guess, too: what is larger is another load, a contact or a fault, not noise that would hide them for ever.
  static constexpr double kMost = 25;
  static constexpr double kOthers = 15;  ///< residuals that the other joints count as
  static constexpr double kShare =
      0.002;  ///< of the newest residual, at least: some movements are remembered

  Scalar guess_{1}, variance_{1}, least_{0}, weight_{1}, power_{0}, learnt_{0};
  Scalar sum_{0}, information_{0}, in_block_{0};  ///< of the block under way
};

/// The residuals of all joints: what a row counts for, and what an interval has to hold.
///
/// @tparam P  parameters of the recursion
template <typename Scalar, int N, int P>
class ResidualNoises {
 public:
  using Row = std::array<Scalar, P>;

  /// @param guess        standard deviations, > 0
  /// @param known        they are more than that
  /// @param update_rate  [Hz]
  /// @param omega        of the three poles that a residual comes through [1/s]
  /// @param silent       as of restart()
  void start(const JointVector<Scalar, N>& guess, bool known, const Scalar& update_rate, const Scalar& omega,
             std::int32_t silent) noexcept {
    *this = ResidualNoises{};
    learning_ = known ? kLearning : 0;
    for (int i = 0; i < N; ++i) {
      joints_[static_cast<std::size_t>(i)].start(guess[i], known);
    }
    scale_.start(white(update_rate, omega));
    friction_stays_ = updates(kFrictionStays, update_rate, 1.0);
    const Scalar block = updates(kBlock, update_rate, 20.0);
    block_ = block < Scalar(1e6) ? static_cast<std::int32_t>(block) : 1'000'000;
    block_left_ = silent;
  }

  /// Whether what a residual counts for remains within kLargestWeight and its inverse, whatever is learnt.
  /// @param guess  as of start(), of one joint
  /// @param level  of its friction
  static bool in_range(const Scalar& guess, const Scalar& level, const Scalar& update_rate,
                       const Scalar& omega) noexcept {
    const Scalar least = static_cast<Scalar>(0.25) * guess * guess;
    const Scalar most =
        white(update_rate, omega) * guess * guess + updates(kFrictionStays, update_rate, 1.0) * level * level;
    return is_usable_weight(least) && is_usable_weight(Scalar(100) * most);
  }

  /// Variance of one residual of a joint.
  /// @param doubt  variance of its friction's level
  Scalar scatter(int joint, const Scalar& doubt) const noexcept { return at(joint).variance() + doubt; }
  /// What it counts for in the recursion: times factor(), that of an independent one.
  Scalar weight(int joint, const Scalar& doubt) const noexcept {
    return scale_.white() * at(joint).weight() + doubt * friction_stays_ / scale_.value();
  }
  /// Friction is known well enough for a residual to show the noise.
  bool certain(int joint, const Scalar& doubt) const noexcept {
    return doubt < static_cast<Scalar>(0.1) * at(joint).variance();
  }
  bool known(int joint) const noexcept { return at(joint).known(); }
  /// Of the recursion's variances, so that they hold residuals that are correlated in time.
  const Scalar& factor() const noexcept { return scale_.value(); }
  /// Residuals have shown what the noise is; before, weights are guesses.
  bool learnt() const noexcept { return learning_ >= kLearning; }

  /// One more residual, of a joint whose friction is certain.
  /// @param information  variance of what the parameters predict
  void learn(int joint, const Row& row, const Scalar& residual, const Scalar& innovation,
             const Scalar& information) noexcept {
    Scalar error = residual;
    for (std::size_t p = 0; p < row.size(); ++p) {
      error -= row[p] * before_block_[p];
    }
    joints_[static_cast<std::size_t>(joint)].learn(innovation, information, error);
    learns_ = true;
  }

  /// All rows of an update are in.
  /// @return true once: learnt() from now on, and data weighted by guesses are to be forgotten
  bool end_update(const Row& estimate) noexcept {
    if (--block_left_ <= 0) {
      for (ResidualNoise<Scalar>& joint : joints_) {
        joint.end_block(scale_);
      }
      weigh();
      block_left_ = block_;
      before_block_ = estimate;
    }
    const bool before = learnt();
    learning_ += learns_ && !before ? 1 : 0;
    learns_ = false;
    return learnt() && !before;
  }

  /// The estimate starts again.
  /// @param silent  updates until residuals show noise rather than the load
  void restart(std::int32_t silent) noexcept {
    for (ResidualNoise<Scalar>& joint : joints_) {
      joint.forget_block();
    }
    weigh();
    block_left_ = silent;
  }

 private:
  const ResidualNoise<Scalar>& at(int joint) const noexcept {
    return joints_[static_cast<std::size_t>(joint)];
  }

  static Scalar updates(double time, const Scalar& update_rate, double least) noexcept {
    const Scalar count = static_cast<Scalar>(time) * update_rate;
    return count > static_cast<Scalar>(least) ? count : static_cast<Scalar>(least);
  }
  /// Correlation of white noise behind three equal poles, summed over all lags: 6.4 time constants.
  static Scalar white(const Scalar& update_rate, const Scalar& omega) noexcept {
    const Scalar neighbours = static_cast<Scalar>(6.4) * update_rate / omega;
    return neighbours > Scalar(1) ? neighbours : Scalar(1);
  }

  void weigh() noexcept {
    Scalar learnt(1), over_guess(1);
    for (const ResidualNoise<Scalar>& joint : joints_) {
      learnt += joint.learnt();
      over_guess += joint.learnt() * joint.over_guess();
    }
    for (ResidualNoise<Scalar>& joint : joints_) {
      joint.weigh(over_guess / learnt);
    }
  }

  static constexpr int kLearning = 60;   ///< updates that only teach what the noise is, once
  static constexpr double kBlock = 0.5;  ///< longer than filter and friction remember [s]
  /// Friction of a joint at rest, anything between its two levels, counts as another only after so long [s]: who puts
  /// things down stops on the same side each time.
  static constexpr double kFrictionStays = 20;

  std::array<ResidualNoise<Scalar>, static_cast<std::size_t>(N)> joints_{};
  ResidualScale<Scalar> scale_;
  Row before_block_{};  ///< the estimate that the block's errors are of
  Scalar friction_stays_{1};
  std::int32_t block_{50}, block_left_{1}, learning_{0};
  bool learns_{false};  ///< a row of this update taught what the noise is
};

}  // namespace heft::detail
