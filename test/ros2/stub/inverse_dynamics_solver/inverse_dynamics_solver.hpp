// See test/ros2/stub/README.md.
#pragma once

#include <string>
#include <tuple>

#include <Eigen/Core>

#include "rclcpp/node_interfaces/node_parameters_interface.hpp"

namespace inverse_dynamics_solver {

class InverseDynamicsSolver {
 public:
  virtual ~InverseDynamicsSolver() = default;
  virtual void initialize(
      rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr parameters_interface = nullptr,
      const std::string& param_namespace = "", const std::string& robot_description = "") = 0;
  virtual std::tuple<Eigen::MatrixXd, Eigen::VectorXd, Eigen::VectorXd> getDynamicParameters(
      const Eigen::VectorXd& joint_positions, const Eigen::VectorXd& joint_velocities) const {
    return {getInertiaMatrix(joint_positions), getCoriolisVector(joint_positions, joint_velocities),
            getGravityVector(joint_positions)};
  }
  virtual Eigen::MatrixXd getInertiaMatrix(const Eigen::VectorXd& joint_positions) const = 0;
  virtual Eigen::VectorXd getCoriolisVector(const Eigen::VectorXd& joint_positions,
                                            const Eigen::VectorXd& joint_velocities) const = 0;
  virtual Eigen::VectorXd getGravityVector(const Eigen::VectorXd& joint_positions) const = 0;
  virtual Eigen::VectorXd getFrictionVector(const Eigen::VectorXd& joint_velocities) const = 0;
  virtual Eigen::VectorXd getTorques(const Eigen::VectorXd& joint_positions,
                                     const Eigen::VectorXd& joint_velocities,
                                     const Eigen::VectorXd& joint_accelerations) const {
    return getInertiaMatrix(joint_positions) * joint_accelerations +
           getCoriolisVector(joint_positions, joint_velocities) + getGravityVector(joint_positions);
  }

 protected:
  InverseDynamicsSolver() = default;
};

}  // namespace inverse_dynamics_solver
