// Simulated logs of arms whose masses are known only roughly: nothing is suspected as they are, and what is altered is
// named.
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/plausibility/gear.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"

namespace heft::plausibility {
namespace {

using testing::HasSubstr;

model::Robot robot(const std::string& name) { return urdf::load_urdf(urdf::resolve_robot(name)); }

/// The arm in truth: masses up to a fifth off those of its description, with friction of a tenth of the effort limit.
model::Robot true_arm(const model::Robot& nominal, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> factor(0.8, 1.2);
  model::Robot arm = nominal;
  for (model::RobotJoint& joint : arm.joints) {
    const double scale = factor(random);
    for (double& parameter : joint.link) parameter *= scale;
    const double limit = std::min(joint.effort_limit, 100.0);
    joint.actuation.coulomb_friction = 0.05 * limit;
    joint.actuation.viscous_friction = 0.05 * limit;
  }
  return arm;
}

data::Log log_of(const model::Robot& nominal, unsigned seed) {
  test::FourierLogSettings settings;
  settings.seed = seed;
  data::Log log = test::fourier_log(true_arm(nominal, seed), settings);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.5);
  log.tau = log.tau.unaryExpr([&](double torque) { return torque + noise(random); });
  log.qd.resize(0, 0), log.qdd.resize(0, 0);
  return log;
}

/// The only finding.
Finding only(const TorqueCheck& check) {
  EXPECT_EQ(check.findings.size(), 1u) << check.log;
  for (const Finding& f : check.findings) EXPECT_TRUE(f.clear) << f.message;
  return check.findings.empty() ? Finding{} : check.findings.front();
}

/// What a controller takes off by a model that is `error` off.
void take_weight_off(const model::Robot& arm, double error, data::Log& log) {
  const model::Dynamics dynamics(arm);
  for (Eigen::Index k = 0; k < log.q.rows(); ++k)
    log.tau.row(k) -= (1.0 + error) * dynamics.gravity_torque(log.q.row(k).transpose()).transpose();
}

TEST(Plausibility, TorqueWithoutGravityIsNamed) {
  for (const std::string name : {"ur5e", "panda", "kawasaki6r"}) {
    for (const double error : {0.0, 0.1}) {
      SCOPED_TRACE(name + " " + std::to_string(error));
      const model::Robot nominal = robot(name);
      data::Log log = log_of(nominal, 3);
      take_weight_off(true_arm(nominal, 3), error, log);
      const TorqueCheck check = check_torque(nominal, log);
      ASSERT_EQ(check.findings.size(), 1U);
      const Finding& found = check.findings.front();
      EXPECT_EQ(found.kind, Contradiction::kWeightless) << found.message;
      // The Kawasaki's heavy base joint feels no weight: its logs leave a doubt.
      EXPECT_EQ(found.clear, name == "ur5e" || (name == "panda" && error == 0.0)) << found.evidence;
      EXPECT_THAT(found.message, HasSubstr("gravity is already compensated in this torque"));
      // Another unit is none of that, though it leaves little torque too.
      log = log_of(nominal, 3);
      log.tau /= 50.0;
      for (const Finding& other : check_torque(nominal, log).findings)
        EXPECT_NE(other.kind, Contradiction::kWeightless) << other.message;
    }
  }
}

TEST(Plausibility, SuspectsNothingInSoundLogs) {
  for (const char* name : {"ur10e", "ur5e", "panda", "kawasaki6r", "scara"}) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const TorqueCheck check = check_torque(robot(name), log_of(robot(name), seed));
      EXPECT_THAT(check.findings, testing::IsEmpty()) << name << ": " << check.findings.front().message;
      EXPECT_EQ(check.judgement().verdict, host::Verdict::kGood);
      EXPECT_NO_THROW(refuse_contradictions(check));
    }
  }
}

TEST(Plausibility, ComparesEachJointWithItsMasses) {
  const model::Robot ur10e = robot("ur10e");
  const TorqueCheck check = check_torque(ur10e, log_of(ur10e, 1));
  ASSERT_EQ(check.joints.size(), 6u);
  EXPECT_NEAR(check.joints[1].slope, 1.0, 3.0 * check.joints[1].slope_std);
  EXPECT_LT(check.joints[1].slope_std, 0.4);
  EXPECT_TRUE(check.joints[1].moving);
}

