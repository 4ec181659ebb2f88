#include "heft/model/kinematics.hpp"

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/model/sized.hpp"

namespace heft::model {

namespace {

/// All answers of a pose, in the base frame.
struct Answers {
  ToolPlacement tip;
  Eigen::MatrixXd J;
  Eigen::MatrixXd K;  // only when a wrench was given
};

}  // namespace

/// Core behind one virtual call, one instantiation a number of joints.
struct Kinematics::Impl {
  Impl(Robot r, const ToolFrame<double>& t) : robot(std::move(r)), tool(t) {}
  virtual ~Impl() = default;
  virtual void fill(const Eigen::VectorXd& q, const ToolWrench<double>* wrench, WrenchFrame frame,
                    Answers& answers) const = 0;
  Robot robot;
  ToolFrame<double> tool;
};

namespace {

template <int N, typename Base>
struct SizedKinematics final : Base {
  SizedKinematics(const Robot& r, const ToolFrame<double>& t) : Base(r, t), arm(to_arm_model<N>(r)) {}

  void fill(const Eigen::VectorXd& q, const ToolWrench<double>* wrench, WrenchFrame frame,
            Answers& answers) const override {
    const Eigen::Matrix<double, N, 1> position = q;
    const auto chain = chain_kinematics(arm, Base::tool, position);
    answers.tip.rotation = chain.rotation;
    answers.tip.position = chain.position;
    answers.J.resize(6, N);
    Eigen::Map<GeometricJacobian<double, N>>(answers.J.data()) = geometric_jacobian(chain);
    if (wrench != nullptr) {
      answers.K.resize(N, N);
      Eigen::Map<Eigen::Matrix<double, N, N>>(answers.K.data()) =
          heft::complementary_stiffness(chain, *wrench, frame);
    }
  }

  ArmModel<double, N> arm;
};

/// diag(R, R) v.
ToolWrench<double> turned(const Eigen::Matrix3d& R, const ToolWrench<double>& v) {
  ToolWrench<double> result;
  result.head<3>() = R * v.head<3>();
  result.tail<3>() = R * v.tail<3>();
  return result;
}

}  // namespace

Kinematics::Kinematics(const Robot& robot) : Kinematics(robot, tip_tool(robot)) {}
Kinematics::Kinematics(const Robot& robot, const ToolFrame<double>& tool)
    : impl_(with_joint_count(robot.num_joints(), robot.name, [&](auto n) -> std::unique_ptr<Impl> {
        return std::make_unique<SizedKinematics<n, Impl>>(robot, tool);
      })) {}
Kinematics::~Kinematics() = default;
Kinematics::Kinematics(Kinematics&&) noexcept = default;
Kinematics& Kinematics::operator=(Kinematics&&) noexcept = default;

int Kinematics::num_joints() const { return impl_->robot.num_joints(); }
const Robot& Kinematics::robot() const { return impl_->robot; }
const ToolFrame<double>& Kinematics::tool() const { return impl_->tool; }

ToolPlacement Kinematics::tip(const Eigen::VectorXd& q) const {
  Answers answers;
  impl_->fill(q, nullptr, WrenchFrame::kBase, answers);
  return answers.tip;
}

ToolPlacement Kinematics::tip_and_jacobian(const Eigen::VectorXd& q, Eigen::MatrixXd& J) const {
  Answers answers;
  impl_->fill(q, nullptr, WrenchFrame::kBase, answers);
  J = std::move(answers.J);
  return answers.tip;
}

Eigen::MatrixXd Kinematics::jacobian(const Eigen::VectorXd& q) const {
  Eigen::MatrixXd J;
  tip_and_jacobian(q, J);
  return J;
}

Eigen::MatrixXd Kinematics::jacobian_in_tool(const Eigen::VectorXd& q) const {
  Eigen::MatrixXd J;
  const Eigen::Matrix3d R = tip_and_jacobian(q, J).rotation;
  for (Eigen::Index j = 0; j < J.cols(); ++j) J.col(j) = turned(R.transpose(), J.col(j));
  return J;
}

Eigen::MatrixXd Kinematics::complementary_stiffness(const Eigen::VectorXd& q,
                                                    const ToolWrench<double>& wrench,
                                                    WrenchFrame frame) const {
  Answers answers;
  impl_->fill(q, &wrench, frame, answers);
  return answers.K;
}

Eigen::VectorXd Kinematics::joint_torque(const Eigen::VectorXd& q, const ToolWrench<double>& wrench,
                                         WrenchFrame frame) const {
  Eigen::MatrixXd J;
  const Eigen::Matrix3d R = tip_and_jacobian(q, J).rotation;
  const ToolWrench<double> in_base = frame == WrenchFrame::kTool ? turned(R, wrench) : wrench;
  return J.transpose() * in_base;
}

ToolFrame<double> tip_tool(const Robot& robot) { return {robot.tip_rotation, robot.tip_position}; }

ToolFrame<double> tool_beyond_tip(const Robot& robot, const Eigen::Vector3d& point) {
  ToolFrame<double> tool = tip_tool(robot);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      tool.position[i] += robot.tip_rotation[3 * i + k] * point[static_cast<Eigen::Index>(k)];
    }
  }
  return tool;
}

Robot make_standard_dh_robot(const std::string& name, const std::vector<DenavitHartenberg<double>>& table) {
  if (table.empty()) {
    throw ModelError(
        fmt::format("robot \"{}\": its Denavit-Hartenberg table has no row; a joint needs one", name));
  }
  Robot robot;
  robot.name = name;
  robot.base_link = "base";
  for (std::size_t i = 0; i < table.size(); ++i) {
    // A joint's placement depends on its own row and the one before.
    const auto pair = make_standard_dh_arm<double, 2>({table[i == 0 ? i : i - 1], table[i]}, {});
    RobotJoint joint;
    joint.name = fmt::format("joint{}", i + 1);
    joint.link_name = fmt::format("link{}", i + 1);
    joint.joint = pair.joints[i == 0 ? 0 : 1];
    robot.joints.push_back(joint);
  }
  robot.tip_link = robot.joints.back().link_name;
  robot.tip_position = standard_dh_tool(table.back()).position;
  return robot;
}

}  // namespace heft::model
