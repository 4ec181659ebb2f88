// D-optimal choice of poses to measure at, by exchange.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/stiffness/dexterity.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Twelve digits below the largest a column, or an eigenvalue, is rounding.
constexpr double kRounding = 1e-12;

/// Indices of the candidates that may be chosen.
std::vector<std::size_t> usable_candidates(const std::vector<PoseCandidate>& candidates, int count,
                                           double least_dexterity) {
  std::vector<std::size_t> usable;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    if (candidates[k].dexterity >= least_dexterity) usable.push_back(k);
  }
  if (count < 1 || usable.size() < static_cast<std::size_t>(count)) {
    throw InputError(
        fmt::format("{} poses are to be chosen; {} of {} candidates have a dexterity of {} or more: offer "
                    "more candidates or lower the threshold",
                    count, usable.size(), candidates.size(), least_dexterity));
  }
  return usable;
}

/// Root mean square of each column over the candidates: with columns of one size the arithmetic is well behaved, and the
/// choice does not depend on it.
VectorXd column_scale(const std::vector<PoseCandidate>& candidates, const std::vector<std::size_t>& usable) {
  const Index p = candidates[usable.front()].rows.cols();
  VectorXd scale = VectorXd::Zero(p);
  for (const std::size_t k : usable) {
    if (candidates[k].rows.cols() != p) {
      throw InputError(fmt::format("candidate pose {} has rows of {} columns, the first {}", k + 1,
                                   candidates[k].rows.cols(), p));
    }
    scale += candidates[k].rows.colwise().squaredNorm().transpose();
  }
  scale = (scale / static_cast<double>(usable.size())).cwiseSqrt();
  // Such a column belongs to an axis that the load's line of action meets.
  const double least = kRounding * scale.maxCoeff();
  std::vector<int> open;
  for (Index j = 0; j < p; ++j) {
    if (!(scale[j] > least)) open.push_back(static_cast<int>(j) + 1);
  }
  if (!open.empty()) {
    throw NotIdentifiableError(
        fmt::format("no candidate pose loads joint {} in a direction that is measured: load or "
                    "measure in further directions",
                    fmt::join(open, ", ")));
  }
  return scale;
}

/// Chooses some of many blocks of rows so that det(Σ RᵀR) is large.
class Exchange {
 public:
  Exchange(std::vector<MatrixXd> rows, std::size_t count)
      : rows_(std::move(rows)),
        count_(count),
        p_(rows_.front().cols()),
        floor_(1e-9 * MatrixXd::Identity(p_, p_)),
        taken_(rows_.size(), false) {}

  /// Exchange ends in the nearest of several maxima: it begins with the greedy choice, then with random ones.
  void run() {
    constexpr int kStarts = 8;
    std::mt19937_64 random(1);
    double most = -std::numeric_limits<double>::infinity();
    std::vector<std::size_t> best;
    for (int start = 0; start < kStarts; ++start) {
      begin(start == 0, random);
      const int exchanges = improve();
      MatrixXd L;
      const double value = cholesky(information_without(kNone), L) ? log_determinant(L) : most;
      if (value > most + kGain) {
        most = value;
        best = chosen_;
        exchanges_ = exchanges;
      }
    }
    chosen_ = best;
  }

  const std::vector<std::size_t>& chosen() const { return chosen_; }
  /// Poses changed on the way to the choice.
  int exchanges() const { return exchanges_; }
  /// Σ RᵀR of the choice.
  MatrixXd information() const { return information_without(kNone) - floor_; }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  static constexpr double kGain = 1e-9;  ///< of the logarithm: less is rounding

  /// From the Cholesky factor.
  static double log_determinant(const MatrixXd& L) { return 2.0 * L.diagonal().array().log().sum(); }

