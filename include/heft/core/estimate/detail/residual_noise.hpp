/// @file
/// Size and correlation of a residual, learnt from innovations.
#pragma once

#include <cmath>

namespace heft::detail {

/// The residual of one joint: slowly, from innovations limited to three standard deviations.
template <typename Scalar>
class ResidualNoise {
 public:
  /// @param guess  standard deviation, > 0
  void start(const Scalar& guess) noexcept {
    *this = ResidualNoise{};
    variance_ = guess * guess;
    least_ = static_cast<Scalar>(0.25) * variance_;
  }

  void learn(const Scalar& innovation, const Scalar& innovation_variance) noexcept {
    using std::sqrt;
    const Scalar most = Scalar(3) * sqrt(innovation_variance);
    const Scalar cut = innovation > most ? most : innovation < -most ? -most : innovation;
    const Scalar mean = Scalar(1) / (Scalar(1) + learnt_);
    const Scalar share = mean > static_cast<Scalar>(0.01) ? mean : static_cast<Scalar>(0.01);
    // Beyond 1000 nothing depends on the number any more.
    learnt_ += learnt_ < Scalar(1000) ? Scalar(1) : Scalar(0);
    power_ += share * (cut * cut - power_);
    product_ += share * (cut * last_ - product_);
    last_ = cut;
    if (learnt_ > Scalar(30)) {
      variance_ = power_ > least_ ? power_ : least_;
    }
  }

  const Scalar& variance() const noexcept { return variance_; }
  /// More than a guess.
  bool known() const noexcept { return learnt_ > Scalar(100); }

  /// Factor on variances against those of white residuals: (1 + ρ) / (1 − ρ) of a first-order process, ρ from 0 to 0.95.
  Scalar widening() const noexcept {
    const Scalar rho = power_ > Scalar(0) ? product_ / power_ : Scalar(0);
    const Scalar most = static_cast<Scalar>(0.95);
    const Scalar limited = rho > most ? most : rho > Scalar(0) ? rho : Scalar(0);
    return (Scalar(1) + limited) / (Scalar(1) - limited);
  }

 private:
  Scalar variance_{1}, least_{0}, power_{0}, product_{0}, last_{0}, learnt_{0};
};

}  // namespace heft::detail
