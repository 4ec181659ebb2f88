/// The model file: what is written is read back, what is wrong is named.
#include "heft/model/model_file.hpp"

#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/arms.hpp"
#include "support/temporary_folder.hpp"

namespace heft::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

ModelFile example() {
  ModelFile model = make_model(test::planar_two_link());
  model.actuation[1] = {0.1, 1.0 / 3.0, 2e-300, -0.25};
  model.standard_deviations = Eigen::VectorXd::LinSpaced(28, 0.1, 2.8);
  (*model.standard_deviations)[3] = std::numeric_limits<double>::quiet_NaN();
  model.covariance = Eigen::MatrixXd::Random(28, 28);
  model.provenance = {"ols", {"A.csv", "B.csv"}, {"a note"}};
  return model;
}

/// The message when `from` in the example's JSON is replaced by `to`.
std::string message_after(const std::string& from, const std::string& to) {
  std::string text = to_json(example());
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  return test::message_of<ModelError>([&] { (void)parse_model(text, "arm.json"); });
}

FitRecord example_fit() {
  FitRecord fit;
  fit.method = "wls";
  fit.torque_at = "joint";
  fit.base_parameters = {{"Izz1*", "kg·m²", "Izz1 + Iyy2", 1.0 / 3.0, 0.01, 0.02, true},
                         {"mcx2", "kg·m", "mcx2", -0.1, std::nan(""), std::nan(""), false}};
  fit.condition_number = 12.5;
  fit.physically_consistent = true;
  fit.noise_std = Eigen::Vector2d(0.5, 0.25);
  fit.rmse = Eigen::Vector2d(1.0, 2.0);
  fit.band_hz = 8.0;
  fit.samples = 12345;
  fit.missing = {"move joint 2"};
  return fit;
}

TEST(ModelFile, IsAWholeRobotByItself) {
  Robot robot = test::planar_two_link();
  robot.gravity = {0.1, -9.7, 1.0 / 3.0};
  robot.tip_position = {0.0, 0.1, 0.2};
  robot.base_link = "floor";
  robot.tip_link = "flange";
  robot.joints[0].joint.type = JointType::kPrismatic;
  robot.joints[0].lower = -1.5;
  robot.joints[1].joint.rotation = test::roll_pitch_yaw(0.1, 0.2, 0.3);
  robot.joints[1].effort_limit = 56.0;
  const Robot read = make_robot(parse_model(to_json(make_model(robot)), "arm.json"));
  EXPECT_EQ(read.name, robot.name);
  EXPECT_EQ(read.base_link, "floor");
  EXPECT_EQ(read.tip_link, "flange");
  EXPECT_EQ(read.gravity, robot.gravity);
  EXPECT_EQ(read.tip_rotation, robot.tip_rotation);
  EXPECT_EQ(read.tip_position, robot.tip_position);
  ASSERT_EQ(read.num_joints(), 2);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(read.joints[k].name, robot.joints[k].name);
    EXPECT_EQ(read.joints[k].link_name, robot.joints[k].link_name);
    EXPECT_EQ(read.joints[k].joint.type, robot.joints[k].joint.type);
    EXPECT_EQ(read.joints[k].joint.rotation, robot.joints[k].joint.rotation);
    EXPECT_EQ(read.joints[k].joint.position, robot.joints[k].joint.position);
    EXPECT_EQ(read.joints[k].joint.axis, robot.joints[k].joint.axis);
    EXPECT_EQ(read.joints[k].link, robot.joints[k].link);
    EXPECT_EQ(read.joints[k].lower, robot.joints[k].lower);
    EXPECT_EQ(read.joints[k].upper, robot.joints[k].upper);
    EXPECT_EQ(read.joints[k].velocity_limit, robot.joints[k].velocity_limit);
    EXPECT_EQ(read.joints[k].effort_limit, robot.joints[k].effort_limit);
  }
}

TEST(ModelFile, WithoutKinematicsAsksForTheUrdf) {
  ModelFile model = example();
  model.kinematics.reset();
  const ModelFile read = parse_model(to_json(model), "old.json");
  EXPECT_THAT(test::message_of<ModelError>([&] { (void)make_robot(read); }),
              AllOf(HasSubstr("old.json"), HasSubstr("--urdf")));
}

