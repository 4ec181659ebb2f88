/// @file
/// A function of many quantities of which nothing is known, fitted as a sum of small regression trees.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace heft::diagnose {

/// Quantities in steps, each of which holds about as many rows as another.
class BinnedFeatures {
 public:
  /// @param features  m × k
  explicit BinnedFeatures(const Eigen::MatrixXd& features);

  Eigen::Index rows() const { return steps_.rows(); }
  Eigen::Index count() const { return steps_.cols(); }
  /// Step of each row, m.
  auto column(Eigen::Index feature) const { return steps_.col(feature); }

  static constexpr int kSteps = 64;

 private:
  Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic> steps_;
};

struct BoostingOptions {
  int trees{120};
  int stages{12};    ///< after how many equal parts of the trees the sum is looked at
  double rate{0.1};  ///< part of each tree that is added
  int most_features{
      8};  ///< the quantities that helped most in the first stage; only they are asked for after it
  double features{0.8};     ///< share of them that a tree may ask for
  double rows{0.5};         ///< share of the rows that a tree is fitted to
  double least_rows{0.01};  ///< of the fitted rows, in a leaf at least
  unsigned seed{1};
};

/// Fits a sum of trees of three questions each by gradient boosting on the squared error (Friedman, Stochastic gradient
/// boosting, 2002) and evaluates it where it was not fitted.
///
/// Cost: O(trees · (rows fitted · quantities + rows left out)), bounded; no randomness but that of the seed.
///
/// @param target    m; of the rows left out it is not looked at
/// @param fitted    rows to fit to
/// @param left_out  rows to evaluate
/// @return rows left out × stages + 1: the function after 0, trees / stages, 2 trees / stages, ... trees
Eigen::MatrixXd boosted(const BinnedFeatures& features, const Eigen::VectorXd& target,
                        const std::vector<Eigen::Index>& fitted, const std::vector<Eigen::Index>& left_out,
                        const BoostingOptions& options = {});

}  // namespace heft::diagnose
