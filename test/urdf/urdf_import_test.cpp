#include "heft/urdf/urdf_import.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "support/measured_data.hpp"
#include "support/temporary_folder.hpp"

namespace heft::urdf {
namespace {

using heft::test::message_of;
using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;

// --- building URDF text, one element a line so that line numbers are known ---

std::string inertial(
    double mass = 1.0, const std::string& xyz = "0 0 0", const std::string& rpy = "0 0 0",
    const std::string& inertia = "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"") {
  return fmt::format(R"(<inertial><origin xyz="{}" rpy="{}"/><mass value="{}"/><inertia {}/></inertial>)",
                     xyz, rpy, mass, inertia);
}

std::string link(const std::string& name, const std::string& inside = inertial()) {
  return fmt::format("<link name=\"{}\">{}</link>\n", name, inside);
}

const std::string kLimit = "<limit lower=\"-1\" upper=\"2\" velocity=\"3\" effort=\"4\"/>";
const std::string kAxis = "<axis xyz=\"0 0 1\"/>";

std::string joint(const std::string& name, const std::string& parent, const std::string& child,
                  const std::string& type = "revolute", const std::string& inside = kAxis + kLimit,
                  const std::string& xyz = "0 0 0", const std::string& rpy = "0 0 0") {
  return fmt::format(
      "<joint name=\"{}\" type=\"{}\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{}\" "
      "rpy=\"{}\"/>{}</joint>\n",
      name, type, parent, child, xyz, rpy, inside);
}

std::string robot(const std::string& inside) {
  return fmt::format("<robot name=\"arm\">\n{}</robot>\n", inside);
}

/// Base, two moving links. Lines: 2 base, 3 link a, 4 link b, 5 joint ja, 6 joint jb.
std::string two_joints() {
  return robot(link("base", "") + link("a") + link("b") + joint("ja", "base", "a") + joint("jb", "a", "b"));
}

model::Robot load(const std::string& text, const UrdfOptions& options = {},
                  std::vector<std::string>* warnings = nullptr) {
  return load_urdf_string(text, "arm.urdf", options, warnings);
}

/// The message, with a check that urdfdom has kept quiet.
std::string refusal(const std::string& text, const UrdfOptions& options = {}) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  std::string message = message_of<UrdfError>([&] { load(text, options); });
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(message.find('\n'), std::string::npos) << "one line: " << message;
  return message;
}

Matrix3 rotation_of(const model::RobotJoint& joint) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(joint.joint.rotation.data());
}
Vector3 position_of(const model::RobotJoint& joint) { return Vector3(joint.joint.position.data()); }

Matrix3 rpy(double r, double p, double y) {
  return (Eigen::AngleAxisd(y, Vector3::UnitZ()) * Eigen::AngleAxisd(p, Vector3::UnitY()) *
          Eigen::AngleAxisd(r, Vector3::UnitX()))
      .toRotationMatrix();
}

/// The ten parameters of a body given by mass, centre of mass and inertia about it.
Eigen::Matrix<double, 10, 1> ten(double m, const Vector3& c, const Matrix3& about_com) {
  const Matrix3 I = about_com + m * (c.squaredNorm() * Matrix3::Identity() - c * c.transpose());
  Eigen::Matrix<double, 10, 1> p;
  p << m, m * c, I(0, 0), I(0, 1), I(1, 1), I(0, 2), I(1, 2), I(2, 2);
  return p;
}

double difference(const InertialParameters<double>& found, const Eigen::Matrix<double, 10, 1>& expected) {
  return (Eigen::Map<const Eigen::Matrix<double, 10, 1>>(found.data()) - expected).cwiseAbs().maxCoeff();
}

const std::string kSkew = "ixx=\"0.03\" ixy=\"0.002\" ixz=\"-0.001\" iyy=\"0.04\" iyz=\"0.003\" izz=\"0.05\"";
Matrix3 skew() {
  Matrix3 I;
  I << 0.03, 0.002, -0.001, 0.002, 0.04, 0.003, -0.001, 0.003, 0.05;
  return I;
}

// --- what is read ---

TEST(Urdf, ReadsJointsInChainOrder) {
  // Written out of order on purpose.
  const model::Robot arm = load(
      robot(joint("jb", "a", "b") + link("b") + link("a") + joint("ja", "base", "a") + link("base", "")));
  ASSERT_EQ(arm.num_joints(), 2);
  EXPECT_EQ(arm.name, "arm");
  EXPECT_EQ(arm.base_link, "base");
  EXPECT_EQ(arm.tip_link, "b");
  EXPECT_EQ(arm.joints[0].name, "ja");
  EXPECT_EQ(arm.joints[0].link_name, "a");
  EXPECT_EQ(arm.joints[1].name, "jb");
  EXPECT_EQ(arm.joints[1].link_name, "b");
}

