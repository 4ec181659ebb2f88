#include "heft/urdf/urdf_export.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/kdl.hpp"
#include "support/measured_data.hpp"
#include "support/temporary_folder.hpp"
#include "urdf/comparison.hpp"

namespace heft::urdf {
namespace {

using heft::test::KdlArm;
using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

namespace fs = std::filesystem;

std::string read(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream content;
  content << in.rdbuf();
  return content.str();
}

model::Robot loaded(const std::string& text, bool accept_impossible = false) {
  UrdfOptions options;
  options.accept_impossible_values = accept_impossible;
  return load_urdf_string(text, "arm.urdf", options);
}

std::string exported(const std::string& text, const model::Robot& robot,
                     const UrdfExportOptions& options = {}, UrdfExportReport* report = nullptr) {
  return urdf_with_parameters(text, "arm.urdf", robot, options, report);
}

/// A link that a body can have: a few point masses about the old centre of mass, and friction.
void perturb(model::Robot& robot, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (model::RobotJoint& joint : robot.joints) {
    InertialParameters<double>& p = joint.link;
    const double old_mass = p[kMass] > 0.0 ? p[kMass] : 1.0;
    const double cx = p[kMcx] / old_mass, cy = p[kMcy] / old_mass, cz = p[kMcz] / old_mass;
    p = {};
    for (int k = 0; k < 6; ++k) {
      const double m = old_mass * (1.0 + 0.5 * uniform(random)) / 6.0;
      const double x = cx + 0.1 * uniform(random), y = cy + 0.1 * uniform(random),
                   z = cz + 0.1 * uniform(random);
      p[kMass] += m;
      p[kMcx] += m * x;
      p[kMcy] += m * y;
      p[kMcz] += m * z;
      p[kIxx] += m * (y * y + z * z);
      p[kIyy] += m * (x * x + z * z);
      p[kIzz] += m * (x * x + y * y);
      p[kIxy] -= m * x * y;
      p[kIxz] -= m * x * z;
      p[kIyz] -= m * y * z;
    }
    joint.actuation.coulomb_friction = 5.0 + uniform(random);
    joint.actuation.viscous_friction = 3.0 + uniform(random);
  }
}

Eigen::VectorXd random_vector(int size, double scale, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-scale, scale);
  return Eigen::VectorXd::NullaryExpr(size, [&] { return uniform(random); });
}

/// Largest difference between heft on the robot and KDL on the file, over the largest torque.
double difference_from_kdl(const model::Robot& robot, const std::string& path) {
  const model::Dynamics dynamics(robot);
  KdlArm kdl(test::kdl_chain_from_urdf(path), robot.gravity);
  std::mt19937_64 random(7);
  double difference = 0.0, largest = 0.0;
  for (int k = 0; k < 200; ++k) {
    const Eigen::VectorXd q = random_vector(robot.num_joints(), 3.2, random);
    const Eigen::VectorXd qd = random_vector(robot.num_joints(), 4.0, random);
    const Eigen::VectorXd qdd = random_vector(robot.num_joints(), 20.0, random);
    const Eigen::VectorXd torque = dynamics.inverse_dynamics(q, qd, qdd);
    largest = std::max(largest, torque.cwiseAbs().maxCoeff());
    difference = std::max(difference, (kdl.inverse_dynamics(q, qd, qdd) - torque).cwiseAbs().maxCoeff());
  }
  return difference / largest;
}

// --- an arm with everything that should survive ---

constexpr const char* kOddities = R"(<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE robot [ <!ENTITY maker "none"> ]>
<!-- an arm; <inertial> in a comment is not one -->
<robot name="arm"   xmlns:xi='http://www.w3.org/2001/XInclude' version = "1.0">
    <gazebo reference="forearm"><mu1>0.2</mu1></gazebo>
    <link name="base"/>	<!-- held still -->
    <link name='upper &amp; lower'>
        <!-- weighed -->
        <inertial>
            <mass   value = '3.5' unit="kg"/> <!-- on the kitchen scales -->
            <inertia izz="0.01" ixx='0.03' iyy="0.03"
                     ixy="0" ixz="0" iyz="0"/>
            <origin rpy="0.3 -0.2 0.1" xyz="0 0 0.1"/>
        </inertial>
        <visual><geometry><box size="1 1 1"/></geometry></visual>
        <![CDATA[ <inertial> 1 < 2 ]]>
    </link>
    <joint type="revolute" name="shoulder">
        <parent link="base"/><child link="upper &amp; lower"/>
        <axis xyz="0 0 1"/>
        <origin rpy="0 0.5 0" xyz="0 0 0.2"/>
        <limit lower="-1" upper="1" velocity="2" effort="9"/> <!-- guessed -->
        <safety_controller k_velocity="1"/>
    </joint>
    <link name="forearm">
        <!-- the mesh -->
        <visual><geometry><box size="1 1 1"/></geometry></visual>
    </link>
    <joint name="elbow" type="continuous"><parent link="upper &amp; lower"/><child link="forearm"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/></joint>
    <link name="camera"><inertial><mass value="0.25"/><!-- <mass value="9"/> --><origin xyz="0.05 0 0"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
    <joint name="mount" type="fixed"><parent link="forearm"/><child link="camera"/><origin xyz="0 0 0.3" rpy="0 0.7 0"/></joint>
    <link name="wrist"/>
    <joint name="roll" type="prismatic"><parent link="forearm"/><child link="wrist"/>
        <limit lower="0" upper="1" velocity="2" effort="9"/>
        <dynamics   friction='1' /></joint>
    <link name="tool">
        <inertial>
            <origin xyz="0 0 0.02"/>
            <mass value="1"/>
            <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>
        </inertial>
    </link>
    <joint name="flange" type="fixed"><parent link="wrist"/><child link="tool"/></joint>
    <transmission name="t"><joint name="elbow"/></transmission>
</robot>
<!-- the end -->
)";

