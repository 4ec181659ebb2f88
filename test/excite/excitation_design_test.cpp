/// Exciting motions: gradient, limits, figures and refusals.
#include "heft/excite/excitation_design.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/arms.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using regression::BaseParameters;
using regression::find_base_parameters;
using ::testing::AllOf;
using ::testing::HasSubstr;

model::Robot ur10e() { return urdf::load_urdf(std::string(HEFT_URDF_DIR) + "/ur10e.urdf"); }

/// The arm with rotor inertia and a gear that couples the last two joints: every kind of column.
model::Robot coupled_arm() {
  model::Robot robot = test::six_joint_arm();
  robot.couplings.push_back({4, 5, 0.7, 0.05, 1.1, 0.3});
  for (model::RobotJoint& joint : robot.joints) {
    joint.lower = -3.0;
    joint.upper = 3.0;
  }
  return robot;
}

ExcitationOptions quick_design() {
  ExcitationOptions options;
  options.duration = 10.0;
  options.starts = 2;
  options.finalists = 1;
  options.iterations = 45;
  return options;
}

/// Largest difference between the gradient and central differences of the cost, relative to the gradient.
double gradient_error(const ExcitationDesign& design, double barrier) {
  // A random motion lies on a limit, where the barrier is infinite: a slower one is not.
  VectorXd x, gradient;
  double value = std::numeric_limits<double>::infinity();
  for (std::uint64_t seed = 3; !std::isfinite(value) && seed < 30; ++seed) {
    ExcitationTrajectory motion = design.random_motion(seed);
    motion.sine *= 0.9;
    motion.cosine *= 0.9;
    x = design.encode(motion);
    value = design.cost(x, barrier, &gradient);
  }
  EXPECT_TRUE(std::isfinite(value));
  EXPECT_EQ(gradient.size(), design.num_variables());
  double worst = 0.0;
  for (Index i = 0; i < x.size(); i += 3) {
    VectorXd up = x, down = x;
    const double h = 1e-5;
    up[i] += h;
    down[i] -= h;
    VectorXd up2 = x, down2 = x;
    up2[i] += 2.0 * h;
    down2[i] -= 2.0 * h;
    // Four points: near the limits the barrier bends too much for two.
    const double difference = (8.0 * (design.cost(up, barrier) - design.cost(down, barrier)) -
                               (design.cost(up2, barrier) - design.cost(down2, barrier))) /
                              (12.0 * h);
    worst = std::max(worst, std::abs(difference - gradient[i]));
  }
  return worst / gradient.cwiseAbs().maxCoeff();
}

std::string refusal(const model::Robot& robot, const MotionLimits& limits, const ExcitationOptions& options) {
  try {
    ExcitationDesign(robot, limits, options).random_motion(1);
  } catch (const InputError& error) {
    return error.what();
  } catch (const NotIdentifiableError& error) {
    return std::string("no safe motion: ") + error.what();
  }
  return "accepted";
}

// Differences of step 1e-5 leave about 1e-9 of rounding and less of truncation.
TEST(ExcitationGradient, AgreesWithDifferencesForBothCosts) {
  for (const ExcitationCost cost : {ExcitationCost::kDOptimal, ExcitationCost::kCondition}) {
    ExcitationOptions options = quick_design();
    options.cost = cost;
    const model::Robot robot = ur10e();
    EXPECT_LT(gradient_error(ExcitationDesign(robot, limits_of(robot), options), 0.0), 1e-6);
  }
}

TEST(ExcitationGradient, AgreesWithDifferencesThroughTheBarrierOfEveryLimit) {
  const model::Robot robot = ur10e();
  MotionLimits limits = limits_of(robot);
  limits.acceleration.setConstant(4.0);
  limits.torque *= 0.8;
  limits.box =
      std::array<Eigen::Vector3d, 2>{Eigen::Vector3d(-1.5, -1.5, -0.5), Eigen::Vector3d(1.5, 1.5, 2.0)};
  EXPECT_LT(gradient_error(ExcitationDesign(robot, limits, quick_design()), 0.1), 1e-6);
}

