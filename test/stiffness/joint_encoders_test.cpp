/// Stiffness from encoders on both sides of a gear, on logs whose truth is known.
#include "heft/stiffness/joint_encoders.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"

namespace heft::stiffness {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// One joint on a sum of sines, loaded by its own inertia and weight and by the motion of other joints.
struct Truth {
  double compliance{1.5e-7};     ///< [rad/(N·m)]
  double delay{0.003};           ///< of the link's channel [s]
  double lost_motion{0.0};       ///< with the direction of motion [rad]
  double motor_coulomb{300.0};   ///< [N·m]
  double motor_viscous{1000.0};  ///< [N·m·s/rad]
  double rotor_inertia{0.0};     ///< [kg·m²]
  double torque_play{0.0};       ///< loop with the direction of the torque [rad]
  double eccentricity{0.0};      ///< [rad]
  double damping{0.0};           ///< D/K [s]
  double noise{0.0};             ///< of the deflection, standard deviation [rad]
  double memory{0.3};            ///< of that noise [s]
  double torque_noise{0.0};      ///< white [N·m]
  double duration{30.0};
  double rate{100.0};
  bool moves{true};
  bool loaded{true};
  unsigned seed{1};
};

struct Synthetic {
  data::Log log;
  Eigen::MatrixXd gear_torque;  ///< through the gear, without noise
};

Synthetic make(const Truth& truth) {
  std::mt19937 random(truth.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0.5, 1.0), phase(0.0, 2.0 * std::numbers::pi);
  constexpr int kHarmonics = 4;
  constexpr double kFundamental = 2.0 * std::numbers::pi * 0.1;
  std::array<double, kHarmonics> a{}, p{};
  for (int h = 0; h < kHarmonics; ++h) {
    a[static_cast<std::size_t>(h)] = 0.3 * share(random) / (1 + h);
    p[static_cast<std::size_t>(h)] = phase(random);
  }
  const double other = phase(random);
  struct Motion {
    double q{0.2}, qd{0.0}, qdd{0.0};
  };
  const auto motion = [&](double t) {
    Motion m;
    if (!truth.moves) return m;
    for (int h = 0; h < kHarmonics; ++h) {
      const double w = kFundamental * (h + 1);
      const double x = w * t + p[static_cast<std::size_t>(h)], b = a[static_cast<std::size_t>(h)];
      m.q += b * std::sin(x);
      m.qd += b * w * std::cos(x);
      m.qdd -= b * w * w * std::sin(x);
    }
    return m;
  };
  const auto load = [&](double t) {
    if (!truth.loaded) return 900.0;
    const Motion m = motion(t);
    return 800.0 * m.qdd + 1500.0 * std::cos(m.q + 0.7) + 700.0 * std::sin(1.3 * t + other);
  };
  const auto side = [](double qd) { return std::tanh(qd / 0.005); };
  const int n = static_cast<int>(truth.duration * truth.rate) + 1;
  Synthetic s;
  s.log.path = "synthetic.csv";
  s.log.time.resize(n);
  s.log.q.resize(n, 1);
  s.log.tau.resize(n, 1);
  s.gear_torque.resize(n, 1);
  Eigen::VectorXd qlink(n);
  const double decay = std::exp(-1.0 / (truth.rate * truth.memory));
  double e = truth.noise * normal(random);
  double play = 0.0, last = load(-truth.delay);
  for (int k = 0; k < n; ++k) {
    const double t = k / truth.rate;
    const Motion now = motion(t), then = motion(t - truth.delay);
    const double through = load(t - truth.delay);
    const double rate = (load(t - truth.delay + 1e-4) - load(t - truth.delay - 1e-4)) / 2e-4;
    play = std::clamp(play + (through - last) / 100.0, -1.0, 1.0);
    last = through;
    e = decay * e + std::sqrt(1.0 - decay * decay) * truth.noise * normal(random);
    s.log.time[k] = t;
    s.log.q(k, 0) = now.q;
    s.gear_torque(k, 0) = load(t);
    s.log.tau(k, 0) = load(t) + truth.motor_coulomb * side(now.qd) + truth.motor_viscous * now.qd +
                      truth.rotor_inertia * now.qdd + truth.torque_noise * normal(random);
    // The spring K φ + D φ' = τ with φ' slow against K/D: φ = c (τ − (D/K) τ').
    const double deflection = truth.compliance * (through - truth.damping * rate) +
                              0.5 * truth.lost_motion * side(then.qd) - 0.5 * truth.torque_play * play +
                              truth.eccentricity * std::sin(then.q + 0.3);
    qlink[k] = then.q - deflection + e;
  }
  s.log.extra = {{"qlink1", qlink}};
  return s;
}

JointStiffness fit_one(const data::Log& log, const JointEncoderOptions& options = {}) {
  return fit_joint_encoders({log}, options).pooled.at(0);
}
JointStiffness fit_one(const Truth& truth, const JointEncoderOptions& options = {}) {
  return fit_one(make(truth).log, options);
}

bool uses(const JointStiffness& s, DeflectionTerm term) {
  return std::find(s.terms.begin(), s.terms.end(), term) != s.terms.end();
}

std::string message_of(const std::vector<data::Log>& logs, const JointEncoderOptions& options = {}) {
  try {
    fit_joint_encoders(logs, options);
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

TEST(JointEncoders, RecoverTheStiffnessToOnePercent) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Truth truth;
    truth.seed = seed;
    truth.noise = 2e-6;
    truth.compliance = 0.5e-7 * seed;
    const JointStiffness s = fit_one(truth);
    ASSERT_TRUE(s.identifiable) << s.reason;
    EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01) << "seed " << seed;
    EXPECT_LT(s.rms, 0.2 * s.rms_rigid);
    EXPECT_GT(s.r2, 0.95);
  }
}

