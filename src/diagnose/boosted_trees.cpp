#include "boosted_trees.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDepth = 3, kLeaves = 1 << kDepth;

/// Asks at each level of each branch whether a quantity is above a step; a branch that is not divided asks nothing.
struct Tree {
  struct Question {
    Index feature{-1};
    int step{0};       ///< up to it: left
    double gain{0.0};  ///< fall of the squared error
  };
  std::array<Question, kLeaves - 1> questions{};
  std::array<double, kLeaves> values{};

  int next(int node, const BinnedFeatures& features, Index row) const {
    const Question& q = questions[static_cast<std::size_t>(node)];
    const bool right = q.feature >= 0 && features.column(q.feature)[row] > q.step;
    return 2 * node + (right ? 2 : 1);
  }
  double operator()(const BinnedFeatures& features, Index row) const {
    int node = 0;
    for (int level = 0; level < kDepth; ++level) node = next(node, features, row);
    return values[static_cast<std::size_t>(node - (kLeaves - 1))];
  }
};

struct Cell {
  double sum{0.0}, count{0.0};
};

/// Sums of the target by node and step, of one quantity.
class Histogram {
 public:
  void fill(const BinnedFeatures& features, Index feature, const VectorXd& target,
            const std::vector<Index>& rows, const std::vector<int>& place, int first_node) {
    cells_.fill({});
    const auto column = features.column(feature);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      Cell& cell = at(place[k] - first_node, column[rows[k]]);
      cell.sum += target[rows[k]];
      cell.count += 1.0;
    }
  }
  Cell& at(int node, int step) {
    return cells_[static_cast<std::size_t>(node * BinnedFeatures::kSteps + step)];
  }

 private:
  std::array<Cell, static_cast<std::size_t>(kLeaves / 2 * BinnedFeatures::kSteps)> cells_{};
};

/// The division that lowers the squared error most, of all nodes of one level.
void divide(const BinnedFeatures& features, const std::vector<Index>& asked, const VectorXd& target,
            const std::vector<Index>& rows, const std::vector<int>& place, int level, double least,
            Tree& tree) {
  const int first = (1 << level) - 1, nodes = 1 << level;
  Histogram histogram;
  for (const Index feature : asked) {
    histogram.fill(features, feature, target, rows, place, first);
    for (int node = 0; node < nodes; ++node) {
      Cell all, left;
      for (int s = 0; s < BinnedFeatures::kSteps; ++s) {
        all.sum += histogram.at(node, s).sum;
        all.count += histogram.at(node, s).count;
      }
      for (int s = 0; s + 1 < BinnedFeatures::kSteps; ++s) {
        left.sum += histogram.at(node, s).sum;
        left.count += histogram.at(node, s).count;
        const Cell right{all.sum - left.sum, all.count - left.count};
        if (left.count < least || right.count < least) continue;
        const double gain = left.sum * left.sum / left.count + right.sum * right.sum / right.count -
                            all.sum * all.sum / all.count;
        Tree::Question& question = tree.questions[static_cast<std::size_t>(first + node)];
        if (gain > question.gain) question = {feature, s, gain};
      }
    }
  }
}

Tree fitted_tree(const BinnedFeatures& features, const std::vector<Index>& asked, const VectorXd& target,
                 const std::vector<Index>& rows, double least) {
  Tree tree;
  std::vector<int> place(rows.size(), 0);
  for (int level = 0; level < kDepth; ++level) {
    divide(features, asked, target, rows, place, level, least, tree);
    for (std::size_t k = 0; k < rows.size(); ++k) place[k] = tree.next(place[k], features, rows[k]);
  }
  std::array<Cell, kLeaves> leaves{};
  for (std::size_t k = 0; k < rows.size(); ++k) {
    Cell& leaf = leaves[static_cast<std::size_t>(place[k] - (kLeaves - 1))];
    leaf.sum += target[rows[k]];
    leaf.count += 1.0;
  }
  for (std::size_t l = 0; l < leaves.size(); ++l)
    tree.values[l] = leaves[l].count > 0.0 ? leaves[l].sum / leaves[l].count : 0.0;
  return tree;
}

/// Some of a list, in its order.
std::vector<Index> some_of(const std::vector<Index>& all, double share, std::mt19937& random) {
  std::vector<Index> some;
  const auto wanted = static_cast<std::size_t>(std::ceil(share * static_cast<double>(all.size())));
  some.reserve(wanted);
  std::sample(all.begin(), all.end(), std::back_inserter(some), wanted, random);
  return some;
}

/// The quantities whose questions lowered the error most.
std::vector<Index> best_of(const VectorXd& gains, int count) {
  std::vector<Index> order(static_cast<std::size_t>(gains.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return gains[a] > gains[b]; });
  order.resize(std::min(order.size(), static_cast<std::size_t>(count)));
  return order;
}

}  // namespace

BinnedFeatures::BinnedFeatures(const MatrixXd& features) : steps_(features.rows(), features.cols()) {
  std::vector<double> sorted(static_cast<std::size_t>(features.rows()));
  for (Index f = 0; f < features.cols(); ++f) {
    std::copy(features.col(f).begin(), features.col(f).end(), sorted.begin());
    std::sort(sorted.begin(), sorted.end());
    std::vector<double> bounds;
    for (int s = 1; s < kSteps; ++s) {
      const double bound = sorted[sorted.size() * static_cast<std::size_t>(s) / kSteps];
      if (bounds.empty() || bound > bounds.back()) bounds.push_back(bound);
    }
    for (Index i = 0; i < features.rows(); ++i) {
      steps_(i, f) = static_cast<std::uint8_t>(
          std::upper_bound(bounds.begin(), bounds.end(), features(i, f)) - bounds.begin());
    }
  }
}

MatrixXd boosted(const BinnedFeatures& features, const VectorXd& target, const std::vector<Index>& fitted,
                 const std::vector<Index>& left_out, const BoostingOptions& options) {
  MatrixXd stages = MatrixXd::Zero(static_cast<Index>(left_out.size()), options.stages + 1);
  if (fitted.empty() || features.count() == 0) return stages;
  std::mt19937 random(options.seed);
  std::vector<Index> asked(static_cast<std::size_t>(features.count()));
  std::iota(asked.begin(), asked.end(), Index{0});
  const double least = std::max(10.0, options.least_rows * options.rows * static_cast<double>(fitted.size()));
  VectorXd left = target, gains = VectorXd::Zero(features.count());
  for (int stage = 0; stage < options.stages; ++stage) {
    stages.col(stage + 1) = stages.col(stage);
    for (int t = 0; t < options.trees / options.stages; ++t) {
      const Tree tree = fitted_tree(features, stage == 0 ? asked : some_of(asked, options.features, random),
                                    left, some_of(fitted, options.rows, random), least);
      for (const Tree::Question& q : tree.questions) {
        if (q.feature >= 0) gains[q.feature] += q.gain;
      }
      for (const Index row : fitted) left[row] -= options.rate * tree(features, row);
      for (std::size_t k = 0; k < left_out.size(); ++k)
        stages(static_cast<Index>(k), stage + 1) += options.rate * tree(features, left_out[k]);
    }
    if (stage == 0) asked = best_of(gains, options.most_features);
  }
  return stages;
}

}  // namespace heft::diagnose
