/// Distances of capsules and boxes against sampled points and FCL; capsules and pairs of robots.
#include "heft/collision/collision.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/arms.hpp"

namespace heft::collision {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using ::testing::HasSubstr;

constexpr const char* kRobots[] = {"kawasaki6r", "panda", "scara", "ur10e", "ur5", "ur5e"};

std::string path_of(const std::string& robot) { return std::string(HEFT_URDF_DIR) + "/" + robot + ".urdf"; }

Vector3d random_vector(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> unit(-size, size);
  return {unit(random), unit(random), unit(random)};
}

VectorXd random_pose(std::mt19937_64& random, const model::Robot& robot) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  VectorXd q(robot.num_joints());
  for (int j = 0; j < robot.num_joints(); ++j) {
    const auto& joint = robot.joints[static_cast<std::size_t>(j)];
    q[j] = joint.lower + unit(random) * (joint.upper - joint.lower);
  }
  return q;
}

/// The frames of a robot without joints that matter: everything is in the base frame.
LinkFrames base_frames() { return LinkFrames(model::Robot{}, VectorXd()); }

Capsule capsule(const Vector3d& a, const Vector3d& b, double radius) { return {-1, a, b, radius, "", {}}; }

/// Smallest distance of two segments by looking at points of both: too large by at most the spacing.
double sampled_distance(const Capsule& first, const Capsule& second, int points) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= points; ++i) {
    const Vector3d p = first.a + (first.b - first.a) * i / points;
    for (int k = 0; k <= points; ++k) {
      const Vector3d r = second.a + (second.b - second.a) * k / points;
      least = std::min(least, (p - r).norm());
    }
  }
  return least - first.radius - second.radius;
}

TEST(CapsuleDistance, IsThatOfSampledPoints) {
  std::mt19937_64 random(1);
  constexpr int kPoints = 300;
  for (int trial = 0; trial < 200; ++trial) {
    Capsule first = capsule(random_vector(random, 1.0), random_vector(random, 1.0), 0.1);
    Capsule second = capsule(random_vector(random, 1.0), random_vector(random, 1.0), 0.05);
    if (trial % 5 == 1) second.b = second.a + 0.7 * (first.b - first.a);  // parallel
    if (trial % 5 == 2) second.b = second.a;                              // a ball
    if (trial % 5 == 3) first.b = first.a;
    const double found = distance(base_frames(), first, second).distance;
    const double sampled = sampled_distance(first, second, kPoints);
    // Sampled points are never nearer than the segments are; each is within half a spacing (≤ 3.5/300/2) of the best.
    EXPECT_LE(found, sampled + 1e-12) << trial;
    EXPECT_GE(found, sampled - 2.0 * 0.006) << trial;
  }
}

TEST(CapsuleDistance, OfABoxIsThatOfSampledPoints) {
  std::mt19937_64 random(2);
  constexpr int kPoints = 3000;
  for (int trial = 0; trial < 300; ++trial) {
    const Capsule c = capsule(random_vector(random, 1.0),
                              trial % 4 == 0 ? Vector3d(0.3, 0.1, 0.2) : random_vector(random, 1.0), 0.1);
    const BoxObstacle box{"", random_vector(random, 0.4) - Vector3d::Constant(0.4),
                          random_vector(random, 0.4) + Vector3d::Constant(0.4)};
    double sampled = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= kPoints; ++i) {
      const Vector3d p = c.a + (c.b - c.a) * i / kPoints;
      sampled = std::min(sampled, (p - p.cwiseMax(box.lower).cwiseMin(box.upper)).norm());
    }
    EXPECT_NEAR(distance(base_frames(), c, box).distance, sampled - 0.1, 6e-4) << trial;
  }
}