TEST(Urdf, ReadsPlacementTypeAndAxis) {
  const model::Robot arm = load(robot(
      link("base", "") + link("a") + link("b") +
      joint("ja", "base", "a", "prismatic", "<axis xyz=\"0 3 4\"/>" + kLimit, "0.1 -0.2 0.3", "0.4 0.5 0.6") +
      joint("jb", "a", "b", "continuous", "<axis xyz=\"-2 0 0\"/>")));
  EXPECT_EQ(arm.joints[0].joint.type, JointType::kPrismatic);
  EXPECT_LT((rotation_of(arm.joints[0]) - rpy(0.4, 0.5, 0.6)).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(position_of(arm.joints[0]), Vector3(0.1, -0.2, 0.3));
  EXPECT_LT((Vector3(arm.joints[0].joint.axis.data()) - Vector3(0, 0.6, 0.8)).norm(), 1e-15);
  EXPECT_EQ(arm.joints[1].joint.type, JointType::kRevolute);
  EXPECT_THAT(arm.joints[1].joint.axis, ElementsAre(-1.0, 0.0, 0.0));
}

TEST(Urdf, ReadsLimitsAndFriction) {
  const model::Robot arm = load(robot(
      link("base", "") + link("a") + link("b") + link("c") +
      joint("ja", "base", "a", "revolute", kAxis + kLimit + "<dynamics friction=\"0.7\" damping=\"0.2\"/>") +
      joint("jb", "a", "b", "continuous", kAxis) +
      joint("jc", "b", "c", "revolute",
            kAxis + "<limit lower=\"-1\" upper=\"0\" velocity=\"0\" effort=\"0\"/>")));
  EXPECT_EQ(arm.joints[0].lower, -1.0);
  EXPECT_EQ(arm.joints[0].upper, 2.0);
  EXPECT_EQ(arm.joints[0].velocity_limit, 3.0);
  EXPECT_EQ(arm.joints[0].effort_limit, 4.0);
  EXPECT_EQ(arm.joints[0].actuation.coulomb_friction, 0.7);
  EXPECT_EQ(arm.joints[0].actuation.viscous_friction, 0.2);
  EXPECT_EQ(arm.joints[0].actuation.rotor_inertia, 0.0);
  EXPECT_TRUE(std::isinf(arm.joints[1].upper));
  EXPECT_TRUE(std::isinf(arm.joints[1].velocity_limit));
  EXPECT_EQ(arm.joints[2].lower, -1.0);
  EXPECT_TRUE(std::isinf(arm.joints[2].velocity_limit)) << "zero means not stated";
  EXPECT_TRUE(std::isinf(arm.joints[2].effort_limit));
}

TEST(Urdf, TurnsInertiaIntoTenParametersAboutTheLinkFrame) {
  const model::Robot arm =
      load(robot(link("base", "") + link("a", inertial(2.5, "0.1 -0.2 0.3", "0.4 -0.5 0.6", kSkew)) +
                 joint("ja", "base", "a")));
  const Matrix3 R = rpy(0.4, -0.5, 0.6);
  EXPECT_LT(difference(arm.joints[0].link, ten(2.5, Vector3(0.1, -0.2, 0.3), R * skew() * R.transpose())),
            1e-15);
}

TEST(Urdf, MergesBodiesBehindFixedJoints) {
  // a carries t (in the chain's direction), which carries u; s sits on a side branch of a.
  const model::Robot arm =
      load(robot(link("base", inertial(50.0)) + link("a", inertial(2.0, "0 0 0.1", "0 0 0", kSkew)) +
                 link("s", inertial(0.5, "0.01 0.02 0.03", "0.2 0 0", kSkew)) +
                 link("t", inertial(1.0, "0 0.1 0", "0 0 0", kSkew)) +
                 link("u", inertial(0.25, "0.3 0 0", "0 0 0", kSkew)) +
                 link("b", inertial(0.7, "0 0 0", "0 0 0", kSkew)) + joint("ja", "base", "a") +
                 joint("js", "a", "s", "fixed", "", "0 0.5 0", "0 0.3 0") +
                 joint("jt", "a", "t", "fixed", "", "0.4 0 0", "0 0 0.7") +
                 joint("jb", "t", "b", "revolute", kAxis + kLimit, "0 0 0.2") +
                 joint("ju", "t", "u", "fixed", "", "0 0 -0.3", "0.1 0.2 0.3")));
  ASSERT_EQ(arm.num_joints(), 2);
  const Matrix3 Rs = rpy(0, 0.3, 0), Rsi = Rs * rpy(0.2, 0, 0);
  const Matrix3 Rt = rpy(0, 0, 0.7), Ru = Rt * rpy(0.1, 0.2, 0.3);
  const Vector3 pt(0.4, 0, 0), pu = pt + Rt * Vector3(0, 0, -0.3);
  const Eigen::Matrix<double, 10, 1> expected =
      ten(2.0, Vector3(0, 0, 0.1), skew()) +
      ten(0.5, Vector3(0, 0.5, 0) + Rs * Vector3(0.01, 0.02, 0.03), Rsi * skew() * Rsi.transpose()) +
      ten(1.0, pt + Rt * Vector3(0, 0.1, 0), Rt * skew() * Rt.transpose()) +
      ten(0.25, pu + Ru * Vector3(0.3, 0, 0), Ru * skew() * Ru.transpose());
  EXPECT_LT(difference(arm.joints[0].link, expected), 1e-15);
  EXPECT_LT(difference(arm.joints[1].link, ten(0.7, Vector3::Zero(), skew())), 1e-15);
  EXPECT_LT((rotation_of(arm.joints[1]) - Rt).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_LT((position_of(arm.joints[1]) - Vector3(0.4, 0, 0.2)).norm(), 1e-15);
}

TEST(Urdf, PutsFixedJointsBeforeTheFirstMovingOneIntoItsPlacement) {
  const model::Robot arm =
      load(robot(link("world", "") + link("base", inertial(9.0)) + link("a") +
                 joint("jw", "world", "base", "fixed", "", "1 2 3", "0 0 1.5707963267948966") +
                 joint("ja", "base", "a", "revolute", kAxis + kLimit, "1 0 0")));
  EXPECT_EQ(arm.base_link, "world");
  EXPECT_LT((position_of(arm.joints[0]) - Vector3(1, 3, 3)).norm(), 1e-15);
  EXPECT_EQ(arm.joints[0].link[kMass], 1.0) << "the base's mass must not count";
}

TEST(Urdf, KeepsThePlacementOfTheTip) {
  const model::Robot arm =
      load(robot(link("base", "") + link("a") + link("flange", "") + link("tool", "") +
                 joint("ja", "base", "a") + joint("jf", "a", "flange", "fixed", "", "0 0 0.1", "0 0 0.5") +
                 joint("jt", "flange", "tool", "fixed", "", "0.2 0 0", "0.3 0 0")));
  EXPECT_EQ(arm.tip_link, "tool");
  const Matrix3 R = rpy(0, 0, 0.5) * rpy(0.3, 0, 0);
  const Vector3 p = Vector3(0, 0, 0.1) + rpy(0, 0, 0.5) * Vector3(0.2, 0, 0);
  EXPECT_LT((Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(arm.tip_rotation.data()) - R)
                .cwiseAbs()
                .maxCoeff(),
            1e-15);
  EXPECT_LT((Vector3(arm.tip_position.data()) - p).norm(), 1e-15);
}

TEST(Urdf, TakesTheChainBetweenNamedLinks) {
  UrdfOptions options;
  options.base_link = "a";
  options.tip_link = "b";
  std::vector<std::string> warnings;
  const model::Robot arm =
      load(robot(link("base", "") + link("a") + link("b") + link("c") + joint("ja", "base", "a") +
                 joint("jb", "a", "b") + joint("jc", "b", "c")),
           options, &warnings);
  ASSERT_EQ(arm.num_joints(), 1);
  EXPECT_EQ(arm.joints[0].name, "jb");
  EXPECT_EQ(arm.joints[0].link[kMass], 1.0);
  EXPECT_THAT(
      warnings,
      ElementsAre(
          "arm.urdf:8: joint \"jc\" moves but is not on the chain: link \"c\" and what it carries (1 kg) "
          "are left out"));
}

TEST(Urdf, TakesTheLastMovingLinkAsTipWhenSeveralFramesAreFixedToIt) {
  std::vector<std::string> warnings;
  const model::Robot arm =
      load(robot(link("base", "") + link("a") + link("tool", "") + link("camera", inertial(0.2)) +
                 joint("ja", "base", "a") + joint("jt", "a", "tool", "fixed", "", "0 0 1") +
                 joint("jc", "a", "camera", "fixed", "")),
           {}, &warnings);
  EXPECT_EQ(arm.tip_link, "a");
  EXPECT_EQ(arm.tip_position[2], 0.0);
  EXPECT_DOUBLE_EQ(arm.joints[0].link[kMass], 1.2);
  EXPECT_THAT(
      warnings,
      ElementsAre(HasSubstr("arm.urdf:3: link \"a\": several frames are fixed to the last moving link")));
}

TEST(Urdf, MakesQuarterTurnsExact) {
  for (const char* quarter : {"1.5707963267948966", "1.57079633", "1.5707963", "-4.71238898"}) {
    const model::Robot arm = load(
        robot(link("base", "") + link("a") + link("b") +
              joint("ja", "base", "a", "revolute", kAxis + kLimit, "0 0 0", std::string(quarter) + " 0 0") +
              joint("jb", "a", "b", "revolute", kAxis + kLimit, "0 0 0", "0.5 0 " + std::string(quarter))));
    const bool close =
        std::string(quarter) != "1.5707963";  // 2.7e-8 off: not what eight decimals make of a quarter turn
    Matrix3 exact;
    exact << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    EXPECT_EQ(rotation_of(arm.joints[0]) == exact, close) << quarter << '\n' << rotation_of(arm.joints[0]);
    // Mixed with another angle the matrix must stay a rotation.
    const Matrix3 R = rotation_of(arm.joints[1]);
    EXPECT_LT((R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff(), 2e-15);
    EXPECT_LT((R - rpy(0.5, 0, std::stod(quarter))).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(Urdf, LeavesSmallButRealAnglesAlone) {
  // A calibrated misalignment of 5e-8 and one in which only some entries are near zero.
  const model::Robot arm =
      load(robot(link("base", "") + link("a") + link("b") +
                 joint("ja", "base", "a", "revolute", kAxis + kLimit, "0 0 0", "5e-8 0 0") +
                 joint("jb", "a", "b", "revolute", kAxis + kLimit, "0 0 0", "1.2e-8 0.9e-8 0.8")));
  EXPECT_NEAR(rotation_of(arm.joints[0])(2, 1), 5e-8, 1e-15);
  EXPECT_LT((rotation_of(arm.joints[1]) - rpy(1.2e-8, 0.9e-8, 0.8)).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(Urdf, TurnsGravityIntoATiltedBase) {
  EXPECT_THAT(load(two_joints()).gravity, ElementsAre(0.0, 0.0, -9.81));
  UrdfOptions options;
  options.mount_rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1};  // hanging from the ceiling
  EXPECT_THAT(load(two_joints(), options).gravity, ElementsAre(0.0, 0.0, 9.81));
  const Matrix3 R = rpy(0.2, -0.3, 0.4);
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(options.mount_rotation.data()) = R;
  options.gravity = {0.1, 0.0, -1.62};
  const Vector3 expected = R.transpose() * Vector3(0.1, 0, -1.62);
  EXPECT_LT((Vector3(load(two_joints(), options).gravity.data()) - expected).norm(), 1e-15);
}

TEST(Urdf, TakesAMasslessLinkInTheMiddle) {
  std::vector<std::string> warnings;
  const model::Robot arm = load(
      robot(link("base", "") + link("a", "") + link("b") + joint("ja", "base", "a") + joint("jb", "a", "b")),
      {}, &warnings);
  EXPECT_THAT(arm.joints[0].link, Each(0.0));
  EXPECT_THAT(warnings, ElementsAre("arm.urdf:3: link \"a\" moves but has no mass, nor has anything fixed to "
                                    "it; it is taken as massless"));
}

TEST(Urdf, IgnoresElementsOfOtherTools) {
  // <transmission> and <gazebo> hold joints and links that are not the robot's.
  const std::string others =
      "<transmission name=\"t\"><joint name=\"ja\"><x/></joint></transmission>\n"
      "<gazebo reference=\"a\"><link name=\"a\"/></gazebo>\n<material name=\"m\"><color rgba=\"1 1 1 "
      "1\"/></material>\n";
  const model::Robot arm = load(robot(others + link("base", "") + link("a") + joint("ja", "base", "a")));
  EXPECT_EQ(arm.num_joints(), 1);
}

TEST(Urdf, WarnsAboutImpossibleInertiaAndRefusesItOnRequest) {
  struct Case {
    const char* inertia;
    const char* text;
  };
  for (const Case& c :
       {Case{"ixx=\"0.005\" ixy=\"0\" ixz=\"0\" iyy=\"0.006\" iyz=\"0\" izz=\"0.02\"",
             "Ixx+Iyy=0.011 < Izz=0.02 kg·m²; check units and about-point"},
        Case{"ixx=\"0.02\" ixy=\"0\" ixz=\"0\" iyy=\"0.006\" iyz=\"0\" izz=\"0.005\"",
             "Iyy+Izz=0.011 < Ixx=0.02 kg·m²"},
        Case{"ixx=\"0.006\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.005\"",
             "Ixx+Izz=0.011 < Iyy=0.02 kg·m²"},
        Case{"ixx=\"0.01\" ixy=\"0.008\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.005\"",
             "principal moments 0.002, 0.005, 0.018 kg·m²: the largest exceeds the sum of the others"},
        Case{"ixx=\"0.01\" ixy=\"0.02\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"",
             "principal moments -0.01, 0.01, 0.03 kg·m²: expected all positive"},
        Case{"ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"",
             "principal moments 0, 0, 0 kg·m²: expected all positive"}}) {
    const std::string text =
        robot(link("base", "") + link("forearm", inertial(1.0, "0 0 0", "0 0 0", c.inertia)) +
              joint("j", "base", "forearm"));
    std::vector<std::string> warnings;
    EXPECT_EQ(load(text, {}, &warnings).num_joints(), 1);
    EXPECT_THAT(warnings, ElementsAre(HasSubstr(std::string("arm.urdf:3: link \"forearm\": ") + c.text)));
    UrdfOptions options;
    options.refuse_impossible_inertia = true;
    EXPECT_THAT(refusal(text, options), HasSubstr(std::string("arm.urdf:3: link \"forearm\": ") + c.text));
  }
}

TEST(Urdf, AcceptsFlatAndThinBodies) {
  // A disc and a rod lie on the edge of what is possible; rounded numbers may lie a hair beyond.
  for (const char* inertia :
       {"ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.02\"",
        "ixx=\"0.3333333\" ixy=\"0\" ixz=\"0\" iyy=\"0.3333333\" iyz=\"0\" izz=\"0.6666667\""}) {
    std::vector<std::string> warnings;
    load(robot(link("base", "") + link("a", inertial(1.0, "0 0 0", "0 0 0", inertia)) +
               joint("j", "base", "a")),
         {}, &warnings);
    EXPECT_THAT(warnings, IsEmpty());
  }
}

TEST(Urdf, ReadsTheRobotsOfTheMeasuredLogs) {
  const std::filesystem::path folder = HEFT_DATA_DIR;
  HEFT_NEEDS_MEASURED_DATA(folder);
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".urdf") continue;
    const model::Robot arm = load_urdf(entry.path().string());
    EXPECT_GE(arm.num_joints(), 4) << entry.path();
    // Their quarter turns are printed with eight decimals.
    for (const model::RobotJoint& j : arm.joints) {
      for (const double r : j.joint.rotation)
        EXPECT_TRUE(r == 0.0 || std::abs(r) > 1e-6) << entry.path() << ' ' << j.name << ' ' << r;
    }
    ++count;
  }
  EXPECT_GE(count, 7);
}

// --- what is refused ---

TEST(UrdfRefusal, MissingFile) {
  const heft::test::TemporaryFolder folder;
  EXPECT_EQ(message_of<UrdfError>([&] { load_urdf(folder.path("no.urdf")); }),
            folder.path("no.urdf") + ": cannot read the URDF: No such file or directory; check the path");
}

TEST(UrdfRefusal, EmptyFile) {
  EXPECT_EQ(refusal(" \n"), "arm.urdf: the file is empty; expected a URDF (<robot ...>)");
}

TEST(UrdfRefusal, NotXml) {
  EXPECT_EQ(refusal("time,q1\n0,1\n"),
            "arm.urdf:1: not XML: found no XML element; expected a URDF (<robot ...>); repair the file");
  EXPECT_EQ(refusal("<robot name=\"arm\">\n<link name=\"a\">\n</robot>\n"),
            "arm.urdf:3: not XML: found </robot> where </link> is due (opened in line 2); expected a URDF "
            "(<robot ...>); repair the file");
}

TEST(UrdfRefusal, NoRobotElement) {
  EXPECT_EQ(refusal("<html>\n</html>"),
            "arm.urdf:1: the root element is <html>; expected <robot>; check that this is a URDF");
  EXPECT_THAT(refusal("<?xml version=\"1.0\"?>\n<sdf version=\"1.6\"></sdf>"),
              HasSubstr("arm.urdf:2: the root element is <sdf>; expected <robot>; this is an SDF file, "
                        "convert it to URDF"));
}

TEST(UrdfRefusal, XacroFile) {
  EXPECT_EQ(refusal(robot("<xacro:include filename=\"x\"/>")),
            "arm.urdf:2: <xacro:include>: this is a xacro file; expected plain URDF; expand it first (xacro "
            "IN > OUT)");
}

TEST(UrdfRefusal, NoLinks) {
  EXPECT_EQ(
      refusal(robot("")),
      "arm.urdf:1: the robot has no <link>; expected links and joints; check that this is the right file");
}

TEST(UrdfRefusal, NamesMissingOrTwice) {
  EXPECT_THAT(refusal(robot("<link/>")), HasSubstr("arm.urdf:2: <link> without a name"));
  EXPECT_EQ(refusal(robot(link("a") + link("a"))),
            "arm.urdf:3: link \"a\" already exists (line 2); expected every name once; rename one");
  EXPECT_THAT(refusal(robot(link("a") + link("b") + joint("j", "a", "b") + joint("j", "a", "b"))),
              HasSubstr("arm.urdf:5: joint \"j\" already exists (line 4)"));
}

TEST(UrdfRefusal, LoopOfTwoParents) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") + link("b") + joint("j1", "base", "a") +
                          joint("j2", "base", "b") + joint("j3", "a", "b"))),
            "arm.urdf:7: link \"b\" is the child of two joints, \"j2\" (line 6) and \"j3\": a loop; expected "
            "an open tree of links; "
            "cut the loop at one joint");
}

TEST(UrdfRefusal, LoopWithoutARoot) {
  EXPECT_EQ(refusal(robot(link("a") + link("b") + joint("j1", "a", "b") + joint("j2", "b", "a"))),
            "arm.urdf:5: joint \"j2\": links \"a\" and \"b\" go round in a loop; expected an open tree of "
            "links; cut the loop at one joint");
}

TEST(UrdfRefusal, LoopNextToATree) {
  EXPECT_THAT(
      refusal(robot(link("base") + link("m") + link("a") + link("b") + link("c") + joint("jm", "base", "m") +
                    joint("j1", "a", "b") + joint("j2", "b", "c") + joint("j3", "c", "a"))),
      AllOf(HasSubstr("arm.urdf:10: joint \"j3\": links \"a\", \"c\" and \"b\" go round in a loop")));
}

TEST(UrdfRefusal, LinkThatIsItsOwnParent) {
  EXPECT_THAT(refusal(robot(link("a") + joint("j", "a", "a"))),
              HasSubstr("arm.urdf:3: joint \"j\": link \"a\" is its own parent: a loop"));
}

TEST(UrdfRefusal, RobotInPieces) {
  EXPECT_EQ(refusal(robot(link("a") + link("b") + link("c") + joint("j", "a", "b"))),
            "arm.urdf: links \"a\" and \"c\" have no parent: the robot is in pieces; expected one root; join "
            "them by joints");
}

TEST(UrdfRefusal, UnknownJointType) {
  EXPECT_EQ(refusal(robot(link("a") + link("b") + joint("j", "a", "b", "ball"))),
            "arm.urdf:4: joint \"j\": found type \"ball\"; expected type revolute, continuous, prismatic or "
            "fixed; correct it");
  EXPECT_THAT(refusal(robot(link("a") + link("b") +
                            "<joint name=\"j\"><parent link=\"a\"/><child link=\"b\"/></joint>")),
              HasSubstr("joint \"j\": found no type"));
}

TEST(UrdfRefusal, JointTypesHeftCannotMove) {
  for (const char* type : {"floating", "planar"}) {
    EXPECT_THAT(refusal(robot(link("a") + link("b") + joint("j", "a", "b", type, kAxis))),
                HasSubstr(std::string("arm.urdf:4: joint \"j\": type \"") + type +
                          "\" is on the chain; expected revolute, continuous, prismatic or fixed"));
  }
}

TEST(UrdfRefusal, JointBetweenLinksThatDoNotExist) {
  EXPECT_EQ(refusal(robot(link("a") + link("b") + joint("j", "x", "b"))),
            "arm.urdf:4: joint \"j\": its parent link \"x\" does not exist; expected the name of a <link>; "
            "correct the name or add the link");
  EXPECT_THAT(refusal(robot(link("a") + link("b") + joint("j", "a", "y"))),
              HasSubstr("its child link \"y\" does not exist"));
  EXPECT_THAT(refusal(robot(link("a") + "<joint name=\"j\" type=\"fixed\"><parent link=\"a\"/></joint>")),
              HasSubstr("arm.urdf:3: joint \"j\": found no <child link=\"...\">"));
}

TEST(UrdfRefusal, UnknownLinkNamedByTheUser) {
  UrdfOptions options;
  options.tip_link = "tool0";
  EXPECT_EQ(refusal(two_joints(), options),
            "arm.urdf: there is no link \"tool0\" for the tip; the links are \"a\", \"b\" and \"base\"; name "
            "one of them");
  options = {};
  options.base_link = "world";
  EXPECT_THAT(refusal(two_joints(), options), HasSubstr("there is no link \"world\" for the base"));
}

TEST(UrdfRefusal, TipThatIsNotOutboardOfTheBase) {
  UrdfOptions options;
  options.base_link = "b";
  options.tip_link = "a";
  EXPECT_EQ(refusal(two_joints(), options),
            "arm.urdf: the tip link \"a\" is not outboard of the base link \"b\"; expected a chain from base "
            "to tip; name other links");
}

TEST(UrdfRefusal, MoreThanOneChain) {
  EXPECT_EQ(refusal(robot(link("base") + link("hand") + link("f1") + link("f2") + link("pad", "") +
                          joint("j", "base", "hand") + joint("j1", "hand", "f1") + joint("j2", "hand", "f2") +
                          joint("jp", "f2", "pad", "fixed", ""))),
            "arm.urdf: more than one chain begins at \"base\"; candidate tips are \"f1\" and \"pad\", or "
            "\"hand\" where they part; "
            "expected one chain; name the tip link");
  EXPECT_EQ(refusal(robot(link("base") + link("left") + link("right") + joint("j1", "base", "left") +
                          joint("j2", "base", "right"))),
            "arm.urdf: more than one chain begins at \"base\"; candidate tips are \"left\" and \"right\"; "
            "expected one chain; name the tip link");
}

TEST(UrdfRefusal, NothingMoves) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") + joint("j", "base", "a", "fixed", ""))),
            "arm.urdf: no joint moves outboard of \"base\"; expected at least one revolute, continuous or "
            "prismatic joint; check that this is the right file");
  UrdfOptions options;
  options.tip_link = "base";
  EXPECT_THAT(refusal(two_joints(), options), HasSubstr("no joint moves between \"base\" and \"base\""));
}