TEST(Plausibility, NamesASign) {
  const model::Robot ur10e = robot("ur10e");
  for (int j = 0; j < 6; ++j) {
    data::Log log = log_of(ur10e, 2);
    log.tau.col(j) *= -1.0;
    const TorqueCheck check = check_torque(ur10e, log);
    const Finding found = only(check);
    EXPECT_EQ(found.kind, Contradiction::kSign);
    EXPECT_EQ(found.joint, j);
    EXPECT_THAT(found.message, HasSubstr("fits with the opposite sign"));
    EXPECT_FALSE(check.judgement().usable());
    EXPECT_THROW(refuse_contradictions(check), DataError);
  }
}

TEST(Plausibility, NamesSeveralSigns) {
  const model::Robot ur10e = robot("ur10e");
  data::Log log = log_of(ur10e, 2);
  log.tau.col(1) *= -1.0, log.tau.col(4) *= -1.0;
  const TorqueCheck check = check_torque(ur10e, log);
  ASSERT_EQ(check.findings.size(), 2u);
  EXPECT_EQ(check.findings[0].joint + check.findings[1].joint, 5);
}

TEST(Plausibility, NamesInterchangedJoints) {
  const model::Robot panda = robot("panda");
  data::Log log = log_of(panda, 3);
  log.tau.col(1).swap(log.tau.col(3));
  const Finding found = only(check_torque(panda, log));
  EXPECT_EQ(found.kind, Contradiction::kInterchanged);
  EXPECT_EQ(found.joint, 1);
  EXPECT_EQ(found.other, 3);
}

TEST(Plausibility, NamesAnotherUnit) {
  const model::Robot ur10e = robot("ur10e");
  for (const auto& [factor, words] :
       {std::pair{1.0 / 101.0, "motor's side"}, {1.0 / 11.0, "amperes"}, {1000.0, "another unit"}}) {
    data::Log log = log_of(ur10e, 4);
    log.tau *= factor;
    const Finding found = only(check_torque(ur10e, log));
    EXPECT_EQ(found.kind, Contradiction::kScale);
    EXPECT_THAT(found.message, HasSubstr(words));
  }
}

TEST(Plausibility, NamesAZeroOffByAQuarterTurn) {
  const model::Robot ur10e = robot("ur10e");
  data::Log log = log_of(ur10e, 5);
  log.q.col(2).array() += 0.5 * std::numbers::pi;
  const Finding found = only(check_torque(ur10e, log));
  EXPECT_EQ(found.kind, Contradiction::kZero);
  EXPECT_EQ(found.joint, 2);
  EXPECT_NEAR(found.value, -0.5 * std::numbers::pi, 1e-9);
  EXPECT_THAT(found.message, HasSubstr("-90° is added to q3"));
}

TEST(Plausibility, NamesTheMountThatTheTorqueShows) {
  const model::Robot level = robot("ur10e");
  model::Robot wall = level;
  wall.gravity = {9.81, 0.0, 0.0};
  const Finding found = only(check_torque(level, log_of(wall, 6)));
  EXPECT_EQ(found.kind, Contradiction::kGravity);
  EXPECT_THAT(found.message, HasSubstr("along +x of the base"));
  EXPECT_THAT(found.message, HasSubstr("--mount 0,1.5708,0"));
}

TEST(Plausibility, NamesAnotherRobot) {
  Options options;
  options.other_robots = [] {
    return std::vector<model::Robot>{robot("ur5"), robot("ur10e"), robot("panda")};
  };
  const Finding found = only(check_torque(robot("ur5e"), log_of(robot("ur10e"), 7), options));
  EXPECT_EQ(found.kind, Contradiction::kRobot);
  EXPECT_THAT(found.message, HasSubstr("fits ur10e"));
}

TEST(Plausibility, NamesTorqueThatNeverChanges) {
  const model::Robot ur10e = robot("ur10e");
  data::Log log = log_of(ur10e, 8);
  log.tau.setZero();
  EXPECT_EQ(only(check_torque(ur10e, log)).kind, Contradiction::kNoSignal);
}

TEST(Plausibility, TakesTheTorqueOfAnArmAtRestForConstant) {
  const model::Robot ur10e = robot("ur10e");
  data::Log log = log_of(ur10e, 8);
  log.q.rowwise() = log.q.row(0).eval();
  log.qd = log.qdd = Eigen::MatrixXd::Zero(log.q.rows(), 6);
  test::put_torque(log, ur10e);
  EXPECT_THAT(check_torque(ur10e, log).findings, testing::IsEmpty());
  log.tau.setZero();
  EXPECT_EQ(only(check_torque(ur10e, log)).kind, Contradiction::kNoSignal);
}

