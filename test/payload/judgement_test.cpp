// A load is what it says, or contradicts itself.
#include "payload/judgement.hpp"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/model_file.hpp"
#include "payload/payload_run.hpp"
#include "payload/recursive_fit.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"

namespace heft::payload {
namespace {

using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Rank = host::Verdict;

/// A run that found this body, every parameter known to a hundredth of the body's size.
PayloadRun found_body(const InertialParameters<double>& body, double share = 0.01) {
  PayloadRun run;
  run.parameters = Eigen::Map<const VectorXd>(body.data(), 10);
  const VectorXd size{{1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01}};
  run.covariance = (share * size).cwiseAbs2().asDiagonal();
  run.interval_factor = 2.0;
  const auto part = [&](int from, int count) {
    std::vector<Estimated> estimated;
    for (int i = from; i < from + count; ++i) {
      estimated.push_back({statistics::Interval::around(run.parameters[i], std::sqrt(run.covariance(i, i)),
                                                        run.interval_factor),
                           true});
    }
    return estimated;
  };
  run.mass = part(0, 1).front();
  run.first_moment = part(1, 3);
  run.inertia = part(4, 6);
  run.mass_visible = true;
  run.converged_at = 5.0;
  return run;
}

const InertialParameters<double> kBody =
    test::body(2.0, {0.05, 0.1, -0.05}, {0.02, 0.001, 0.015, 0, 0, 0.02});

TEST(Load, ThatABodyCanHaveIsGood) {
  EXPECT_THAT(contradiction(found_body(kBody)), IsEmpty());
  EXPECT_EQ(judge(found_body(kBody)).verdict, Rank::kGood);
}

TEST(Load, BelowZeroBeyondItsIntervalAsksWhetherTheLogsAreInterchanged) {
  InertialParameters<double> taken = kBody;
  for (double& p : taken) p = -p;
  const PayloadRun run = found_body(taken);
  EXPECT_THAT(contradiction(run), AllOf(HasSubstr("-2 kg"), HasSubstr("interchanged")));
  EXPECT_FALSE(judge(run).usable());
}

TEST(Load, BelowZeroWithinItsIntervalIsNoContradiction) {
  PayloadRun run = found_body({});
  run.mass = {statistics::Interval::around(-0.01, 0.01, 2.0), true};
  EXPECT_THAT(contradiction(run), IsEmpty());
  run.mass = {statistics::Interval::around(-0.03, 0.01, 2.0), true};
  EXPECT_THAT(contradiction(run), HasSubstr("mass is negative"));
}

TEST(Load, WithAnInertiaThatNoBodyHasIsAContradictionBeyondItsIntervalsOnly) {
  // Ixx about the flange of a mass 0.11 m off its x axis is at least m (cy² + cz²) = 0.025; here it is 0.
  InertialParameters<double> impossible = kBody;
  impossible[4] = 0.0;
  EXPECT_THAT(contradiction(found_body(impossible)), HasSubstr("mass, centre of mass and inertia are "
                                                               "physically impossible"));
  EXPECT_THAT(contradiction(found_body(impossible, 0.5)), IsEmpty());
  // A point, whose pseudo-inertia is singular, is a body within any interval.
  EXPECT_THAT(contradiction(found_body(test::body(2.0, {0.05, 0.1, -0.05}, {0, 0, 0, 0, 0, 0}))), IsEmpty());
}

TEST(Load, ThatOneJointFeelsDifferentlyIsDoubtfulOrAContradiction) {
  PayloadRun run = found_body(kBody);
  const auto scale = [](double value, double half_width) -> Estimated {
    return {statistics::Interval::around(value, half_width, 1.0), true};
  };
  run.torque_scale = {scale(1.0, 0.05), scale(1.3, 0.05), scale(1.02, 0.01)};
  EXPECT_EQ(judge(run).verdict, Rank::kDoubtful);
  EXPECT_THAT(judge(run).reasons,
              ::testing::ElementsAre(AllOf(HasSubstr("joint 2 1.30"), Not(HasSubstr("joint 3")))));
  run.torque_scale[1] = scale(1.3, 0.4);
  EXPECT_EQ(judge(run).verdict, Rank::kGood);
  run.torque_scale[1] = scale(-1.0, 0.4);
  EXPECT_THAT(contradiction(run), AllOf(HasSubstr("joint 2"), HasSubstr("sign")));
  run.torque_scale[1].identifiable = false;
  EXPECT_THAT(contradiction(run), IsEmpty());
}

/// A load weighed on logs whose torque of one joint was multiplied by a factor, in both.
PayloadRun weighed(int joint, double factor, bool loaded = true) {
  const model::Robot arm = test::six_joint_arm();
  const InertialParameters<double> load =
      test::body(1.5, {0.04, 0.11, -0.05}, {0.01, 0.001, 0.008, -0.002, 0.0005, 0.012});
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  data::Log bare = test::synthetic_log(arm, settings);
  settings.noise_seed = 2;
  data::Log carrying = test::synthetic_log(loaded ? test::carrying(arm, load) : arm, settings);
  bare.tau.col(joint) *= factor;
  carrying.tau.col(joint) *= factor;
  const RecursiveFit fit = fit_recursively(arm, {bare});
  model::Robot fitted = arm;
  model::apply(fit.model, fitted);
  PayloadRunOptions options;
  options.residual = fit.residual;
  options.model_covariance = fit.model.covariance;
  return run_payload(fitted, carrying, options);
}

/// A load that is known whole.
Payload known_load(const InertialParameters<double>& body) {
  Payload load;
  load.log = "carrying.csv";
  load.run = found_body(body);
  for (std::size_t k = 1; k < 4; ++k)
    load.run.com.push_back({statistics::Interval::around(body[k] / body[kMass], 0.001, 2.0), true});
  return load;
}

TEST(Body, IsWhatWasFoundOrAPointWhereNoBodyHasTheInertia) {
  Payload load = known_load(kBody);
  EXPECT_TRUE(load.has_inertia());
  EXPECT_EQ(load.body(), kBody);
  load.run.inertia[3].identifiable = false;
  EXPECT_FALSE(load.has_inertia());
  load = known_load(kBody);
  load.run.parameters[kIxx] = -0.01;
  EXPECT_FALSE(load.has_inertia());
  const InertialParameters<double> point = load.body();
  EXPECT_EQ(point[kMass], 2.0);
  // Of 2 kg at (0.05, 0.1, -0.05): m c, and -m c_y c_z.
  EXPECT_NEAR(point[kMcy], 0.2, 1e-12);
  EXPECT_NEAR(point[kIyz], 0.01, 1e-12);
}

TEST(Body, IsRefusedWhereTheMassIsNotClearOfZeroOrTheCentreIsNotKnown) {
  Payload load = known_load(kBody);
  load.run.com[2].identifiable = false;
  EXPECT_THROW(load.body(), NotIdentifiableError);
  load = known_load(kBody);
  load.run.mass.lower = -0.1;
  EXPECT_THROW(load.body(), NotIdentifiableError);
  load = known_load(kBody);
  load.run.mass.identifiable = false;
  EXPECT_THROW(load.body(), NotIdentifiableError);
  load = known_load(kBody);
  load.contradiction = "the load of this log is impossible";
  EXPECT_THROW(load.body(), NotIdentifiableError);
}

TEST(TorqueScale, IsOneWhereTheJointsAgree) {
  const PayloadRun run = weighed(2, 1.0);
  int known = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    if (!run.torque_scale[j].identifiable) continue;
    ++known;
    // 95 % intervals of six joints: twice the half-width holds for all of them.
    EXPECT_NEAR(run.torque_scale[j].value, 1.0, 2.0 * run.torque_scale[j].half_width()) << "joint " << j + 1;
  }
  EXPECT_GE(known, 3);
  EXPECT_EQ(judge(run).verdict, Rank::kGood) << ::testing::PrintToString(judge(run).reasons);
}

TEST(TorqueScale, NamesTheJointWithAnotherTorqueConstant) {
  const PayloadRun run = weighed(2, 1.3);
  ASSERT_TRUE(run.torque_scale[2].identifiable);
  // Against the others, which the load found is a compromise with.
  double others = 0.0;
  int count = 0;
  for (const std::size_t j : {1U, 3U}) {
    if (!run.torque_scale[j].identifiable) continue;
    others += run.torque_scale[j].value, ++count;
  }
  ASSERT_GT(count, 0);
  EXPECT_NEAR(run.torque_scale[2].value / (others / count), 1.3, 0.15);
  EXPECT_EQ(judge(run).verdict, Rank::kDoubtful);
  EXPECT_THAT(judge(run).reasons, ::testing::Contains(HasSubstr("joint 3")));
}

TEST(TorqueScale, SaysNothingWhereThereIsNoLoad) {
  const PayloadRun run = weighed(2, 1.0, false);
  EXPECT_THAT(contradiction(run), IsEmpty());
  ASSERT_EQ(run.torque_scale.size(), 6U);
  for (const Estimated& scale : run.torque_scale) EXPECT_FALSE(scale.identifiable);
}

}  // namespace
}  // namespace heft::payload