TEST(UrdfRefusal, MassThatIsNotPositive) {
  for (const int mass : {0, -2}) {
    EXPECT_EQ(
        refusal(robot(link("base") + link("a", inertial(mass)) + joint("j", "base", "a"))),
        fmt::format(
            "arm.urdf:3: link \"a\": mass {} kg; expected a positive number on a moving link; correct it, or "
            "remove <inertial> from a link without mass",
            mass));
  }
  // Also on a body fixed to a moving link, but not on the base, whose mass does not matter.
  EXPECT_THAT(refusal(robot(link("base") + link("a") + link("t", inertial(-1)) + joint("j", "base", "a") +
                            joint("jt", "a", "t", "fixed", ""))),
              HasSubstr("arm.urdf:4: link \"t\": mass -1 kg"));
  EXPECT_EQ(load(robot(link("base", inertial(0)) + link("a") + joint("j", "base", "a"))).num_joints(), 1);
}

TEST(UrdfImport, AFixedFrameWithoutMassAddsNothing) {
  const auto arm = [](const std::string& tool) {
    return load(robot(link("base") + link("a") + link("t", tool) + joint("j", "base", "a") +
                      joint("jt", "a", "t", "fixed", "")));
  };
  // The inertia that some programs ask for even of a frame.
  const std::string frame = inertial(0.0, "0 0 0", "0 0 0");
  EXPECT_EQ(arm(frame).joints[0].link, arm("").joints[0].link);
}

