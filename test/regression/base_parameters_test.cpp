// Base parameters: how many there are, that they give the same torque, and how they are written.
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/QR>

#include "heft/regression/base_parameters.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::regression {
namespace {

model::Robot robot_named(const std::string& name) {
  return urdf::load_urdf(std::string(HEFT_URDF_DIR) + "/" + name + ".urdf");
}

ModelStructure rigid_only() {
  ModelStructure structure;
  structure.rotor_inertia = structure.coulomb = structure.viscous = structure.offset = false;
  return structure;
}

Eigen::VectorXd random_vector(Eigen::Index size, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd v(size);
  for (Eigen::Index i = 0; i < size; ++i) v[i] = normal(random);
  return v;
}

TEST(BaseParameters, AreAsManyAsTheLiteratureCounts) {
  // 36 for a UR (parallel axes 2, 3, 4; first axis along gravity), 43 for a seven-joint arm with alternating
  // axes: stated with the measured logs of those robots by their sources.
  for (const auto& [name, count] : {std::pair{"ur10e", 36}, std::pair{"ur5", 36}, std::pair{"panda", 43}}) {
    const RegressionColumns columns(robot_named(name), rigid_only());
    const BaseParameters base = find_base_parameters(columns);
    EXPECT_EQ(base.count(), count) << name;
    EXPECT_GT(base.gap, 1e4) << name;
  }
}

TEST(BaseParameters, GiveTheTorqueOfAllParametersOnEveryRobot) {
  for (const char* name : {"kawasaki6r", "ur5", "ur5e", "ur10e", "panda", "scara"}) {
    ModelStructure structure;
    if (std::string(name) == "ur10e") structure.couplings.push_back({4, 5, 0.7, 0, 0, 0});
    const RegressionColumns columns(robot_named(name), structure);
    const BaseParameters base = find_base_parameters(columns);
    std::mt19937_64 random(7);
    for (int state = 0; state < 50; ++state) {
      const Eigen::Index n = columns.num_joints();
      const Eigen::MatrixXd Y =
          columns.regressor(random_vector(n, random), random_vector(n, random), random_vector(n, random));
      const Eigen::VectorXd x = random_vector(columns.count(), random);
      const Eigen::VectorXd beta = base.regrouping * x;
      Eigen::VectorXd torque = Eigen::VectorXd::Zero(n);
      for (int k = 0; k < base.count(); ++k)
        torque += Y.col(base.kept[static_cast<std::size_t>(k)]) * beta[k];
      EXPECT_LT((torque - Y * x).norm(), 1e-10 * (Y * x).norm()) << name;
    }
  }
}

TEST(BaseParameters, AreIndependent) {
  const RegressionColumns columns(robot_named("ur10e"), {});
  const BaseParameters base = find_base_parameters(columns);
  std::mt19937_64 random(11);
  Eigen::MatrixXd W(6 * 100, base.count());
  for (int s = 0; s < 100; ++s) {
    const Eigen::MatrixXd Y =
        columns.regressor(random_vector(6, random), random_vector(6, random), random_vector(6, random));
    for (int k = 0; k < base.count(); ++k)
      W.block(6 * s, k, 6, 1) = Y.col(base.kept[static_cast<std::size_t>(k)]);
  }
  W = W * W.colwise().norm().cwiseInverse().asDiagonal();
  EXPECT_EQ(Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(W).rank(), base.count());
}

/// Two links of length 0.5 m turning about parallel horizontal axes.
model::Robot planar_arm() {
  model::Robot robot;
  robot.name = "planar";
  robot.joints.resize(2);
  for (model::RobotJoint& joint : robot.joints) joint.joint.axis = {0.0, 1.0, 0.0};
  robot.joints[1].joint.position = {0.5, 0.0, 0.0};
  return robot;
}

TEST(BaseParameters, OfAPlanarArmAreTheTextbooks) {
  // Rotation about y: inertia Iyy and the first moments x, z count. Link 2 moves link 1's pivot by l = 0.5:
  // Iyy1 + l² m2, mcx1 + l m2, mcz1, Iyy2, mcx2, mcz2.
  const RegressionColumns columns(planar_arm(), rigid_only());
  const BaseParameters base = find_base_parameters(columns);
  EXPECT_THAT(base.expressions, testing::UnorderedElementsAre("Iyy1 + 0.25 m2", "mcx1 + 0.5 m2", "mcz1",
                                                              "Iyy2", "mcx2", "mcz2"));
  EXPECT_THAT(base.null_space, testing::Contains("the mass of link 1 moves no torque"));
  EXPECT_THAT(base.null_space, testing::Contains("the mass of link 2 is felt only together with mcx1, Iyy1"));
}

TEST(BaseParameters, FoldTheFirstJointsRotorIntoItsLink) {
  const RegressionColumns columns(planar_arm(), {});
  const BaseParameters base = find_base_parameters(columns);
  EXPECT_THAT(base.expressions, testing::Contains("Iyy1 + 0.25 m2 + Ia1"));
  EXPECT_THAT(base.null_space,
              testing::Contains("the rotor inertia of joint 1 is felt only together with Iyy1"));
}

TEST(BaseParameters, DependOnHowTheBaseStands) {
  // A first axis along gravity hides the first link's first moments; a wall mount shows them.
  model::Robot robot = robot_named("ur5");
  const int upright = find_base_parameters(RegressionColumns(robot, rigid_only())).count();
  robot.gravity = {9.81, 0.0, 0.0};
  const int wall = find_base_parameters(RegressionColumns(robot, rigid_only())).count();
  EXPECT_EQ(wall, upright + 2);
}

TEST(RegressionColumns, TimesTheRobotsValuesIsTheJointTorque) {
  model::Robot robot = robot_named("panda");
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> some(0.1, 1.0);
  for (model::RobotJoint& joint : robot.joints)
    joint.actuation = {some(random), some(random), some(random), some(random)};
  robot.couplings.push_back({2, 5, -1.5, 0.02, 0.3, 0.4});
  ModelStructure structure;
  structure.couplings = robot.couplings;
  const RegressionColumns columns(robot, structure);
  const model::Dynamics dynamics(robot);
  const Eigen::VectorXd x = columns.values(robot);
  for (int state = 0; state < 20; ++state) {
    const Eigen::VectorXd q = random_vector(7, random), qd = random_vector(7, random),
                          qdd = random_vector(7, random);
    const Eigen::VectorXd tau = dynamics.joint_torque(q, qd, qdd);
    EXPECT_LT((columns.regressor(q, qd, qdd) * x - tau).norm(), 1e-12 * tau.norm());
  }
  model::Robot copy = robot_named("panda");
  columns.apply(x, copy);
  EXPECT_EQ(columns.values(copy), x);
}

}  // namespace
}  // namespace heft::regression
