// Robots in other programs' forms: read back by urdfdom, and by the conventions of MJCF and SDF into KDL's chains.
#include <cctype>
#include <cstdlib>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/exchange/robot_formats.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/kdl.hpp"
#include "support/temporary_folder.hpp"

namespace heft::exchange {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

model::Robot arm(const std::string& name) { return urdf::load_urdf(urdf::resolve_robot(name)); }

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Numbers of an attribute (name="1 2 3"), or of an element's text (<name>1 2 3</name>, <name ...>); empty: none.
std::vector<double> numbers_of(const std::string& line, const std::string& name, bool attribute) {
  const std::string start = attribute ? " " + name + "=\"" : "<" + name;
  std::size_t at = line.find(start);
  if (at == std::string::npos) return {};
  at = attribute ? at + start.size() : line.find('>', at) + 1;
  std::vector<double> values;
  const char* text = line.c_str() + at;
  for (char* end = nullptr;; text = end) {
    const double value = std::strtod(text, &end);
    if (end == text) return values;
    values.push_back(value);
  }
}

KDL::Vector vector_of(const std::vector<double>& v) { return {v.at(0), v.at(1), v.at(2)}; }

/// As MuJoCo's documentation says: a body's frame from pos and quat (w x y z) in its parent, its joint at its origin about
/// `axis` in its own axes, inertia about pos in its axes with entries xx yy zz xy xz yz.
KDL::Chain chain_of_mjcf(const std::string& text) {
  KDL::Chain chain;
  KDL::Frame frame;
  KDL::RigidBodyInertia inertia;
  for (const std::string& line : lines_of(text)) {
    if (line.find("<body ") != std::string::npos) {
      const auto pos = numbers_of(line, "pos", true), quat = numbers_of(line, "quat", true);
      frame = KDL::Frame::Identity();
      if (!pos.empty())
        frame = {KDL::Rotation::Quaternion(quat.at(1), quat[2], quat[3], quat[0]), vector_of(pos)};
    } else if (line.find("<inertial ") != std::string::npos) {
      const auto i = numbers_of(line, "fullinertia", true);
      inertia = KDL::RigidBodyInertia(numbers_of(line, "mass", true).at(0),
                                      vector_of(numbers_of(line, "pos", true)),
                                      KDL::RotationalInertia(i.at(0), i[1], i[2], i[3], i[4], i[5]));
    } else if (line.find("<joint ") != std::string::npos) {
      const KDL::Vector axis = frame.M * vector_of(numbers_of(line, "axis", true));
      const auto type =
          line.find("\"hinge\"") != std::string::npos ? KDL::Joint::RotAxis : KDL::Joint::TransAxis;
      chain.addSegment(KDL::Segment("s", KDL::Joint("j", frame.p, axis, type), frame, inertia));
      inertia = KDL::RigidBodyInertia::Zero();
    }
  }
  return chain;
}

/// As SDF 1.7 says: a link's pose x y z r p y in the link before, its joint at its origin about xyz in its axes.
KDL::Chain chain_of_sdf(const std::string& text) {
  KDL::Chain chain;
  KDL::Frame frame;
  KDL::Vector com;
  double mass = 0.0;
  std::vector<double> entries;
  bool prismatic = false;
  for (const std::string& line : lines_of(text)) {
    if (line.find("<link ") != std::string::npos) mass = 0.0;
    if (line.find("<joint ") != std::string::npos) prismatic = line.find("prismatic") != std::string::npos;
    const auto pose = numbers_of(line, "pose", false);
    if (line.find("relative_to") != std::string::npos)
      frame = {KDL::Rotation::RPY(pose.at(3), pose[4], pose[5]), vector_of(pose)};
    if (!pose.empty() && line.find("relative_to") == std::string::npos) com = vector_of(pose);
    if (const auto m = numbers_of(line, "mass", false); !m.empty()) mass = m[0], entries.clear();
    for (const char* name : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}) {
      if (const auto i = numbers_of(line, name, false); !i.empty()) entries.push_back(i[0]);
    }
    if (const auto xyz = numbers_of(line, "xyz", false); !xyz.empty()) {
      KDL::RigidBodyInertia inertia = KDL::RigidBodyInertia::Zero();
      if (mass > 0.0)
        inertia = KDL::RigidBodyInertia(mass, com,
                                        KDL::RotationalInertia(entries.at(0), entries[3], entries.at(5),
                                                               entries[1], entries[2], entries[4]));
      chain.addSegment(KDL::Segment("s",
                                    KDL::Joint("j", frame.p, frame.M * vector_of(xyz),
                                               prismatic ? KDL::Joint::TransAxis : KDL::Joint::RotAxis),
                                    frame, inertia));
    }
  }
  return chain;
}