TEST(UrdfRefusal, LastLinkWithoutMass) {
  EXPECT_EQ(refusal(robot(link("base") + link("a", "") + link("t", "") + joint("j", "base", "a") +
                          joint("jt", "a", "t", "fixed", ""))),
            "arm.urdf:3: link \"a\" is the last that moves and has no mass, nor has anything fixed to it; "
            "expected <inertial> with a "
            "positive mass; add it or name another tip link");
}

TEST(UrdfRefusal, ValuesThatAreNotFinite) {
  EXPECT_THAT(refusal(robot(link("base") + link("a", inertial(NAN)) + joint("j", "base", "a"))),
              HasSubstr("arm.urdf:3:"));
  EXPECT_THAT(refusal(robot(link("base") + link("a", inertial(1, "nan 0 0")) + joint("j", "base", "a"))),
              HasSubstr("arm.urdf:3:"));
  EXPECT_THAT(refusal(robot(link("base") + link("a") +
                            joint("j", "base", "a", "revolute", kAxis + kLimit, "0 inf 0"))),
              HasSubstr("arm.urdf:4:"));
}

TEST(UrdfRefusal, TextWhereNumbersAreDue) {
  const std::string inertia = R"(<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>)";
  for (const auto& [inside, found] : std::vector<std::pair<std::string, std::string>>{
           {fmt::format(R"(<inertial><mass value="heavy"/>{}</inertial>)", inertia), "heavy"},
           {fmt::format(R"(<inertial><mass value="1.5kg"/>{}</inertial>)", inertia), "1.5kg"},
           {fmt::format(R"(<inertial><origin xyz="0 0"/><mass value="1"/>{}</inertial>)", inertia),
            "2 elements but 3 expected"},
           {R"(<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>)", "missing ixy"},
           {fmt::format("<inertial>{}</inertial>", inertia), "must have a mass"}}) {
    EXPECT_THAT(refusal(robot(link("base") + link("a", inside) + joint("j", "base", "a"))),
                AllOf(HasSubstr("arm.urdf:3: urdfdom refuses the file: "), HasSubstr(found)));
  }
  EXPECT_THAT(refusal(robot(link("base") + link("a") +
                            joint("j", "base", "a", "revolute",
                                  kAxis + R"(<limit lower="-1" upper="x" velocity="1" effort="1"/>)"))),
              AllOf(HasSubstr("arm.urdf:4: urdfdom refuses the file: "),
                    HasSubstr("upper value (x) is not a valid float")));
}

