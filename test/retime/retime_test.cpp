// The fastest motion along a path, against closed forms, against the simulated arm, and as limits change.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/retime/retime.hpp"
#include "heft/sim/forward_dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::retime {
namespace {

using ::testing::HasSubstr;

/// An upright axis that turns an inertia: nothing but τ = J q̈ + friction.
model::Robot turntable(double inertia, double torque, double velocity = kInfinity) {
  model::RobotJoint joint;
  joint.name = "axis";
  joint.link[kIzz] = inertia;
  joint.effort_limit = torque;
  joint.velocity_limit = velocity;
  model::Robot robot;
  robot.name = "turntable";
  robot.joints = {joint};
  return robot;
}

data::Log points(std::initializer_list<std::initializer_list<double>> rows) {
  data::Log log;
  log.q.resize(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(rows.begin()->size()));
  log.time = Eigen::VectorXd::LinSpaced(log.q.rows(), 0.0, static_cast<double>(log.q.rows() - 1));
  Eigen::Index i = 0;
  for (const auto& row : rows) {
    Eigen::Index j = 0;
    for (const double value : row) log.q(i, j++) = value;
    ++i;
  }
  return log;
}

Options exact() {
  Options options;
  options.margin_percent = 0.0;
  options.rehearse = false;
  return options;
}

template <typename Error>
std::string refusal(const std::function<void()>& what) {
  try {
    what();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

/// A UR5e takes something up, lifts it over and puts it down.
data::Log pick_and_place() {
  return points({{-0.9, -1.1, 1.9, -2.37, -1.57, -0.9},
                 {-0.8, -1.35, 1.7, -1.92, -1.57, -0.8},
                 {0.0, -1.5, 1.5, -1.57, -1.57, 0.0},
                 {0.8, -1.35, 1.7, -1.92, -1.57, 0.8},
                 {0.9, -1.1, 1.9, -2.37, -1.57, 0.9}});
}

model::Robot ur5e() { return urdf::load_urdf(urdf::resolve_robot("ur5e")); }

/// The arm as it is: catalogue values with rotors and friction, which the URDF lacks.
model::Robot true_arm() {
  model::Robot robot = ur5e();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    robot.joints[j].actuation.rotor_inertia = j < 3 ? 1.5 : 0.2;
    robot.joints[j].actuation.coulomb_friction = j < 3 ? 6.0 : 1.5;
    robot.joints[j].actuation.viscous_friction = j < 3 ? 8.0 : 1.5;
  }
  return robot;
}

// Bang-bang: half the way at +τ/J, half at -τ/J.
TEST(Retime, TakesTheClosedFormOfADoubleIntegrator) {
  const double inertia = 2.0, torque = 30.0, way = 1.7;
  const model::Robot robot = turntable(inertia, torque);
  const Retiming found = retime(robot, through(robot, points({{0.2}, {0.2 + way}})), exact());
  EXPECT_NEAR(found.duration() / (2.0 * std::sqrt(way * inertia / torque)), 1.0, 1e-4);
  EXPECT_LE(found.torque_use[0], 1.0);
}

// With a velocity limit: a trapezoid.
TEST(Retime, TakesTheClosedFormOfATrapezoid) {
  const double inertia = 2.0, torque = 30.0, way = 1.7, top = 1.1;
  const model::Robot robot = turntable(inertia, torque, top);
  const Retiming found = retime(robot, through(robot, points({{0.0}, {-way}})), exact());
  EXPECT_NEAR(found.duration() / (way / top + top * inertia / torque), 1.0, 1e-4);
  EXPECT_LE(found.velocity_use[0], 1.0);
}

// A straight line of all joints under acceleration limits alone is the double integrator of the joint that takes longest.
TEST(Retime, TakesTheClosedFormOnAStraightLineOfAnArm) {
  const model::Robot robot = ur5e();
  Options options = exact();
  options.acceleration = {3.0, 2.0, 4.0, 5.0, 5.0, 5.0};
  options.velocity = {kInfinity};
  options.torque = {kInfinity};
  const data::Log line = points({{0.0, -1.2, 1.0, -1.0, -1.5, 0.0}, {0.8, -0.6, 0.4, -0.5, -1.0, 0.9}});
  const Retiming found = retime(robot, through(robot, line), options);
  // Joint 2: 0.6 rad at 2 rad/s² is the slowest.
  EXPECT_NEAR(found.duration() / (2.0 * std::sqrt(0.6 / 2.0)), 1.0, 1e-4);
  ASSERT_FALSE(found.active.empty());
  for (const Stretch& stretch : found.active) {
    EXPECT_EQ(stretch.joint, 1);
    EXPECT_EQ(stretch.limit, Limit::kAcceleration);
  }
}

// J v̇ = ±τ - Fc - Fv v from rest to rest: exponentials; the instant of the switch by bisection on the way.
TEST(Retime, TakesTheClosedFormWithCoulombAndViscousFriction) {
  const double J = 2.0, torque = 30.0, Fc = 5.0, Fv = 9.0, way = 2.5;
  model::Robot robot = turntable(J, torque);
  robot.joints[0].actuation.coulomb_friction = Fc;
  robot.joints[0].actuation.viscous_friction = Fv;
  const double a = (torque - Fc) / Fv, b = (torque + Fc) / Fv, T = J / Fv;  // terminal speeds, time constant
  const auto braking_time = [&](double v) { return T * std::log1p(v / b); };
  const auto way_after = [&](double t) {
    const double v = a * (1.0 - std::exp(-t / T)), stop = braking_time(v);
    return a * t - T * v + (v + b) * T * (1.0 - std::exp(-stop / T)) - b * stop;
  };
  double low = 0.0, high = 10.0;
  for (int k = 0; k < 60; ++k) (way_after(0.5 * (low + high)) < way ? low : high) = 0.5 * (low + high);
  const double duration = low + braking_time(a * (1.0 - std::exp(-low / T)));
  const Retiming found = retime(robot, through(robot, points({{0.0}, {way}})), exact());
  // Limits hold at both ends of an interval; friction in between errs by the first order of its length.
  EXPECT_NEAR(found.duration() / duration, 1.0, 5e-4);
  EXPECT_GE(found.duration(), duration);
  EXPECT_LE(found.torque_use[0], 1.0);
}

// What Pontryagin's principle asks of the fastest motion on a path: some limit is always reached.
TEST(Retime, ReachesALimitAllTheTime) {
  const model::Robot robot = true_arm();
  Options options;
  options.load = {5.0, {0.0, 0.0, 0.05}};
  options.rehearse = false;
  const Retiming found = retime(robot, through(robot, pick_and_place()), options);
  double reached = 0.0;
  for (const Stretch& stretch : found.active) reached += stretch.end - stretch.begin;
  EXPECT_GT(reached, 0.98 * found.duration());
  // Limits hold at both ends of an interval, so that hardly anything is left to mend in between.
  EXPECT_LT(found.lowered, 1e-4);
}

// The arm of the simulator has dynamics of its own.
TEST(Retime, ExceedsNoLimitOnTheSimulatedArm) {
  model::Robot robot = true_arm();
  robot.effects.push_back({joint_effect_kind("stribeck"), 1, {4.0, 0.15}});
  robot.couplings.push_back({4, 5, 1.0, 0.15, 1.2, 0.8});
  robot.effects.push_back({joint_effect_kind("load_friction"), 2, {0.05}});
  Options options;
  options.load = {5.0, {0.0, 0.0, 0.05}};
  const Retiming found = retime(robot, through(robot, pick_and_place()), options);
  ASSERT_TRUE(found.rehearsal);
  EXPECT_EQ(found.rehearsal->failure, "");
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kGood);
  EXPECT_LT(found.rehearsal->tracking_error, 0.01);
  EXPECT_TRUE((found.torque_use.array() <= 0.95).all());
  EXPECT_TRUE((found.velocity_use.array() <= 0.95).all());
  EXPECT_EQ(found.log.qd.row(found.log.qd.rows() - 1).norm(), 0.0);
  EXPECT_NEAR((found.log.q.row(found.log.q.rows() - 1) - pick_and_place().q.row(4)).norm(), 0.0, 1e-12);
}

// Friction that breaks away takes a controller more torque than the plan: the plan leaves it.
TEST(Retime, LeavesTheControllerWhatTheRehearsalShows) {
  model::Robot robot = turntable(0.05, 100.0, 20.0);
  robot.joints[0].actuation.coulomb_friction = 20.0;
  const Path path = through(robot, points({{0.0}, {2.0}}));
  Options options;
  options.margin_percent = 0.0;
  const Retiming found = retime(robot, path, options);
  ASSERT_TRUE(found.rehearsal);
  EXPECT_EQ(found.rehearsal->failure, "");
  EXPECT_GT(found.torque_margin[0], 0.001);
  options.rehearse = false;
  const Retiming bold = retime(robot, path, options);
  EXPECT_LT(bold.duration(), found.duration());
  EXPECT_EQ(bold.judgement.verdict, host::Verdict::kDoubtful);
}

// A spring between motor and link lets the link swing when acceleration jumps.
TEST(Retime, DoubtsAMotionThatTheArmDoesNotFollow) {
  model::Robot robot = turntable(0.5, 100.0, 20.0);
  robot.elasticities.push_back({0, 300.0, 1.0, 0.1});
  const Retiming found = retime(robot, through(robot, points({{0.0}, {2.0}})));
  ASSERT_TRUE(found.rehearsal);
  EXPECT_GT(found.rehearsal->tracking_error, 0.02);
  EXPECT_FALSE(found.judgement.verdict == host::Verdict::kGood);
  EXPECT_EQ(found.notes.size(), 1U);
}

// A model that is 20 % too heavy, with the reserve that such a model asks for, against the identified one.
TEST(Retime, TheIdentifiedModelSavesATenthOfAConservativeOne) {
  const model::Robot robot = true_arm();
  model::Robot conservative = robot;
  for (model::RobotJoint& joint : conservative.joints) {
    for (double& parameter : joint.link) parameter *= 1.2;
    joint.actuation.rotor_inertia *= 1.2;
    joint.actuation.coulomb_friction *= 1.2;
    joint.actuation.viscous_friction *= 1.2;
  }
  Options options;
  options.rehearse = false;
  options.load = {5.0, {0.0, 0.0, 0.05}};
  const Path path = through(robot, pick_and_place());
  const Retiming identified = retime(robot, path, options);
  Options reserved = options;
  reserved.torque = {0.8 * 150.0, 0.8 * 150.0, 0.8 * 150.0, 0.8 * 28.0, 0.8 * 28.0, 0.8 * 28.0};
  reserved.load.mass *= 1.2;
  const Retiming cautious = retime(conservative, path, reserved);
  RecordProperty("identified", std::to_string(identified.duration()));
  RecordProperty("conservative", std::to_string(cautious.duration()));
  EXPECT_LT(identified.duration(), 0.9 * cautious.duration());
}

// Whatever is loosened, the motion is not longer: on random paths of an arm with friction.
TEST(Retime, IsNeverLongerWithLooserLimits) {
  const model::Robot robot = true_arm();
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> step(-0.6, 0.6), looser(1.0, 1.5);
  for (int trial = 0; trial < 3; ++trial) {
    data::Log log = pick_and_place();
    log.q += Eigen::MatrixXd::NullaryExpr(log.q.rows(), log.q.cols(), [&] { return 0.3 * step(random); });
    const Path path = through(robot, log);
    Options options = exact();
    options.torque = {140, 140, 140, 25, 25, 25};
    options.velocity = {2.0};
    options.acceleration = {15.0};
    double before = retime(robot, path, options).duration();
    for (std::vector<double>* limits : {&options.velocity, &options.torque, &options.acceleration}) {
      for (double& limit : *limits) limit *= looser(random);
      const double now = retime(robot, path, options).duration();
      // Limits are lowered between places by what was found there, a part in ten thousand of the time.
      EXPECT_LT(now, before * (1.0 + 1e-4)) << "trial " << trial;
      before = now;
    }
  }
}

/// The shortest time over a grid of speeds: transitions from place to place, torque by the simulator's dynamics at both ends of
/// each. No motion of the grid is faster than the fastest; with more speeds it comes near.
double shortest_on_grid(const model::Robot& robot, const Path& path, const Eigen::VectorXd& torque,
                        const Retiming& found, int speeds) {
  const Eigen::Index places = 121;
  const double length = path.length(), d = length / static_cast<double>(places - 1);
  const sim::ForwardDynamics dynamics(robot);
  const double most = 1.3 * found.profile.speed.maxCoeff();
  std::vector<Eigen::VectorXd> by_u, by_x, rest;
  for (Eigen::Index i = 0; i < places; ++i) {
    Eigen::VectorXd q, dq, ddq;
    path.evaluate(std::min(static_cast<double>(i) * d, length), q, dq, ddq);
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(q.size());
    Eigen::MatrixXd inverse(q.size(), q.size());
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      inverse.col(j) = dynamics.acceleration(q, zero, Eigen::VectorXd::Unit(q.size(), j)) -
                       dynamics.acceleration(q, zero, zero);
    }
    const Eigen::MatrixXd M = inverse.inverse();
    const Eigen::VectorXd moved = -M * dynamics.acceleration(q, dq, zero);
    rest.push_back(-M * dynamics.acceleration(q, zero, zero));
    by_u.push_back(M * dq);
    by_x.push_back(M * ddq + moved - rest.back());
  }
  const auto x_of = [&](int k) { return std::pow(most * k / (speeds - 1), 2); };
  const auto allowed = [&](Eigen::Index i, double x, double u) {
    return ((by_u[static_cast<std::size_t>(i)] * u + by_x[static_cast<std::size_t>(i)] * x +
             rest[static_cast<std::size_t>(i)])
                .cwiseAbs()
                .array() <= torque.array())
        .all();
  };
  std::vector<double> cost(static_cast<std::size_t>(speeds), kInfinity);
  cost[0] = 0.0;
  for (Eigen::Index i = places - 2; i >= 0; --i) {
    std::vector<double> next(static_cast<std::size_t>(speeds), kInfinity);
    for (int from = 0; from < speeds; ++from) {
      for (int to = 0; to < speeds; ++to) {
        const double x = x_of(from), y = x_of(to), u = (y - x) / (2.0 * d);
        if (from + to == 0 || cost[static_cast<std::size_t>(to)] == kInfinity) continue;
        const double time = 2.0 * d / (std::sqrt(x) + std::sqrt(y)) + cost[static_cast<std::size_t>(to)];
        if (time >= next[static_cast<std::size_t>(from)]) continue;
        if (allowed(i, x, u) && allowed(i + 1, y, u)) next[static_cast<std::size_t>(from)] = time;
      }
    }
    cost = next;
  }
  return cost[0];
}

