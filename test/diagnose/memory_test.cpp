/// What several logs of an arm reveal: friction that remembers, from what a joint does after it has stopped (two joints
/// settle by tenths of a milliradian, with encoders too coarse to show it), and effects too small for one run.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "heft/core/effects/effects.hpp"
#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/identify/identify.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRate = 200.0, kX0 = 2e-4, kSharp = 0.3;

model::Robot arm() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.0, 6.0, 2.0, 0.0};
  robot.joints[1].actuation = {0.0, 3.0, 1.0, 0.0};
  return robot;
}

model::Robot remembering_arm() {
  model::Robot robot = arm();
  JointEffect<double> memory;
  memory.kind = joint_effect_kind<Hysteresis>();
  memory.joint = 0;
  memory.parameters = {kX0, kSharp};
  memory.displacement = Displacement::kVelocity;
  robot.effects = {memory};
  return robot;
}

/// Rests, moves for 24 s and rests again; each joint swings back a little as it stops.
/// @param coarse  joints whose encoder has steps and noise
data::Log log_of(const model::Robot& robot, unsigned seed, bool velocities, int coarse = 2) {
  const double moving = 24.0, begin = 2.0, rest = 4.0;
  const auto rows = static_cast<Index>((begin + moving + rest) * kRate);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 6.28), part(0.7, 1.3);
  std::normal_distribution<double> noise(0.0, 1.0);
  data::Log log;
  log.path = "memory-" + std::to_string(seed);
  log.time.resize(rows), log.q.resize(rows, 2), log.qd.resize(rows, 2);
  MatrixXd qdd(rows, 2), steps = MatrixXd::Zero(rows, 4);
  for (int j = 0; j < 2; ++j) {
    const double a = 0.5 * part(random), b = 0.25 * part(random), f = 0.13 * part(random),
                 g = 0.41 * part(random);
    const double p = phase(random), r = phase(random), back = 2.5e-4 * part(random);
    const auto q = [&](double t) {
      const double u = t - begin, w = 2.0 * 3.14159265358979;
      if (u <= 0.0) return 0.0;
      // Fades in and out within a second.
      const double in = std::min(u, 1.0), out = std::min(std::max(moving - u, 0.0), 1.0);
      const double fade =
          in * in * in * (10 - in * (15 - 6 * in)) * out * out * out * (10 - out * (15 - 6 * out));
      const double settled =
          u > moving ? back * (std::exp(-8.0 * (u - moving)) * (1 + 8.0 * (u - moving)) - 1) : 0.0;
      return fade * (a * std::sin(w * f * u + p) + b * std::sin(w * g * u + r)) + settled;
    };
    constexpr double h = 1e-4;
    for (Index k = 0; k < rows; ++k) {
      const double t = log.time[k] = static_cast<double>(k) / kRate;
      log.q(k, j) = q(t);
      log.qd(k, j) = (q(t + h) - q(t - h)) / (2 * h);
      qdd(k, j) = (q(t + h) - 2 * q(t) + q(t - h)) / (h * h);
      if (k > 0) steps(k, j) = log.q(k, j) - log.q(k - 1, j);
    }
  }
  log.tau = model::MotionTorque(robot).torque(log.time, log.q, log.qd, qdd, 1e-3, steps);
  for (Index k = 0; k < rows; ++k) {
    for (int j = 0; j < 2; ++j) {
      log.tau(k, j) += 0.05 * noise(random);
      if (j < coarse) log.q(k, j) = 2.4e-5 * std::round((log.q(k, j) + 2e-5 * noise(random)) / 2.4e-5);
    }
  }
  if (!velocities) log.qd.resize(0, 0);
  return log;
}

