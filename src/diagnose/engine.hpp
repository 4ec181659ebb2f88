/// @file
/// The model under diagnosis: base, accepted effects, and the regression that goes with them.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "candidates.hpp"
#include "deflection.hpp"
#include "heft/model/model_file.hpp"

namespace heft::diagnose {

/// The base alone on the rows of a table: what every model of these starts from.
struct BaseFit {
  std::shared_ptr<const BaseModel> base;
  std::shared_ptr<const MotionTable> table;
  std::vector<GearCoupling<double>> pairs;  ///< of joints that may share a motor
  std::shared_ptr<const BaseRows> rows;
  std::shared_ptr<const Problem> fitted;
  model::Robot robot;          ///< with the fitted parameters
  Eigen::MatrixXd load, held;  ///< see Workbench
};

/// Base column that an effect in place contains, so that the fit does without it: the offset in a spring or cable, the rotor
/// inertia in an elastic joint; -1: none.
int contained_column(const Candidate& effect, const BaseModel& base);

/// The numbers of a fit.
struct Replica {
  struct Effect {
    Eigen::VectorXd coefficients;  ///< k, of the columns
    double shape, second;          ///< see Candidate
  };
  model::Robot robot;           ///< with the base parameters
  std::vector<Effect> effects;  ///< of each accepted effect
};

/// Base model and accepted effects on training logs.
class Engine {
 public:
  /// Fits the base alone.
  /// @param pairs   of joints that may share a motor
  Engine(std::shared_ptr<const BaseModel> base, std::shared_ptr<const MotionTable> table,
         std::vector<GearCoupling<double>> pairs);
  /// Another model of the same base and table. build() comes after it.
  explicit Engine(std::shared_ptr<const BaseFit> fit);
  Engine(const Engine&) = delete;  // the problem points into it
  Engine& operator=(const Engine&) = delete;

  /// Draws base columns to given values from the next build() on.
  /// @param values   b
  /// @param columns  b: which of them
  /// @param weight   part of each column's squared norm that the value weighs; far above 1 holds it there
  void anchor(const Eigen::VectorXd& values, const std::vector<bool>& columns, double weight);
  /// The next build() finds the deflection of elastic joints from the fit of another model of the same table, which has
  /// most of these effects.
  /// @param fits  that it takes, 1 to 3: what the columns of effects are made of is that of the fit before
  void begin_near(const Engine& other, int fits);
  /// Fits base and accepted effects again.
  void build();
  /// Puts a candidate in place of an accepted effect, or as one more: index accepted.size(). A second memory brings the
  /// distance of the first one with it. build() comes after it.
  void put(std::size_t index, Candidate candidate);
  /// Takes the motors' inertias that the fit has below zero out of their springs. build() comes after it.
  /// @return joints
  std::vector<int> remove_impossible_motors();
  /// Betters the numbers of elastic joints and delays, which the rest of the model has a part in.
  void tune();
  /// Candidates for one more effect, judged: those of the joints asked for and those of the whole arm.
  /// @param joints  n; `done` gets 0..1
  /// @param least   see Workbench::least_gain
  std::vector<Candidate> propose(const std::vector<bool>& joints, const std::function<void(double)>& done,
                                 double least) const;
  /// A spring together with one of another joint, see there.
  std::vector<Candidate> spring_pairs(const Candidate& first, const std::vector<bool>& others) const;
  /// An effect of one joint in each of its forms, or one of the whole arm at its best shape, judged next to those in place.
  std::vector<Candidate> forms_of(const Candidate& effect) const;
  /// Judges a candidate again with the effects that are in place now.
  void judge_again(Candidate& candidate) const;

  std::vector<Candidate> accepted;
  /// A joint that an effect has made quiet weighs no more than it did without effects. It would draw the masses that
  /// all joints share towards what is left in it, at the expense of the others.
  bool weights_held{false};
  /// The masses stay those of the fit without effects: no joint pays for an effect of another one.
  bool masses_held{false};
  /// Base columns that the model is fitted without; empty: none. A column that an effect in place contains (the offset
  /// in that of a spring, the rotor inertia in that of an elastic joint) is left out anyway.
  std::vector<bool> left_out;
  /// Joints whose spring was refused for good: none is looked for there again.
  std::vector<int> no_springs_in;
  /// Joint whose standstill counts even if no friction that remembers is in place; -1: none.
  int standing_counts{-1};