TEST(Retime, IsAsFastAsTheBestOfAGridOfSpeeds) {
  const model::Robot robot = ur5e();
  Options options = exact();
  options.velocity = {kInfinity};
  const Path path = through(robot, pick_and_place());
  const Retiming found = retime(robot, path, options);
  const double on_grid = shortest_on_grid(robot, path, found.torque, found, 240);
  EXPECT_LT(found.duration(), on_grid * 1.002);
  EXPECT_GT(found.duration(), on_grid * 0.93);
}

TEST(Retime, PathsGoThroughTheirPointsAndBendContinuously) {
  const data::Log log = pick_and_place();
  const Path path = through(ur5e(), log);
  Eigen::VectorXd q, dq, ddq, before, slope, bend, after;
  for (Eigen::Index k = 0; k < path.s.size(); ++k) {
    path.evaluate(path.s[k], q, dq, ddq);
    EXPECT_LT((q - log.q.row(k).transpose()).norm(), 1e-12);
  }
  constexpr double kStep = 1e-5;
  for (double s = kStep; s < path.length() - kStep; s += 0.0137) {
    path.evaluate(s, q, dq, ddq);
    path.evaluate(s - kStep, before, slope, bend);
    path.evaluate(s + kStep, after, slope, bend);
    EXPECT_LT(((after - before) / (2.0 * kStep) - dq).norm(), 1e-7) << s;
    EXPECT_LT((bend - ddq).norm(), 1e-2) << s;
    path.evaluate(s - kStep, before, bend, after);
    EXPECT_LT(((slope - bend) / (2.0 * kStep) - ddq).norm(), 1e-3) << s;
  }
}