TEST(Urdf, DoesNotCareAboutLooks) {
  // An unknown shape and an unreadable colour are no matter of dynamics.
  const std::string looks =
      "<visual><geometry><teapot/></geometry></visual>\n<collision><geometry><box size=\"a "
      "b\"/></geometry></collision>";
  const model::Robot arm =
      load(robot("<material name=\"m\"><color rgba=\"red\"/></material>\n" + link("base", looks) +
                 link("a", inertial() + looks) + joint("j", "base", "a")));
  EXPECT_EQ(arm.joints[0].link[kMass], 1.0);
}

TEST(UrdfRefusal, AxisOfNoLength) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") +
                          joint("j", "base", "a", "revolute", "<axis xyz=\"0 0 0\"/>" + kLimit))),
            "arm.urdf:4: joint \"j\": its axis is (0 0 0); expected a direction other than zero; correct "
            "<axis xyz>");
}

TEST(UrdfRefusal, MissingLimits) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") + joint("j", "base", "a", "revolute", kAxis))),
            "arm.urdf:4: joint \"j\": found no <limit>; expected lower, upper, velocity and effort on a "
            "revolute joint; add it or make the joint continuous");
  EXPECT_THAT(refusal(robot(link("base") + link("a") + joint("j", "base", "a", "prismatic", kAxis))),
              HasSubstr("on a prismatic joint; add it"));
  EXPECT_THAT(refusal(robot(link("base") + link("a") +
                            joint("j", "base", "a", "revolute",
                                  kAxis + "<limit lower=\"-1\" upper=\"1\" velocity=\"1\"/>"))),
              HasSubstr("arm.urdf:4: joint \"j\": <limit> has no effort"));
  EXPECT_THAT(
      refusal(robot(link("base") + link("a") +
                    joint("j", "base", "a", "revolute", kAxis + "<limit velocity=\"1\" effort=\"1\"/>"))),
      HasSubstr("<limit> has no lower"));
}