  const std::shared_ptr<const BaseFit>& base_fit() const { return fit_; }
  const Problem& problem() const { return *problem_; }
  const MotionTable& table() const { return table_; }
  const Motion& motion() const { return motion_; }
  /// Rows that count, m × n: those of the table, with the standstill of joints whose friction remembers and without
  /// contacts.
  const Eigen::MatrixXd& keep() const { return keep_; }
  /// Rigid-body torque of the fit, m × n, with that of a load which comes or goes and of a tilt of the base.
  const Eigen::MatrixXd& load() const {
    load_all();
    return lazy_load_;
  }
  int num_base_parameters() const { return base_.columns(); }
  /// Base parameters whose 95 % interval is wider than half of their size, the fitted or the robot's own, by name.
  /// @param cutoff  of the low-pass on q [Hz]: behind it 2 cutoff rows a second are independent
  std::vector<std::string> undetermined(double cutoff) const;
  /// Torque that an accepted effect adds, m × n; no columns for one that is no torque of its own (delay, contact).
  Eigen::MatrixXd effect_torque(std::size_t index) const;
  /// What a model file keeps of the fit's parameters: base parameters and coefficients of the joint effects in the
  /// order of robot().effects, with intervals and covariance for residuals correlated in time.
  model::FitRecord parameter_record() const;
  /// The fit as the prior steadies it least, then that without a group of neighbouring blocks each, to first order in all
  /// parameters and shapes.
  std::vector<Replica> replicas() const;
  /// Two memories of one joint share a coefficient: a column alone does not say how well either is known.
  bool shares_memory(std::size_t index) const { return first_memory(index) >= 0 || second_memory(index) >= 0; }
  /// Mean of ln(squared error) over the rows of all joints.
  double mean_log_error() const;
  /// Of each joint's residual, n; see noise_with_hum().
  Eigen::VectorXd noise_floor() const;
  /// Where a joint's rows that count lie; without limits where none counts.
  SeenWithin<double> seen(int joint) const;
  /// The fitted robot with its effects; a payload change as it is at the end of training.
  model::Robot robot() const;
  /// Torque of every row, also of rows that do not count, m × n.
  Eigen::MatrixXd predicted() const;
  /// Coefficients of an accepted effect. The first memory of a joint's friction holds its part of what both do.
  Eigen::VectorXd coefficients(std::size_t index) const;
  /// The memory that an accepted one is second to, or that is second to it; -1: none.
  std::ptrdiff_t first_memory(std::size_t index) const;
  std::ptrdiff_t second_memory(std::size_t index) const;

 private:
  /// Passes of deflection and fit from a fit of rigid joints: steps of Gauss and Newton for masses, springs and effects together.
  static constexpr int kElasticPasses = 3;

  Workbench bench() const;
  void load_all() const;
  void load_joints(const std::vector<bool>& joints) const;
  void refit(bool deflect);
  void note_fit();
  /// Torque of some rows.
  Eigen::MatrixXd predicted(Eigen::Index begin, Eigen::Index count) const;
  /// Adds that of the columns of an effect.
  void add_torque_of(std::size_t index, Eigen::Index begin, Eigen::Index count, Eigen::MatrixXd& tau) const;
  Eigen::MatrixXd base_torque(Eigen::Index begin, Eigen::Index count) const;
  /// Base parameters; 0 where the column holds other values now.
  Eigen::VectorXd base_parameters() const;
  /// Of the columns.
  Eigen::VectorXd fitted(std::size_t index) const;
  struct Nearby;
  /// What makes elastic joints deflect: see deflections().
  struct LinkLoad {
    Eigen::VectorXd masses;  ///< b: see masses_of()
    LinkTorque links;        ///< along the links' motion; no torque
    Eigen::MatrixXd load;    ///< m × k: τ + G e, the links' torque where they would be with stiff joints

