/// Rows of a log that is still being written.
#include "heft/data/live_log.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Read {
  std::vector<double> times;
  std::vector<std::string> notes;
  LiveRow last;
  long refused{0};
};

Read read(const std::string& text, const LogRequirements& needs) {
  const test::TemporaryFolder folder;
  host::write_file_atomically(folder.path("log.csv"), text);
  Read all;
  LiveLog log(folder.path("log.csv"), needs, [&](const std::string& note) { all.notes.push_back(note); });
  while (log.next(all.last)) all.times.push_back(all.last.time);
  all.refused = log.refused();
  return all;
}

LogRequirements torque() {
  LogRequirements needs;
  needs.torque = true;
  return needs;
}

TEST(LiveLog, RefusesARowWithItsLineAndGoesOn) {
  const Read all = read("time,q1,tau1\n1,0,0\n2,0\n3,0,nan\n1,0,0\n\n4,0,0,0\n5,0.5,7\n6,0", torque());
  EXPECT_THAT(all.times, ElementsAre(1, 5));
  EXPECT_EQ(all.refused, 5);
  ASSERT_EQ(all.notes.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k) {
    const std::string lines[]{":3: ", ":4: ", ":5: ", ":7: ", ":9: "};
    EXPECT_THAT(all.notes[k], HasSubstr(lines[k]));
  }
  EXPECT_EQ(all.last.q[0], 0.5);
  EXPECT_EQ(all.last.tau[0], 7.0);
  EXPECT_EQ(all.last.qd.size(), 0);
}

TEST(LiveLog, AColumnThatIsNotAskedForRefusesNothing) {
  LogRequirements needs = torque();
  needs.torque_constant = {2.0};
  const Read all = read("time,q1,i1,qd1,temp1,state\n1,0,3,4,warm,on\n", needs);
  EXPECT_THAT(all.times, ElementsAre(1));
  EXPECT_EQ(all.last.tau[0], 6.0);
  EXPECT_EQ(all.last.qd[0], 4.0);
}

// One row from the far future makes all that follow look late; a clock that was set does the same.
TEST(LiveLog, FollowsAClockThatWasSet) {
  std::string text = "time,q1,tau1\n1,0,0\n1e9,0,0\n";
  for (int k = 2; k < 20; ++k) text += std::to_string(k) + ",0,0\n";
  const Read all = read(text, torque());
  EXPECT_THAT(all.times, ElementsAre(1, 1e9, 11, 12, 13, 14, 15, 16, 17, 18, 19));
  EXPECT_EQ(all.refused, 9);
}

TEST(LiveLog, ARecorderOfNothingButBadRowsDoesNotFloodATerminal) {
  std::string text = "time,q1,tau1\n1,0,0\n";
  for (int k = 0; k < 1000; ++k) text += "2,0\n";
  const Read all = read(text, torque());
  EXPECT_EQ(all.refused, 1000);
  EXPECT_EQ(static_cast<long>(all.notes.size()), LiveLog::kMostNotes + 2);
  EXPECT_THAT(all.notes.back(), HasSubstr("1000 rows"));
}

TEST(LiveLog, RefusesAHeaderThatIsNotThatOfALog) {
  EXPECT_THROW(read("hello\n1\n", torque()), DataError);
  EXPECT_THROW(read("time,q1\n1,0\n", torque()), DataError);
  EXPECT_THROW(read("", torque()), DataError);
}

std::vector<double> times_of(const std::vector<LiveRow>& rows) {
  std::vector<double> times;
  for (const LiveRow& row : rows) times.push_back(row.time);
  return times;
}

TEST(LiveClock, HandsOutTheFirstRowsTogetherAndThenEachAtOnce) {
  LiveClock clock;
  for (const double time : {0.0, 0.01, 0.02, 0.03, 0.04}) EXPECT_TRUE(clock.push({time, {}, {}, {}}).empty());
  EXPECT_EQ(clock.waiting(), 5U);
  EXPECT_THAT(times_of(clock.push({0.09, {}, {}, {}})), ElementsAre(0.0, 0.01, 0.02, 0.03, 0.04, 0.09));
  EXPECT_NEAR(clock.period(), 0.01, 1e-12);
  EXPECT_NEAR(clock.step(), 0.05, 1e-12);
  EXPECT_THAT(times_of(clock.push({0.1, {}, {}, {}})), ElementsAre(0.1));
  EXPECT_FALSE(clock.anew());
}

TEST(LiveClock, StartsAnewWhereItWasSetBackOrFarForward) {
  for (const double set : {-5.0, 1.7e9}) {
    LiveClock clock;
    for (int k = 0; k < 8; ++k) clock.push({0.01 * k, {}, {}, {}});
    EXPECT_TRUE(clock.push({set, {}, {}, {}}).empty());
    EXPECT_TRUE(clock.anew());
    EXPECT_EQ(clock.step(), 0.0);
    EXPECT_TRUE(clock.push({set + 0.02, {}, {}, {}}).empty());
    EXPECT_FALSE(clock.anew());
    EXPECT_THAT(times_of(clock.end()), ElementsAre(set, set + 0.02));
    EXPECT_NEAR(clock.period(), 0.02, 1e-6);
  }
}

}  // namespace
}  // namespace heft::data