TEST(Retime, KeepsThePathOfALogAndItsRestAtBothEnds) {
  const model::Robot robot = ur5e();
  data::Log log;
  const Eigen::Index rows = 1200;
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, 11.99);
  log.q = Eigen::MatrixXd::Zero(rows, 6);
  log.q.col(1).setConstant(-1.2);
  // One second of standstill at either end; joint 1 swings there and back, joint 3 bends along the way.
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double phase = std::clamp((log.time[i] - 1.0) / 10.0, 0.0, 1.0);
    log.q(i, 0) = 0.7 * (1.0 - std::cos(2.0 * std::numbers::pi * phase));
    log.q(i, 2) = 0.9 * phase * phase * (3.0 - 2.0 * phase);
  }
  const auto specs = robot.joint_specs();
  const data::LogSet logs = data::log_set(specs, {}, {log});
  const Path path = along(robot, logs.judge().front());
  EXPECT_LT(path.deviation, 1e-3);
  EXPECT_NEAR(path.duration, 10.0, 0.5);
  EXPECT_EQ(path.points.row(0), log.q.row(0));
  EXPECT_EQ(path.points.row(path.points.rows() - 1), log.q.row(rows - 1));
  EXPECT_GT(path.points.col(0).maxCoeff(), 1.399);
  const Retiming found = retime(robot, path);
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kGood);
  EXPECT_LT(found.duration(), 3.0);
  EXPECT_GT(found.saved(), 0.6);
}

