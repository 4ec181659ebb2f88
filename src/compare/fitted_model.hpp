/// @file
/// A model file ready to be compared: what was fitted, how well it is known, and the torque that it makes.
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/compare/compare.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::compare {

/// The file's path for messages.
std::string name_of(const model::ModelFile& file);

/// Kinds of joint effects that are part of the friction at a speed, so that its other terms mean something else without them.
bool is_friction_of_speed(int kind);

/// One fitted number.
struct Parameter {
  Kind kind{Kind::kLink};
  std::string name, meaning, unit;
  int joint{0};
  int column{-1};       ///< of the regression; -1: coefficient of an effect, or not known
  int effect{-1};       ///< place in the robot's effects
  int coefficient{-1};  ///< of the effect
  double value{0.0}, std{0.0};
  double freedom{0.0};  ///< degrees of freedom behind `std`
  bool determined{true};
};

/// One instant of the reference motion.
struct State {
  Eigen::VectorXd q, qd, qdd;
};
/// As compare() describes them; the same for the same limits.
std::vector<State> reference_states(const model::Robot& robot);

class FittedModel {
 public:
  /// @throws ModelError when the file has no kinematics or no intervals
  explicit FittedModel(const model::ModelFile& file);

  const std::vector<Parameter>& parameters() const { return parameters_; }
  /// The parameter of that name and meaning; none: nullptr.
  const Parameter* find(const std::string& name) const;
  const model::Robot& robot() const { return dynamics_.robot(); }
  bool has_covariance() const { return covariance_.size() > 0; }
  /// Of the parameters in their order.
  const Eigen::MatrixXd& covariance() const { return covariance_; }
  /// Variance of what has this gradient by the parameters; NaN: not known.
  double variance(const Eigen::VectorXd& gradient) const;
  const Eigen::VectorXd& largest_torque() const { return largest_torque_; }  ///< as Comparison's, of this fit

  /// Torque of a part of the model, n.
  Eigen::VectorXd torque(Part part, const State& state) const;
  /// What each parameter adds to that, n × number of parameters, times its value.
  Eigen::MatrixXd rows(Part part, const State& state) const;
  /// The same of all parts for one column.
  Eigen::VectorXd column(const Parameter& parameter, const State& state) const;

  /// Temperatures at which friction is said, n [°C]; not a number, as at first: at the T0 of what follows the temperature.
  void set_temperature(const Eigen::VectorXd& temperature) { temperature_ = temperature; }
  /// Temperature at which the declared friction of a joint holds [°C]; not a number: it knows of none.
  double own_temperature(int joint) const;
  /// Friction of a joint that moves forward and its gradient by the parameters.
  /// @param load  torque that the gear transmits [N·m, N]
  double friction(int joint, double speed, double load, Eigen::VectorXd* gradient = nullptr) const;
  /// Whether friction of the joint has more terms than Coulomb and viscous friction.
  bool has_other_friction(int joint) const;
  /// Whether an effect of one of these kinds acts on the joint.
  bool has_effect(int joint, std::initializer_list<int> kinds) const;
  /// Cables that pull at the joint, by their driving and driven joints.
  std::set<std::pair<int, int>> cables_of(int joint) const;

 private:
  double effect_column(const Parameter& parameter, const EffectPoint<double>& point) const;
  EffectPoint<double> point_of(int joint, const State& state) const;

  model::Dynamics dynamics_;
  regression::RegressionColumns columns_;
  std::vector<Parameter> parameters_;
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd largest_torque_;
  Eigen::VectorXd temperature_;
};

/// Lets models say friction at the same temperature: of each joint, the mean of the models' own.
/// @return n [°C]; not a number for a joint whose friction goes by none
Eigen::VectorXd bring_to_one_temperature(const std::vector<FittedModel*>& models);

/// @throws ModelError when two models are not of one robot
void refuse_different_robots(const model::ModelFile& a, const model::ModelFile& b, const model::Robot& before,
                             const model::Robot& after);

/// Gravity, inertia and friction of every joint in both models.
std::vector<TorquePart> torque_parts(const FittedModel& before, const FittedModel& after,
                                     const std::vector<State>& states);
/// rms of the rigid-body torque of each joint over the states, n.
Eigen::VectorXd typical_load(const FittedModel& model, const std::vector<State>& states);
/// Friction over speed, up to half of the velocity limit.
std::vector<FrictionCurve> friction_curves(const FittedModel& before, const FittedModel& after,
                                           const Eigen::VectorXd& load);
/// Fastest speed of the reference states [rad/s, m/s].
double fastest(const model::RobotJoint& joint);

}  // namespace heft::compare
