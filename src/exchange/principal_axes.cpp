#include "principal_axes.hpp"

#include <algorithm>
#include <array>

#include <Eigen/LU>

#include "heft/host/decompositions.hpp"

namespace heft::exchange {

PrincipalAxes principal_axes(const Eigen::Matrix3d& inertia) {
  const Eigensystem system = eigensystem_of(inertia);
  // Each axis goes to the place where it points most, so that a body that is hardly turned has hardly a turn.
  std::array<int, 3> order{0, 1, 2}, best = order;
  double most = -1.0;
  do {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) sum += std::abs(system.vectors(k, order[static_cast<std::size_t>(k)]));
    if (sum > most) most = sum, best = order;
  } while (std::next_permutation(order.begin(), order.end()));
  PrincipalAxes axes;
  for (int k = 0; k < 3; ++k) {
    const int from = best[static_cast<std::size_t>(k)];
    const Eigen::Vector3d axis = system.vectors.col(from);
    axes.moments[k] = system.values[from];
    axes.rotation.col(k) = axis[k] < 0.0 ? Eigen::Vector3d(-axis) : axis;
  }
  if (axes.rotation.determinant() < 0.0) {
    Eigen::Index least = 0;
    axes.rotation.diagonal().cwiseAbs().minCoeff(&least);
    axes.rotation.col(least) *= -1.0;
  }
  return axes;
}

}  // namespace heft::exchange