TEST(ModelFile, RefusesImpossibleKinematics) {
  EXPECT_THAT(message_after("\"revolute\"", "\"helical\""),
              AllOf(HasSubstr("/kinematics/joints/0/type"), HasSubstr("helical"), HasSubstr("prismatic")));
  EXPECT_THAT(message_after("\"axis\": [\n     0.0", "\"axis\": [\n     0.5"),
              AllOf(HasSubstr("/kinematics/joints/0/axis"), HasSubstr("unit vector")));
  EXPECT_THAT(message_after("\"rotation\": [\n     1.0", "\"rotation\": [\n     0.5"),
              AllOf(HasSubstr("/kinematics/joints/0/rotation"), HasSubstr("not a rotation")));
  EXPECT_THAT(message_after("\"rotation\": [\n    1.0", "\"rotation\": [\n    \"one\""),
              AllOf(HasSubstr("/kinematics/tip/rotation/0"), HasSubstr("a number")));
}

TEST(ModelFile, NotesThatTheUrdfsJointsAreElsewhere) {
  const ModelFile model = parse_model(to_json(example()), "arm.json");
  Robot robot = test::planar_two_link();
  std::vector<std::string> notes;
  apply(model, robot, &notes);
  EXPECT_TRUE(notes.empty());
  robot.joints[1].joint.position[0] += 0.01;
  apply(model, robot, &notes);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("joint 2"), HasSubstr("elsewhere")));
}

TEST(ModelFile, KeepsTheRecordOfItsFit) {
  ModelFile written = example();
  written.fit = example_fit();
  const ModelFile read = parse_model(to_json(written), "arm.json");
  ASSERT_TRUE(read.fit.has_value());
  EXPECT_EQ(read.fit->method, "wls");
  EXPECT_EQ(read.fit->torque_at, "joint");
  ASSERT_EQ(read.fit->base_parameters.size(), 2U);
  EXPECT_EQ(read.fit->base_parameters[0].value, 1.0 / 3.0);
  EXPECT_EQ(read.fit->base_parameters[0].expression, "Izz1 + Iyy2");
  EXPECT_TRUE(read.fit->base_parameters[0].determined);
  EXPECT_TRUE(std::isnan(read.fit->base_parameters[1].std));
  EXPECT_FALSE(read.fit->base_parameters[1].determined);
  EXPECT_EQ(read.fit->condition_number, 12.5);
  EXPECT_TRUE(read.fit->physically_consistent);
  EXPECT_TRUE(std::isnan(read.fit->physical_cost_ratio));
  EXPECT_EQ(read.fit->noise_std, written.fit->noise_std);
  EXPECT_EQ(read.fit->r2.size(), 0);
  EXPECT_EQ(read.fit->samples, 12345);
  EXPECT_EQ(read.fit->missing, written.fit->missing);
  EXPECT_EQ(to_json(read), to_json(written));
  std::string text = to_json(written);
  text.replace(text.find("\"torque_at\": \"joint\""), 20, "\"torque_at\": \"wrist\"");
  EXPECT_THAT(test::message_of<ModelError>([&] { (void)parse_model(text, "arm.json"); }),
              AllOf(HasSubstr("/fit/torque_at"), HasSubstr("wrist")));
}

TEST(ModelFile, ReadsBackWhatItWrote) {
  const test::TemporaryFolder folder;
  const ModelFile written = example();
  write_model(folder.path("model.json"), written);
  const ModelFile read = read_model(folder.path("model.json"));
  EXPECT_EQ(read.robot, written.robot);
  EXPECT_EQ(read.links, written.links);
  EXPECT_EQ(read.joint_names, written.joint_names);
  EXPECT_EQ(read.link_names, written.link_names);
  ASSERT_EQ(read.actuation.size(), 2U);
  EXPECT_EQ(read.actuation[1].rotor_inertia, 0.1);
  EXPECT_EQ(read.actuation[1].coulomb_friction, 1.0 / 3.0);
  EXPECT_EQ(read.actuation[1].viscous_friction, 2e-300);
  EXPECT_EQ(read.actuation[1].friction_offset, -0.25);
  EXPECT_EQ(*read.covariance, *written.covariance);
  EXPECT_TRUE(std::isnan((*read.standard_deviations)[3]));
  EXPECT_EQ((*read.standard_deviations)[4], (*written.standard_deviations)[4]);
  EXPECT_EQ(read.provenance.logs, written.provenance.logs);
  EXPECT_EQ(to_json(read), to_json(written));
}

