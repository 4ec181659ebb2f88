/// @file
/// The regression behind a diagnosis, kept as moments of blocks: candidates are fitted together with the base
/// model and judged on blocks they were not fitted to, without reading a row again.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base_model.hpp"

namespace heft::diagnose {

/// Columns that a candidate adds: k coefficients, each with entries in the rows of one or several joints.
struct Columns {
  std::vector<int> joints;              ///< whose rows they reach
  std::vector<Eigen::MatrixXd> values;  ///< m × k for each of them
  int count() const { return values.empty() ? 0 : static_cast<int>(values.front().cols()); }
};

/// Moments of columns with the base and with themselves, by block and joint.
struct ColumnMoments {
  int count{0};
  std::vector<int> joints;
  /// [block][place in joints]: (p_j + 1) × k, the last row with the torque; and k × k. A single block is all rows.
  std::vector<std::vector<Eigen::MatrixXd>> cross, square;
};

struct Factored;  // moments.hpp

/// Moments over all rows of columns of one joint that lie side by side, some to a candidate.
struct WideMoments {
  int joint{-1};
  int each{1};             ///< columns of a candidate
  Eigen::MatrixXd cross;   ///< (p_j + 1) × c: with the joint's columns, the last row with the torque
  Eigen::MatrixXd square;  ///< each × c: each candidate's with themselves
};

/// Puts values of some rows into columns.
/// @param from  first row
using WriteRows = std::function<void(Eigen::Index from, Eigen::Ref<Eigen::MatrixXd> values)>;

/// How a candidate does.
struct Trial {
  Eigen::VectorXd coefficients;  ///< k
  Eigen::VectorXd std;           ///< k, robust to correlation within blocks
  Eigen::VectorXd base;          ///< p: parameters of the base next to it
  double gain{0.0};              ///< fall of the weighted squared error on the rows of the fit
  double cv_gain{0.0};           ///< rows times fall of ln(squared error) on left-out blocks: what counts
  double cv_t{0.0};              ///< mean of it over blocks against its standard error
  double lost{1.0};              ///< what blocks lose by it, in parts of what others gain
  double wald{0.0};              ///< statistic of the coefficients tested, robust
  double p_value{1.0};           ///< of it, one candidate
  double effective_rows{0.0};    ///< rows less what their correlation costs
  Eigen::VectorXd joint_before, joint_after;  ///< n: squared error on left-out blocks [N²m²]
  /// By how much a quarter of the time asks for more or less of the torque of the coefficients tested, in parts of it, at most;
  /// only what exceeds three standard errors counts.
  double drift{0.0};
  double half_t[2]{0.0, 0.0};    ///< cv_t of the blocks of the first and of the second half
  std::vector<double> run_gain;  ///< of each log: rows times fall of ln(squared error) on its left-out blocks
  bool valid{false};             ///< false: the base explains the columns, nothing can be said
};

/// Mean of gains over its standard error [1]; 0: nothing can be said.
double steadiness(const Eigen::Ref<const Eigen::VectorXd>& gains);

/// Rows of base model and accepted effects. Copies share the rows of the base.
class Problem {
 public:
  /// @param keep  m × n, 1 or 0: the row counts; has to outlive the problem
  /// @param places  for each joint the global columns of its rows
  /// @param prior   values of the base's columns that the fit leans on where the motion shows little
  /// @param steady  how much: part of each column's squared norm that the prior weighs; 0 chooses it by the error on
  ///                left-out blocks
  /// @param hold    p: the same on top, column by column; far above 1 keeps a column where the prior has it. Empty: 0
  /// @param like    another problem of the same table and torque, without further columns: where it has the same rows, their
  ///                moments are taken from it; nullptr: none
  Problem(const MotionTable& table, const Eigen::MatrixXd& keep, std::shared_ptr<const BaseRows> rows,
          std::vector<std::vector<int>> places, const Eigen::VectorXd& prior, double steady,
          const Eigen::MatrixXd& tau, const Eigen::VectorXd& hold = {}, const Problem* like = nullptr);
  double steady() const { return steady_; }