model::Robot odd_robot() {
  UrdfOptions options;
  options.tip_link = "tool";
  return load_urdf_string(kOddities, "arm.urdf", options);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The text without its <inertial> and <dynamics> elements: what must stay byte for byte. Comments, CDATA and
/// declarations are passed over.
std::string without_parameters(std::string text) {
  const auto skip = [&](std::size_t at, std::string_view close) {
    return text.find(close, at) + close.size();
  };
  for (std::size_t at = 0; at < text.size();) {
    if (text.compare(at, 4, "<!--") == 0) {
      at = skip(at, "-->");
    } else if (text.compare(at, 9, "<![CDATA[") == 0) {
      at = skip(at, "]]>");
    } else if (text.compare(at, 10, "<inertial>") == 0) {
      text.erase(at, skip(at, "</inertial>") - at);
    } else if (text.compare(at, 9, "<dynamics") == 0) {
      text.erase(at, skip(at, "/>") - at);
    } else {
      ++at;
    }
  }
  return text;
}

TEST(UrdfExport, TheParametersOfTheFileLeaveEveryByte) {
  UrdfExportReport report;
  EXPECT_EQ(exported(kOddities, odd_robot(), {}, &report), kOddities);
  EXPECT_THAT(report.changed_links, IsEmpty());
  EXPECT_THAT(report.changed_joints, IsEmpty());
  EXPECT_THAT(report.notes, IsEmpty());
  EXPECT_EQ(report.torque_difference, 0.0);
}

TEST(UrdfExport, OnlyNumbersChangeInAnInertial) {
  model::Robot robot = odd_robot();
  InertialParameters<double>& p = robot.joints[0].link;
  for (double& value : p) value *= 2.0;  // twice the density: same centre of mass
  const std::string text = exported(kOddities, robot);
  std::vector<std::string> before = lines_of(kOddities), after = lines_of(text);
  ASSERT_EQ(before.size(), after.size());
  EXPECT_EQ(after[9], "            <mass   value = '7' unit=\"kg\"/> <!-- on the kitchen scales -->");
  std::vector<std::size_t> changed;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (before[k] != after[k]) changed.push_back(k + 1);
  }
  for (const std::size_t line : changed) EXPECT_TRUE(line >= 10 && line <= 13) << "line " << line;
  EXPECT_THAT(after[10],
              testing::MatchesRegex(" +<inertia izz=\"0.0[0-9]+\" ixx='0.0[0-9]+' iyy=\"0.0[0-9]+\""));
  EXPECT_THAT(after[12], testing::StartsWith("            <origin rpy=\"0.3 -0.2 0.1\" xyz=\""))
      << "keeps its turn";
}