/// Largest difference of rigid-body torques over the largest torque, on random states.
double difference(KDL::Chain chain, const model::Robot& robot) {
  test::KdlArm kdl(chain, robot.gravity);
  const model::Dynamics heft(robot);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&](double size) -> Eigen::VectorXd {
    return Eigen::VectorXd::NullaryExpr(robot.num_joints(), [&] { return size * uniform(random); });
  };
  double most = 0.0, error = 0.0;
  for (int k = 0; k < 100; ++k) {
    const Eigen::VectorXd q = vector(3.0), qd = vector(3.0), qdd = vector(10.0);
    const Eigen::VectorXd torque = heft.inverse_dynamics(q, qd, qdd);
    most = std::max(most, torque.cwiseAbs().maxCoeff());
    error = std::max(error, (kdl.inverse_dynamics(q, qd, qdd) - torque).cwiseAbs().maxCoeff());
  }
  return error / most;
}

TEST(RobotFormats, MoveAsTheRobotDoes) {
  for (const char* name : {"ur5e", "panda", "scara"}) {
    model::Robot robot = arm(name);
    EXPECT_LT(difference(chain_of_mjcf(to_text(robot, "mjcf").text), robot), 1e-9) << name;
    EXPECT_LT(difference(chain_of_sdf(to_text(robot, "sdf").text), robot), 1e-9) << name;
    const test::TemporaryFolder folder;
    const std::string path = folder.write("arm.urdf", to_text(robot, "urdf").text);
    EXPECT_LT(difference(test::kdl_chain_from_urdf(path), robot), 1e-9) << name;
  }
}

TEST(RobotFormats, UrdfReadsBackAsTheSameRobot) {
  model::Robot robot = arm("panda");
  robot.joints[2].actuation.coulomb_friction = 0.75;
  robot.joints[2].actuation.viscous_friction = 0.5;
  const model::Robot again = urdf::load_urdf_string(to_text(robot, "urdf").text, "again.urdf");
  ASSERT_EQ(again.num_joints(), robot.num_joints());
  EXPECT_EQ(again.tip_link, robot.tip_link);
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const model::RobotJoint &a = again.joints[j], &b = robot.joints[j];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.link_name, b.link_name);
    EXPECT_EQ(a.lower, b.lower);
    EXPECT_EQ(a.upper, b.upper);
    EXPECT_EQ(a.velocity_limit, b.velocity_limit);
    EXPECT_EQ(a.effort_limit, b.effort_limit);
    EXPECT_EQ(a.actuation.coulomb_friction, b.actuation.coulomb_friction);
    EXPECT_EQ(a.actuation.viscous_friction, b.actuation.viscous_friction);
    for (std::size_t k = 0; k < 10; ++k) EXPECT_NEAR(a.link[k], b.link[k], 1e-12);
  }
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(again.tip_position[k], robot.tip_position[k], 1e-12);
}

/// A robot with everything that heft knows.
model::Robot full_robot() {
  model::Robot robot = arm("ur5e");
  robot.joints[1].actuation = {
      .rotor_inertia = 0.4, .coulomb_friction = 5.0, .viscous_friction = 8.0, .friction_offset = 0.6};
  robot.effects = {{joint_effect_kind<LoadFriction>(), 1, {0.05}},
                   {joint_effect_kind<Spring>(), 2, {12.0, 0.5}},
                   {joint_effect_kind<Spring>(), 2, {4.0, -0.5}}};
  robot.elasticities = {{.joint = 0, .stiffness = 9000.0, .damping = 5.0, .motor_inertia = 0.3}};
  robot.torque_delay = 0.002;
  return robot;
}