  int num_joints() const { return static_cast<int>(places_.size()); }
  /// Adds columns to the base for good; returns the global number of the first. What is fitted is the old base until
  /// reweight().
  int append(const Columns& columns) { return append(std::span(&columns, 1)).front(); }
  /// The same of several, one after the other, which costs less than one by one: joints on all processors, and each
  /// joint's rows are read once.
  std::vector<int> append(std::span<const Columns> list);
  /// Puts other values in the place of a base column that reaches one joint; as append().
  void replace(int joint, int column, const Eigen::VectorXd& values);

  /// Draws some columns to the prior, which for those appended is 0, as `hold` of the constructor. reweight() comes after it.
  void lean(int first, int count, double weight) { ridge_.segment(first, count).setConstant(weight); }
  /// Fits, with the joints weighted by their residual: fitted and weighted until that settles. Call after append or replace.
  void reweight();
  /// From the next reweight() on no joint weighs more than with this residual.
  /// @param noise  n [N·m]
  void hold_weights(const Eigen::VectorXd& noise) { least_noise_ = noise; }
  const Eigen::VectorXd& noise() const { return noise_; }  ///< n: rms residual of rows that count [N·m]
  Eigen::VectorXd theta() const { return theta_ + prior_; }
  const Eigen::MatrixXd& keep() const { return *keep_; }  ///< m × n, 1 or 0: the row counts
  /// p: standard deviation of each coefficient if residuals of different rows were independent.
  Eigen::VectorXd white_std() const;
  const Eigen::VectorXd& counted() const { return counted_; }  ///< n: rows that count

  /// Changes of theta() where groups of neighbouring blocks are left out, p × groups with rows that count. By the jackknife
  /// they give its covariance, which holds for residuals that are correlated within the groups.
  /// @param held_by  fit that the values come from at which base columns are held: they are known no better than it knows them
  /// @param follows  which of the base columns are held at its values, and not at 0
  Eigen::MatrixXd changes_without_blocks(const Problem& held_by, const std::vector<bool>& follows) const;

  /// theta() where the prior steadies as little as it can.
  Eigen::VectorXd unsteadied_theta() const;

  Eigen::MatrixXd residual() const;  ///< of rows that count; others 0
  /// n: rms residual of each joint's rows fitted on their own, with parameters that no other joint has a say in [N·m].
  Eigen::VectorXd noise_alone() const;

  /// Moments of many columns of one joint over all rows. They are made and used up piece by piece, so that they never
  /// leave the cache.
  /// @param columns  how many
  /// @param each     columns of a candidate
  /// @param write    puts in the columns' values of some rows, those that do not count as well; pieces come in order
  WideMoments wide_moments(int joint, Eigen::Index columns, int each, const WriteRows& write) const;
  /// Gains of candidates of one joint.
  /// @return one gain and its coefficients for every candidate; gain 0 where the base explains the columns
  std::vector<std::pair<double, Eigen::VectorXd>> scan(const WideMoments& candidates) const;
  /// gain() of each of several candidates.
  /// @param joints  their moments in the rows of each joint that they reach
  std::vector<double> gains(std::span<const WideMoments> joints, int without = -1) const;
  /// The same of linear combinations of all columns.
  /// @param columns       as one candidate
  /// @param combinations  c × k each
  std::vector<double> gains(const WideMoments& columns, const std::vector<Eigen::MatrixXd>& combinations,
                            int without = -1) const;
  /// The same of candidates that reach several joints.
  /// @param joints        all columns of a joint as one candidate
  /// @param combinations  of each candidate, one a joint: c × k
  std::vector<double> gains(std::span<const WideMoments> joints,
                            const std::vector<std::vector<Eigen::MatrixXd>>& combinations) const;

  ColumnMoments moments(const Columns& columns) const;
  /// Moments of the columns from one row on, those before taken as 0.
  /// @param all  moments of the columns as they are
  ColumnMoments moments_from(Eigen::Index row, const Columns& columns, const ColumnMoments& all) const;
  /// Fall of the weighted squared error on the rows of the fit.
  /// @param without  column of the base that the candidate replaces; -1: none
  double gain(const ColumnMoments& moments, int without = -1) const;
  /// @param tested  how many of the first coefficients chance is asked of; 0: all
  /// @param least   gain below which it is not valid
  Trial judge(const ColumnMoments& moments, int without = -1, int tested = 0, double least = 0.0) const;
  /// Part of the fall of a joint's squared error that lies in some of its rows; 0 where the error does not fall. Where the joint
  /// rests counts as well, if the error falls there.
  /// @param trial         of the columns, by this problem
  /// @param where         m, 1 or 0
  /// @param left_at_rest  m: see Workbench
  double part_of_fall(const Columns& columns, const Trial& trial, int joint, const Eigen::VectorXd& where,
                      const Eigen::Ref<const Eigen::VectorXd>& left_at_rest) const;
  /// Sum of the squared residuals of a joint's rows that count [N²m²].
  double squares_of(int joint) const;
  double weight(int joint) const { return 1.0 / (noise_[joint] * noise_[joint]); }