TEST(ModelFile, NamesTheRowOfACovarianceThatHasAnotherLength) {
  EXPECT_THAT(
      message_after("\"covariance\": [\n  [", "\"covariance\": [\n  [\n   1.0,"),
      AllOf(HasSubstr("arm.json: /covariance/0: found 29 entries"), HasSubstr("28 numbers, 14 a joint")));
  EXPECT_THAT(message_after("\"covariance\": [\n  [", "\"covariance\": [\n  [], ["),
              AllOf(HasSubstr("arm.json: /covariance: found 29 entries"), HasSubstr("28 rows")));
}

TEST(ModelFile, KeepsFieldsItDoesNotKnow) {
  std::string text = to_json(example());
  text.replace(text.rfind('}'), 1, R"(,"calibration": {"by": "someone", "at": [1, 2]}})");
  const ModelFile model = parse_model(text, "arm.json");
  EXPECT_THAT(to_json(model), AllOf(HasSubstr("\"calibration\""), HasSubstr("someone")));
}

TEST(ModelFile, OnlyFormatVersionAndLinksAreNeeded) {
  const ModelFile model = parse_model(
      R"({"format": "heft-model", "version": 1, "links": [{"parameters": [1,2,3,4,5,6,7,8,9,10]}]})",
      "arm.json");
  EXPECT_EQ(model.num_joints(), 1);
  EXPECT_EQ(model.links[0][9], 10.0);
  EXPECT_EQ(model.actuation[0].coulomb_friction, 0.0);
  EXPECT_FALSE(model.covariance.has_value());
}

TEST(ModelFile, NamesFileAndPathOfWhatIsWrong) {
  EXPECT_THAT(message_after("\"heft-model\"", "\"other\""),
              AllOf(HasSubstr("arm.json: /format"), HasSubstr("heft-model")));
  EXPECT_THAT(message_after("\"version\": 1", "\"version\": 2"),
              AllOf(HasSubstr("arm.json: /version"), HasSubstr("found 2")));
  EXPECT_THAT(message_after("\"links\"", "\"lynx\""),
              AllOf(HasSubstr("arm.json: /links: missing"), HasSubstr("list")));
  EXPECT_THAT(message_after("\"num_joints\": 2", "\"num_joints\": 3"),
              AllOf(HasSubstr("/links"), HasSubstr("expected 3")));
  EXPECT_THAT(
      message_after("\"rotor_inertia\": 0.1", "\"rotor_inertia\": \"high\""),
      AllOf(HasSubstr("arm.json: /joints/1/rotor_inertia"), HasSubstr("\"high\""), HasSubstr("a number")));
  EXPECT_THAT(message_after("\"rotor_inertia\": 0.1", "\"rotor_inertia\": 1e999"), HasSubstr("arm.json"));
  EXPECT_THAT(message_after("\"provenance\": {", "\"provenance\": [] ,\"x\": {"),
              AllOf(HasSubstr("arm.json: /provenance"), HasSubstr("an object")));
  EXPECT_THAT(message_after("{", "["), HasSubstr("arm.json:2:10: found ':' where JSON does not allow it"));
}

TEST(ModelFile, RefusesALinkWithoutTenParameters) {
  const std::string message = test::message_of<ModelError>([] {
    (void)parse_model(R"({"format": "heft-model", "version": 1, "links": [{"parameters": [1,2,3]}]})",
                      "arm.json");
  });
  EXPECT_THAT(message, AllOf(HasSubstr("/links/0/parameters"), HasSubstr("found 3 entries"),
                             HasSubstr("ten numbers")));
}

TEST(ModelFile, ReplacesTheRobotsParameters) {
  Robot robot = test::planar_two_link();
  ModelFile model = example();
  model.links[1][kMass] = 9.0;
  std::vector<std::string> notes;
  apply(model, robot, &notes);
  EXPECT_EQ(robot.joints[1].link[kMass], 9.0);
  EXPECT_EQ(robot.joints[1].actuation.friction_offset, -0.25);
  EXPECT_TRUE(notes.empty());
}

TEST(ModelFile, RefusesAnotherRobotsJoints) {
  Robot robot = test::planar_two_link();
  ModelFile model = example();
  model.path = "arm.json";
  model.joint_names[1] = "wrist";
  EXPECT_THAT(test::message_of<ModelError>([&] { apply(model, robot); }),
              AllOf(HasSubstr("arm.json: /joints/1/name"), HasSubstr("wrist"), HasSubstr("joint2")));
  model = parse_model(
      R"({"format": "heft-model", "version": 1, "links": [{"parameters": [1,2,3,4,5,6,7,8,9,10]}]})",
      "arm.json");
  EXPECT_THAT(test::message_of<ModelError>([&] { apply(model, robot); }),
              AllOf(HasSubstr("arm.json"), HasSubstr("1 joints"), HasSubstr("expected 2")));
}