TEST(Plausibility, DoubtsAMotorTorqueWithoutFriction) {
  const model::Robot ur10e = robot("ur10e");
  model::Robot frictionless = ur10e;
  for (model::RobotJoint& joint : frictionless.joints) joint.actuation = {};
  const data::Log log = test::fourier_log(frictionless, {});
  const TorqueCheck check = check_torque(ur10e, log);
  ASSERT_EQ(check.findings.size(), 1u);
  EXPECT_EQ(check.findings[0].kind, Contradiction::kModelTorque);
  EXPECT_FALSE(check.refused());
  EXPECT_EQ(check.judgement().verdict, host::Verdict::kDoubtful);
  Options behind_the_gear;
  behind_the_gear.at_motor = false;
  EXPECT_THAT(check_torque(ur10e, log, behind_the_gear).findings, testing::IsEmpty());
}

TEST(Plausibility, DoubtsATorqueBeyondTheEffortLimit) {
  model::Robot weak = robot("ur10e");
  weak.joints[1].effort_limit = 20.0;
  const TorqueCheck check = check_torque(weak, log_of(robot("ur10e"), 9));
  ASSERT_EQ(check.findings.size(), 1u);
  EXPECT_EQ(check.findings[0].joint, 1);
  EXPECT_FALSE(check.refused());
  EXPECT_THAT(check.findings[0].message, HasSubstr("beyond the effort limit of 20"));
}

TEST(Plausibility, SaysNothingAboutARobotWithoutMasses) {
  model::Robot massless = robot("ur10e");
  for (model::RobotJoint& joint : massless.joints) joint.link.fill(0.0);
  EXPECT_THAT(check_torque(massless, log_of(robot("ur10e"), 9)).findings, testing::IsEmpty());
}

TEST(Plausibility, TakesASpringForNoOtherSign) {
  // Where no gravity acts, a spring looks like inertia of the opposite sign.
  const model::Robot scara = robot("scara");
  for (unsigned seed = 1; seed <= 5; ++seed) {
    data::Log log = log_of(scara, seed);
    log.tau.col(1) += 60.0 * log.q.col(1);
    EXPECT_THAT(check_torque(scara, log).findings, testing::IsEmpty());
  }
}

TEST(Plausibility, TakesALoadedArmForSound) {
  const model::Robot ur10e = robot("ur10e");
  model::Robot loaded = ur10e;
  // 5 kg, 10 cm in front of the flange.
  InertialParameters<double>& link = loaded.joints.back().link;
  link[kMass] += 5.0, link[kMcz] += 0.5, link[kIxx] += 0.05, link[kIyy] += 0.05;
  EXPECT_THAT(check_torque(ur10e, log_of(loaded, 10)).findings, testing::IsEmpty());
}

/// Rows of a log into the check of a stream.
struct Stream {
  std::optional<TorqueCheck> found;
  double at{0.0};  ///< time of the row that brought it, or of the last one [s]
};
Stream push(LiveCheck& check, const data::Log& log) {
  Stream stream;
  for (Eigen::Index k = 0; k < log.num_samples() && !stream.found; ++k) {
    stream.at = log.time[k];
    stream.found = check.push({log.time[k], log.q.row(k), {}, log.tau.row(k)});
  }
  return stream;
}

TEST(LivePlausibility, SuspectsNothingInASoundStream) {
  for (const char* name : {"ur10e", "panda", "scara"}) {
    LiveCheck check(robot(name), "-");
    EXPECT_FALSE(push(check, log_of(robot(name), 1)).found) << name;
    const std::optional<TorqueCheck> whole = check.end();
    ASSERT_TRUE(whole.has_value()) << name;
    EXPECT_THAT(whole->findings, testing::IsEmpty()) << name;
    EXPECT_FALSE(check.end().has_value()) << "said once";
  }
}