TEST(ExcitationGradient, AgreesWithDifferencesForEveryKindOfColumn) {
  const model::Robot robot = coupled_arm();
  ExcitationOptions options = quick_design();
  options.structure = {true, true, true, true, robot.couplings};
  options.harmonics = 6;
  EXPECT_LT(gradient_error(ExcitationDesign(robot, limits_of(robot), options), 0.1), 1e-6);
}

TEST(ExcitationGradient, AgreesWithDifferencesOnAPrismaticAxisAndAFixedStart) {
  model::Robot robot = test::scara_arm();
  for (model::RobotJoint& joint : robot.joints) {
    joint.lower = joint.joint.type == JointType::kPrismatic ? 0.0 : -2.5;
    joint.upper = joint.joint.type == JointType::kPrismatic ? 0.15 : 2.5;
    joint.velocity_limit = 2.0;
  }
  ExcitationOptions options = quick_design();
  options.start = Eigen::Vector4d(0.3, -0.4, 0.07, 0.1);
  options.duration = 9.0;  // two and a quarter periods
  options.period = 4.0;
  const ExcitationDesign design(robot, limits_of(robot), options);
  EXPECT_LT(gradient_error(design, 0.05), 1e-6);
}

TEST(ExcitationTrajectory, StartsAndEndsAtRestWhateverTheDuration) {
  const model::Robot robot = ur10e();
  for (const double duration : {10.0, 20.0, 27.3}) {
    ExcitationOptions options = quick_design();
    options.period = 10.0;
    options.duration = duration;
    const ExcitationDesign design(robot, limits_of(robot), options);
    const ExcitationTrajectory motion = design.random_motion(5);
    VectorXd q, qd, qdd;
    for (const double t : {0.0, duration}) {
      motion.evaluate(t, q, qd, qdd);
      EXPECT_LT(qd.cwiseAbs().maxCoeff(), 1e-12);
      EXPECT_LT(qdd.cwiseAbs().maxCoeff(), 1e-12);
    }
    EXPECT_GT(design.use_of(motion).velocity.maxCoeff(), 0.1);
    motion.evaluate(0.37 * duration, q, qd, qdd);
    // Velocity and acceleration are the derivatives of what goes before.
    VectorXd q1, qd1, other, q0, qd0;
    const double h = 1e-5;
    motion.evaluate(0.37 * duration + h, q1, qd1, other);
    motion.evaluate(0.37 * duration - h, q0, qd0, other);
    EXPECT_LT(((q1 - q0) / (2 * h) - qd).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_LT(((qd1 - qd0) / (2 * h) - qdd).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(ExcitationTrajectory, EncodingComesBack) {
  const model::Robot robot = ur10e();
  const ExcitationDesign design(robot, limits_of(robot), quick_design());
  const ExcitationTrajectory motion = design.random_motion(7), back = design.decode(design.encode(motion));
  EXPECT_LT((motion.sine - back.sine).norm() + (motion.cosine - back.cosine).norm(), 1e-12);
  EXPECT_LT((motion.start - back.start).norm(), 1e-12);
}

TEST(Excitation, RandomMotionsKeepTheLimitsBetweenSamplesToo) {
  const model::Robot robot = ur10e();
  const MotionLimits limits = limits_of(robot);
  const ExcitationDesign design(robot, limits, quick_design());
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const ExcitationTrajectory motion = design.random_motion(seed);
    EXPECT_TRUE(design.use_of(motion).inside) << seed;
    VectorXd q, qd, qdd;
    for (double t = 0.0; t < motion.duration; t += 0.00371) {
      motion.evaluate(t, q, qd, qdd);
      EXPECT_TRUE(((limits.upper - q).array() > 0.0).all() && ((q - limits.lower).array() > 0.0).all());
      EXPECT_TRUE((qd.cwiseAbs().array() < limits.velocity.array()).all());
      EXPECT_TRUE((design.torque(q, qd, qdd).cwiseAbs().array() < limits.torque.array()).all());
    }
  }
}

TEST(Excitation, ConditionNumberIsThatOfTheStackedRegressor) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.sample_rate = 20.0;
  const ExcitationDesign design(robot, limits_of(robot), options);
  const ExcitationTrajectory motion = design.random_motion(11);
  // By the singular values of the matrix itself; the design works on its normal equations.
  const model::Dynamics dynamics(robot);
  const RegressionColumns columns(robot, options.structure);
  const BaseParameters base = find_base_parameters(columns);
  const Index rows = 200;
  MatrixXd W(6 * rows, base.count()), U = W;
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    motion.evaluate((static_cast<double>(i) + 0.5) * 0.05, q, qd, qdd);
    U.middleRows(6 * i, 6) = columns.regressor(q, qd, qdd)(Eigen::all, base.kept);
    for (Index j = 0; j < 6; ++j) {
      W.row(6 * i + j) = U.row(6 * i + j) / (0.01 * robot.joints[static_cast<std::size_t>(j)].effort_limit);
    }
  }
  const auto condition = [](const MatrixXd& M) {
    const MatrixXd scaled = M * M.colwise().norm().cwiseInverse().asDiagonal();
    const VectorXd s = singular_values(triangle_of(scaled));
    return s[0] / s[s.size() - 1];
  };
  const ExcitationScore score = design.score(motion);
  EXPECT_NEAR(score.condition / condition(W), 1.0, 1e-9);
  EXPECT_NEAR(score.condition_unit_rows / condition(U), 1.0, 1e-9);
  const MatrixXd covariance = solve_square(W.transpose() * W, MatrixXd::Identity(base.count(), base.count()));
  EXPECT_NEAR(score.log_det, -eigenvalues_of(covariance).array().log().sum(), 1e-6 * std::abs(score.log_det));
  EXPECT_LT(
      (score.std.cwiseQuotient(covariance.diagonal().cwiseSqrt()) - VectorXd::Ones(base.count())).norm(),
      1e-8);
}

TEST(Excitation, ExpectedStandardDeviationsAreThoseOfRepeatedFits) {
  const model::Robot robot = test::planar_two_link();
  MotionLimits limits = limits_of(robot);
  limits.lower.setConstant(-2.0);
  limits.upper.setConstant(2.0);
  limits.velocity.setConstant(2.0);
  limits.torque.setConstant(60.0);
  ExcitationOptions options = quick_design();
  options.sample_rate = 50.0;
  options.torque_noise = Eigen::Vector2d(0.5, 0.2);
  const ExcitationDesign design(robot, limits, options);
  const ExcitationTrajectory motion = design.random_motion(2);
  const Index rows = 500, b = design.num_parameters();
  MatrixXd W(2 * rows, b);
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    motion.evaluate((static_cast<double>(i) + 0.5) / 50.0, q, qd, qdd);
    W.middleRows(2 * i, 2) = options.torque_noise.cwiseInverse().asDiagonal() *
                             design.columns().regressor(q, qd, qdd)(Eigen::all, design.kept());
  }
  const MatrixXd solution = pseudo_inverse(W);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  VectorXd squares = VectorXd::Zero(b), noise(2 * rows);
  const int trials = 2000;
  for (int trial = 0; trial < trials; ++trial) {
    for (double& e : noise) e = normal(random);
    squares += (solution * noise).cwiseAbs2();
  }
  const VectorXd ratio = (squares / trials).cwiseSqrt().cwiseQuotient(design.score(motion).std);
  // A standard deviation from 2000 trials is good to 1.6 %.
  EXPECT_LT((ratio - VectorXd::Ones(b)).cwiseAbs().maxCoeff(), 0.06) << ratio.transpose();
}

