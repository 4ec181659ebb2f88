#include "bias_test.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "instrument_comparison.hpp"

namespace heft::identify {

BiasTest test_bias(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit, double length, double edge_factor) {
  const Comparison c = compare(sums, weights, start, condition_limit, length, true);
  BiasTest test;
  const auto B = static_cast<int>(c.without.cols());
  const auto k = static_cast<int>(c.u.size());
  const Eigen::VectorXd d = c.u - c.frame.u_plain;
  // W T is orthonormal, so ‖d‖ is the weighted torque that the two predict differently.
  test.torque_difference = c.frame.residual > 0.0 ? d.norm() / std::sqrt(c.frame.residual) : 0.0;
  constexpr int kLeastGroups = 10;
  constexpr int kGroupsPerDirection = 5;
  if (k == 0 || B < kLeastGroups) {
    test.verdict = fmt::format(
        "no verdict on bias: {} independent stretches of log, at least {} are needed; record longer", B,
        kLeastGroups);
    return test;
  }

  // Noise in the rows, W = W₀ + E: WᵀW − ZᵀW ≈ EᵀE, here I − K. It moves least squares by −EᵀE β. The
  // directions where that is most are tested.
  const Eigensystem noise = eigensystem_of(Eigen::MatrixXd::Identity(k, k) - 0.5 * (c.K + c.K.transpose()));
  const Eigen::VectorXd whole = c.frame.from * start + c.u;
  const Eigen::VectorXd expected = noise.values.cwiseProduct(noise.vectors.transpose() * whole).cwiseAbs();
  std::vector<Eigen::Index> order(static_cast<std::size_t>(k));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return expected[a] > expected[b]; });
  order.resize(static_cast<std::size_t>(std::max(1, std::min(k, B / kGroupsPerDirection))));
  const Eigen::MatrixXd P = noise.vectors(Eigen::all, order);
  const Eigen::VectorXd part = P.transpose() * d;
  const Eigen::MatrixXd V =
      statistics::jackknife_covariance(P.transpose() * (c.without - c.plain_without), edge_factor);

  // Rank-revealing once more: a direction in which the two estimates do not differ at all (an offset is its
  // own instrument) has no variance either.
  const Eigen::VectorXd scale =
      V.diagonal().cwiseSqrt().cwiseMax(1e-12 * std::sqrt(c.frame.residual) + 1e-300);
  const Eigensystem eigen =
      eigensystem_of(scale.cwiseInverse().asDiagonal() * V * scale.cwiseInverse().asDiagonal());
  const Eigen::VectorXd along = eigen.vectors.transpose() * part.cwiseQuotient(scale);
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (eigen.values[i] < 1e-8) continue;
    test.statistic += along[i] * along[i] / eigen.values[i];
    ++test.degrees_of_freedom;
  }
  if (test.degrees_of_freedom > 0) {
    const double dof = test.degrees_of_freedom;
    test.p_value = statistics::fisher_tail(test.statistic * (B - dof) / (dof * (B - 1)), dof, B - dof);
  }
  test.biased = test.p_value < 0.01 && test.torque_difference > 0.1;
  // How far apart the two would be by chance alone.
  const double chance =
      std::sqrt(statistics::jackknife_covariance(c.without - c.plain_without, edge_factor).trace() /
                std::max(c.frame.residual, 1e-300));
  const std::string figures = fmt::format("p = {:.2g}, torque differs by {:.1f} % of the residual",
                                          test.p_value, 100.0 * test.torque_difference);
  if (test.biased) {
    test.verdict = fmt::format(
        "plain least squares is biased by noise in the measured motion: use --method iv ({})", figures);
  } else if (test.p_value < 0.01) {
    test.verdict = fmt::format(
        "no significant bias: the parameters differ with instruments, but the predicted torque barely does "
        "({})",
        figures);
  } else if (chance > 0.5) {
    test.verdict = fmt::format(
        "no verdict on bias: the instruments are too weak, chance alone moves the torque by {:.0f} % of "
        "the residual ({})",
        100.0 * chance, figures);
  } else {
    test.verdict = fmt::format("no bias found ({})", figures);
  }
  return test;
}

}  // namespace heft::identify
