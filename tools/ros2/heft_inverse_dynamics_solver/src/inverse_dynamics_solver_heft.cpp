#include "inverse_dynamics_solver_heft.hpp"

#include <stdexcept>

#include "heft/cycle/cycle.hpp"
#include "heft/host/error.hpp"
#include "heft/model/without_effects.hpp"
#include "inverse_dynamics_solver/exceptions.hpp"
#include "pluginlib/class_list_macros.hpp"

namespace heft_inverse_dynamics_solver {
namespace {

// Width of friction's sign, so that a joint at rest has none [rad/s, m/s].
constexpr double kSignWidth = 0.02;

std::string text_parameter(const rclcpp::node_interfaces::NodeParametersInterface* parameters,
                           const std::string& name) {
  rclcpp::Parameter parameter;
  return parameters != nullptr && parameters->get_parameter(name, parameter) ? parameter.as_string()
                                                                             : std::string();
}

}  // namespace

void InverseDynamicsSolverHeft::initialize(
    rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr parameters_interface,
    const std::string& param_namespace, const std::string& robot_description) {
  const std::string in = param_namespace.empty() ? "" : param_namespace + ".";
  const auto* const given = parameters_interface.get();
  heft::cycle::Parameters parameters;
  parameters.urdf =
      robot_description.empty() ? text_parameter(given, "robot_description") : robot_description;
  parameters.model = text_parameter(given, in + "model");
  parameters.base_link = text_parameter(given, in + "root");
  parameters.tip_link = text_parameter(given, in + "tip");
  if (parameters.urdf.empty() && parameters.model.empty()) {
    throw inverse_dynamics_solver::ParameterUninitializedException(
        "'robot_description' and '" + in +
        "model' are both missing; heft_inverse_dynamics_solver needs one of them");
  }
  try {
    dynamics_ = std::make_unique<heft::model::Dynamics>(
        heft::model::without_effects(heft::cycle::robot_of(parameters)));
  } catch (const heft::Error& error) {
    throw inverse_dynamics_solver::InvalidParameterValueException(error.what());
  }
}

const heft::model::Dynamics& InverseDynamicsSolverHeft::checked(const Eigen::VectorXd& values) const {
  if (!dynamics_) throw inverse_dynamics_solver::UninitializedException();
  if (values.size() != dynamics_->num_joints()) {
    throw std::invalid_argument("found " + std::to_string(values.size()) + " values; expected " +
                                std::to_string(dynamics_->num_joints()) + ", one a joint");
  }
  return *dynamics_;
}

Eigen::MatrixXd InverseDynamicsSolverHeft::getInertiaMatrix(const Eigen::VectorXd& joint_positions) const {
  const heft::model::Dynamics& dynamics = checked(joint_positions);
  Eigen::MatrixXd inertia = dynamics.mass_matrix(joint_positions);
  for (Eigen::Index i = 0; i < inertia.rows(); ++i)
    inertia(i, i) += dynamics.robot().joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  return inertia;
}

Eigen::VectorXd InverseDynamicsSolverHeft::getCoriolisVector(const Eigen::VectorXd& joint_positions,
                                                             const Eigen::VectorXd& joint_velocities) const {
  const heft::model::Dynamics& dynamics = checked(joint_positions);
  checked(joint_velocities);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(joint_positions.size());
  return dynamics.inverse_dynamics(joint_positions, joint_velocities, rest) -
         dynamics.gravity_torque(joint_positions);
}

Eigen::VectorXd InverseDynamicsSolverHeft::getGravityVector(const Eigen::VectorXd& joint_positions) const {
  return checked(joint_positions).gravity_torque(joint_positions);
}

Eigen::VectorXd InverseDynamicsSolverHeft::getFrictionVector(const Eigen::VectorXd& joint_velocities) const {
  const heft::model::Dynamics& dynamics = checked(joint_velocities);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(joint_velocities.size());
  return dynamics.joint_torque(rest, joint_velocities, rest, kSignWidth) -
         dynamics.inverse_dynamics(rest, joint_velocities, rest);
}

}  // namespace heft_inverse_dynamics_solver

PLUGINLIB_EXPORT_CLASS(heft_inverse_dynamics_solver::InverseDynamicsSolverHeft,
                       inverse_dynamics_solver::InverseDynamicsSolver)