TEST(LivePlausibility, SaysOfTheFirstSecondsWhatTheCheckOfALogSays) {
  data::Log sign = log_of(robot("ur10e"), 1), order = sign;
  sign.tau.col(1) *= -1.0;
  order.tau.col(1).swap(order.tau.col(2));
  for (const auto& [log, text] : {std::pair{sign, "tau2 fits with the opposite sign"},
                                  std::pair{order, "tau2 and tau3 look interchanged"}}) {
    LiveCheck check(robot("ur10e"), "-");
    const Stream stream = push(check, log);
    ASSERT_TRUE(stream.found.has_value()) << text;
    EXPECT_LT(stream.at, 10.0) << text;
    EXPECT_TRUE(stream.found->refused());
    EXPECT_THAT(stream.found->findings.front().message, HasSubstr(text));
    EXPECT_EQ(stream.found->log, "-");
  }
}

TEST(LivePlausibility, OfALogThatEndsBeforeIsThatOfTheLog) {
  data::Log log = log_of(robot("ur10e"), 1);
  log.tau.col(1) *= -1.0;
  const Eigen::Index rows = (log.time.array() < 3.9).count();
  LiveCheck check(robot("ur10e"), "-");
  for (Eigen::Index k = 0; k < rows; ++k)
    EXPECT_FALSE(check.push({log.time[k], log.q.row(k), {}, log.tau.row(k)}).has_value());
  const std::optional<TorqueCheck> found = check.end();
  ASSERT_TRUE(found.has_value());
  EXPECT_TRUE(found->refused());
}

TEST(LivePlausibility, AnArmThatStandsUsesUpNoTime) {
  data::Log log = log_of(robot("ur10e"), 1);
  log.tau.col(1) *= -1.0;
  LiveCheck check(robot("ur10e"), "-");
  // Two minutes at the first pose, and the clock is set before it moves.
  for (double t = -120.0; t < 0.0; t += 0.01)
    EXPECT_FALSE(check.push({t, log.q.row(0), {}, log.tau.row(0)}).has_value());
  log.time.array() -= 500.0;
  const Stream stream = push(check, log);
  ASSERT_TRUE(stream.found.has_value());
  EXPECT_LT(stream.at, -490.0);
  EXPECT_THAT(stream.found->findings.front().message, HasSubstr("tau2 fits with the opposite sign"));
}

TEST(LivePlausibility, RefusesSlipsOfUnits) {
  data::Log degrees = log_of(robot("ur10e"), 1), milliseconds = degrees;
  degrees.q *= 180.0 / std::numbers::pi;
  milliseconds.time *= 1000.0;
  for (const auto& [log, text] : {std::pair{degrees, "degrees"}, std::pair{milliseconds, "milliseconds"}}) {
    LiveCheck check(robot("ur10e"), "-");
    try {
      push(check, log);
      FAIL() << "took " << text;
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(testing::StartsWith("-: column '"), HasSubstr(text)));
    }
  }
}

TEST(Gear, KnowsWhatAStrainWaveJointOfThatSizeCanBeLike) {
  model::RobotJoint joint;
  joint.effort_limit = 82.0;  // size 20
  using Outcome = GearCheck::Outcome;
  const auto stiffness = [&](double value) {
    return check_gear(ElasticJoint{}, {{"stiffness", value}}, joint).outcome;
  };
  EXPECT_EQ(stiffness(1.6e4), Outcome::kPlausible);  // the catalogue's K1
  EXPECT_EQ(stiffness(2.9e4), Outcome::kPlausible);  // and K3
  EXPECT_EQ(stiffness(500.0), Outcome::kImplausible);
  EXPECT_EQ(stiffness(5e5), Outcome::kImplausible);
  const GearCheck soft = check_gear(ElasticJoint{}, {{"stiffness", 500.0}, {"motor_inertia", 0.5}}, joint);
  EXPECT_THAT(soft.words, testing::AllOf(HasSubstr("stiffness 500"), testing::Not(HasSubstr("motor_inertia"))));
  EXPECT_THAT(check_gear(ElasticJoint{}, {{"stiffness", 1.6e4}, {"motor_inertia", 0.5}}, joint).words,
              testing::AllOf(HasSubstr("stiffness"), HasSubstr("motor_inertia")));
  EXPECT_EQ(check_gear(LoadFriction{}, {{"mu", 0.9}}, joint).outcome, Outcome::kImplausible);
  EXPECT_EQ(check_gear(Delay{}, {{"delay", 0.9}}, joint).outcome, Outcome::kUnknown);
  joint.effort_limit = std::numeric_limits<double>::infinity();
  EXPECT_EQ(stiffness(500.0), Outcome::kUnknown) << "the size is not stated";
}

}  // namespace
}  // namespace heft::plausibility