TEST(JointEncoders, TellADelayFromCompliance) {
  for (const double delay : {-0.004, 0.003, 0.025}) {
    Truth truth;
    truth.delay = delay;
    truth.noise = 2e-6;
    truth.motor_viscous = 0.0;
    const JointStiffness s = fit_one(truth);
    EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01) << "delay " << delay;
    EXPECT_NEAR(s.time_shift.value, delay, 2e-5);
  }
  // The same delay on a rigid joint is no compliance.
  Truth rigid;
  rigid.delay = 0.025;
  rigid.compliance = 0.0;
  rigid.noise = 10e-6;
  EXPECT_FALSE(fit_one(rigid).identifiable);
}

TEST(JointEncoders, AttributeViscousFrictionToTheDelayAndNotToTheStiffness) {
  Truth truth;
  truth.noise = 2e-6;
  truth.motor_viscous = 4000.0;
  const JointStiffness s = fit_one(truth);
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
  // δ − c f_v, as the header says
  EXPECT_NEAR(s.time_shift.value, truth.delay - truth.compliance * 4000.0, 2e-5);
}

TEST(JointEncoders, ReadTheLoopBothWays) {
  Truth truth;
  truth.noise = 2e-6;
  truth.motor_coulomb = 0.0;
  truth.lost_motion = 80e-6;
  const JointStiffness gear = fit_one(truth);
  EXPECT_NEAR(gear.direction.loop.value, 80e-6, 4e-6);
  EXPECT_GT(gear.direction.lost_motion_at_least, 60e-6);
  EXPECT_LE(gear.direction.lost_motion_at_least, 80e-6);
  EXPECT_EQ(gear.direction.motor_friction_at_least, 0.0);
  EXPECT_THAT(gear.direction.text, HasSubstr("of lost motion"));

  truth.motor_coulomb = 400.0;
  truth.lost_motion = 0.0;
  const JointStiffness motor = fit_one(truth);
  EXPECT_NEAR(motor.direction.friction_if_no_lost_motion, 400.0, 20.0);
  EXPECT_GT(motor.direction.motor_friction_at_least, 300.0);
  EXPECT_LE(motor.direction.motor_friction_at_least, 400.0);
  EXPECT_EQ(motor.direction.lost_motion_at_least, 0.0);
  EXPECT_TRUE(std::isinf(motor.direction.lost_motion_at_most));
  EXPECT_THAT(motor.direction.text, HasSubstr("motor's side"));

  // Both: with the joint's friction known, the lost motion has an upper bound, and the truth is below it.
  truth.lost_motion = 50e-6;
  JointEncoderOptions options;
  options.coulomb_friction = {400.0};
  const JointStiffness both = fit_one(truth, options);
  EXPECT_GE(both.direction.lost_motion_at_most, 50e-6);
  EXPECT_LT(both.direction.lost_motion_at_most, 70e-6);
  for (const JointStiffness& s : {gear, motor, both})
    EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
}