const LeftOut* find(const RobotText& text, const std::string& what) {
  for (const LeftOut& left : text.left_out) {
    if (left.what == what) return &left;
  }
  return nullptr;
}

TEST(RobotFormats, CarryWhatTheyHavePlacesForAndListTheRest) {
  const model::Robot robot = full_robot();
  const RobotText mjcf = to_text(robot, "mjcf");
  EXPECT_THAT(mjcf.text, HasSubstr("damping=\"8\" frictionloss=\"5\" armature=\"0.4\""));
  // 12 (q - 0.5) + 4 (q + 0.5) = 16 (q - 0.25)
  EXPECT_THAT(mjcf.text, HasSubstr("stiffness=\"16\" springref=\"0.25\""));
  EXPECT_EQ(find(mjcf, "rotor_inertia"), nullptr);
  EXPECT_EQ(find(mjcf, "spring"), nullptr);
  EXPECT_NE(find(mjcf, "elasticity"), nullptr);
  EXPECT_NE(find(mjcf, "delay"), nullptr);
  ASSERT_NE(find(mjcf, "load_friction"), nullptr);
  EXPECT_EQ(find(mjcf, "load_friction")->joint, 1);
  // Joint 2 of an upright arm carries mostly the load that this friction is a share of.
  EXPECT_GT(find(mjcf, "load_friction")->share, 0.02);
  EXPECT_LT(find(mjcf, "load_friction")->share, 0.06);
  ASSERT_NE(find(mjcf, "friction_offset"), nullptr);
  EXPECT_EQ(find(mjcf, "friction_offset")->joint, 1);

  const RobotText sdf = to_text(robot, "sdf");
  EXPECT_THAT(sdf.text, HasSubstr("<spring_reference>0.25</spring_reference>"));
  EXPECT_THAT(sdf.text, HasSubstr("<friction>5</friction>"));
  EXPECT_NE(find(sdf, "rotor_inertia"), nullptr);

  const RobotText urdf = to_text(robot, "urdf");
  EXPECT_THAT(urdf.text, HasSubstr("<dynamics damping=\"8\" friction=\"5\"/>"));
  EXPECT_NE(find(urdf, "rotor_inertia"), nullptr);
  EXPECT_NE(find(urdf, "spring"), nullptr);
  EXPECT_EQ(find(urdf, "gravity"), nullptr);
  EXPECT_TRUE(to_text(arm("ur5e"), "urdf").left_out.empty());
}

TEST(RobotFormats, GravityOfATurnedBaseIsKeptOrNamed) {
  model::Robot robot = arm("ur5e");
  robot.gravity = {0.0, 9.81, 0.0};
  EXPECT_THAT(to_text(robot, "mjcf").text, HasSubstr("gravity=\"0 9.81 0\""));
  EXPECT_EQ(find(to_text(robot, "mjcf"), "gravity"), nullptr);
  EXPECT_NE(find(to_text(robot, "urdf"), "gravity"), nullptr);
}

TEST(RobotFormats, RefuseWhatNoArmCanHave) {
  for (const RobotFormat& format : robot_formats()) {
    model::Robot robot = arm("ur5e");
    robot.joints[3].link[kMass] = -0.1;
    EXPECT_THROW(to_text(robot, format.id), ModelError) << format.id;
    robot = arm("ur5e");
    robot.joints[3].actuation.viscous_friction = -1.0;
    try {
      to_text(robot, format.id);
      ADD_FAILURE() << format.id;
    } catch (const ModelError& error) {
      EXPECT_THAT(error.what(), HasSubstr("joint \"wrist_1_joint\": found viscous friction -1"));
    }
  }
  EXPECT_THROW(to_text(arm("ur5e"), "mjfc"), InputError);
}

TEST(RobotFormats, NamesAreSafeInXml) {
  model::Robot robot = arm("ur5e");
  robot.name = "arm <\"left\"> & co";
  EXPECT_THAT(to_text(robot, "mjcf").text, HasSubstr("arm &lt;&quot;left&quot;&gt; &amp; co"));
}

}  // namespace
}  // namespace heft::exchange