TEST(CapsuleAround, HoldsAllPointsAndIsTightAroundACylinder) {
  std::mt19937_64 random(3);
  Eigen::Matrix3Xd points(3, 400);
  std::uniform_real_distribution<double> turn(0.0, 6.28), along(-0.5, 0.5);
  const Eigen::Matrix3d R = Eigen::Quaterniond(0.3, 0.5, -0.2, 0.7).normalized().toRotationMatrix();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const double a = turn(random);
    points.col(i) = R * Vector3d(0.1 * std::cos(a), 0.1 * std::sin(a), along(random)) + Vector3d(1, 2, 3);
  }
  const Capsule found = capsule_around(points, R);
  EXPECT_NEAR(found.radius, 0.1, 0.002);
  EXPECT_LT((found.b - found.a).norm(), 1.01);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Vector3d p = points.col(i);
    EXPECT_LE(distance(base_frames(), capsule(p, p, 0.0), found).distance, 1e-9);
  }
}

TEST(LinkFrames, SpeedGradientAgreesWithDifferences) {
  std::mt19937_64 random(4);
  for (const char* name : {"scara", "ur5", "panda"}) {
    const model::Robot robot = urdf::load_urdf(path_of(name));
    const int n = robot.num_joints();
    const VectorXd q = random_pose(random, robot), qd = VectorXd::Random(n);
    const Vector3d point(0.1, -0.2, 0.3);
    const auto half_square = [&](const VectorXd& at, const VectorXd& velocity) {
      const LinkFrames frames(robot, at);
      return 0.5 * frames.velocity(n - 1, frames.at(n - 1, point), velocity).squaredNorm();
    };
    VectorXd by_q = VectorXd::Zero(n), by_qd = by_q;
    const LinkFrames frames(robot, q);
    frames.add_speed_gradient(n - 1, frames.at(n - 1, point), qd, 1.0, by_q, by_qd);
    for (int j = 0; j < n; ++j) {
      const VectorXd step = 1e-6 * VectorXd::Unit(n, j);
      EXPECT_NEAR(by_q[j], (half_square(q + step, qd) - half_square(q - step, qd)) / 2e-6, 1e-8) << name << j;
      EXPECT_NEAR(by_qd[j], (half_square(q, qd + step) - half_square(q, qd - step)) / 2e-6, 1e-8)
          << name << j;
    }
    // Velocity is the derivative of the place along the motion.
    const double h = 1e-6;
    const Vector3d moved =
        (LinkFrames(robot, q + h * qd).at(n - 1, point) - LinkFrames(robot, q - h * qd).at(n - 1, point)) /
        (2 * h);
    EXPECT_LT((frames.velocity(n - 1, frames.at(n - 1, point), qd) - moved).norm(), 1e-8);
  }
}

// The robots' capsules are written as cylinders with a sphere at each end: FCL, which knows nothing of capsules here,
// must find the same distances.
TEST(ShapeDistance, OfTheShapesIsTheCapsulesOwn) {
  std::mt19937_64 random(5);
  for (const char* name : kRobots) {
    const model::Robot robot = urdf::load_urdf(path_of(name));
    const auto shapes = urdf::load_shapes(path_of(name), robot);
    ArmCapsules arm = arm_capsules(robot, shapes);
    EXPECT_TRUE(arm.notes.empty()) << name << ": every link has shapes";
    VectorXd lower(robot.num_joints()), upper(robot.num_joints());
    for (int j = 0; j < robot.num_joints(); ++j) {
      lower[j] = robot.joints[static_cast<std::size_t>(j)].lower;
      upper[j] = robot.joints[static_cast<std::size_t>(j)].upper;
    }
    choose_pairs(robot, lower, upper, 0.01, {}, arm);
    EXPECT_FALSE(arm.pairs.empty()) << name;
    const ShapeDistance exact(robot, shapes, arm);
    for (int trial = 0; trial < 30; ++trial) {
      const VectorXd q = random_pose(random, robot);
      const LinkFrames frames(robot, q);
      double least = std::numeric_limits<double>::infinity();
      for (const CapsulePair& pair : arm.pairs) {
        least = std::min(least, distance(frames, arm.capsules[static_cast<std::size_t>(pair.first)],
                                         arm.capsules[static_cast<std::size_t>(pair.second)])
                                    .distance);
      }
      // FCL's iteration stops at 1e-6.
      EXPECT_NEAR(exact.nearest(q).distance, std::max(0.0, least), 1e-5) << name;
    }
  }
}