    const std::vector<int>& joints() const { return links.joints; }
    bool is_possible() const;
  };
  /// Torque around a deflection: see linearised().
  struct Linear {
    std::shared_ptr<const BaseRows> rows;  ///< derivatives by the base parameters
    std::vector<std::vector<int>> places;  ///< n: whose
    Eigen::MatrixXd constant;              ///< m × n: what torque is there besides
    Columns springs;  ///< 2 k: derivatives by ln K and ln D of each joint; none: the masses are physically impossible together
  };
  void refit_near(const Nearby& nearby);
  void deflect_links();
  LinkLoad link_load(const model::Robot& robot, const std::vector<int>& joints) const;
  LinkLoad possible_near(LinkLoad wanted) const;
  void put_deflections(const LinkLoad& by);
  Eigen::VectorXd masses_of(Eigen::VectorXd beta) const;
  Eigen::VectorXd of_springs(double Candidate::*number) const;
  Linear linearised() const;
  void turn_springs();
  void settle_springs();
  void tune_delays(const std::vector<std::size_t>& delays);
  Eigen::VectorXd hold() const;
  Eigen::VectorXd prior() const;
  bool is_out(int column) const;
  std::vector<bool> followers() const;
  std::vector<Columns> shape_slopes(std::vector<std::size_t>& whose) const;
  double held_at(int column) const;
  void set_up_base();
  Eigen::MatrixXd joint_columns(std::size_t index) const;
  void find_columns();
  std::optional<Columns> appended(std::size_t index, bool deflect) const;
  void add_to_problem(bool deflect);
  void find_holding_torque();
  void find_resting_torque();

  std::shared_ptr<const MotionTable> shared_;
  const MotionTable& table_;
  std::shared_ptr<const BaseModel> shared_base_;
  const BaseModel& base_;
  std::vector<GearCoupling<double>> pairs_;
  Eigen::MatrixXd keep_;  ///< see keep()
  Motion motion_;
  std::shared_ptr<const BaseRows> rows_;        ///< along `motion_`
  std::shared_ptr<const BaseRows> rigid_rows_;  ///< the same where no link deflects
  std::shared_ptr<const Problem> plain_;        ///< of the base alone on `rigid_rows_` and rows that count
  Eigen::VectorXd plain_hold_;                  ///< what it holds, see hold()
  std::shared_ptr<const BaseFit> fit_;
  double delay_{0.0};       ///< of `motion_` [s]
  Eigen::VectorXd anchor_;  ///< values that base columns are held at; empty: those of the fit without effects
  std::vector<bool> anchored_;  ///< which of them; empty: none
  double anchor_weight_{0.0};
  std::unique_ptr<Problem> problem_;
  model::Robot rigid_;                       ///< with the fitted base parameters
  Eigen::MatrixXd more_load_;  ///< m × n: torque of a load that comes or goes, and of a tilt, in the fit; empty: neither is there
  /// Rigid-body torque of the fit, m × n, of the joints that were asked for; see load_joints().
  mutable Eigen::MatrixXd lazy_load_;
  mutable std::vector<bool> loaded_;  ///< n: which of them; empty: nothing is fitted yet
  mutable std::mutex loading_;
  Eigen::MatrixXd held_, left_at_rest_;      ///< see Workbench
  Eigen::VectorXd base_noise_, base_theta_;  ///< of the fit without effects
  double steady_{0.0};
  std::vector<int> first_column_;  ///< of each accepted effect; -1: has none
  /// A fit that the next build() begins with, see begin_near().
  struct Nearby {
    model::Robot robot;
    Eigen::MatrixXd held, load;  ///< see Workbench; no load: no effect takes it
    LinkLoad link_load;
    int fits;
  };
  std::optional<Nearby> nearby_;
  LinkLoad link_load_;     ///< of the last deflection since build()
  Linear linear_;          ///< the same; what the present fit is of where `deflected_`
  int first_spring_column_{-1};  ///< of Linear::springs; -1: none
  double spring_step_{0.0};      ///< of the last fit: longest step of ln K, or tenth of one of ln D
  bool deflected_{false};  ///< the last fit was one of elastic joints, with whose masses the next one begins
};

}  // namespace heft::diagnose
