#include "boosted_trees.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <span>
#include <utility>

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

  /// Takes all rows one level down, from the nodes of that level.
  /// @param place  node that each row has come to
  void descend(const BinnedFeatures& features, int level, std::vector<std::uint8_t>& place) const {
    for (int node = (1 << level) - 1; node < (2 << level) - 1; ++node) {
      const Question& q = questions[static_cast<std::size_t>(node)];
      const std::uint8_t* const steps = features.column(std::max<Index>(q.feature, 0)).data();
      const auto here = static_cast<std::uint8_t>(node), left = static_cast<std::uint8_t>(2 * node + 1);
      const auto last = static_cast<std::uint8_t>(q.feature >= 0 ? q.step : BinnedFeatures::kSteps);
      for (std::size_t row = 0; row < place.size(); ++row) {
        const auto below = static_cast<std::uint8_t>(left + (steps[row] > last ? 1 : 0));
        place[row] = place[row] == here ? below : place[row];
      }
    }
  }
  /// @param place  after the last level
  double value(std::uint8_t place) const { return values[place - std::size_t{kLeaves - 1}]; }
};

struct Cell {
  using Pair [[gnu::vector_size(2 * sizeof(double))]] = double;
  Pair sum_and_count{0.0, 0.0};
  double sum() const { return sum_and_count[0]; }
  double count() const { return sum_and_count[1]; }
  void add(double target) { sum_and_count += Pair{target, 1.0}; }
};

/// Rows that a tree is fitted to, in the order in which they are read.
struct Sample {
  std::vector<Index> rows;
  std::vector<double> target;
};

/// Sums of the target by quantity, node and step, level by level. Of two nodes that came of one, the rows of the smaller are summed;
/// the other has what is left.
class Histograms {
 public:
  Histograms(const BinnedFeatures& features, std::span<const Index> asked, const Sample& sample)
      : features_(features), asked_(asked), sample_(sample) {}

  /// Goes on to a level, from the one above it.
  /// @param place  node that each row has come to
  void fill(int level, const std::vector<std::uint8_t>& place) {
    const std::size_t nodes = std::size_t{1} << level, first = nodes - 1;
    const std::vector<Cell> above = std::exchange(cells_, std::vector<Cell>(asked_.size() * nodes * kSteps));
    nodes_ = nodes;
    if (level == 0) {
      add(sample_, place, first);
      return;
    }
    const auto node_of = [&](Index row) { return place[static_cast<std::size_t>(row)] - first; };
    std::array<std::size_t, kLeaves / 2> count{};
    for (const Index row : sample_.rows) ++count[node_of(row)];
    std::array<bool, kLeaves / 2> smaller{};
    for (std::size_t node = 0; node < nodes; ++node) {
      const std::size_t sibling = node ^ 1U;
      smaller[node] = count[node] < count[sibling] || (count[node] == count[sibling] && node < sibling);
    }
    Sample few;
    for (std::size_t k = 0; k < sample_.rows.size(); ++k) {
      if (!smaller[node_of(sample_.rows[k])]) continue;
      few.rows.push_back(sample_.rows[k]);
      few.target.push_back(sample_.target[k]);
    }
    add(few, place, first);
    for (std::size_t at = 0; at < asked_.size() * nodes; ++at) {  // quantity and node
      if (smaller[at % nodes]) continue;
      for (std::size_t s = 0; s < kSteps; ++s)
        cells_[at * kSteps + s].sum_and_count =
            above[at / 2 * kSteps + s].sum_and_count - cells_[(at ^ 1U) * kSteps + s].sum_and_count;
    }
  }
  /// Of all steps in sequence.
  const Cell* of(std::size_t quantity, std::size_t node) const { return &cells_[(quantity * nodes_ + node) * kSteps]; }

 private:
  static constexpr auto kSteps = static_cast<std::size_t>(BinnedFeatures::kSteps);
  static constexpr std::size_t kTogether = 4;

  /// A cell waits for the last row that came to it, so that several quantities are summed in the same time as one.
  void add(const Sample& sample, const std::vector<std::uint8_t>& place, std::size_t first_node) {
    for (std::size_t from = 0; from < asked_.size(); from += kTogether) {
      switch (asked_.size() - from) {
        case 1: add_together<1>(from, sample, place, first_node); break;
        case 2: add_together<2>(from, sample, place, first_node); break;
        case 3: add_together<3>(from, sample, place, first_node); break;
        default: add_together<kTogether>(from, sample, place, first_node);
      }
    }
  }
  template <std::size_t kCount>
  void add_together(std::size_t from, const Sample& sample, const std::vector<std::uint8_t>& place, std::size_t first_node) {
    std::array<const std::uint8_t*, kCount> steps{};
    for (std::size_t f = 0; f < kCount; ++f) steps[f] = features_.column(asked_[from + f]).data();
    Cell* const cells = &cells_[from * nodes_ * kSteps];
    for (std::size_t k = 0; k < sample.rows.size(); ++k) {
      const Index row = sample.rows[k];
      Cell* const of_node = cells + (place[static_cast<std::size_t>(row)] - first_node) * kSteps;
      for (std::size_t f = 0; f < kCount; ++f) of_node[f * nodes_ * kSteps + steps[f][row]].add(sample.target[k]);
    }
  }

