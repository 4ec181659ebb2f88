/// @file
/// Rigid bodies and simple friction: what a diagnosis starts from, and what the model that it writes always has.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// The motion that the base model is evaluated on; link side and motor side differ where a joint is elastic.
struct Motion {
  Eigen::MatrixXd q, qd, qdd;                 ///< m × n, motor side
  Eigen::MatrixXd link_q, link_qd, link_qdd;  ///< m × n
  Eigen::MatrixXd direction;                  ///< m × n, of the motor's velocity
  Eigen::MatrixXd displacement;  ///< m × 2 n, as measured, since the row before; may be without columns
};

/// Rows of the base model for each joint, m × p_j, also those that do not count.
using BaseRows = std::vector<Eigen::MatrixXd>;

/// The motion as logged.
Motion rigid_motion(const MotionTable& table);

/// Rigid bodies, Coulomb and viscous friction: what a search for effects begins with.
regression::ModelStructure searched_structure();
/// What identify fits, and the written model has: rotor inertia and offset as well.
/// @param joint_sensor  torque was measured behind the gear, where no rotor is felt
regression::ModelStructure written_structure(bool joint_sensor);

/// Columns of the base model and what their coefficients mean.
class BaseModel {
 public:
  BaseModel(const model::Robot& robot, const regression::ModelStructure& structure);

  int columns() const { return static_cast<int>(base_.kept.size()); }  ///< b
  int num_joints() const { return columns_.num_joints(); }
  /// For each joint the base columns that reach its rows.
  const std::vector<std::vector<int>>& places() const { return places_; }
  int coulomb(int joint) const { return coulomb_[static_cast<std::size_t>(joint)]; }
  int viscous(int joint) const { return viscous_[static_cast<std::size_t>(joint)]; }
  /// Column of a joint's rotor inertia and offset; -1: the base has none, or holds it in that of a link.
  int rotor(int joint) const { return rotor_[static_cast<std::size_t>(joint)]; }
  int offset(int joint) const { return offset_[static_cast<std::size_t>(joint)]; }
  bool is_link(int column) const;
  /// "Izz1*".
  std::string name(int column) const { return base_.name(columns_, column); }
  /// "kg·m²".
  const std::string& unit(int column) const {
    return columns_[base_.kept[static_cast<std::size_t>(column)]].unit;
  }
  /// "Izz1 + Iyy2 + 0.375 m3".
  const std::string& expression(int column) const {
    return base_.expressions[static_cast<std::size_t>(column)];
  }
  /// Rows for each joint, m × p_j, also those that do not count.
  BaseRows rows(const Motion& motion) const;
  /// Torque of these rows, m × n.
  /// @param beta  b or more values; those beyond are not looked at
  Eigen::MatrixXd torque(const BaseRows& rows, const Eigen::VectorXd& beta) const {
    return torque(rows, beta, 0, rows.front().rows());
  }
  /// The same of some of the rows.
  Eigen::MatrixXd torque(const BaseRows& rows, const Eigen::VectorXd& beta, Eigen::Index begin,
                         Eigen::Index count) const;
  /// The robot nearest to the given one that has these base parameters. A rotor inertia that no motion tells from the
  /// links' stays the given one.
  model::Robot robot(const Eigen::VectorXd& beta) const;
  /// Base parameters of a robot, b.
  Eigen::VectorXd parameters(const model::Robot& robot) const {
    return base_.regrouping * columns_.values(robot);
  }
  /// The fit of identify to logs, b: its rows, weights and regularisation.
  Eigen::VectorXd identified(const std::vector<data::Log>& logs) const;
  /// The same of rows, b.
  Eigen::VectorXd identified(regression::BlockFactors rows) const;
  /// The rows of that fit in parts, of which any may be left out.
  /// @param part  number of the part that a log's row at a time [s, of the log] belongs to, 0 to `parts` - 1
  regression::BlockFactors rows_in_parts(const std::vector<data::Log>& logs, int parts,
                                         const std::function<int(int log, double time)>& part) const;
  /// Base parameters of the given robot, b; friction 0.
  Eigen::VectorXd prior() const;
  /// What ten parameters of a link add to the base parameters, b × 10.
  Eigen::MatrixXd link_share(int link) const;
  /// What links' parameters may change by without any base parameter changing, 10 n × r.
  Eigen::MatrixXd hidden_masses() const;
  /// Columns of k quantities that add to the base parameters, of each joint m × k.
  /// @param share  b × k, what each adds
  std::vector<Eigen::MatrixXd> columns_of(const BaseRows& rows, const Eigen::MatrixXd& share) const;

 private:
  void put_motor_columns(const Motion& motion, std::size_t joint, Eigen::Index first, Eigen::Index count,
                         Eigen::MatrixXd& rows) const;

  regression::RegressionColumns columns_;
  regression::BaseParameters base_;
  std::vector<std::vector<int>> places_;
  std::vector<int> coulomb_, viscous_, rotor_, offset_;
};

}  // namespace heft::diagnose