TEST(Retime, RoundsCornersOfStraightLines) {
  model::Robot robot = ur5e();
  robot.joints[1].upper = -0.95;
  data::Log log = pick_and_place();
  log.q.col(1) << -1.6, -1.0, -1.0, -1.0, -1.6;
  // The spline leaves the range; straight lines with rounded corners do not.
  EXPECT_THAT(refusal<DataError>([&] { through(robot, log); }), HasSubstr("joint 2"));
  const Path path = through(robot, log, 0.1);
  EXPECT_GT(path.deviation, 1e-3);
  EXPECT_LT(path.deviation, 0.05);
  EXPECT_LT((path.points.bottomRows(1) - log.q.bottomRows(1)).norm(), 1e-12);
  const Retiming found = retime(robot, path);
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kGood);
}

// The tip of a swing lies between the points that the spacing picks.
TEST(Retime, KeepsTheTipsOfASwing) {
  const model::Robot robot = turntable(1.0, 10.0, 3.0);
  for (int trial = 0; trial < 7; ++trial) {
    data::Log log;
    log.time = Eigen::VectorXd::LinSpaced(801, 0.0, 8.0);
    log.q = (1.0 + 0.003 * trial) * (log.time.array() * std::numbers::pi / 4.0).sin();
    const auto specs = robot.joint_specs();
    const data::LogSet logs = data::log_set(specs, {}, {log});
    EXPECT_LT(along(robot, logs.judge().front()).deviation, 3e-3) << "trial " << trial;
  }
}