TEST(ArmCapsules, AreFittedWhereADescriptionHasNoShapes) {
  const model::Robot robot = urdf::load_urdf(path_of("ur10e"));
  const ArmCapsules arm = arm_capsules(robot);
  ASSERT_EQ(arm.capsules.size(), 7U);
  ASSERT_EQ(arm.notes.size(), 1U);
  EXPECT_THAT(arm.notes.front(), HasSubstr("fitted from the kinematics"));
  EXPECT_NEAR((arm.capsules[2].b - arm.capsules[2].a).norm(), 0.6127, 1e-9) << "the upper arm";
  EXPECT_NEAR(arm.capsules[2].radius, 0.075, 1e-3) << "that of the cylinder its inertia is of";
}

TEST(ArmCapsules, WatchesWhatCanMeetAndSaysWhatItLeavesOut) {
  const model::Robot robot = urdf::load_urdf(path_of("ur10e"));
  ArmCapsules arm = arm_capsules(robot, urdf::load_shapes(path_of("ur10e"), robot));
  choose_pairs(robot, VectorXd::Constant(6, -3.1), VectorXd::Constant(6, 3.1), 0.035, {}, arm);
  for (const ExcludedPair& pair : arm.excluded)
    EXPECT_EQ(pair.reason, "neighbours in the chain") << pair.first;
  EXPECT_EQ(arm.excluded.size(), 6U);
  // Folded: the wrist in the upper arm, the pose that the motion of the README once ran through.
  VectorXd folded = VectorXd::Zero(6);
  folded[1] = -1.5;
  folded[2] = 2.9;
  const ShapeDistance exact(robot, urdf::load_shapes(path_of("ur10e"), robot), arm);
  EXPECT_LT(exact.nearest(folded).distance, 0.05);
  folded[2] = 0.0;
  EXPECT_GT(exact.nearest(folded).distance, 0.005);
}

TEST(CollisionShapes, ReadsEveryKindAndWhatIsFixedToALink) {
  const std::string text = R"(<robot name="r"><link name="base"/>
    <link name="arm"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
      <collision><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>
      <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
      <collision><geometry><mesh filename="none.dae"/></geometry></collision></link>
    <link name="hand"><collision><geometry><sphere radius="0.07"/></geometry></collision></link>
    <joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
    <joint name="f" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="2 0 0"/></joint></robot>)";
  const model::Robot robot = urdf::load_urdf_string(text, "r.urdf");
  std::vector<std::string> warnings;
  const auto shapes = urdf::load_shapes_string(text, "r.urdf", robot, &warnings);
  ASSERT_EQ(shapes.size(), 3U);
  EXPECT_EQ(shapes[2].link_name, "hand");
  EXPECT_EQ(shapes[2].link, 0);
  EXPECT_EQ(shapes[2].position[0], 2.0);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings[0], ::testing::AllOf(HasSubstr("r.urdf:5"), HasSubstr("none.dae")));
  const ArmCapsules arm = arm_capsules(robot, shapes);
  // The cylinder lies along x from 0.8 to 1.2.
  const auto along_x = std::find_if(arm.capsules.begin(), arm.capsules.end(),
                                    [](const Capsule& c) { return std::abs(c.radius - 0.1) < 1e-12; });
  ASSERT_NE(along_x, arm.capsules.end());
  EXPECT_NEAR(std::min(along_x->a.x(), along_x->b.x()), 0.8, 1e-12);
  EXPECT_THROW(
      urdf::load_shapes_string(std::string(text).replace(text.find("0.07"), 4, "-0.7"), "r.urdf", robot),
      std::runtime_error);
}

}  // namespace
}  // namespace heft::collision