TEST(JointEncoders, FindHysteresisOfTheGear) {
  Truth truth;
  truth.noise = 2e-6;
  truth.torque_play = 60e-6;
  // Without friction on the motor's side tau is the gear's torque, and the width is right.
  truth.motor_coulomb = truth.motor_viscous = 0.0;
  const JointStiffness clean = fit_one(truth);
  ASSERT_TRUE(clean.gear_hysteresis.has_value());
  EXPECT_TRUE(uses(clean, DeflectionTerm::kTorqueHysteresis));
  EXPECT_NEAR(clean.gear_hysteresis->value, 60e-6, 3e-6);
  EXPECT_NEAR(clean.gear_hysteresis_torque, clean.gear_hysteresis->value * clean.stiffness.value, 1e-6);
  // It slips within 3.3 % of the range, between two of the widths tried.
  EXPECT_NEAR(clean.stiffness.value * truth.compliance, 1.0, 0.02);
  // With it tau turns at other times than the gear's torque does.
  truth.motor_coulomb = 300.0;
  truth.motor_viscous = 1000.0;
  const JointStiffness s = fit_one(truth);
  ASSERT_TRUE(s.gear_hysteresis.has_value());
  EXPECT_GT(s.gear_hysteresis->value, 0.8 * 60e-6);
  EXPECT_LT(s.gear_hysteresis->value, 1.05 * 60e-6);
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.05);
}

TEST(JointEncoders, FindDamping) {
  Truth truth;
  truth.noise = 2e-6;
  truth.damping = 0.05;
  truth.motor_viscous = 0.0;
  const JointStiffness s = fit_one(truth);
  ASSERT_TRUE(uses(s, DeflectionTerm::kDamping));
  for (const TermEvidence& e : s.evidence) {
    if (e.term == DeflectionTerm::kDamping) {
      EXPECT_NEAR(e.coefficients.at(0).value, truth.compliance * truth.damping,
                  0.1 * truth.compliance * truth.damping);
    }
  }
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
}

TEST(JointEncoders, TakeUpAnEccentricEncoder) {
  Truth truth;
  truth.noise = 5e-6;
  truth.eccentricity = 500e-6;
  const JointStiffness s = fit_one(truth);
  EXPECT_TRUE(uses(s, DeflectionTerm::kEccentricity) || uses(s, DeflectionTerm::kPosition));
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.03);
  // Without the term the answer is another one, and the evidence says so.
  JointEncoderOptions plain;
  plain.terms = std::vector<DeflectionTerm>{};
  const JointStiffness blind = fit_one(truth, plain);
  EXPECT_GT(std::abs(blind.stiffness.value * truth.compliance - 1.0), 0.05);
  EXPECT_GT(blind.rms, 2.0 * s.rms);
}