TEST(Retime, NamesTheJointAndThePlaceThatCannotBeHeld) {
  const model::Robot robot = ur5e();
  Options options;
  options.load.mass = 40.0;
  const std::string text =
      refusal<NotIdentifiableError>([&] { retime(robot, through(robot, pick_and_place()), options); });
  EXPECT_THAT(text, HasSubstr("joint 2 (shoulder_lift_joint) cannot hold"));
  EXPECT_THAT(text, HasSubstr("of the path"));
}

TEST(Retime, RefusesPathsThatAreNone) {
  const model::Robot robot = turntable(1.0, 10.0);
  EXPECT_THAT(refusal<DataError>([&] { through(robot, points({{0.1}})); }), HasSubstr("1 waypoint"));
  data::Log degrees = pick_and_place();
  degrees.q *= 180.0 / 3.14159265358979;
  EXPECT_THAT(refusal<DataError>([&] { through(ur5e(), degrees); }), HasSubstr("multiplied by pi/180"));
  EXPECT_THAT(refusal<DataError>([&] {
                through(robot, points({{0.1}, {0.2}, {0.2}}));
              }),
              HasSubstr("points 2 and 3 are the same"));
  EXPECT_THAT(refusal<DataError>([&] {
                through(robot, points({{0.1}, {kNaN}, {0.2}}));
              }),
              HasSubstr("point 2: found a position that is not finite"));
  EXPECT_THAT(refusal<DataError>([&] { through(ur5e(), points({{0.1}, {0.2}})); }), HasSubstr("expected 6"));
  data::Log still = points({{0.1}, {0.101}, {0.1}});
  const auto specs = robot.joint_specs();
  const data::LogSet logs = data::log_set(specs, {}, {still});
  EXPECT_THAT(refusal<DataError>([&] { along(robot, logs.judge().front()); }),
              HasSubstr("no joint moves more than"));
  model::Robot narrow = robot;
  narrow.joints[0].upper = 0.15;
  EXPECT_THAT(refusal<DataError>([&] {
                through(narrow, points({{0.1}, {0.2}}));
              }),
              HasSubstr("joint 1 (axis)"));
}

TEST(Retime, RefusesAJointThatNothingLimits) {
  const model::Robot robot = turntable(1.0, kInfinity, 2.0);
  const Path path = through(robot, points({{0.0}, {1.0}}));
  EXPECT_THAT(refusal<ModelError>([&] { retime(robot, path); }),
              HasSubstr("neither a torque nor an acceleration limit"));
  Options options = exact();
  options.acceleration = {4.0};
  EXPECT_NEAR(retime(robot, path, options).duration(), 1.0 / 2.0 + 2.0 / 4.0, 1e-3);
  options.acceleration = {4.0, 5.0};
  EXPECT_THAT(refusal<ModelError>([&] { retime(robot, path, options); }), HasSubstr("found 2 numbers"));
  options.acceleration = {std::nan("")};
  EXPECT_THAT(refusal<ModelError>([&] { retime(robot, path, options); }), HasSubstr("joint 1 (axis)"));
}

}  // namespace
}  // namespace heft::retime