TEST(Excitation, SearchImprovesOnEveryRandomMotionAndKeepsTheLimits) {
  const model::Robot robot = ur10e();
  const MotionLimits limits = limits_of(robot);
  const ExcitationDesign design(robot, limits, quick_design());
  const Excitation best = design.optimize();
  EXPECT_TRUE(design.use_of(best.trajectory).inside) << design.use_of(best.trajectory).worst;
  EXPECT_GT(best.scale, 0.95);
  for (std::uint64_t seed = 100; seed < 110; ++seed) {
    EXPECT_LT(best.score.volume_std, design.score(design.random_motion(seed)).volume_std);
  }
  // The last step of the search is near a stationary point of cost plus barrier: costs fall on the way.
  EXPECT_LT(best.history.back(), best.history.front() - 0.3);
}

TEST(Excitation, ResultDoesNotDependOnThreads) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.iterations = 20;
  options.starts = 3;
  options.finalists = 2;
  const auto with = [&](int threads) {
    options.threads = threads;
    return ExcitationDesign(robot, limits_of(robot), options).optimize().trajectory;
  };
  const ExcitationTrajectory one = with(1), three = with(3);
  EXPECT_EQ(one.start, three.start);
  EXPECT_EQ(one.sine, three.sine);
  EXPECT_EQ(one.cosine, three.cosine);
}