ModelFile with_effects() {
  ModelFile model = example();
  int kind = 0;
  for (const double scale : {0.1, 0.3, 0.7, 1.3, 1.9, 2.3, 0.9, 1.7, 3.1, 0.4, 0.6, 1.1}) {
    model.effects.push_back({kind, kind % 2, {}});
    visit_joint_effect(kind++, [&](auto effect) {
      for (std::size_t i = 0; i < decltype(effect)::kParameters.size(); ++i) {
        model.effects.back().parameters[i] = scale / static_cast<double>(i + 3);
      }
    });
  }
  model.effects[0].displacement = Displacement::kMeasured;
  model.effects[1].seen = {{-0.1, 1.0 / 3.0}, {-7.0, 9.0}, {-1.1, 2.2}};
  model.effects[2].seen.load = {-20.0 / 3.0, 4.0};  // the others without limits
  model.effects[3].seen.temperature = {20.0, 125.0 / 3.0};
  model.cables = {{0, 1, -2.0 / 3.0, 8.0 / 7.0, 0.1, {-0.2, 1.0 / 3.0}}, {1, 0, 0.5, 2.0, -0.3}};
  model.elasticities = {{1, 9000.0 / 7.0, 0.1, 1.0 / 3.0, 0.01 / 7.0}};
  model.torque_delay = 0.0021;
  return model;
}

TEST(ModelFile, CarriesEveryEffectToTheRobot) {
  const ModelFile written = with_effects();
  ASSERT_EQ(written.effects.size(), static_cast<std::size_t>(kNumJointEffects));
  const ModelFile read = parse_model(to_json(written), "arm.json");
  EXPECT_EQ(to_json(read), to_json(written));
  EXPECT_TRUE(read.other_fields.empty());
  Robot applied = test::planar_two_link();
  apply(read, applied);
  for (const Robot& robot : {make_robot(read), applied, make_robot(make_model(applied))}) {
    ASSERT_EQ(robot.effects.size(), written.effects.size());
    for (std::size_t k = 0; k < written.effects.size(); ++k) {
      EXPECT_EQ(robot.effects[k].kind, written.effects[k].kind);
      EXPECT_EQ(robot.effects[k].joint, written.effects[k].joint);
      EXPECT_EQ(robot.effects[k].parameters, written.effects[k].parameters);
      EXPECT_EQ(robot.effects[k].displacement, written.effects[k].displacement);
      for (const auto interval :
           {&SeenWithin<double>::velocity, &SeenWithin<double>::load, &SeenWithin<double>::position,
          &SeenWithin<double>::temperature}) {
        EXPECT_EQ((robot.effects[k].seen.*interval).low, (written.effects[k].seen.*interval).low);
        EXPECT_EQ((robot.effects[k].seen.*interval).high, (written.effects[k].seen.*interval).high);
      }
    }
    ASSERT_EQ(robot.elasticities.size(), 1U);
    EXPECT_EQ(robot.elasticities[0].joint, 1);
    EXPECT_EQ(robot.elasticities[0].stiffness, 9000.0 / 7.0);
    EXPECT_EQ(robot.elasticities[0].damping, 0.1);
    EXPECT_EQ(robot.elasticities[0].motor_inertia, 1.0 / 3.0);
    EXPECT_EQ(robot.elasticities[0].gap, 0.01 / 7.0);
    EXPECT_EQ(robot.torque_delay, 0.0021);
    ASSERT_EQ(robot.cables.size(), 2U);
    EXPECT_EQ(robot.cables[0].driving, 0);
    EXPECT_EQ(robot.cables[0].driven, 1);
    EXPECT_EQ(robot.cables[0].ratio, -2.0 / 3.0);
    EXPECT_EQ(robot.cables[0].stiffness, 8.0 / 7.0);
    EXPECT_EQ(robot.cables[0].neutral, 0.1);
    EXPECT_EQ(robot.cables[0].seen.low, -0.2);
    EXPECT_EQ(robot.cables[0].seen.high, 1.0 / 3.0);
    EXPECT_EQ(robot.cables[1].seen.high, SeenInterval<double>{}.high);
  }
}

TEST(ModelFile, WithoutEffectsTakesThoseOfTheRobotAway) {
  Robot robot = make_robot(with_effects());
  apply(example(), robot);
  EXPECT_TRUE(robot.effects.empty());
  EXPECT_TRUE(robot.elasticities.empty());
  EXPECT_TRUE(robot.cables.empty());
  EXPECT_EQ(robot.torque_delay, 0.0);
}

