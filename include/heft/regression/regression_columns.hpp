/// @file
/// Columns of the regression: which parameters a fit has, what they are called and their regressor.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/core/friction/gear_coupling.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::regression {

/// Terms in addition to the rigid bodies.
struct ModelStructure {
  bool rotor_inertia{true};  ///< not for torque measured behind the gear: the sensor does not see it
  bool coulomb{true};
  bool viscous{true};
  bool offset{true};
  /// Known gear couplings: pair and ratio are given, their three parameters are fitted.
  std::vector<GearCoupling<double>> couplings{};
};

/// Kinds of columns.
enum class ColumnKind {
  kLink,  ///< one of the ten inertial parameters
  kRotorInertia,
  kCoulomb,
  kViscous,
  kOffset,
  kCouplingInertia,
  kCouplingCoulomb,
  kCouplingViscous
};

/// One parameter.
struct Column {
  std::string name;  ///< "Ixx3", "Ia3", "Fc3", "Fv3", "off3", "Ia5+6", "Fc5+6", "Fv5+6"; joints count from 1
  std::string unit;  ///< "kg·m²"
  ColumnKind kind{ColumnKind::kLink};
  int joint{0};   ///< link, joint, or driven joint of a coupling, counted from 0
  int entry{-1};  ///< of a link: position in InertialParameters
  int coupling{-1};
};

/// The parameters of a fit and the regressor that goes with them: τ = Y(q, q̇, q̈) x.
///
/// Order: ten a link, base first; then the blocks rotor inertia, Coulomb, viscous, offset (those that the
/// structure has), each in joint order; then inertia, Coulomb, viscous of each coupling.
class RegressionColumns {
 public:
  /// @throws ModelError for more than model::kMaxJoints joints, or a coupling between joints that do not
  ///         exist, or of a joint with itself.
  RegressionColumns(const model::Robot& robot, ModelStructure structure);

  int count() const { return static_cast<int>(columns_.size()); }  ///< p
  int num_joints() const { return dynamics_.num_joints(); }        ///< n
  const std::vector<Column>& columns() const { return columns_; }
  const Column& operator[](int index) const { return columns_[static_cast<std::size_t>(index)]; }
  const ModelStructure& structure() const { return structure_; }
  const model::Robot& robot() const { return dynamics_.robot(); }

  /// Y, n × p, for one instant; Coulomb columns with the sharp sign, 0 at standstill.
  Eigen::MatrixXd regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                            const Eigen::VectorXd& qdd) const;

  /// Some entries of the regressors of many instants, a matrix of each joint.
  /// @param q, qd, qdd  rows × n each; rows first .. first + count are taken
  /// @param columns  n lists of parameters
  /// @param rows     made count × columns[j].size(); its storage is used again
  void fill(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd, Eigen::Index first,
            Eigen::Index count, const std::vector<std::vector<int>>& columns, model::RegressorRows& rows) const;

  /// The robot's present values of these parameters, p. Couplings are found by their pair of joints.
  Eigen::VectorXd values(const model::Robot& robot) const;
  /// Puts values into a robot. Parameters outside the structure become 0: the fit had none of them.
  void apply(const Eigen::VectorXd& values, model::Robot& robot) const;

 private:
  double coupled_entry(int joint, int column, const Eigen::RowVectorXd& qd, const Eigen::RowVectorXd& qdd) const;

  ModelStructure structure_;
  model::Dynamics dynamics_;
  model::BatchDynamics batch_;
  std::vector<Column> columns_;
};

}  // namespace heft::regression