TEST(UrdfExport, EveryByteOutsideTheParametersStays) {
  model::Robot robot = odd_robot();
  std::mt19937_64 random(3);
  perturb(robot, random);
  UrdfExportReport report;
  const std::string text = exported(kOddities, robot, {}, &report);
  // Each insertion brings its line break and indent, each self-closing link its closing tag, each element set
  // aside its comment; taken out again, the rest is the original.
  std::string rest = without_parameters(text);
  const auto take_out = [&rest](const std::string& what, const std::string& instead = "") {
    const std::size_t found = rest.find(what);
    ASSERT_NE(found, std::string::npos) << what;
    rest.replace(found, what.size(), instead);
  };
  take_out("effort=\"9\"/> <!-- guessed -->\n        \n", "effort=\"9\"/> <!-- guessed -->\n");
  take_out("<link name=\"forearm\">\n        \n", "<link name=\"forearm\">\n");
  take_out("<link name=\"wrist\">\n        \n    </link>", "<link name=\"wrist\"/>");
  for (int k = 0; k < 2; ++k) {
    const std::size_t begin = rest.find("<!-- heft: counted");
    ASSERT_NE(begin, std::string::npos);
    rest.erase(begin, rest.find("-->", begin) + 3 - begin);
  }
  EXPECT_EQ(rest, without_parameters(kOddities));
  EXPECT_THAT(report.changed_links, ElementsAre("upper & lower"));
  EXPECT_THAT(report.inserted_links, ElementsAre("forearm", "wrist"));
  EXPECT_THAT(report.set_aside_links, ElementsAre("camera", "tool"));
  EXPECT_THAT(report.changed_joints, ElementsAre("shoulder", "elbow", "roll"));
  EXPECT_THAT(report.notes, SizeIs(2));
  EXPECT_LT(report.torque_difference, 1e-13);
}