 private:
  /// Residual of a joint's rows that count; others 0.
  /// @param theta  p, in addition to the prior
  Eigen::VectorXd residual_of(int joint, const Eigen::VectorXd& theta) const;
  /// Moments of one block and joint, shared by copies until one of them puts others in their place.
  using BlockMoments = std::shared_ptr<const Eigen::MatrixXd>;

  void append_to_joint(int joint, std::span<const Columns> list, const std::vector<int>& firsts);
  void choose_steady();
  void collect(std::size_t block, const Problem* like);
  bool has_same_rows(const Problem* like, const Block& block, int joint) const;
  void sum_folds();
  void sum_base();
  Eigen::MatrixXd total_without(std::size_t first, std::size_t end) const;
  /// Xᵀ C of some rows of a joint, p_j × k.
  /// @param C  rows × k; 0 where a row does not count
  Eigen::MatrixXd rows_times(int joint, Eigen::Index begin, Eigen::Index count,
                             const Eigen::Ref<const Eigen::MatrixXd>& C) const;
  Eigen::MatrixXd counted_of(int joint, const Eigen::MatrixXd& values) const;

  /// Base and candidate together.
  struct Joint;
  /// Fits of the base alone that candidates are held against.
  struct BaseFits;
  static std::shared_ptr<BaseFits> new_base_fits();
  /// The total, and the total less each fold.
  /// @param without  column to leave out; -1: none
  const Factored& base_without(int without) const;
  const std::vector<Factored>& folds_without(int without) const;
  const std::vector<Eigen::VectorXd>& errors_left_out() const;
  bool is_explained(const Joint& joint) const;
  void put_products(Joint& joint) const;
  Eigen::MatrixXd scores_of(const Joint& joint) const;
  bool test_coefficients(const Joint& joint, const Eigen::MatrixXd& scores, int t, Trial& trial) const;
  double drift_of(const Joint& joint, const Eigen::MatrixXd& scores) const;
  void cross_validate(const Joint& joint, Trial& trial) const;

  const MotionTable* table_;
  const Eigen::MatrixXd* keep_;
  std::shared_ptr<const BaseRows> rows_;
  /// n: m × columns that are not the base's, appended or in the place of one of the base's; 0 where a row does not count.
  std::vector<Eigen::MatrixXd> own_;
  std::vector<std::vector<Eigen::Index>> own_at_;  ///< n: where they are among the joint's columns
  std::vector<std::vector<int>> places_;
  int columns_;
  Eigen::VectorXd prior_;  ///< p; the fit is of the rest
  double steady_;
  Eigen::MatrixXd tau_;                                        ///< less what the prior says
  std::vector<std::vector<BlockMoments>> moments_;             ///< [block][joint]
  std::vector<std::vector<Eigen::MatrixXd>> moments_of_fold_;  ///< [fold][joint]: sums of these
  /// n: whether the sums hold the joint's moments as they are; bytes, which threads may write side by side.
  std::vector<char> summed_;
  Eigen::VectorXd counted_, noise_, theta_;  ///< theta_: in addition to the prior
  Eigen::VectorXd least_noise_;                                ///< see hold_weights(); empty: any
  Eigen::VectorXd ridge_;                                      ///< p: see `hold` of the constructor
  Eigen::MatrixXd total_;               ///< (p + 1)², weighted, unscaled
  std::vector<Eigen::MatrixXd> folds_;  ///< the same, one fold's blocks only
  std::shared_ptr<const Factored> base_;  ///< the total
  std::shared_ptr<BaseFits> base_fits_;  ///< of the present weights; filled when first asked for
};

}  // namespace heft::diagnose
