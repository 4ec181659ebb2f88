#include "encoder_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "encoder_terms.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::stiffness {

namespace {

/// Weighted mean of independent estimates with few degrees of freedom each, and Welch's test that they estimate
/// the same: B. L. Welch, On the comparison of several mean values, Biometrika 38 (1951).
struct Mean {
  double value{0.0}, variance{0.0}, chi_square{0.0}, p_value{1.0};
};
Mean weighted_mean(const std::vector<double>& x, const std::vector<double>& variance,
                   const std::vector<double>& dof) {
  Mean mean;
  double weights = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    weights += 1.0 / variance[i];
    mean.value += x[i] / variance[i];
  }
  mean.value /= weights;
  mean.variance = 1.0 / weights;
  const auto k = static_cast<double>(x.size());
  double spread = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean.chi_square += (x[i] - mean.value) * (x[i] - mean.value) / variance[i];
    const double share = 1.0 - 1.0 / (variance[i] * weights);
    spread += share * share / dof[i];
  }
  // F = [χ²/(k − 1)] / [1 + 2 (k − 2)/(k² − 1) s], ν = (k² − 1)/(3 s), s = Σ (1 − w_i/w)²/ν_i
  if (x.size() > 1) {
    const double f = mean.chi_square / (k - 1) / (1.0 + 2.0 * (k - 2) / (k * k - 1) * spread);
    mean.p_value = statistics::fisher_tail(f, k - 1, (k * k - 1) / (3.0 * spread));
  }
  return mean;
}

}  // namespace

StiffnessAgreement compare(const std::vector<std::vector<JointStiffness>>& separate, std::size_t j) {
  StiffnessAgreement a;
  a.joint = separate.front()[j].joint;
  std::vector<double> x, variance, dof;
  for (const std::vector<JointStiffness>& fits : separate) {
    const JointStiffness& s = fits[j];
    if (!std::isfinite(s.compliance.std) || !(s.compliance.std > 0)) continue;
    x.push_back(s.compliance.value);
    variance.push_back(s.compliance.std * s.compliance.std);
    dof.push_back(std::max(1, s.blocks - 1));
  }
  if (x.size() < 2) {
    a.text = "fewer than two logs determine the stiffness of this joint";
    return a;
  }
  const Mean mean = weighted_mean(x, variance, dof);
  a.chi_square = mean.chi_square;
  a.degrees_of_freedom = static_cast<int>(x.size()) - 1;
  a.p_value = mean.p_value;
  a.agrees = a.p_value >= kLevel;
  a.text = fmt::format("{} logs {}: chi-square {:.2f} at {} degrees of freedom, p = {:.2g}", x.size(),
                       a.agrees ? "agree" : "do not agree", a.chi_square, a.degrees_of_freedom, a.p_value);
  return a;
}

CommonTimeShift common_shift(const std::vector<JointStiffness>& fits) {
  CommonTimeShift c;
  std::vector<double> x, variance, dof;
  for (const JointStiffness& s : fits) {
    if (!s.time_shift_known || !(s.time_shift.std > 0)) continue;
    x.push_back(s.time_shift.value);
    variance.push_back(s.time_shift.std * s.time_shift.std);
    dof.push_back(std::max(1, s.blocks - 1));
  }
  if (x.size() < 2) return c;
  const Mean mean = weighted_mean(x, variance, dof);
  c.known = true;
  c.value =
      uncertain(mean.value, mean.variance,
                statistics::interval_factor(static_cast<int>(std::accumulate(dof.begin(), dof.end(), 0.0))));
  c.p_value = mean.p_value;
  c.agrees = c.p_value >= kLevel;
  return c;
}

}  // namespace heft::stiffness
