#include "heft/regression/base_parameters.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::regression {
namespace {

/// Regressors of random states stacked: a triangle with the same column dependences, p × p.
Eigen::MatrixXd random_observations(const RegressionColumns& columns, const BaseOptions& options) {
  const int n = columns.num_joints();
  const int p = columns.count();
  const int samples = options.samples > 0 ? options.samples : 6 * ((p + n - 1) / n);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  TriangularFactor factor(p);
  Eigen::VectorXd q(n), qd(n), qdd(n);
  for (int s = 0; s < samples; ++s) {
    for (int j = 0; j < n; ++j) {
      const bool prismatic =
          columns.robot().joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
      q[j] = unit(random) * (prismatic ? 1.0 : std::numbers::pi);
      qd[j] = unit(random);
      qdd[j] = unit(random);
    }
    factor.add(columns.regressor(q, qd, qdd), Eigen::VectorXd::Zero(n));
  }
  return factor.R();
}

/// Columns in the order in which they are kept: what comes later is grouped with what came before.
std::vector<int> order_of_preference(const RegressionColumns& columns) {
  // Within a link, Iyy, mcz and the mass come last: for a revolute joint they fold into the link before.
  constexpr std::array<int, 10> kRank{9, 5, 6, 8, 0, 1, 7, 2, 3, 4};
  const auto key = [&](int i) {
    const Column& column = columns[i];
    if (column.kind == ColumnKind::kLink) {
      return std::array<int, 3>{0, column.joint, kRank[static_cast<std::size_t>(column.entry)]};
    }
    return std::array<int, 3>{1, static_cast<int>(column.kind), column.joint};
  };
  std::vector<int> order(static_cast<std::size_t>(columns.count()));
  for (int i = 0; i < columns.count(); ++i) order[static_cast<std::size_t>(i)] = i;
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  return order;
}

/// " + 0.375 m3", " - Iyy4"; a first term without its plus.
std::string term(double factor, const std::string& name, bool first) {
  const double size = std::abs(factor);
  std::string text = first ? (factor < 0 ? "-" : "") : (factor < 0 ? " - " : " + ");
  if (std::abs(size - 1.0) > 1e-9) text += fmt::format("{:.6g} ", size);
  return text + name;
}

std::string what(const Column& column) {
  static constexpr std::array<const char*, 10> kWords{
      "mass",        "first moment mcx", "first moment mcy", "first moment mcz", "inertia Ixx",
      "inertia Ixy", "inertia Iyy",      "inertia Ixz",      "inertia Iyz",      "inertia Izz"};
  switch (column.kind) {
    case ColumnKind::kLink:
      return fmt::format("the {} of link {}", kWords[static_cast<std::size_t>(column.entry)],
                         column.joint + 1);
    case ColumnKind::kRotorInertia: return fmt::format("the rotor inertia of joint {}", column.joint + 1);
    case ColumnKind::kCoulomb: return fmt::format("the Coulomb friction of joint {}", column.joint + 1);
    case ColumnKind::kViscous: return fmt::format("the viscous friction of joint {}", column.joint + 1);
    case ColumnKind::kOffset: return fmt::format("the offset of joint {}", column.joint + 1);
    case ColumnKind::kCouplingInertia:
    case ColumnKind::kCouplingCoulomb:
    case ColumnKind::kCouplingViscous: return fmt::format("{} of the gear coupling", column.name);
  }
  return column.name;
}

}  // namespace

std::string BaseParameters::name(const RegressionColumns& columns, int i) const {
  const int others = static_cast<int>((regrouping.row(i).array() != 0.0).count()) - 1;
  return columns[kept[static_cast<std::size_t>(i)]].name + (others > 0 ? "*" : "");
}

