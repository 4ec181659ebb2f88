/// @file
/// What a moving horizon knows, as sums: the rows of the window with their outlier weights, and everything before them
/// as one triangular factor. Derivation: src/identify/moving_horizon.md
#pragma once

#include <deque>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/triangular_factor.hpp"
#include "horizon_rows.hpp"

namespace heft::identify {

/// ‖R s − z‖² after s has walked at random: information (Λ⁻¹ + D²)⁻¹ without inverting Λ, which may be singular.
/// @param walk  u: standard deviation D of the step; 0 where s stays
/// Cost: (k + u)³ for k entries of the walk that are not 0.
regression::TriangularFactor widened(const regression::TriangularFactor& factor, const Eigen::VectorXd& walk);

/// Scatter of a joint's rows.
struct RowNoise {
  double std{0.0};         ///< [N·m, N]; 0: not known yet
  double correlated{1.0};  ///< rows that hold as much information as one
  bool learnt{false};      ///< from residuals; before, from the torque
};

/// Rows of the window.
class HorizonWindow {
 public:
  explicit HorizonWindow(int joints) : noise_(static_cast<std::size_t>(joints)) {}

  void add(HorizonTick tick) {
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(tick.y.size());
    ticks_.push_back({std::move(tick), std::move(weights)});
  }
  /// Into other unknowns: W x − y becomes W T s − (y − W x₀).
  void transform(const Eigen::MatrixXd& T, const Eigen::VectorXd& x0);
  void clear() { ticks_.clear(); }

  int rows() const;
  const RowNoise& noise(int joint) const { return noise_[static_cast<std::size_t>(joint)]; }

  /// Scatter as a share of each joint's torque: before anything is known.
  void guess_noise();
  /// Scatter and correlation of the residuals, mixed with what they were; a joint with few rows keeps its own, one that shows
  /// its first rows begins with a share of its torque.
  /// @param share  of the new figures, 1: forget the old ones
  void learn_noise(const Eigen::VectorXd& s, double share);
  /// Student's weights at s. @return share of the rows that count less than half
  double weigh(const Eigen::VectorXd& s, double degrees_of_freedom);
  /// The rows in units of their scatter.
  regression::TriangularFactor factor(int unknowns) const;
  /// Takes off the rows before `time` and adds them to a factor.
  void move_older(double time, regression::TriangularFactor& to);

 private:
  struct Weighted {
    HorizonTick tick;
    Eigen::VectorXd weights;  ///< m: 0..1
  };
  /// Of the i-th row of a tick: square root of its information.
  double scale(const Weighted& weighted, Eigen::Index i) const;

  std::deque<Weighted> ticks_;
  std::vector<RowNoise> noise_;
};

}  // namespace heft::identify