TEST(UrdfRefusal, LimitsThatMakeNoSense) {
  EXPECT_EQ(
      refusal(robot(link("base") + link("a") +
                    joint("j", "base", "a", "revolute",
                          kAxis + "<limit lower=\"1\" upper=\"-1\" velocity=\"1\" effort=\"1\"/>"))),
      "arm.urdf:4: joint \"j\": position limits from 1 to -1; expected lower below upper; correct <limit>");
  EXPECT_THAT(refusal(robot(link("base") + link("a") +
                            joint("j", "base", "a", "revolute",
                                  kAxis + "<limit lower=\"-1\" upper=\"1\" velocity=\"-1\" effort=\"1\"/>"))),
              HasSubstr("velocity limit -1 and effort limit 1; expected numbers not below zero"));
}

TEST(UrdfRefusal, NegativeFriction) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") +
                          joint("j", "base", "a", "revolute",
                                kAxis + kLimit + "<dynamics friction=\"-1\" damping=\"0\"/>"))),
            "arm.urdf:4: joint \"j\": friction -1 and damping 0; expected finite numbers not below zero; "
            "correct <dynamics>");
}

TEST(UrdfRefusal, MimicJoints) {
  EXPECT_EQ(refusal(robot(link("base") + link("a") + link("b") + joint("ja", "base", "a") +
                          joint("jb", "a", "b", "revolute", kAxis + kLimit + "<mimic joint=\"ja\"/>"))),
            "arm.urdf:6: joint \"jb\" mimics \"ja\"; expected joints that move on their own; name a tip link "
            "before it, or fix the joint");
}

