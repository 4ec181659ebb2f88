#include "dynamics_controller.hpp"

#include <algorithm>
#include <limits>

#include "pluginlib/class_list_macros.hpp"

namespace heft_dynamics_controller {
namespace {

using controller_interface::CallbackReturn;
using controller_interface::return_type;

constexpr const char* kStates[] = {"position", "velocity", "effort"};
constexpr const char* kReferences[] = {"position", "velocity", "acceleration"};
constexpr const char* kShown[] = {"load/mass", "load/known", "contact/detected", "contact/joint"};

controller_interface::InterfaceConfiguration individual(std::vector<std::string> names) {
  return {controller_interface::interface_configuration_type::INDIVIDUAL, std::move(names)};
}

}  // namespace

CallbackReturn DynamicsController::on_init() {
  auto_declare<std::string>("urdf", "");
  auto_declare<std::string>("model", "");
  auto_declare<std::string>("base_link", "");
  auto_declare<std::string>("tip_link", "");
  auto_declare<bool>("torque_behind_gears", false);
  auto_declare<bool>("follow_load", true);
  auto_declare<std::vector<std::string>>("joints", {});
  auto_declare<std::vector<double>>("kp", {0.0});
  auto_declare<std::vector<double>>("kd", {0.0});
  return CallbackReturn::SUCCESS;
}

CallbackReturn DynamicsController::on_configure(const rclcpp_lifecycle::State&) {
  const auto node = get_node();
  heft::cycle::Parameters parameters;
  parameters.urdf = node->get_parameter("urdf").as_string();
  parameters.model = node->get_parameter("model").as_string();
  parameters.base_link = node->get_parameter("base_link").as_string();
  parameters.tip_link = node->get_parameter("tip_link").as_string();
  parameters.torque_behind_gears = node->get_parameter("torque_behind_gears").as_bool();
  parameters.follow_load = node->get_parameter("follow_load").as_bool();
  if (parameters.urdf.empty() && parameters.model.empty()) parameters.urdf = get_robot_description();
  if (cycle_.configure(parameters) != heft::Status::kOk) {
    RCLCPP_ERROR(node->get_logger(), "%s", cycle_.message().c_str());
    return CallbackReturn::ERROR;
  }
  const auto n = static_cast<std::size_t>(cycle_.num_joints());
  joints_ = node->get_parameter("joints").as_string_array();
  if (joints_.empty()) joints_ = cycle_.joint_names();
  if (joints_.size() != n) {
    RCLCPP_ERROR(node->get_logger(),
                 "parameter joints: found %zu names; expected %zu, as the model has joints", joints_.size(),
                 n);
    return CallbackReturn::ERROR;
  }
  if (!gains("kp", kp_) || !gains("kd", kd_)) return CallbackReturn::ERROR;
  for (std::vector<double>* values : {&q_, &qd_, &tau_, &q_ref_, &qd_ref_, &qdd_ref_, &command_})
    values->assign(n, 0.0);
  return CallbackReturn::SUCCESS;
}

bool DynamicsController::gains(const std::string& name, std::vector<double>& values) {
  values = get_node()->get_parameter(name).as_double_array();
  if (values.size() == 1) values.assign(joints_.size(), values.front());
  if (values.size() == joints_.size()) return true;
  RCLCPP_ERROR(get_node()->get_logger(), "parameter %s: found %zu numbers; expected 1 or %zu, one a joint",
               name.c_str(), values.size(), joints_.size());
  return false;
}

CallbackReturn DynamicsController::on_activate(const rclcpp_lifecycle::State&) {
  cycle_.reset();
  // Until the controller before says where to go there is no reference.
  std::fill(reference_interfaces_.begin(), reference_interfaces_.end(),
            std::numeric_limits<double>::quiet_NaN());
  return CallbackReturn::SUCCESS;
}

controller_interface::InterfaceConfiguration DynamicsController::command_interface_configuration() const {
  std::vector<std::string> names;
  for (const std::string& joint : joints_) names.push_back(joint + "/effort");
  return individual(std::move(names));
}

controller_interface::InterfaceConfiguration DynamicsController::state_interface_configuration() const {
  std::vector<std::string> names;
  for (const std::string& joint : joints_) {
    for (const char* state : kStates) names.push_back(joint + "/" + state);
  }
  return individual(std::move(names));
}

std::vector<hardware_interface::CommandInterface> DynamicsController::on_export_reference_interfaces() {
  reference_interfaces_.assign(std::size(kReferences) * joints_.size(),
                               std::numeric_limits<double>::quiet_NaN());
  std::vector<hardware_interface::CommandInterface> interfaces;
  std::size_t at = 0;
  for (const std::string& joint : joints_) {
    for (const char* reference : kReferences)
      interfaces.emplace_back(get_node()->get_name(), joint + "/" + reference, &reference_interfaces_[at++]);
  }
  return interfaces;
}

std::vector<hardware_interface::StateInterface> DynamicsController::on_export_state_interfaces() {
  state_interfaces_values_.assign(std::size(kShown), 0.0);
  std::vector<hardware_interface::StateInterface> interfaces;
  for (std::size_t k = 0; k < std::size(kShown); ++k)
    interfaces.emplace_back(get_node()->get_name(), kShown[k], &state_interfaces_values_[k]);
  return interfaces;
}

return_type DynamicsController::update_reference_from_subscribers(const rclcpp::Time&,
                                                                  const rclcpp::Duration&) {
  return return_type::OK;  // the reference comes from another controller alone
}

bool DynamicsController::read_states() {
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    double* const values[] = {&q_[i], &qd_[i], &tau_[i]};
    for (std::size_t k = 0; k < std::size(kStates); ++k) {
      const auto value = state_interfaces_[std::size(kStates) * i + k].get_optional();
      if (!value) return false;
      *values[k] = *value;
    }
  }
  return true;
}

return_type DynamicsController::update_and_write_commands(const rclcpp::Time&,
                                                          const rclcpp::Duration& period) {
  const double dt = period.seconds();
  // A state that is locked or not finite for one cycle costs the estimate that sample. It costs the command too: without a
  // position nothing can be fed back.
  if (!read_states() || cycle_.update(q_, qd_, tau_, dt, output_) != heft::Status::kOk)
    return return_type::ERROR;
  for (std::size_t k = 0; k < state_interfaces_values_.size(); ++k) {
    const double shown[] = {output_.mass, output_.load_state == heft::LoadState::kKnown ? 1.0 : 0.0,
                            output_.contact ? 1.0 : 0.0, static_cast<double>(output_.contact_joint)};
    state_interfaces_values_[k] = shown[k];
  }
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    q_ref_[i] = reference_interfaces_[3 * i];
    qd_ref_[i] = reference_interfaces_[3 * i + 1];
    qdd_ref_[i] = reference_interfaces_[3 * i + 2];
  }
  // A reference that is not finite is refused, and no command is written.
  if (cycle_.inverse_dynamics(q_ref_, qd_ref_, qdd_ref_, dt, command_) != heft::Status::kOk)
    return return_type::ERROR;
  bool written = true;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const double effort = command_[i] + kp_[i] * (q_ref_[i] - q_[i]) + kd_[i] * (qd_ref_[i] - qd_[i]);
    written = command_interfaces_[i].set_value(effort) && written;
  }
  return written ? return_type::OK : return_type::ERROR;
}

}  // namespace heft_dynamics_controller

PLUGINLIB_EXPORT_CLASS(heft_dynamics_controller::DynamicsController,
                       controller_interface::ChainableControllerInterface)