BaseParameters find_base_parameters(const RegressionColumns& columns, const BaseOptions& options) {
  const int p = columns.count();
  Eigen::MatrixXd R = random_observations(columns, options);
  // Columns of norm 1; a column that is nothing against the largest moves no torque.
  Eigen::VectorXd norm = R.colwise().norm();
  const double largest = norm.maxCoeff();
  std::vector<int> silent;
  for (int i = 0; i < p; ++i) {
    if (norm[i] <= options.tolerance * largest) {
      silent.push_back(i);
      norm[i] = 1.0;
      R.col(i).setZero();
    }
  }
  R = R * norm.cwiseInverse().asDiagonal();

  // Modified Gram-Schmidt, twice, in the order of preference: what is left of a column after those before it.
  BaseParameters base;
  std::vector<int> kept, dropped;
  Eigen::MatrixXd Q(p, 0);
  double smallest_kept = std::numeric_limits<double>::infinity(), largest_dropped = 0.0;
  for (const int i : order_of_preference(columns)) {
    Eigen::VectorXd left = R.col(i);
    for (int pass = 0; pass < 2; ++pass) left -= Q * (Q.transpose() * left);
    const double size = left.norm();
    if (size > options.tolerance) {
      Q.conservativeResize(p, Q.cols() + 1);
      Q.col(Q.cols() - 1) = left / size;
      kept.push_back(i);
      smallest_kept = std::min(smallest_kept, size);
    } else {
      dropped.push_back(i);
      largest_dropped = std::max(largest_dropped, size);
    }
  }
  base.gap =
      largest_dropped > 0.0 ? smallest_kept / largest_dropped : std::numeric_limits<double>::infinity();
  std::sort(kept.begin(), kept.end());
  base.kept = kept;
  const auto b = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXd K(p, b);
  for (Eigen::Index k = 0; k < b; ++k) K.col(k) = R.col(kept[static_cast<std::size_t>(k)]);
  base.regrouping = Eigen::MatrixXd::Zero(b, p);
  for (Eigen::Index k = 0; k < b; ++k) base.regrouping(k, kept[static_cast<std::size_t>(k)]) = 1.0;
  const Eigen::MatrixXd shares = least_squares(K, R(Eigen::all, dropped));
  for (std::size_t at = 0; at < dropped.size(); ++at) {
    const int i = dropped[at];
    // Column i = Σ c_k column k (scaled): x_i adds c_k norm_k⁻¹ norm_i x_i to β_k.
    const Eigen::VectorXd share = shares.col(static_cast<Eigen::Index>(at));
    for (Eigen::Index k = 0; k < b; ++k) {
      const double factor = share[k] * norm[i] / norm[kept[static_cast<std::size_t>(k)]];
      // Rounding leaves dust; a share that moves the torque less than that is none.
      if (std::abs(share[k]) < 1e-8) continue;
      const double whole = std::round(factor);
      base.regrouping(k, i) = std::abs(factor - whole) < 1e-10 ? whole : factor;
    }
  }

  for (Eigen::Index k = 0; k < b; ++k) {
    std::string text = columns[kept[static_cast<std::size_t>(k)]].name;
    for (const int i : dropped) {
      if (base.regrouping(k, i) != 0.0) text += term(base.regrouping(k, i), columns[i].name, false);
    }
    base.expressions.push_back(text);
  }

  for (const int i : silent) base.null_space.push_back(fmt::format("{} moves no torque", what(columns[i])));
  std::sort(dropped.begin(), dropped.end());
  for (const int i : dropped) {
    if (std::find(silent.begin(), silent.end(), i) != silent.end()) continue;
    std::string partners;
    for (Eigen::Index k = 0; k < b; ++k) {
      if (base.regrouping(k, i) == 0.0) continue;
      partners += (partners.empty() ? "" : ", ") + columns[kept[static_cast<std::size_t>(k)]].name;
    }
    base.null_space.push_back(fmt::format("{} is felt only together with {}", what(columns[i]), partners));
  }
  return base;
}

}  // namespace heft::regression