TEST(ModelFile, NamesWhatIsWrongWithAnEffect) {
  const auto message = [](const std::string& effects) {
    std::string text = to_json(example());
    text.replace(text.find("\"links\""), 0, "\"effects\": " + effects + ", ");
    return test::message_of<ModelError>([&] { (void)parse_model(text, "arm.json"); });
  };
  EXPECT_EQ(message(R"([{"kind": "offset", "joint": 2, "parameters": {"tau0": 1}}])"), "");
  EXPECT_THAT(message("{}"), AllOf(HasSubstr("arm.json: /effects"), HasSubstr("a list")));
  const auto ranged = [&](const std::string& range) {
    return message(R"([{"kind": "offset", "joint": 2, "parameters": {"tau0": 1}, "range": )" + range + "}]");
  };
  EXPECT_EQ(ranged("{}"), "");
  EXPECT_EQ(ranged(R"({"load": [-1, 1], "position": [0, 0]})"), "");
  EXPECT_THAT(ranged("3"), AllOf(HasSubstr("arm.json: /effects/0/range"), HasSubstr("an object")));
  EXPECT_THAT(ranged(R"({"velocity": [1]})"),
              AllOf(HasSubstr("/effects/0/range/velocity"), HasSubstr("2 numbers")));
  EXPECT_THAT(ranged(R"({"velocity": [1, -1]})"),
              AllOf(HasSubstr("/effects/0/range/velocity: found 1 and -1"), HasSubstr("smallest")));
  EXPECT_THAT(message(R"([{"kind": "backlash", "joint": 1, "parameters": {}}])"),
              AllOf(HasSubstr("arm.json: /effects/0/kind"), HasSubstr("\"backlash\""), HasSubstr("stribeck"),
                    HasSubstr("elasticity, delay, cable")));
  EXPECT_THAT(
      message(R"([{"kind": "offset", "joint": 1, "parameters": {"tau0": 1}, "displacement": "encoder"}])"),
      AllOf(HasSubstr("/effects/0/displacement"), HasSubstr("\"encoder\""),
            HasSubstr("position, velocity, measured")));
  EXPECT_THAT(message(R"([{"kind": "base_tilt", "joint": null, "parameters": {}}])"),
              HasSubstr("/kinematics/gravity"));
  EXPECT_THAT(message(R"([{"kind": "offset", "joint": 3, "parameters": {"tau0": 1}}])"),
              AllOf(HasSubstr("/effects/0/joint"), HasSubstr("found 3"), HasSubstr("1 to 2")));
  EXPECT_THAT(message(R"([{"kind": "offset", "joint": null, "parameters": {"tau0": 1}}])"),
              AllOf(HasSubstr("/effects/0/joint"), HasSubstr("found null"), HasSubstr("1 to 2")));
  EXPECT_THAT(message(R"([{"kind": "stribeck", "joint": 1, "parameters": {"Fs": 1}}])"),
              AllOf(HasSubstr("/effects/0/parameters/vs: missing"), HasSubstr("rad/s")));
  EXPECT_THAT(message(R"([{"kind": "stribeck", "joint": 1, "parameters": {"Fs": 1, "vs": 0}}])"),
              AllOf(HasSubstr("/effects/0/parameters"), HasSubstr("above zero")));
  EXPECT_THAT(message(R"([{"kind": "hysteresis", "joint": 1, "parameters": {"x0": 0}}])"),
              AllOf(HasSubstr("/effects/0/parameters"), HasSubstr("above zero")));
  const auto wrong = [&](const std::string& kind, const std::string& parameters, const std::string& name,
                         const std::string& found) {
    EXPECT_THAT(message(R"([{"kind": ")" + kind + R"(", "joint": 1, "parameters": {)" + parameters + "}}]"),
                AllOf(HasSubstr("/effects/0/parameters/" + name + ": found " + found),
                      HasSubstr("expected a number above zero")));
  };
  wrong("hysteresis", R"("x0": -0.01)", "x0", "-0.01");
  wrong("friction_drift", R"("alpha_c": 1, "alpha_v": 1, "T": -1)", "T", "-1");
  wrong("friction_drift", R"("alpha_c": 1, "alpha_v": 1, "T": 0)", "T", "0");
  wrong("stribeck", R"("Fs": 1, "vs": -0.1)", "vs", "-0.1");
  wrong("viscous_nonlinear", R"("c": 1, "p": -2)", "p", "-2");
  wrong("ripple", R"("A": 1, "n": 0, "phase": 0)", "n", "0");
  EXPECT_THAT(message(R"([{"kind": "hysteresis", "joint": 1, "parameters": {"x0": 0.01, "sharp": 1.5}}])"),
              AllOf(HasSubstr("/effects/0/parameters/sharp"), HasSubstr("found 1.5"), HasSubstr("0 to 1")));
  EXPECT_THAT(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"damping": 1}}])"),
              HasSubstr("/effects/0/parameters/stiffness: missing"));
  EXPECT_THAT(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"stiffness": 1, "gap": -0.1}}])"),
              AllOf(HasSubstr("/effects/0/parameters/gap"), HasSubstr("found -0.1"), HasSubstr("0 to 0.5 rad")));
  EXPECT_THAT(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"stiffness": 1, "gap": 5}}])"),
              AllOf(HasSubstr("/effects/0/parameters/gap"), HasSubstr("found 5"), HasSubstr("0 to 0.5 rad")))
      << "given in degrees";
  EXPECT_EQ(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"stiffness": 1, "gap": 0.1}}])"), "");
  EXPECT_THAT(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"stiffness": -1}}])"),
              AllOf(HasSubstr("/effects/0/parameters/stiffness"), HasSubstr("found -1")));
  EXPECT_THAT(message(R"([{"kind": "elasticity", "joint": 1, "parameters": {"stiffness": 1}},
                          {"kind": "elasticity", "joint": 1, "parameters": {"stiffness": 2}}])"),
              AllOf(HasSubstr("/effects/1"), HasSubstr("second elasticity of joint 1")));
  const auto cable = [&](const std::string& joints, const std::string& parameters) {
    return message(R"([{"kind": "cable", )" + joints + R"(, "parameters": {)" + parameters + "}}]");
  };
  const std::string pair = R"("joint": 1, "driven_joint": 2)";
  EXPECT_EQ(cable(pair, R"("k": 2, "x0": 0, "ratio": -1)"), "");
  EXPECT_THAT(cable(R"("joint": 1)", R"("k": 2, "x0": 0, "ratio": 1)"), HasSubstr("/effects/0/driven_joint"));
  EXPECT_THAT(cable(R"("joint": 1, "driven_joint": 1)", R"("k": 2, "x0": 0, "ratio": 1)"),
              AllOf(HasSubstr("/effects/0/driven_joint"), HasSubstr("same joint twice")));
  EXPECT_THAT(cable(pair, R"("k": -2, "x0": 0, "ratio": 1)"),
              AllOf(HasSubstr("/effects/0/parameters/k"), HasSubstr("found -2"), HasSubstr("0 or more")));
  EXPECT_THAT(cable(pair, R"("k": 2, "x0": 0)"), HasSubstr("/effects/0/parameters/ratio: missing"));
  EXPECT_THAT(message(R"([{"kind": "delay", "joint": 1, "parameters": {"delay": 0.002}}])"),
              AllOf(HasSubstr("/effects/0/joint"), HasSubstr("all joints")));
  EXPECT_THAT(message(R"([{"kind": "delay", "parameters": {"delay": -0.002}}])"),
              AllOf(HasSubstr("/effects/0/parameters/delay"), HasSubstr("0 or more")));
}

TEST(ModelFile, BringsTheGravityItWasFittedWith) {
  Robot robot = test::planar_two_link();
  robot.base_link = "floor";
  Robot tilted = robot;
  tilted.gravity = {0.3, -9.7, 0.1};
  const ModelFile model = make_model(tilted);
  std::vector<std::string> notes;
  Robot applied = robot;
  apply(model, applied, &notes);
  EXPECT_EQ(applied.gravity, tilted.gravity);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("gravity (0.3, -9.7, 0.1)"), HasSubstr("the model's is used")));
  // Another base frame: the vector would mean something else.
  applied = robot;
  applied.base_link = "trolley";
  apply(model, applied, &notes);
  EXPECT_EQ(applied.gravity, robot.gravity);
  EXPECT_THAT(notes.back(), HasSubstr("another link"));
}

TEST(ModelFile, SaysWhenItWasMadeForARobotOfAnotherName) {
  Robot robot = test::planar_two_link();
  ModelFile model = example();
  model.robot = "someone_else";
  std::vector<std::string> notes;
  apply(model, robot, &notes);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("someone_else"), HasSubstr("planar_two_link")));
}

}  // namespace
}  // namespace heft::model