TEST(UrdfExport, InsertsElementsIndentedAsTheFileIs) {
  model::Robot robot = odd_robot();
  robot.joints[0].actuation = {0.0, 0.5, 0.25, 0.0};
  robot.joints[1].actuation = {0.0, 1.5, 0.0, 0.0};
  robot.joints[2].link = {2.0, 0, 0, 1.0, 0.75, 0, 0.75, 0, 0, 0.5};
  robot.joints[2].actuation = {0.0, 1.0, 4.0, 0.0};
  const std::string text = exported(kOddities, robot);
  EXPECT_THAT(text, HasSubstr(R"(effort="9"/> <!-- guessed -->
        <dynamics damping="0.25" friction="0.5"/>
        <safety_controller k_velocity="1"/>)"));
  EXPECT_THAT(text, HasSubstr(R"(<axis xyz="0 1 0"/><dynamics damping="0" friction="1.5"/></joint>)"))
      << "a joint on one line stays on one line";
  EXPECT_THAT(text, HasSubstr(R"(<dynamics   friction='1' damping="4" /></joint>)"));
  EXPECT_THAT(text, HasSubstr(R"(    <link name="wrist">
        <inertial>
            <origin xyz="0 0 0.5" rpy="0 0 0"/>
            <mass value="2"/>
            <inertia ixx="0.25" ixy="0" ixz="0" iyy="0.25" iyz="0" izz="0.5"/>
        </inertial>
    </link>
)"));
}

TEST(UrdfExport, GivesAnInertialTheOriginThatItLacks) {
  const std::string text = R"(<robot name="arm">
\t<link name="base"></link>
\t<link name="a">
\t\t<inertial>
\t\t\t<mass value="1"/>
\t\t\t<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
\t\t</inertial>
\t</link>
\t<link name="b"></link>
\t<joint name="ja" type="continuous"><parent link="base"/><child link="a"/></joint>
\t<joint name="jb" type="continuous"><parent link="a"/><child link="b"/></joint>
\t<link name="c"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
\t<joint name="jc" type="continuous"><parent link="b"/><child link="c"/></joint>
</robot>
)";
  std::string tabs = text;
  for (std::size_t at = tabs.find("\\t"); at != std::string::npos; at = tabs.find("\\t"))
    tabs.replace(at, 2, "\t");
  model::Robot robot = loaded(tabs);
  robot.joints[0].link = {1, 0, 0, 0.5, 1.25, 0, 1.25, 0, 0, 1};
  robot.joints[1].link = {2, 0, 0, 0, 1, 0, 1, 0, 0, 1};
  std::string written = exported(tabs, robot);
  for (std::size_t at = written.find('\t'); at != std::string::npos; at = written.find('\t'))
    written.replace(at, 1, "\\t");
  EXPECT_THAT(written, HasSubstr(R"(\t\t<inertial>
\t\t\t<origin xyz="0 0 0.5" rpy="0 0 0"/>
\t\t\t<mass value="1"/>
)"));
  EXPECT_THAT(written, HasSubstr(R"(\t<link name="b">
\t\t<inertial>
\t\t\t<origin xyz="0 0 0" rpy="0 0 0"/>
\t\t\t<mass value="2"/>
\t\t\t<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
\t\t</inertial>
\t</link>
)"));
}

TEST(UrdfExport, KeepsTheLineEndsOfTheFile) {
  std::string dos;
  for (const char c : std::string(kOddities)) dos += c == '\n' ? std::string("\r\n") : std::string(1, c);
  model::Robot robot = odd_robot();
  std::mt19937_64 random(3);
  perturb(robot, random);
  const std::string text = exported(dos, robot);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), std::count(text.begin(), text.end(), '\r'));
  std::string unix_text = text;
  std::erase(unix_text, '\r');
  EXPECT_EQ(unix_text, exported(kOddities, robot));
}

TEST(UrdfExport, TheMovingLinkCarriesWhatIsFixedToIt) {
  model::Robot robot = odd_robot();
  std::mt19937_64 random(5);
  perturb(robot, random);
  UrdfExportReport report;
  const std::string text = exported(kOddities, robot, {}, &report);
  EXPECT_THAT(
      text,
      HasSubstr(R"(<link name="camera"><!-- heft: counted in link "forearm", which this link is fixed )"
                R"(to: <inertial><mass value="0.25"/><!- - <mass value="9"/> - -><origin xyz="0.05 0 0"/>)"));
  UrdfOptions options;
  options.tip_link = "tool";
  const model::Robot again = load_urdf_string(text, "arm.urdf", options);
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    for (std::size_t i = 0; i < 10; ++i)
      EXPECT_NEAR(again.joints[k].link[i], robot.joints[k].link[i], 1e-14) << "link " << k << ", entry " << i;
    EXPECT_EQ(again.joints[k].actuation.coulomb_friction, robot.joints[k].actuation.coulomb_friction);
    EXPECT_EQ(again.joints[k].actuation.viscous_friction, robot.joints[k].actuation.viscous_friction);
  }
  const TemporaryFolder folder;
  // KDL along the chain alone: the camera hangs on a side branch. urdfdom itself cannot read the document type.
  std::string plain = text;
  plain.erase(plain.find("<!DOCTYPE"), plain.find("]>") + 2 - plain.find("<!DOCTYPE"));
  const std::string path = folder.write("arm.urdf", plain);
  const model::Dynamics dynamics(robot);
  KdlArm kdl(test::kdl_chain_from_urdf(path, "tool"), robot.gravity);
  const Eigen::VectorXd q = random_vector(3, 3.0, random), qd = random_vector(3, 3.0, random),
                        qdd = random_vector(3, 9.0, random);
  const Eigen::VectorXd torque = dynamics.inverse_dynamics(q, qd, qdd);
  EXPECT_LT((kdl.inverse_dynamics(q, qd, qdd) - torque).cwiseAbs().maxCoeff(),
            1e-12 * torque.cwiseAbs().maxCoeff());
}