TEST(UrdfRefusal, MountingThatIsNoRotation) {
  UrdfOptions options;
  options.mount_rotation = {1, 0, 0, 0, 1, 0, 0, 0, -1};
  EXPECT_THAT(refusal(two_joints(), options), HasSubstr("the mounting is not a rotation matrix"));
  options.mount_rotation = {2, 0, 0, 0, 1, 0, 0, 0, 0.5};
  EXPECT_THAT(refusal(two_joints(), options), HasSubstr("the mounting is not a rotation matrix"));
}

std::string renamed(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

TEST(Urdf, ReadsNamesWithReferencesToCharacters) {
  const model::Robot robot = load(renamed(two_joints(), "\"ja\"", "\"j&#111;&#x6C;nt&amp;&lt;\""));
  EXPECT_EQ(robot.joints[0].name, "jolnt&<");
}

TEST(UrdfRefusal, NamesThatCanBeReadInTwoWays) {
  using namespace std::string_literals;
  EXPECT_NE(refusal(renamed(two_joints(), "\"ja\"", "\"\xff\xff_\xd0\0\2\xf5-\""s)), "");
  for (const std::string& name : {"j&#10;a"s, "j&#955;a"s}) {
    EXPECT_THAT(refusal(renamed(two_joints(), "\"ja\"", "\"" + name + "\"")),
                HasSubstr("its name can be read in two ways"))
        << name;
  }
}

TEST(UrdfRefusal, FileOfNoise) {
  for (unsigned seed = 1; seed < 200; ++seed) {
    // Every truncation of a good file must end in a message, never in a crash.
    const std::string good = two_joints();
    const std::string text = good.substr(0, good.size() * seed / 200);
    EXPECT_THAT(refusal(text), HasSubstr("arm.urdf")) << text;
  }
}

}  // namespace
}  // namespace heft::urdf