TEST(Memory, GoesByTheVelocityWhereTheEncoderIsTooCoarse) {
  for (const bool velocities : {true, false}) {
    const auto log = [velocities](unsigned seed) { return log_of(remembering_arm(), seed, velocities); };
    const Diagnosis d = diagnose(arm(), {log(1), log(2), log(3)}, {log(4)});
    const Finding* found = nullptr;
    for (const Finding& f : d.findings) {
      EXPECT_TRUE(f.effect.is<Hysteresis>() && f.joint == 0) << f.effect.id() << " " << f.joint + 1;
      found = &f;
    }
    ASSERT_NE(found, nullptr) << velocities;
    if (!velocities) {
      EXPECT_EQ(found->displacement, Displacement::kPosition);
      continue;
    }
    EXPECT_NE(found->displacement, Displacement::kPosition);
    EXPECT_NEAR(found->parameters[0].second, kX0, 0.15 * kX0);
    EXPECT_NEAR(found->parameters[1].second, kSharp, 0.05);
    // What holds the joint at rest is reported.
    const Traces& judged = d.validate.front();
    const auto at_rest = static_cast<Index>(3.0 * kRate);
    const auto rms = [&](const MatrixXd& r) {
      return std::sqrt(r.col(0).tail(at_rest).squaredNorm() / static_cast<double>(at_rest));
    };
    EXPECT_LT(rms(judged.after), 0.1 * rms(judged.before));
  }
}

TEST(Memory, OfTwoDistancesIsFoundWhereThreeRunsAgree) {
  // Most of the friction turns over within a short distance, the rest within one fifteen times as long.
  constexpr double kShort = 1.5e-4, kLong = 2.2e-3, kPart = 0.6;
  model::Robot robot = remembering_arm();
  robot.effects.push_back(robot.effects[0]);
  robot.effects[0].parameters = {kShort, 1.0 - kPart};
  robot.effects[1].parameters = {kLong, kPart};
  const auto log = [&robot](unsigned seed) { return log_of(robot, seed, true); };

  const Diagnosis two = diagnose(arm(), {log(1), log(2)}, {log(4)});
  ASSERT_EQ(two.findings.size(), 1u);
  EXPECT_TRUE(two.findings[0].effect.is<Hysteresis>());

  const Diagnosis three = diagnose(arm(), {log(1), log(2), log(3)}, {log(4)});
  ASSERT_EQ(three.findings.size(), 2u);
  std::vector<std::pair<double, double>> found;  // distance and part
  for (const Finding& f : three.findings) {
    EXPECT_TRUE(f.effect.is<Hysteresis>() && f.joint == 0) << f.effect.id() << " " << f.joint + 1;
    found.emplace_back(f.parameters[0].second, 1.0 - f.parameters[1].second);
  }
  std::sort(found.begin(), found.end());
  EXPECT_NEAR(found[0].first, kShort, 0.25 * kShort);
  EXPECT_NEAR(found[1].first, kLong, 0.25 * kLong);
  EXPECT_NEAR(found[0].second, kPart, 0.1);
  EXPECT_NEAR(found[0].second + found[1].second, 1.0, 0.05);
  EXPECT_LT(three.validate_after.rmse[0], 0.8 * two.validate_after.rmse[0]);
  // The robot that is handed on holds both.
  EXPECT_EQ(three.after.effects.size(), 2u);
}

TEST(Motion, KeepsTheBandThatWasAskedFor) {
  // Chosen by the residual, the cut-off of these logs is lower.
  const auto log = [](unsigned seed) { return log_of(arm(), seed, false); };
  DiagnoseOptions options;
  options.band = 25.0;
  const double chosen = diagnose(arm(), {log(1)}, {log(2)}).cutoff;
  EXPECT_LT(chosen, options.band);
  EXPECT_GE(diagnose(arm(), {log(1)}, {log(2)}, options).cutoff, options.band);
  options.band = 0.45 * kRate;  // higher than any cut-off tried: no limit
  EXPECT_EQ(diagnose(arm(), {log(1)}, {log(2)}, options).cutoff, chosen);
  options.cutoff = 10.0;
  EXPECT_EQ(diagnose(arm(), {log(1)}, {log(2)}, options).cutoff, 10.0);
}