TEST(UrdfExport, WritingTwiceGivesTheSameText) {
  model::Robot robot = odd_robot();
  std::mt19937_64 random(11);
  perturb(robot, random);
  const std::string once = exported(kOddities, robot);
  EXPECT_NE(once, kOddities);
  EXPECT_EQ(exported(once, robot), once);
  UrdfOptions options;
  options.tip_link = "tool";
  EXPECT_EQ(exported(once, load_urdf_string(once, "arm.urdf", options)), once);
}

TEST(UrdfExport, ARoundedTurnOfTheInertialFrameGoesIntoTheInertia) {
  // Read as an exact quarter turn, which other readers do not do.
  std::string text = kOddities;
  const std::string rpy = "rpy=\"0.3 -0.2 0.1\"";
  text.replace(text.find(rpy), rpy.size(), "rpy=\"1.57079633 0 0\"");
  UrdfOptions options;
  options.tip_link = "tool";
  model::Robot robot = load_urdf_string(text, "arm.urdf", options);
  robot.joints[0].link[kMass] *= 1.01;
  UrdfExportReport report;
  const std::string written = exported(text, robot, {}, &report);
  EXPECT_THAT(written, HasSubstr("<origin rpy=\"0 0 0\" xyz=\""));
  EXPECT_THAT(report.notes, ElementsAre(HasSubstr("rounded angle")));
  EXPECT_EQ(exported(written, robot), written);
}

// --- refusals ---

/// Two joints, every element on a line of its own. Lines: 3 link a, 9 link b, 15 joint ja.
constexpr const char* kPlain = R"(<robot name="arm">
  <link name="base"/>
  <link name="a"><inertial><mass value="2"/><origin xyz="0 0 0.1"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><origin xyz="0 0 0.1"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <joint name="ja" type="continuous"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/></joint>
  <joint name="jb" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>
</robot>
)";

std::string refusal_to_write(const model::Robot& robot, const UrdfExportOptions& options = {},
                             const std::string& text = kPlain) {
  return message_of<UrdfError>([&] { exported(text, robot, options); });
}

TEST(UrdfExport, RefusesAMassNotAboveZero) {
  model::Robot robot = loaded(kPlain);
  robot.joints[1].link[kMass] = -0.31;
  EXPECT_EQ(
      refusal_to_write(robot),
      "arm.urdf:5: link \"b\": mass -0.31 kg: expected above zero; not written; fit a physically consistent "
      "model (method physical), or allow impossible values");
  robot.joints[0].link = {0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1};
  EXPECT_THAT(refusal_to_write(robot),
              HasSubstr("link \"a\": mass 0 kg: expected above zero (and 1 more); not written"));
}

TEST(UrdfExport, RefusesAnImpossibleInertia) {
  model::Robot robot = loaded(kPlain);
  robot.joints[0].link[kIzz] = 0.5;  // about the centre of mass: 0.02, 0.02, 0.5
  EXPECT_THAT(
      refusal_to_write(robot),
      AllOf(HasSubstr("arm.urdf:3: link \"a\": Ixx+Iyy=0.04 < Izz=0.5 kg·m²"), HasSubstr("method physical")));
  // Positive about the link's origin, negative about the centre of mass.
  robot.joints[0].link = {2, 0, 0, 2, 1.5, 0, 1.5, 0, 0, 0.5};
  EXPECT_THAT(refusal_to_write(robot), HasSubstr("link \"a\": "));
}