  /// While fewer rows than unknowns are chosen, a little of everything (the floor) replaces the rest.
  /// @param without  place in the choice to leave out
  MatrixXd information_without(std::size_t without) const {
    MatrixXd M = floor_;
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
      if (i != without) M += rows_[chosen_[i]].transpose() * rows_[chosen_[i]];
    }
    return M;
  }

  MatrixXd covariance_without(std::size_t without) const {
    return solve_symmetric(information_without(without), MatrixXd::Identity(p_, p_));
  }

  /// log det(M + RᵀR) - log det M = log det(E + R M⁻¹ Rᵀ).
  static double gain(const MatrixXd& inverse, const MatrixXd& R) {
    MatrixXd L;
    if (!cholesky(MatrixXd::Identity(R.rows(), R.rows()) + R * inverse * R.transpose(), L)) return 0.0;
    return log_determinant(L);
  }

  /// The block not taken that adds most, and how much.
  std::pair<std::size_t, double> best_free(const MatrixXd& inverse) const {
    std::size_t best = rows_.size();
    double most = -1.0;
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      if (taken_[k]) continue;
      const double value = gain(inverse, rows_[k]);
      if (value > most) most = value, best = k;
    }
    return {best, most};
  }

  /// Fills the choice, greedily or at random.
  void begin(bool greedy, std::mt19937_64& random) {
    chosen_.clear();
    std::fill(taken_.begin(), taken_.end(), false);
    while (chosen_.size() < count_) {
      std::size_t next = random() % rows_.size();
      if (greedy) next = best_free(covariance_without(kNone)).first;
      if (taken_[next]) continue;
      taken_[next] = true;
      chosen_.push_back(next);
    }
  }

  /// Exchanges one at a time until none helps.
  /// @return how many
  int improve() {
    constexpr int kMostPasses = 50;
    int exchanges = 0;
    bool improved = rows_.size() > chosen_.size();
    for (int pass = 0; pass < kMostPasses && improved; ++pass) {
      improved = false;
      for (std::size_t& place : chosen_) {
        const MatrixXd inverse = covariance_without(static_cast<std::size_t>(&place - chosen_.data()));
        const auto [best, value] = best_free(inverse);
        if (!(value > gain(inverse, rows_[place]) + kGain)) continue;
        taken_[place] = false;
        taken_[best] = true;
        place = best;
        ++exchanges;
        improved = true;
      }
    }
    return exchanges;
  }

  std::vector<MatrixXd> rows_;
  std::size_t count_;
  Index p_;
  MatrixXd floor_;
  std::vector<bool> taken_;
  std::vector<std::size_t> chosen_;
  int exchanges_{0};
};

void refuse_undetermined(const Eigensystem& system, int count) {
  const Index p = system.values.size();
  const double least = kRounding * system.values[p - 1];
  if (system.values[0] > least) return;
  // What the null vectors reach stays open.
  std::vector<int> open;
  for (Index j = 0; j < p; ++j) {
    double reached = 0.0;
    for (Index k = 0; k < p && !(system.values[k] > least); ++k) {
      reached = std::max(reached, std::abs(system.vectors(j, k)));
    }
    if (reached > 0.1) open.push_back(static_cast<int>(j) + 1);
  }
  throw NotIdentifiableError(
      fmt::format("{} poses do not determine {} compliances: joint {} stays open; choose more poses or "
                  "measure more directions",
                  count, p, fmt::join(open, ", ")));
}

}  // namespace

PoseChoice choose_poses(const std::vector<PoseCandidate>& candidates, int count, double least_dexterity) {
  const std::vector<std::size_t> usable = usable_candidates(candidates, count, least_dexterity);
  const VectorXd scale = column_scale(candidates, usable);
  std::vector<MatrixXd> rows;
  for (const std::size_t k : usable) rows.push_back(candidates[k].rows * scale.cwiseInverse().asDiagonal());
  Exchange exchange(std::move(rows), static_cast<std::size_t>(count));
  exchange.run();
  const MatrixXd scaled = exchange.information();
  const Eigensystem system = eigensystem_of(scaled);
  refuse_undetermined(system, count);
  PoseChoice choice;
  for (const std::size_t k : exchange.chosen()) choice.chosen.push_back(static_cast<int>(usable[k]));
  choice.exchanges = exchange.exchanges();
  choice.information = scale.asDiagonal() * scaled * scale.asDiagonal();
  choice.log_determinant = system.values.array().log().sum() + 2.0 * scale.array().log().sum();
  return choice;
}

}  // namespace heft::stiffness
