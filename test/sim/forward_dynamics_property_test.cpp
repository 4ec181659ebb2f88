// Forward dynamics against core's inverse dynamics, which is written apart from it.
#include "heft/sim/forward_dynamics.hpp"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/model/dynamics.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// An arm with random geometry: axes in any direction, about a third of the joints prismatic.
model::Robot random_arm(int n, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  model::Robot robot;
  robot.name = "random";
  robot.gravity = {3.0 * u(random), 3.0 * u(random), 9.81 * u(random)};
  for (int i = 0; i < n; ++i) {
    const JointType type = u(random) < -0.3 ? JointType::kPrismatic : JointType::kRevolute;
    const Vector3d axis = Vector3d(u(random), u(random), u(random)).normalized();
    const Matrix3d root = 0.1 * Matrix3d::NullaryExpr([&] { return u(random); });
    // A random mass distribution: covariance S gives the inertia tr(S) 1 − S.
    const Matrix3d S = root * root.transpose() + 1e-3 * Matrix3d::Identity();
    const double m = 1.5 + u(random);
    const Matrix3d I = m * (S.trace() * Matrix3d::Identity() - S);
    model::RobotJoint joint = test::make_joint(
        "joint" + std::to_string(i + 1), type, {0.4 * u(random), 0.4 * u(random), 0.4 * u(random)},
        test::roll_pitch_yaw(3.0 * u(random), 3.0 * u(random), 3.0 * u(random)),
        {axis.x(), axis.y(), axis.z()},
        test::body(m, {0.2 * u(random), 0.2 * u(random), 0.2 * u(random)},
                   {I(0, 0), I(0, 1), I(1, 1), I(0, 2), I(1, 2), I(2, 2)}));
    joint.actuation.rotor_inertia = u(random) > 0.0 ? 0.05 : 0.0;
    robot.joints.push_back(joint);
  }
  return robot;
}

std::vector<model::Robot> arms() {
  std::mt19937 random(20240611);
  std::vector<model::Robot> robots{test::planar_two_link(), test::scara_arm(), test::six_joint_arm()};
  robots.back().gravity = {1.2, -3.4, -9.0};
  for (int n : {1, 3, 6, 7, 9}) robots.push_back(random_arm(n, random));
  return robots;
}

VectorXd rotor_inertia(const model::Robot& robot) {
  VectorXd rotor(robot.num_joints());
  for (int i = 0; i < robot.num_joints(); ++i) {
    rotor[i] = robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  }
  return rotor;
}

struct State {
  VectorXd q, qd, tau;
};

State random_state(int n, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  State s{VectorXd(n), VectorXd(n), VectorXd(n)};
  for (int i = 0; i < n; ++i) {
    s.q[i] = 3.0 * u(random);
    s.qd[i] = 2.0 * u(random);
    s.tau[i] = 20.0 * u(random);
  }
  return s;
}

TEST(ForwardDynamicsProperty, InverseDynamicsReturnsTheTorque) {
  std::mt19937 random(1);
  for (const model::Robot& robot : arms()) {
    const ForwardDynamics forward(robot);
    const model::Dynamics inverse(robot);
    const VectorXd rotor = rotor_inertia(robot);
    for (int k = 0; k < 200; ++k) {
      const State s = random_state(robot.num_joints(), random);
      const VectorXd qdd = forward.acceleration(s.q, s.qd, s.tau);
      const VectorXd tau = inverse.inverse_dynamics(s.q, s.qd, qdd) + rotor.cwiseProduct(qdd);
      EXPECT_LT((tau - s.tau).norm(), 1e-10 * s.tau.norm())
          << robot.name << " with " << robot.num_joints() << " joints at q = " << s.q.transpose();
    }
  }
}

TEST(ForwardDynamicsProperty, AnAttachedBodyEqualsAHeavierLastLink) {
  std::mt19937 random(2);
  Body body;
  body.mass = 1.7;
  body.com = {0.05, -0.12, 0.2};
  body.inertia << 0.02, 0.001, -0.002, 0.001, 0.03, 0.003, -0.002, 0.003, 0.025;
  const InertialParameters<double> added = inertial_parameters(body);
  for (const model::Robot& robot : arms()) {
    ForwardDynamics forward(robot);
    forward.attach(body);
    model::Robot heavier = robot;
    for (std::size_t k = 0; k < added.size(); ++k) heavier.joints.back().link[k] += added[k];
    const model::Dynamics inverse(heavier);
    const VectorXd rotor = rotor_inertia(robot);
    const State s = random_state(robot.num_joints(), random);
    const VectorXd qdd = forward.acceleration(s.q, s.qd, s.tau);
    const VectorXd tau = inverse.inverse_dynamics(s.q, s.qd, qdd) + rotor.cwiseProduct(qdd);
    EXPECT_LT((tau - s.tau).norm(), 1e-10 * s.tau.norm()) << robot.name;

    forward.detach();
    const VectorXd without = forward.acceleration(s.q, s.qd, s.tau);
    EXPECT_EQ(without, ForwardDynamics(robot).acceleration(s.q, s.qd, s.tau)) << robot.name;
  }
}