  const BinnedFeatures& features_;
  std::span<const Index> asked_;
  const Sample& sample_;
  std::vector<Cell> cells_;
  std::size_t nodes_{0};  ///< of the level
};

/// How much a node's division at each step lowers the squared error.
class Divisions {
 public:
  /// @param cells  of all steps
  explicit Divisions(const Cell* cells) {
    Cell left;
    for (std::size_t s = 0; s < kSteps; ++s) {
      left.sum_and_count += cells[s].sum_and_count;
      sum_[s] = left.sum();
      count_[s] = left.count();
    }
    const double all = sum_.back() * sum_.back() / count_.back();
    // Where a side is empty it is no number, which nobody asks for.
    for (std::size_t s = 0; s + 1 < kSteps; ++s) {
      const double right = sum_.back() - sum_[s], right_count = count_.back() - count_[s];
      gain_[s] = sum_[s] * sum_[s] / count_[s] + right * right / right_count - all;
    }
  }

  /// Takes the place of a question that lowers it less.
  /// @param least  rows on each side
  void ask(Index feature, double least, Tree::Question& question) const {
    for (std::size_t s = 0; s + 1 < kSteps; ++s) {
      if (count_[s] < least || count_.back() - count_[s] < least) continue;
      if (gain_[s] > question.gain) question = {feature, static_cast<int>(s), gain_[s]};
    }
  }

 private:
  static constexpr std::size_t kSteps = BinnedFeatures::kSteps;
  std::array<double, kSteps> sum_, count_, gain_;  ///< of the rows up to each step
};

/// @param place  gets the leaf of every row
Tree fitted_tree(const BinnedFeatures& features, const std::vector<Index>& asked, const VectorXd& target,
                 std::vector<Index> rows, double least, std::vector<std::uint8_t>& place) {
  Tree tree;
  Sample sample{std::move(rows), {}};
  sample.target.reserve(sample.rows.size());
  for (const Index row : sample.rows) sample.target.push_back(target[row]);
  place.assign(static_cast<std::size_t>(features.rows()), 0);
  Histograms histograms(features, asked, sample);
  for (int level = 0; level < kDepth; ++level) {
    histograms.fill(level, place);
    const std::size_t nodes = std::size_t{1} << level;
    for (std::size_t f = 0; f < asked.size(); ++f) {
      for (std::size_t node = 0; node < nodes; ++node)
        Divisions(histograms.of(f, node)).ask(asked[f], least, tree.questions[nodes - 1 + node]);
    }
    tree.descend(features, level, place);
  }
  std::array<Cell, kLeaves> leaves{};
  for (std::size_t k = 0; k < sample.rows.size(); ++k) {
    const auto node = place[static_cast<std::size_t>(sample.rows[k])];
    leaves[node - std::size_t{kLeaves - 1}].add(sample.target[k]);
  }
  for (std::size_t l = 0; l < leaves.size(); ++l)
    tree.values[l] = leaves[l].count() > 0.0 ? leaves[l].sum() / leaves[l].count() : 0.0;
  return tree;
}

/// Each of a list with this chance, in its order.
std::vector<Index> thinned(const std::vector<Index>& all, double chance, std::mt19937& random) {
  std::vector<Index> some(all.size());
  const auto below = static_cast<std::uint32_t>(std::lround(256.0 * chance));
  std::size_t count = 0;
  std::uint32_t bits = 0;  // eight for each
  for (std::size_t k = 0; k < all.size(); ++k, bits >>= 8U) {
    if (k % 4 == 0) bits = static_cast<std::uint32_t>(random());
    some[count] = all[k];
    count += (bits & 255U) < below ? 1 : 0;
  }
  some.resize(count);
  return some;
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
  std::vector<std::uint8_t> place;
  for (int stage = 0; stage < options.stages; ++stage) {
    stages.col(stage + 1) = stages.col(stage);
    for (int t = 0; t < options.trees / options.stages; ++t) {
      const Tree tree = fitted_tree(features, stage == 0 ? asked : some_of(asked, options.features, random),
                                    left, thinned(fitted, options.rows, random), least, place);
      for (const Tree::Question& q : tree.questions) {
        if (q.feature >= 0) gains[q.feature] += q.gain;
      }
      const auto value = [&](Index row) { return options.rate * tree.value(place[static_cast<std::size_t>(row)]); };
      for (const Index row : fitted) left[row] -= value(row);
      for (std::size_t k = 0; k < left_out.size(); ++k) stages(static_cast<Index>(k), stage + 1) += value(left_out[k]);
    }
    if (stage == 0) asked = best_of(gains, options.most_features);
  }
  return stages;
}

}  // namespace heft::diagnose