TEST(Excitation, PayloadDesignHasTheTenOfTheLastLink) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.payload_only = true;
  const ExcitationDesign design(robot, limits_of(robot), options);
  EXPECT_EQ(design.num_parameters(), 10);
  EXPECT_EQ(design.names().front(), "m6");
  EXPECT_NEAR(design.values()[0], 0.615, 1e-12);
  // A single joint about a vertical axis feels one inertia of its link and nothing else.
  model::Robot turntable = test::pendulum();
  turntable.joints[0].joint.axis = {0, 0, 1};
  turntable.joints[0].velocity_limit = 2.0;
  EXPECT_EQ(ExcitationDesign(turntable, limits_of(turntable), options).names(),
            std::vector<std::string>{"Izz1"});
}

TEST(Excitation, GivenLogsCountAsRowsAlreadyTaken) {
  const model::Robot robot = ur10e();
  const ExcitationOptions options = quick_design();
  // Fast: rows of joints slower than 1 % of their limit are left out of a given log, and must be few.
  const MotionLimits limits = limits_of(robot, {.full_turns = true,
                                                .tool_speed = std::numeric_limits<double>::infinity(),
                                                .shapes = {},
                                                .without_bodies = true});
  ExcitationDesign design(robot, limits, options);
  const ExcitationTrajectory first = design.random_motion(1), second = design.random_motion(2);
  EXPECT_FALSE(design.given_score());
  const ExcitationScore alone = design.score(second);
  const Index rows = 2000;
  MatrixXd q(rows, 6), qd(rows, 6), qdd(rows, 6);
  VectorXd a, v, d;
  for (Index i = 0; i < rows; ++i) {
    first.evaluate(10.0 * (static_cast<double>(i) + 0.5) / rows, a, v, d);
    q.row(i) = a;
    qd.row(i) = v;
    qdd.row(i) = d;
  }
  const ExcitationScore taken = design.score(first);
  design.add_given(q, qd, qdd, 10.0 / rows);
  ASSERT_TRUE(design.given_score());
  // Rows of resting joints are left out of a given log: a few of a hundred.
  EXPECT_NEAR(design.given_score()->mean_std / taken.mean_std, 1.0, 0.05);
  const ExcitationScore together = design.score(second);
  EXPECT_TRUE((together.std.array() < alone.std.array()).all());
  EXPECT_TRUE((together.std.array() < design.given_score()->std.array()).all());
  // The same motion twice: information doubles.
  EXPECT_NEAR(design.score(first).mean_std / taken.mean_std, std::sqrt(0.5), 0.02);
}

TEST(Excitation, DesignForAGivenLogBringsWhatItLacks) {
  // The given motion never moves joint 2.
  model::Robot robot = test::planar_two_link();
  MotionLimits limits = limits_of(robot);
  limits.lower.setConstant(-2.0);
  limits.upper.setConstant(2.0);
  limits.velocity.setConstant(2.0);
  limits.torque.setConstant(60.0);
  ExcitationDesign design(robot, limits, quick_design());
  const Index rows = 1000;
  MatrixXd q = MatrixXd::Zero(rows, 2), qd = q, qdd = q;
  for (Index i = 0; i < rows; ++i) {
    const double t = 0.01 * static_cast<double>(i);
    q(i, 0) = std::sin(1.5 * t);
    qd(i, 0) = 1.5 * std::cos(1.5 * t);
    qdd(i, 0) = -2.25 * std::sin(1.5 * t);
  }
  design.add_given(q, qd, qdd, 0.01);
  EXPECT_FALSE(design.given_score()) << "joint 2 did not move";
  EXPECT_LT(design.optimize().score.condition, 30.0);
}