TEST(UrdfExport, RefusesNegativeFriction) {
  model::Robot robot = loaded(kPlain);
  robot.joints[1].actuation.viscous_friction = -0.2;
  EXPECT_THAT(refusal_to_write(robot),
              HasSubstr("arm.urdf:8: joint \"jb\": viscous friction -0.2: expected not below zero"));
}

TEST(UrdfExport, WritesTheImpossibleWhenAskedAndSaysSo) {
  model::Robot robot = loaded(kPlain);
  robot.joints[0].link[kIzz] = 0.5;
  robot.joints[1].link[kMass] = -0.31;
  robot.joints[1].actuation.viscous_friction = -0.2;
  UrdfExportOptions options;
  options.allow_impossible = true;
  UrdfExportReport report;
  const std::string text = exported(kPlain, robot, options, &report);
  EXPECT_THAT(text, HasSubstr("value=\"-0.31\""));
  EXPECT_THAT(report.notes,
              ElementsAre(HasSubstr("link \"a\": Ixx+Iyy"), HasSubstr("mass -0.31 kg"),
                          AllOf(HasSubstr("viscous friction -0.2"), HasSubstr("written as it is"))));
  EXPECT_LT(report.torque_difference, 1e-12);
  EXPECT_THAT(message_of<UrdfError>([&] { loaded(text); }),
              HasSubstr("damping -0.2; expected finite numbers not below zero"));
  const model::Robot again = loaded(text, true);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(again.joints[1].link[i], robot.joints[1].link[i], 1e-14);
  EXPECT_EQ(exported(text, robot, options), text);
  const TemporaryFolder folder;
  EXPECT_LT(difference_from_kdl(robot, folder.write("arm.urdf", text)), 1e-12);

  robot.joints[1].link = {0, 0, 0, 0, 0.1, 0, 0.2, 0, 0, 0.1};  // no mass, yet inertia: a rotor, perhaps
  EXPECT_LT(difference_from_kdl(robot, folder.write("arm.urdf", exported(kPlain, robot, options))), 1e-12);
}

TEST(UrdfExport, RefusesWhatUrdfCannotExpressEvenWhenAsked) {
  UrdfExportOptions options;
  options.allow_impossible = true;
  model::Robot robot = loaded(kPlain);
  robot.joints[1].link[kMass] = 0.0;  // its first moment stays
  EXPECT_THAT(refusal_to_write(robot, options),
              AllOf(HasSubstr("link \"b\": no mass but a first moment of 0.1 kg·m"),
                    HasSubstr("URDF cannot express")));
  robot.joints[1].link[kMass] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal_to_write(robot, options),
              AllOf(HasSubstr("link \"b\""), HasSubstr("[nan, 0, 0, 0.1,"), HasSubstr("expected numbers")));
  robot = loaded(kPlain);
  robot.joints[0].actuation.coulomb_friction = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusal_to_write(robot, options),
              HasSubstr("joint \"ja\": Coulomb friction inf; expected a finite number"));
}

TEST(UrdfExport, RefusesAnotherRobotsFile) {
  model::Robot robot = loaded(kPlain);
  robot.joints[0].name = "other";
  EXPECT_THAT(refusal_to_write(robot),
              HasSubstr("joint 1 is \"ja\" with link \"a\"; expected \"other\" with link \"a\""));
  robot = loaded(kPlain);
  robot.joints[1].joint.position[2] = 0.1;
  EXPECT_THAT(refusal_to_write(robot),
              HasSubstr("joint \"jb\" has another type, place or axis than in the robot"));
  robot = loaded(kPlain);
  robot.joints.pop_back();
  EXPECT_THAT(refusal_to_write(robot),
              HasSubstr("2 joints move between \"base\" and \"b\"; expected the robot's 1"));
}

// --- files ---

