/// What diagnose() refuses, whoever calls it.
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/diagnose/diagnose.hpp"
#include "heft/host/error.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::diagnose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A two-link arm that swings.
/// @param size  of the swing [rad]
data::Log log_of(const std::string& name, double seconds, double size = 0.5, double phase = 0.0) {
  constexpr double kRate = 100.0;
  const model::Robot robot = test::planar_two_link();
  const auto rows = static_cast<Eigen::Index>(seconds * kRate);
  data::Log log;
  log.path = name;
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRate);
  log.q.resize(rows, 2);
  Eigen::MatrixXd qd(rows, 2), qdd(rows, 2);
  for (int j = 0; j < 2; ++j) {
    const double w = 1.3 + 0.9 * j;
    for (Eigen::Index k = 0; k < rows; ++k) {
      const double at = w * log.time[k] + phase;
      log.q(k, j) = size * std::sin(at);
      qd(k, j) = size * w * std::cos(at);
      qdd(k, j) = -size * w * w * std::sin(at);
    }
  }
  log.tau = model::MotionTorque(robot).torque(log.time, log.q, qd, qdd, 1e-3, {});
  for (Eigen::Index k = 0; k < rows; ++k) log.tau.row(k).array() += 0.01 * std::sin(977.0 * log.time[k]);
  return log;
}

data::Log rows_of(const data::Log& log, const std::string& name, Eigen::Index from, Eigen::Index count) {
  data::Log part;
  part.path = name;
  part.time = log.time.segment(from, count);
  part.q = log.q.middleRows(from, count);
  part.tau = log.tau.middleRows(from, count);
  return part;
}

template <typename Error>
std::string refusal(const data::Log& train, const data::Log& judge) {
  try {
    diagnose(test::planar_two_link(), {train}, {judge});
  } catch (const Error& error) {
    return error.what();
  }
  return "not refused";
}

TEST(Guards, RefuseSamplesThatTheFitHasSeen) {
  const data::Log train = log_of("a", 12.0);
  data::Log copy = train;
  copy.path = "b";
  copy.time.array() += 100.0;
  EXPECT_THAT(refusal<DataError>(train, copy),
              AllOf(HasSubstr("b: the same samples as a"), HasSubstr("not seen")));
  const data::Log part = rows_of(train, "b", 300, 400);
  EXPECT_THAT(refusal<DataError>(train, part), HasSubstr("b: a part of a"));
  EXPECT_THAT(refusal<DataError>(rows_of(train, "a", 300, 800), rows_of(train, "b", 0, 1200)),
              HasSubstr("b: holds all of a"));
}

TEST(Guards, WantALogToJudgeOn) {
  const model::Robot robot = test::planar_two_link();
  EXPECT_THROW(diagnose(robot, data::log_set(robot.joint_specs(), {log_of("a", 12.0)}, {})), DataError);
}

TEST(Guards, RefuseAnArmThatHardlyMoves) {
  const data::Log judge = log_of("b", 12.0, 0.4, 1.0);
  EXPECT_THAT(refusal<NotIdentifiableError>(log_of("a", 12.0, 1e-3), judge), HasSubstr("a: no joint moves"));
  data::Log one = log_of("a", 12.0);
  one.q.col(0).setConstant(0.1);
  one.q.col(1) *= 0.05;
  EXPECT_THAT(refusal<NotIdentifiableError>(one, judge), HasSubstr("a: joints 1 and 2 of 2 hardly move"));
}

TEST(Guards, RefuseAMoment) {
  EXPECT_THAT(refusal<NotIdentifiableError>(log_of("a", 0.5), log_of("b", 12.0, 0.4, 1.0)),
              AllOf(HasSubstr("s determine "), HasSubstr("Missing among others")));
  EXPECT_THAT(refusal<NotIdentifiableError>(log_of("a", 12.0), log_of("b", 1.5, 0.4, 1.0)),
              AllOf(HasSubstr("b: 1.5 s of motion"), HasSubstr("too little to judge")));
  EXPECT_THAT(refusal<NotIdentifiableError>(log_of("a", 12.0), log_of("b", 12.0, 1e-3, 1.0)),
              HasSubstr("in which no joint moves"));
}

TEST(Guards, LetAShortRichLogPass) {
  const Diagnosis d = diagnose(test::planar_two_link(), {log_of("a", 9.0)}, {log_of("b", 9.0, 0.4, 1.0)});
  EXPECT_EQ(d.train.size(), 1U);
}

TEST(ModelFile, KnowsHowItsLogsWereRead) {
  const Diagnosis d = diagnose(test::planar_two_link(), {log_of("a", 12.0)}, {log_of("b", 12.0, 0.4, 1.0)});
  const model::ModelFile file = d.model_file();
  ASSERT_TRUE(file.fit.has_value());
  // A model whose motion is derived as for any other says nothing of it.
  EXPECT_EQ(file.fit->cutoff_hz, d.ordinary_motion ? 0.0 : d.cutoff);
  EXPECT_EQ(file.fit->sign_width, d.ordinary_motion ? 0.0 : d.sign_width);
  EXPECT_EQ(file.fit->rmse, d.train_after.rmse);
  EXPECT_EQ(file.provenance.logs, std::vector<std::string>{"a"});
  EXPECT_EQ(file.num_joints(), 2);
}

}  // namespace
}  // namespace heft::diagnose