TEST(Excitation, HasAFloorOnlyWhereTheBaseIsUpright) {
  model::Robot robot = ur10e();
  EXPECT_EQ(limits_of(robot).floor, 0.0);
  robot.gravity = {0, 0, 9.81};
  EXPECT_FALSE(limits_of(robot).floor);
  robot.gravity = {9.81, 0, 0};
  EXPECT_FALSE(limits_of(robot).floor);
}

TEST(Excitation, StaysInsideTheBox) {
  const model::Robot robot = ur10e();
  MotionLimits limits = limits_of(robot);
  limits.floor.reset();
  limits.box = std::array<Eigen::Vector3d, 2>{Eigen::Vector3d(-2, -2, 0.1), Eigen::Vector3d(2, 2, 0.9)};
  const ExcitationDesign design(robot, limits, quick_design());
  const LimitUse use = design.use_of(design.optimize().trajectory);
  EXPECT_TRUE(use.inside) << use.worst;
  EXPECT_GT(use.box_distance, limits.clearance);
  EXPECT_LT(use.box_distance, limits.clearance + 0.1) << "the box was not felt";
}

TEST(Excitation, RefusesLimitsThatCannotBeKept) {
  const model::Robot robot = ur10e();
  const MotionLimits good = limits_of(robot);
  const ExcitationOptions options = quick_design();
  MotionLimits bad = good;
  bad.velocity[2] = 0.0;
  EXPECT_THAT(refusal(robot, bad, options), AllOf(HasSubstr("joint 3 (elbow_joint): velocity limit: found 0"),
                                                  HasSubstr("cannot be excited")));
  bad = good;
  bad.lower[1] = 2.0;
  bad.upper[1] = 1.0;
  EXPECT_THAT(refusal(robot, bad, options), HasSubstr("found lower 2 and upper 1, expected lower < upper"));
  bad = good;
  bad.torque[0] = 10.0;
  EXPECT_THAT(refusal(robot, bad, options),
              AllOf(HasSubstr("joint 1"), HasSubstr("Coulomb friction alone takes")));
  bad = good;
  bad.torque[1] = 20.0;  // cannot carry the arm but upright
  bad.lower[1] = -0.4;
  bad.upper[1] = 0.4;
  EXPECT_THAT(
      refusal(robot, bad, options),
      AllOf(HasSubstr("no safe motion: "), HasSubstr("no position found"), HasSubstr("torque of joint 2")));
  bad = good;
  bad.floor = 5.0;
  EXPECT_THAT(refusal(robot, bad, options),
              AllOf(HasSubstr("no safe motion: "), HasSubstr("no position found"), HasSubstr("height of")));
  bad = good;
  bad.margin = 1.0;
  EXPECT_THAT(refusal(robot, bad, options), HasSubstr("margin: found 1"));
  bad = good;
  bad.velocity.conservativeResize(5);
  EXPECT_THAT(refusal(robot, bad, options), HasSubstr("velocity limits: found 5 numbers, expected 6"));
  for (const double floor : {1e300, -1e300, std::nan("")}) {
    bad = good;
    bad.floor = floor;
    EXPECT_THAT(refusal(robot, bad, options), HasSubstr("floor: found"));
  }
  bad = good;
  bad.tool_speed = 0.0;
  EXPECT_THAT(refusal(robot, bad, options), HasSubstr("tool speed: found 0 m/s"));
  bad = good;
  bad.obstacles = {{"table", {0, 0, 1}, {1, 1, 0}}};
  EXPECT_THAT(refusal(robot, bad, options), HasSubstr("obstacle \"table\": found 1 to 0 along z"));
  EXPECT_EQ(refusal(robot, good, options), "accepted");
}