TEST(JointEncoders, RefuseTermsThatAreNotThere) {
  int used = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Truth truth;
    truth.seed = seed;
    truth.noise = 30e-6;
    const JointStiffness s = fit_one(truth);
    used += s.terms.size() > 4;
    EXPECT_EQ(s.evidence.size(), 9u);
    for (const TermEvidence& e : s.evidence) {
      EXPECT_FALSE(e.verdict.empty());
      EXPECT_EQ(e.used, uses(s, e.term));
    }
  }
  // A level of 5 % over all terms tried: 1 expected, P(more than 4) = 0.3 %.
  EXPECT_LE(used, 4);
}

TEST(JointEncoders, NeedTheRotorsInertia) {
  Truth truth;
  truth.noise = 2e-6;
  truth.rotor_inertia = 600.0;
  JointEncoderOptions options;
  options.rotor_inertia = {600.0};
  const JointStiffness s = fit_one(truth, options);
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
  const JointStiffness without = fit_one(truth);
  EXPECT_GT(without.stiffness.value * truth.compliance, 1.02);
  EXPECT_THAT(without.notes, Contains(HasSubstr("no rotor inertia")));
  EXPECT_THAT(s.notes, Not(Contains(HasSubstr("no rotor inertia"))));
}

TEST(JointEncoders, AnInstrumentTakesTheBiasOfTorqueNoiseAway) {
  Truth truth;
  truth.noise = 5e-6;
  truth.torque_noise = 2500.0;
  truth.duration = 120.0;
  const Synthetic s = make(truth);
  const JointStiffness plain = fit_one(s.log);
  EXPECT_LT(plain.compliance.value, 0.9 * truth.compliance);
  EXPECT_GT(plain.attenuation, 0.05);
  EXPECT_THAT(plain.notes, Contains(HasSubstr("noise of tau1")));
  JointEncoderOptions options;
  options.torque = GearTorque::kInstrumental;
  // A model that is 20 % wrong in scale serves as well.
  options.model_torque = {1.2 * s.gear_torque};
  const JointStiffness instrumental = fit_one(s.log, options);
  EXPECT_TRUE(instrumental.compliance.contains(truth.compliance));
  EXPECT_NEAR(instrumental.compliance.value / truth.compliance, 1.0, 0.05);
  options.torque = GearTorque::kModel;
  options.model_torque = {s.gear_torque};
  EXPECT_NEAR(fit_one(s.log, options).compliance.value / truth.compliance, 1.0, 0.02);
}

TEST(JointEncoders, SayThatARigidJointIsAtLeastSoStiff) {
  Truth truth;
  truth.compliance = 0.0;
  truth.noise = 10e-6;
  const JointStiffness s = fit_one(truth);
  EXPECT_FALSE(s.identifiable);
  EXPECT_TRUE(std::isinf(s.stiffness.upper));
  EXPECT_GT(s.stiffness.lower, 1e7);
  EXPECT_THAT(s.reason, HasSubstr("at least"));
  EXPECT_THAT(s.reason, HasSubstr("N·m"));
}

TEST(JointEncoders, SayThatTheDeflectionGoesTheWrongWay) {
  Truth truth;
  truth.compliance = -1.5e-7;
  truth.noise = 2e-6;
  const JointStiffness s = fit_one(truth);
  EXPECT_FALSE(s.identifiable);
  EXPECT_TRUE(std::isnan(s.stiffness.value));
  EXPECT_THAT(s.reason, HasSubstr("check the signs of qlink1 and tau1"));
}

TEST(JointEncoders, SayThatTheLinkEncoderRepeatsTheMotors) {
  data::Log log = make({}).log;
  log.extra = {{"qlink1", log.q.col(0)}};
  const JointStiffness s = fit_one(log);
  EXPECT_FALSE(s.identifiable);
  EXPECT_THAT(s.reason, HasSubstr("repeats q1"));
}

