/// The adapters of tools/ros2, compiled against the shape of the published interfaces (test/ros2/stub) and driven as their hosts do.
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cycle/arm_run.hpp"
#include "dynamics_controller.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "inverse_dynamics_solver/exceptions.hpp"
#include "inverse_dynamics_solver_heft.hpp"
#include "support/allocation_counter.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using controller_interface::CallbackReturn;
using controller_interface::return_type;
using heft_dynamics_controller::DynamicsController;
using heft_inverse_dynamics_solver::InverseDynamicsSolverHeft;
using test::ArmRun;
using ::testing::HasSubstr;

std::string ur5e_text() { return host::read_file(urdf::resolve_robot("ur5e"), "URDF"); }

/// The controller between stand-ins of the manager, the controller before and the hardware.
class Loop {
 public:
  explicit Loop(const std::map<std::string, rclcpp::Parameter::Value>& parameters) {
    EXPECT_EQ(controller.stub_init("dynamics", ur5e_text()), CallbackReturn::SUCCESS);
    for (const auto& [name, value] : parameters) controller.get_node()->declare_parameter(name, value);
    configured = controller.on_configure({});
    if (configured != CallbackReturn::SUCCESS) return;
    states = std::vector<double>(controller.state_interface_configuration().names.size(), 0.0);
    commands = std::vector<double>(controller.command_interface_configuration().names.size(), 0.0);
    for (std::size_t k = 0; k < states.size(); ++k)
      state_handles.emplace_back("", controller.state_interface_configuration().names[k], &states[k]);
    for (std::size_t k = 0; k < commands.size(); ++k)
      command_handles.emplace_back("", controller.command_interface_configuration().names[k], &commands[k]);
    references = controller.stub_references();
    shown = controller.stub_states();
    controller.assign_interfaces({command_handles.begin(), command_handles.end()},
                                 {state_handles.begin(), state_handles.end()});
    EXPECT_EQ(controller.on_activate({}), CallbackReturn::SUCCESS);
  }

  void measure(const ArmRun::Sample& sample) {
    for (std::size_t i = 0; i < sample.q.size(); ++i) {
      states[3 * i] = sample.q[i];
      states[3 * i + 1] = sample.qd[i];
      states[3 * i + 2] = sample.tau[i];
    }
  }
  void refer(const ArmRun::Motion& motion) {
    for (Eigen::Index i = 0; i < motion.q.size(); ++i) {
      const auto at = static_cast<std::size_t>(3 * i);
      *references[at].stub_value() = motion.q[i];
      *references[at + 1].stub_value() = motion.qd[i];
      *references[at + 2].stub_value() = motion.qdd[i];
    }
  }
  return_type step() { return controller.update(rclcpp::Time(), rclcpp::Duration(ArmRun::kPeriod)); }

  DynamicsController controller;
  CallbackReturn configured{CallbackReturn::ERROR};
  std::vector<double> states, commands;
  std::vector<hardware_interface::StateInterface> state_handles, shown;
  std::vector<hardware_interface::CommandInterface> command_handles, references;
};

TEST(DynamicsController, CommandsTheModelsTorqueAndShowsTheLoad) {
  Loop loop({{"kp", std::vector<double>{100.0}}});
  ASSERT_EQ(loop.configured, CallbackReturn::SUCCESS) << stub::last_error();
  EXPECT_EQ(loop.controller.command_interface_configuration().names.front(), "shoulder_pan_joint/effort");
  EXPECT_EQ(loop.controller.state_interface_configuration().names[2], "shoulder_pan_joint/effort");
  EXPECT_EQ(loop.references.front().get_name(), "dynamics/shoulder_pan_joint/position");
  EXPECT_EQ(loop.shown.front().get_name(), "dynamics/load/mass");

  const model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur5e"));
  model::Robot loaded = robot;
  loaded.joints.back().link[0] += 2.0;
  ArmRun empty_run(robot), run(loaded);
  const ArmRun::Motion reference = ArmRun::motion(0.3, 6);
  loop.measure(empty_run.next());
  loop.refer(reference);
  ASSERT_EQ(loop.step(), return_type::OK);
  const Eigen::VectorXd torque =
      model::Dynamics(robot).joint_torque(reference.q, reference.qd, reference.qdd, 0.02);
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_NEAR(loop.commands[at], torque[i] + 100.0 * (reference.q[i] - loop.states[3 * at]), 1e-9);
  }

  test::AllocationCount spent;
  for (int k = 0; k < 5000; ++k) {
    loop.measure(run.next());
    const test::AllocationCount before = test::allocation_count();
    ASSERT_EQ(loop.step(), return_type::OK);
    const test::AllocationCount now = test::allocation_count() - before;
    spent.operator_new += now.operator_new;
    spent.malloc += now.malloc;
  }
  if (test::allocations_are_counted()) {
    EXPECT_EQ(spent, test::AllocationCount{});
  }
  EXPECT_NEAR(*loop.shown[0].stub_value(), 2.0, 0.1);
  EXPECT_EQ(*loop.shown[1].stub_value(), 1.0) << "the load is known";
  EXPECT_EQ(*loop.shown[2].stub_value(), 0.0);
}