TEST(Excitation, RefusesWorkWithoutEnd) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.sample_rate = 1e8;
  EXPECT_THAT(refusal(robot, limits_of(robot), options),
              AllOf(HasSubstr("found 1e+09 rows"), HasSubstr("lower rate")));
  options = quick_design();
  options.duration = 1e6;
  EXPECT_THAT(refusal(robot, limits_of(robot), options), HasSubstr("found 1e+08 rows"));
  options = quick_design();
  options.harmonics = 100;
  EXPECT_THAT(refusal(robot, limits_of(robot), options),
              HasSubstr("harmonics: found 100, expected at most 40"));
  options = quick_design();
  options.duration = 10000.1;
  options.period = 1.0;
  EXPECT_THAT(refusal(robot, limits_of(robot), options), HasSubstr("expected a whole number of periods"));
}

TEST(Excitation, RangesBeyondOneTurnAreCutToIt) {
  model::Robot robot = ur10e();
  robot.joints[3].lower = 1.0;
  robot.joints[3].upper = 9.0;
  const MotionLimits limits = limits_of(robot);
  EXPECT_DOUBLE_EQ(limits.lower[0], -3.14159265358979323846);
  EXPECT_DOUBLE_EQ(limits.upper[0], 3.14159265358979323846);
  EXPECT_DOUBLE_EQ(limits.upper[3] - limits.lower[3], 6.28318530717958647692);
  EXPECT_DOUBLE_EQ(limits.lower[3] + limits.upper[3], 10.0)
      << "about the middle where 0 is not inside by half a turn";
  EXPECT_DOUBLE_EQ(limits_of(robot, {.full_turns = true, .shapes = {}}).upper[0], robot.joints[0].upper);
}

TEST(Excitation, RefusesAStartOutsideTheLimits) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.start = VectorXd::Zero(6);
  options.start[4] = 7.0;
  EXPECT_THAT(refusal(robot, limits_of(robot), options),
              AllOf(HasSubstr("joint 5 (wrist_2_joint): start: found 7"), HasSubstr("inside the limits")));
  options.start[4] = 0.0;
  options.start[1] = 1.2;  // the arm points into the table
  EXPECT_THAT(refusal(robot, limits_of(robot), options), AllOf(HasSubstr("start"), HasSubstr("height of")));
}

TEST(Excitation, RefusesMotionsWithoutFreedom) {
  const model::Robot robot = ur10e();
  ExcitationOptions options = quick_design();
  options.harmonics = 1;
  EXPECT_THAT(refusal(robot, limits_of(robot), options),
              AllOf(HasSubstr("harmonics: found 1"), HasSubstr("leaves no motion")));
  options.harmonics = 2;
  options.period = 8.0;
  EXPECT_THAT(refusal(robot, limits_of(robot), options),
              AllOf(HasSubstr("harmonics: found 2"), HasSubstr("leave no motion")));
  options.period = 11.0;
  EXPECT_THAT(refusal(robot, limits_of(robot), options), HasSubstr("at most the duration"));
}

TEST(Excitation, SaysWhatAMotionTooSmallLeavesUndetermined) {
  // Over a hundredth of a degree every gravity torque is a constant: weights cannot be distinguished.
  const model::Robot robot = ur10e();
  MotionLimits limits = limits_of(robot);
  const VectorXd middle = Eigen::Vector<double, 6>(0.0, -1.3, 1.0, -0.5, 0.5, 0.3);
  limits.lower = middle.array() - 1e-4;
  limits.upper = middle.array() + 1e-4;
  try {
    ExcitationDesign(robot, limits, quick_design()).optimize();
    FAIL() << "accepted";
  } catch (const NotIdentifiableError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("undetermined: "), HasSubstr("mcx2"), HasSubstr("--harmonics"),
                                    HasSubstr("wider limits")));
  }
}

}  // namespace
}  // namespace heft::excite