TEST(JointEncoders, SayThatAConstantLoadTellsNothing) {
  Truth truth;
  truth.loaded = false;
  truth.noise = 2e-6;
  truth.rotor_inertia = 0.0;
  const JointStiffness s = fit_one(truth);
  EXPECT_FALSE(s.identifiable) << s.compliance.value << " " << s.independent_torque;
  EXPECT_THAT(s.reason, HasSubstr("load"));
}

TEST(JointEncoders, WorkOnAJointAtRestThatOthersLoad) {
  Truth truth;
  truth.moves = false;
  truth.motor_coulomb = 0.0;
  truth.noise = 2e-6;
  const JointStiffness s = fit_one(truth);
  ASSERT_TRUE(s.identifiable) << s.reason;
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
  EXPECT_FALSE(s.time_shift_known);
  EXPECT_THAT(s.notes, Contains(HasSubstr("does not move")));
}

TEST(JointEncoders, LeaveMissingSamplesOut) {
  Truth truth;
  truth.noise = 2e-6;
  data::Log log = make(truth).log;
  std::mt19937 random(5);
  std::uniform_int_distribution<int> row(0, log.num_samples() - 1);
  for (int i = 0; i < 60; ++i) {
    log.q(row(random), 0) = kNaN;
    log.tau(row(random), 0) = std::numeric_limits<double>::infinity();
    log.extra[0].second[row(random)] = kNaN;
  }
  log.tau.block(1000, 0, 100, 1).setConstant(kNaN);
  const JointStiffness s = fit_one(log);
  ASSERT_TRUE(s.identifiable) << s.reason;
  EXPECT_NEAR(s.stiffness.value * truth.compliance, 1.0, 0.01);
  EXPECT_LT(s.samples, log.num_samples() - 250);
  EXPECT_GT(s.samples, log.num_samples() / 2);
}

TEST(JointEncoders, StateIntervalsThatHoldTheTruth) {
  // 400 experiments at 95 %: standard deviation 1.1 %, so 92 to 98 % are 2.75 of them either way (P = 0.6 %).
  constexpr int kExperiments = 400;
  int held = 0;
  double squares = 0.0;
  for (unsigned seed = 0; seed < kExperiments; ++seed) {
    Truth truth;
    truth.seed = 5000 + seed;
    truth.duration = 20.0;
    truth.noise = 30e-6;
    truth.lost_motion = 60e-6;
    truth.torque_noise = 10.0;
    const JointStiffness s = fit_one(truth);
    held += s.compliance.contains(truth.compliance);
    const double z = (s.compliance.value - truth.compliance) / s.compliance.std;
    squares += z * z / kExperiments;
  }
  EXPECT_GE(held, static_cast<int>(0.92 * kExperiments));
  EXPECT_LE(held, static_cast<int>(0.98 * kExperiments));
  RecordProperty("held", held);
  RecordProperty("mean_square_z", std::to_string(squares));
}

TEST(JointEncoders, CompareLogs) {
  Truth truth;
  truth.noise = 10e-6;
  truth.seed = 11;
  Truth same = truth, softer = truth;
  same.seed = softer.seed = 12;
  softer.compliance *= 1.3;
  const JointEncoderFit one = fit_joint_encoders({make(truth).log, make(same).log});
  ASSERT_EQ(one.separate.size(), 2u);
  ASSERT_EQ(one.agreement.size(), 1u);
  EXPECT_GE(one.agreement[0].chi_square, 0.0);
  EXPECT_EQ(one.agreement[0].degrees_of_freedom, 1);
  EXPECT_EQ(one.pooled[0].offset.size(), 2u);
  EXPECT_LT(one.pooled[0].compliance.std, one.separate[0][0].compliance.std);
  EXPECT_TRUE(one.pooled[0].compliance.contains(truth.compliance));
  const JointEncoderFit two = fit_joint_encoders({make(truth).log, make(softer).log});
  EXPECT_FALSE(two.agreement[0].agrees) << two.agreement[0].text;
  EXPECT_THAT(two.agreement[0].text, HasSubstr("do not agree"));
  EXPECT_LT(two.agreement[0].p_value, 0.01);
}