TEST(Motion, OfAJointWithAQuietEncoderIsCutOffFurtherUp) {
  // What the encoder of joint 1 adds keeps its cut-off low; that of joint 2 adds nothing.
  const data::Log train = log_of(arm(), 1, false, 1), judge = log_of(arm(), 2, false, 1);
  const Diagnosis d = diagnose(arm(), {train}, {judge});
  ASSERT_EQ(d.joint_cutoffs.size(), 2);
  EXPECT_GT(d.joint_cutoffs[1], 1.9 * d.joint_cutoffs[0]);
  EXPECT_EQ(d.cutoff, d.joint_cutoffs.minCoeff());
  EXPECT_TRUE(d.findings.empty());

  DiagnoseOptions options;
  options.cutoff = 10.0;
  const Diagnosis asked = diagnose(arm(), {train}, {judge}, options);
  EXPECT_EQ(asked.joint_cutoffs.minCoeff(), 10.0);
  EXPECT_EQ(asked.joint_cutoffs.maxCoeff(), 10.0);
}

/// Stamps of another clock than that of the samples, as a program sets them that reads late.
data::Log stamped_late(data::Log log, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> late(0.0, 0.3 / kRate);
  for (double& t : log.time) t += late(random);
  return log;
}

TEST(WrittenModel, IsIdentifysWhereStampsScatterAndNothingIsFound) {
  // The search takes samples from where the positions say; identify and validate take the stamps.
  const data::Log train = stamped_late(log_of(arm(), 1, false), 3),
                  judge = stamped_late(log_of(arm(), 2, false), 4);
  const Diagnosis d = diagnose(arm(), {train}, {judge});
  ASSERT_TRUE(d.findings.empty());
  ASSERT_FALSE(d.notes.empty());
  EXPECT_NE(d.notes.front().find("samples are placed accordingly"), std::string::npos) << d.notes.front();
  const auto fit = identify::identify(arm(), data::log_set(arm().joint_specs(), {train}, {judge})).fit;
  for (std::size_t j = 0; j < 2; ++j) {
    const auto &found = d.after.joints[j].actuation, &expected = fit.robot.joints[j].actuation;
    // The first joint's cannot be told from its link's.
    if (j > 0) {
      EXPECT_NEAR(found.rotor_inertia, expected.rotor_inertia, 1e-9);
    }
    EXPECT_NEAR(found.coulomb_friction, expected.coulomb_friction, 1e-9);
    EXPECT_NEAR(found.viscous_friction, expected.viscous_friction, 1e-9);
    EXPECT_NEAR(found.friction_offset, expected.friction_offset, 1e-9);
  }
}

TEST(Size, ThatMattersIsLessWhereThreeRunsAgree) {
  // An offset that makes up between one and two per cent of its joint's error: two runs leave it open, three that all
  // show it do not.
  model::Robot robot = arm();
  robot.joints[1].actuation.friction_offset = 0.04;
  const auto log = [&robot](unsigned seed) { return log_of(robot, seed, false); };
  const auto is_the_offset = [](const auto& x) { return x.effect.template is<Offset>() && x.joint == 1; };

  const Diagnosis two = diagnose(arm(), {log(2), log(3)}, {log(4)});
  EXPECT_TRUE(two.findings.empty());
  const auto refused = std::find_if(two.refusals.begin(), two.refusals.end(), is_the_offset);
  ASSERT_NE(refused, two.refusals.end());
  EXPECT_GT(refused->gain, 1.0 - 0.99 * 0.99);  // of the squared error
  EXPECT_LT(refused->gain, 1.0 - 0.98 * 0.98);

  const Diagnosis three = diagnose(arm(), {log(1), log(2), log(3)}, {log(4)});
  EXPECT_EQ(std::count_if(three.findings.begin(), three.findings.end(), is_the_offset), 1);
}

}  // namespace
}  // namespace heft::diagnose