TEST(ForwardDynamicsProperty, AnyNumberOfLockedJointsSolvesTheReducedEquations) {
  std::mt19937 random(3);
  std::bernoulli_distribution coin(0.5);
  for (const model::Robot& robot : arms()) {
    const int n = robot.num_joints();
    const ForwardDynamics forward(robot);
    const model::Dynamics inverse(robot);
    for (int k = 0; k < 20; ++k) {
      State s = random_state(n, random);
      auto locked = std::make_unique<bool[]>(static_cast<std::size_t>(n));
      std::vector<int> free;
      for (int i = 0; i < n; ++i) {
        locked[static_cast<std::size_t>(i)] = coin(random);
        if (locked[static_cast<std::size_t>(i)]) {
          s.qd[i] = 0.0;
        } else {
          free.push_back(i);
        }
      }
      VectorXd qdd(n), excess(n);
      forward.acceleration(s.q.data(), s.qd.data(), s.tau.data(), locked.get(), nullptr, qdd.data(),
                           excess.data());
      MatrixXd M = inverse.mass_matrix(s.q);
      M.diagonal() += rotor_inertia(robot);
      const VectorXd rest = s.tau - inverse.inverse_dynamics(s.q, s.qd, VectorXd::Zero(n));
      const auto m = static_cast<Eigen::Index>(free.size());
      MatrixXd reduced(m, m);
      VectorXd right(m);
      for (Eigen::Index i = 0; i < m; ++i) {
        right[i] = rest[free[static_cast<std::size_t>(i)]];
        for (Eigen::Index j = 0; j < m; ++j) {
          reduced(i, j) = M(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]);
        }
      }
      VectorXd expected = VectorXd::Zero(n);
      if (m > 0) {
        const VectorXd solved = reduced.ldlt().solve(right);
        for (Eigen::Index i = 0; i < m; ++i) expected[free[static_cast<std::size_t>(i)]] = solved[i];
      }
      EXPECT_LT((qdd - expected).norm(), 1e-9 * (1.0 + expected.norm())) << robot.name;
      EXPECT_LT((excess - (rest - M * expected)).norm(), 1e-9 * (1.0 + rest.norm())) << robot.name;
    }
  }
}

TEST(ForwardDynamicsProperty, GravityTorqueIsTheSlopeOfThePotentialEnergy) {
  std::mt19937 random(4);
  for (const model::Robot& robot : arms()) {
    const int n = robot.num_joints();
    const ForwardDynamics forward(robot);
    const model::Dynamics inverse(robot);
    const State s = random_state(n, random);
    const VectorXd gravity = forward.gravity_torque(s.q);
    EXPECT_LT((gravity - inverse.gravity_torque(s.q)).norm(), 1e-11 * (1.0 + gravity.norm())) << robot.name;
    for (int i = 0; i < n; ++i) {
      VectorXd up = s.q, down = s.q;
      up[i] += 1e-5;
      down[i] -= 1e-5;
      const double slope = (forward.potential_energy(up) - forward.potential_energy(down)) / 2e-5;
      EXPECT_NEAR(slope, gravity[i], 1e-7 * (1.0 + gravity.norm())) << robot.name << " joint " << i + 1;
    }
  }
}

TEST(ForwardDynamicsProperty, KineticEnergyIsTheQuadraticFormOfTheMassMatrix) {
  std::mt19937 random(5);
  for (const model::Robot& robot : arms()) {
    const ForwardDynamics forward(robot);
    const State s = random_state(robot.num_joints(), random);
    MatrixXd M = model::Dynamics(robot).mass_matrix(s.q);
    M.diagonal() += rotor_inertia(robot);
    const double expected = 0.5 * s.qd.dot(M * s.qd);
    EXPECT_NEAR(forward.kinetic_energy(s.q, s.qd), expected, 1e-12 * expected) << robot.name;
  }
}

}  // namespace
}  // namespace heft::sim