TEST(UrdfExport, WhatUrdfHasNoTagForGoesToAModelFileNextToIt) {
  const TemporaryFolder folder;
  const std::string original = folder.write("arm.urdf", kPlain);
  model::Robot robot = load_urdf(original);
  robot.joints[0].link[kMass] = 2.5;
  robot.joints[0].actuation = {0.7, 3.0, 2.0, -0.4};
  robot.couplings.push_back({0, 1, 1.5, 0.2, 0.3, 0.4});
  UrdfExportReport report;
  write_urdf(original, robot, folder.path("fitted.urdf"), {}, &report);
  EXPECT_EQ(read(original), kPlain);
  EXPECT_EQ(report.side_file, folder.path("fitted.heft.json"));
  EXPECT_THAT(report.notes, ElementsAre(HasSubstr("fitted.heft.json")));

  model::Robot again = load_urdf(folder.path("fitted.urdf"));
  EXPECT_EQ(again.joints[0].actuation.rotor_inertia, 0.0);
  EXPECT_EQ(again.joints[0].actuation.coulomb_friction, 3.0);
  model::apply(model::read_model(report.side_file), again);
  std::mt19937_64 random(2);
  const Eigen::VectorXd q = random_vector(2, 3.0, random), qd = random_vector(2, 3.0, random),
                        qdd = random_vector(2, 9.0, random);
  EXPECT_TRUE(model::Dynamics(again)
                  .joint_torque(q, qd, qdd)
                  .isApprox(model::Dynamics(robot).joint_torque(q, qd, qdd), 1e-13));
}

TEST(UrdfExport, WritesNoModelFileWhenTheUrdfHoldsEverything) {
  const TemporaryFolder folder;
  const std::string path = folder.write("arm.urdf", kPlain);
  model::Robot robot = load_urdf(path);
  robot.joints[0].link[kMass] = 2.5;
  UrdfExportReport report;
  write_urdf(path, robot, path, {}, &report);  // in place
  EXPECT_EQ(report.side_file, "");
  EXPECT_EQ(folder.num_entries(), 1u);
  EXPECT_NE(read(path), kPlain);
  EXPECT_EQ(load_urdf(path).joints[0].link[kMass], 2.5);

  UrdfExportOptions options;
  options.side_file = "";
  robot.joints[0].actuation.rotor_inertia = 1.0;
  write_urdf(path, robot, path, options, &report);
  EXPECT_EQ(folder.num_entries(), 1u);
  EXPECT_THAT(report.notes, ElementsAre(HasSubstr("they were not written")));
}

TEST(UrdfExport, TheModelFileKeepsStandardDeviationsAndProvenance) {
  const TemporaryFolder folder;
  const std::string path = folder.write("arm.urdf", kPlain);
  const model::Robot robot = load_urdf(path);
  UrdfExportOptions options;
  options.side_file = folder.path("named.json");
  options.model = model::make_model(robot);
  options.model->standard_deviations = Eigen::VectorXd::Constant(28, 0.5);
  options.model->provenance.method = "wls";
  write_urdf(path, robot, folder.path("out.urdf"), options);
  const model::ModelFile model = model::read_model(folder.path("named.json"));
  ASSERT_TRUE(model.standard_deviations.has_value());
  EXPECT_EQ((*model.standard_deviations)[27], 0.5);
  EXPECT_EQ(model.provenance.method, "wls");
}

TEST(UrdfExport, NothingIsWrittenOnAnError) {
  const TemporaryFolder folder;
  const std::string path = folder.write("arm.urdf", kPlain);
  model::Robot robot = load_urdf(path);
  robot.joints[0].actuation.rotor_inertia = 1.0;
  robot.joints[0].link[kMass] = -1.0;
  EXPECT_THROW(write_urdf(path, robot, folder.path("out.urdf")), UrdfError);
  robot.joints[0].link[kMass] = 2.0;
  UrdfExportOptions options;
  options.side_file = folder.path("side.json");
  EXPECT_THROW(write_urdf(path, robot, folder.path("missing/out.urdf"), options), InputError);
  EXPECT_THAT(message_of<UrdfError>([&] { write_urdf(folder.path("no.urdf"), robot, path); }),
              HasSubstr("cannot read the URDF"));
  EXPECT_EQ(folder.num_entries(), 1u);
  EXPECT_EQ(read(path), kPlain);
}

