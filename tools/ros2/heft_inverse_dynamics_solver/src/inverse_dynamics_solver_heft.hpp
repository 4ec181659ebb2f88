// heft's model behind the interface of the package inverse_dynamics_solver.
#pragma once

#include <memory>
#include <string>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "inverse_dynamics_solver/inverse_dynamics_solver.hpp"

namespace heft_inverse_dynamics_solver {

// Parameters, in the namespace that initialize() is given: `model` (a model file; may be missing), `root` and `tip` (links of the
// chain; may be missing), as in heft::cycle::Parameters. The robot description is the argument, else the parameter
// `robot_description` of the node; without both the model file has to describe the whole robot.
//
// The inertia matrix has the rotors on its diagonal, so that inertia, Coriolis, gravity and friction together are the torque of the
// motors. Friction is what the velocity of a joint alone says: Coulomb, viscous, offset. Gear couplings and effects that depend on
// more (load, position, what was before) have no place in this interface; heft::cycle::Cycle has them.
class InverseDynamicsSolverHeft : public inverse_dynamics_solver::InverseDynamicsSolver {
 public:
  void initialize(rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr parameters_interface,
                  const std::string& param_namespace, const std::string& robot_description) override;
  Eigen::MatrixXd getInertiaMatrix(const Eigen::VectorXd& joint_positions) const override;
  Eigen::VectorXd getCoriolisVector(const Eigen::VectorXd& joint_positions,
                                    const Eigen::VectorXd& joint_velocities) const override;
  Eigen::VectorXd getGravityVector(const Eigen::VectorXd& joint_positions) const override;
  Eigen::VectorXd getFrictionVector(const Eigen::VectorXd& joint_velocities) const override;

 private:
  // Throws UninitializedException, or std::invalid_argument for another number of joints.
  const heft::model::Dynamics& checked(const Eigen::VectorXd& values) const;
  std::unique_ptr<heft::model::Dynamics> dynamics_;
};

}  // namespace heft_inverse_dynamics_solver