TEST(JointEncoders, SeldomSayThatEqualLogsDisagree) {
  // Level 5 %: of 20 pairs 1 expected, P(more than 4) = 0.3 %.
  int disagree = 0;
  for (unsigned seed = 100; seed < 140; seed += 2) {
    Truth truth;
    truth.noise = 20e-6;
    truth.duration = 20.0;
    truth.seed = seed;
    Truth same = truth;
    same.seed = seed + 1;
    disagree += !fit_joint_encoders({make(truth).log, make(same).log}).agreement.at(0).agrees;
  }
  EXPECT_LE(disagree, 4);
}

TEST(JointEncoders, CompareTheDelayOfJoints) {
  const auto two_joints = [](double first, double second) {
    Truth truth;
    truth.noise = 5e-6;
    truth.motor_viscous = 0.0;
    truth.delay = first;
    Synthetic a = make(truth);
    truth.seed = 2;
    truth.delay = second;
    const Synthetic b = make(truth);
    data::Log log = a.log;
    log.q.conservativeResize(Eigen::NoChange, 3);
    log.tau.conservativeResize(Eigen::NoChange, 3);
    log.q.col(1).setZero();
    log.tau.col(1).setZero();
    log.q.col(2) = b.log.q;
    log.tau.col(2) = b.log.tau;
    log.extra = {{"qlink3", b.log.extra[0].second}, {"qlink1", a.log.extra[0].second}};
    return fit_joint_encoders({log});
  };
  const JointEncoderFit same = two_joints(0.003, 0.003);
  EXPECT_EQ(same.joints, (std::vector<int>{0, 2}));
  EXPECT_EQ(same.pooled[1].joint, 2);
  ASSERT_TRUE(same.time_shift.at(0).known);
  EXPECT_TRUE(same.time_shift[0].agrees);
  EXPECT_NEAR(same.time_shift[0].value.value, 0.003, 2e-5);
  EXPECT_FALSE(two_joints(0.003, 0.004).time_shift.at(0).agrees);
}

TEST(JointEncoders, RefuseLogsThatCannotAnswer) {
  const data::Log good = make({}).log;
  data::Log log = good;
  log.extra.clear();
  EXPECT_THAT(message_of({log}), HasSubstr("synthetic.csv: no column qlink1.. found"));
  log = good;
  log.tau.resize(log.num_samples(), 0);
  EXPECT_THAT(message_of({log}), HasSubstr("no column tau1.. found"));
  Truth brief;
  brief.duration = 4.0;
  EXPECT_THAT(message_of({make(brief).log}), HasSubstr("at least 5 s are needed"));
  log = good;
  log.tau.setConstant(kNaN);
  EXPECT_THAT(message_of({log}), HasSubstr("0.0 s of samples with q1, qlink1 and tau1"));
  log = good;
  log.path = "other.csv";
  log.q.conservativeResize(Eigen::NoChange, 2);
  log.q.col(1).setZero();
  log.tau.conservativeResize(Eigen::NoChange, 2);
  log.tau.col(1).setZero();
  EXPECT_THAT(message_of({good, log}), HasSubstr("other.csv: other joints"));
  EXPECT_THAT(message_of({}), HasSubstr("no log given"));
  JointEncoderOptions options;
  options.rotor_inertia = {1.0, 2.0};
  EXPECT_THAT(message_of({good}, options), HasSubstr("rotor inertia: 2 values given for 1 joints"));
  options = {};
  options.torque = GearTorque::kModel;
  EXPECT_THAT(message_of({good}, options), HasSubstr("0 matrices given for 1 logs"));
  options.model_torque = {Eigen::MatrixXd::Zero(3, 1)};
  EXPECT_THAT(message_of({good}, options), HasSubstr("model torque is 3 × 1"));
}

}  // namespace
}  // namespace heft::stiffness
