/// @file
/// The deflection of one joint as a regression: rows, columns of every term, sums by blocks.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include <Eigen/Core>

#include "encoder_stretches.hpp"

namespace heft::stiffness {

/// Changes of torque, as shares of its range, after which its direction has half turned.
inline constexpr std::array kSlips{0.02, 0.05, 0.1};

inline bool contains(const std::vector<DeflectionTerm>& terms, DeflectionTerm term) {
  return std::find(terms.begin(), terms.end(), term) != terms.end();
}

/// Columns of one term in a fit.
struct Columns {
  DeflectionTerm term{};
  std::vector<Eigen::Index> columns;
};

/// All rows of a joint in some logs, with every term that could be tried, and the sums of each block of them.
class EncoderProblem {
 public:
  using Index = Eigen::Index;
  using MatrixXd = Eigen::MatrixXd;
  using VectorXd = Eigen::VectorXd;

  EncoderProblem(std::vector<Stretch> stretches, int num_logs, double cutoff)
      : stretches_(std::move(stretches)), num_logs_(num_logs), cutoff_(cutoff) {
    build(0.0);
  }

  /// The terms that are not linear in the torque, again from the torque less this friction on the motor's side:
  /// its steps at reversals never reach the gear. Of the widths of the play the one that takes most of what these
  /// terms leave. set_blocks() must be called again.
  void set_friction(double friction, const std::vector<DeflectionTerm>& terms);

  /// Deflection with the link's channel taken `shift` later.
  void set_shift(double shift);
  double shift() const { return shift_; }

  /// Rows weighted for a residual whose autocorrelation falls off as exp(-|t|/memory): y(k) − a y(k−1), a =
  /// exp(-T/memory), so that what is left of it is white. 0: as they are. set_blocks() must be called again.
  void set_memory(double memory);

  /// Sums over blocks of about that length [s].
  void set_blocks(double length);

  Index rows() const { return y_.size(); }
  const VectorXd& deflection() const { return y_; }
  const MatrixXd& columns() const { return W_; }
  const std::vector<Columns>& terms() const { return terms_; }
  const Columns* term(DeflectionTerm which) const {
    for (const Columns& t : terms_) {
      if (t.term == which) return &t;
    }
    return nullptr;
  }
  int num_blocks() const { return static_cast<int>(blocks_.size()); }
  double block_length() const { return block_length_; }
  /// Less than this the filter itself makes [s].
  double shortest_memory() const { return 1.0 / cutoff_; }
  double duration() const { return duration_; }
  double shortest_log() const { return shortest_log_; }
  double rate() const { return stretches_.front().rate; }
  const std::vector<int>& log_of_row() const { return log_of_row_; }
  /// Share by which the noise of tau lowers the compliance next to these columns.
  double attenuation(const std::vector<Index>& others, Index torque) const;
  /// Columns were divided by this.
  double scale(Index column) const { return scale_[column]; }
  double torque_range() const { return torque_range_; }
  bool moves() const { return moves_; }

  std::vector<Index> indices(const std::vector<DeflectionTerm>& which) const;

  struct Fit {
    std::vector<Index> index;  ///< columns of W
    VectorXd x;
    MatrixXd covariance;   ///< jackknife
    VectorXd residual;     ///< y − W x
    VectorXd innovation;   ///< of the weighted rows
    double held_out{0.0};  ///< sum of squares of the weighted rows
  };
  Fit fit(const std::vector<DeflectionTerm>& which, double edge_factor = 1.0) const;

  /// Share of the power of these columns (of the worst of them) that the others cannot explain.
  double own_power(const std::vector<Index>& others, const std::vector<Index>& columns) const {
    return own_power(gram_, others, columns);
  }

 private:
  struct Sums {
    MatrixXd ZW, WW;
    VectorXd Zy, Wy;
    double yy{0.0};
  };

  bool is_used(const Stretch& s, Index k) const {
    const double edge = 1.0 / cutoff_;
    return s.measured[static_cast<std::size_t>(k)] != 0 && s.time[k] - s.time[0] >= edge &&
           s.time[s.time.size() - 1] - s.time[k] >= edge;
  }
  /// What the columns are made of, row by row.
  struct Rows {
    VectorXd q, qd, direction;
    std::array<MatrixXd, 2> by_torque;  ///< torque and instrument: see torque_columns()
    std::vector<double> first, last;    ///< time of each log [s]
  };
  void build(double friction);
  Rows collect(Index m, double friction);
  void add_terms(const Rows& raw);
  VectorXd weighted(const VectorXd& rows) const;
  static double own_power(const MatrixXd& gram, const std::vector<Index>& others,
                          const std::vector<Index>& columns);
  static MatrixXd pick(const MatrixXd& A, const std::vector<Index>& index);
  static VectorXd pick(const VectorXd& a, const std::vector<Index>& index);

  std::vector<Stretch> stretches_;
  int num_logs_;
  double cutoff_;
  double shift_{0.0}, block_length_{0.0}, duration_{0.0}, shortest_log_{0.0};
  double torque_noise_{0.0}, torque_range_{0.0};
  bool moves_{false};
  double decay_{0.0};
  VectorXd y_, yw_, time_;
  MatrixXd W_, Z_;                 ///< columns of unit rms, see scale_
  MatrixXd Ww_, Zw_;               ///< weighted
  MatrixXd gram_;                  ///< Wᵀ W
  std::array<MatrixXd, 2> plays_;  ///< column of kTorqueHysteresis for each of kSlips
  std::vector<char> follows_;      ///< the row before is the sample before
  VectorXd scale_;
  std::vector<int> log_of_row_;
  std::vector<Columns> terms_;
  std::vector<Sums> blocks_;
  Sums total_;
};

/// With the interval of `factor` standard deviations.
statistics::Interval uncertain(double value, double variance, double factor);

/// Coefficients of a term in a fit, in its units.
std::vector<statistics::Interval> coefficients(const EncoderProblem& problem, const EncoderProblem::Fit& f,
                                               DeflectionTerm term, double factor);

}  // namespace heft::stiffness