TEST(DynamicsController, WritesNothingOnWhatIsNotFinite) {
  Loop loop({});
  ASSERT_EQ(loop.configured, CallbackReturn::SUCCESS) << stub::last_error();
  ArmRun run(urdf::load_urdf(urdf::resolve_robot("ur5e")));
  loop.commands.assign(6, 7.0);
  loop.measure(run.next());
  EXPECT_EQ(loop.step(), return_type::ERROR) << "no reference yet";
  loop.refer(ArmRun::motion(0.0, 6));
  loop.measure(run.next());
  loop.states[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(loop.step(), return_type::ERROR);
  EXPECT_EQ(loop.commands, std::vector<double>(6, 7.0));
  loop.measure(run.next());
  EXPECT_EQ(loop.step(), return_type::OK);
  EXPECT_NE(loop.commands, std::vector<double>(6, 7.0));
}

TEST(DynamicsController, SaysWhatIsWrongWithItsParameters) {
  EXPECT_EQ(Loop({{"model", std::string("/none/arm.json")}}).configured, CallbackReturn::ERROR);
  EXPECT_THAT(stub::last_error(), HasSubstr("/none/arm.json"));
  EXPECT_EQ(Loop({{"kp", std::vector<double>{1, 2}}}).configured, CallbackReturn::ERROR);
  EXPECT_THAT(stub::last_error(), HasSubstr("parameter kp: found 2 numbers; expected 1 or 6"));
  EXPECT_EQ(Loop({{"joints", std::vector<std::string>{"a"}}}).configured, CallbackReturn::ERROR);
  EXPECT_THAT(stub::last_error(), HasSubstr("parameter joints: found 1 names; expected 6"));
}

/// Parameters of a node.
class Parameters : public rclcpp::node_interfaces::NodeParametersInterface {
 public:
  explicit Parameters(std::map<std::string, std::string> values) : values_(std::move(values)) {}
  bool has_parameter(const std::string& name) const override { return values_.contains(name); }
  bool get_parameter(const std::string& name, rclcpp::Parameter& parameter) const override {
    if (!has_parameter(name)) return false;
    parameter = rclcpp::Parameter(values_.at(name));
    return true;
  }

 private:
  std::map<std::string, std::string> values_;
};

TEST(InverseDynamicsSolver, AddsUpToTheTorqueOfTheMotors) {
  const test::TemporaryFolder folder;
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur5e"));
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.2, 3.0, 1.5, 0.1};
  model::write_model(folder.path("arm.json"), model::make_model(robot));
  const auto parameters = std::make_shared<Parameters>(std::map<std::string, std::string>{
      {"solver.model", folder.path("arm.json")}, {"robot_description", ur5e_text()}});
  const std::unique_ptr<inverse_dynamics_solver::InverseDynamicsSolver> solver =
      std::make_unique<InverseDynamicsSolverHeft>();
  solver->initialize(parameters, "solver");
  const model::Dynamics truth(robot);
  for (int k = 0; k < 20; ++k) {
    const ArmRun::Motion m = ArmRun::motion(0.1 * k, 6);
    const Eigen::VectorXd motors = solver->getTorques(m.q, m.qd, m.qdd) + solver->getFrictionVector(m.qd);
    EXPECT_LT((motors - truth.joint_torque(m.q, m.qd, m.qdd, 0.02)).cwiseAbs().maxCoeff(), 1e-9);
    const auto [inertia, coriolis, gravity] = solver->getDynamicParameters(m.q, m.qd);
    EXPECT_LT((inertia - inertia.transpose()).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((gravity - truth.gravity_torque(m.q)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(InverseDynamicsSolver, RefusesAsItsInterfaceSays) {
  InverseDynamicsSolverHeft solver;
  EXPECT_THROW(solver.getGravityVector(Eigen::VectorXd::Zero(6)),
               inverse_dynamics_solver::UninitializedException);
  EXPECT_THROW(solver.initialize(nullptr, "", ""), inverse_dynamics_solver::ParameterUninitializedException);
  EXPECT_THROW(solver.initialize(nullptr, "", "<robot"),
               inverse_dynamics_solver::InvalidParameterValueException);
  solver.initialize(nullptr, "", ur5e_text());
  EXPECT_THROW(solver.getGravityVector(Eigen::VectorXd::Zero(5)), std::invalid_argument);
  EXPECT_EQ(solver.getGravityVector(Eigen::VectorXd::Zero(6)).size(), 6);
}

TEST(Packages, NameTheirPluginsAndSayThatTheyHaveNotRunOnARobot) {
  const std::string folder = std::string(HEFT_SOURCE_DIR) + "/tools/ros2/";
  const std::map<std::string, std::string> plugins{
      {"heft_dynamics_controller", "heft_dynamics_controller::DynamicsController"},
      {"heft_inverse_dynamics_solver", "heft_inverse_dynamics_solver::InverseDynamicsSolverHeft"}};
  for (const auto& [package, type] : plugins) {
    const auto file = [&, name = package](const std::string& of) {
      return host::read_file(folder + name + "/" + of, "package");
    };
    EXPECT_THAT(file(package + ".xml"), HasSubstr("type=\"" + type + "\""));
    EXPECT_THAT(file("package.xml"), HasSubstr("<name>" + package + "</name>"));
    EXPECT_THAT(file("CMakeLists.txt"), HasSubstr(" " + package + ".xml)"));
    EXPECT_THAT(file("README.md"), HasSubstr("It has not been run on a robot."));
  }
}

}  // namespace
}  // namespace heft