TEST(UrdfExport, ParametersThatMassAndCentreCannotHoldAreAnErrorNotAFile) {
  // A grain of mass with a large first moment: the inertia about its far centre of mass swallows the digits.
  model::Robot robot = loaded(kPlain);
  robot.joints[1].link = {1e-15, 0, 0, 1.0, 0.1, 0, 0.2, 0, 0, 0.1};
  UrdfExportOptions options;
  options.allow_impossible = true;
  EXPECT_THAT(message_of<Error>([&] { exported(kPlain, robot, options); }),
              AllOf(HasSubstr("read again, its torques differ"), HasSubstr("nothing was written")));
}

// --- every robot there is ---

std::vector<std::string> measured_robot_files() {
  std::vector<std::string> files;
  const fs::path data(HEFT_DATA_DIR);
  if (data.empty() || !fs::is_directory(data)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(data)) {
    if (entry.path().filename() == "robot.urdf") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Perturbed parameters out and in again: KDL agrees, the rest of the file is untouched.
/// @param rounded_turns  the file may hold quarter turns printed as 1.57079633, which heft makes exact and KDL
///                       does not: then KDL must agree as well as it does on the file as it was
void expect_writes_back(const std::string& path, bool rounded_turns) {
  SCOPED_TRACE(path);
  const std::string original = read(path);
  model::Robot robot = load_urdf(path);
  const double kdl_tolerance = std::max(1e-12, rounded_turns ? 3.0 * difference_from_kdl(robot, path) : 0.0);
  ASSERT_LE(kdl_tolerance, 1e-7);
  EXPECT_EQ(urdf_with_parameters(original, path, robot, {true, {}, {}}), original);
  std::mt19937_64 random(20);
  perturb(robot, random);
  const TemporaryFolder folder;
  const std::string out = folder.path("out.urdf");
  UrdfExportReport report;
  write_urdf(path, robot, out, {}, &report);
  EXPECT_THAT(report.changed_links.size() + report.inserted_links.size(), robot.joints.size());
  EXPECT_LE(report.torque_difference, 1e-12);
  const double from_kdl = difference_from_kdl(robot, out);
  EXPECT_LE(from_kdl, kdl_tolerance);
  std::cout << robot.name << ": " << from_kdl << " from KDL, " << report.torque_difference
            << " read again, of the largest torque\n";
  EXPECT_EQ(urdf_with_parameters(read(out), out, robot), read(out)) << "idempotent";
  std::string rest = without_parameters(read(out)), expected = without_parameters(original);
  const std::string set_aside = "<!-- heft: counted";
  for (std::size_t at = rest.find(set_aside); at != std::string::npos; at = rest.find(set_aside))
    rest.erase(at, rest.find("-->", at) + 3 - at);
  const auto squeeze = [](std::string& text) {
    std::erase_if(text, [](char c) { return c == ' ' || c == '\n' || c == '\r'; });
  };
  squeeze(rest), squeeze(expected);
  EXPECT_EQ(rest, expected);
}

TEST(UrdfExport, KdlAgreesOnEveryRobotOfHeft) {
  ASSERT_THAT(robot_files(), SizeIs(6));
  for (const std::string& path : robot_files()) expect_writes_back(path, false);
}

TEST(UrdfExport, KdlAgreesOnEveryMeasuredRobot) {
  HEFT_NEEDS_MEASURED_DATA(HEFT_DATA_DIR);
  const std::vector<std::string> files = measured_robot_files();
  ASSERT_FALSE(files.empty());
  for (const std::string& path : files) expect_writes_back(path, true);
}

}  // namespace
}  // namespace heft::urdf
