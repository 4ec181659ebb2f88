// Contacts and false alarms on measured logs: models from some runs, thresholds from others, judged on the rest.
#include <cstdio>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/data/log_set.hpp"
#include "heft/identify/identify.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/measured_data.hpp"

namespace heft::monitor {
namespace {

using Names = std::vector<std::string>;

/// An arm whose model was identified from some runs.
class Measured {
 public:
  Measured(const std::string& folder, data::TorqueAt at, const Names& fitted)
      : folder_(std::string(HEFT_DATA_DIR) + "/" + folder), at_(at) {
    const model::Robot prior = urdf::load_urdf(folder_ + "/robot.urdf");
    const auto found = identify::identify(prior, open(prior, fitted, {}));
    file = found.model_file();
    robot = model::make_robot(file);
  }

  data::LogSet open(const model::Robot& arm, const Names& train, const Names& judge) const {
    data::LogFiles files;
    for (const std::string& name : train) files.train.push_back(folder_ + "/" + name + ".csv");
    for (const std::string& name : judge) files.judge.push_back(folder_ + "/" + name + ".csv");
    files.split = 0.0;
    files.torque_at = at_;
    return data::open_logs(arm.joint_specs(), files);
  }

  std::vector<Contacts> judged(const Names& learnt_from, const Names& runs) const {
    const data::LogSet logs = open(robot, learnt_from, runs);
    const Thresholds thresholds = learn(file, robot, logs);
    Options options;
    options.known_free = false;
    std::vector<Contacts> all = monitor(file, robot, logs, thresholds, options);
    for (const Contacts& one : all) {
      std::printf("%s: %zu contacts in %.1f s\n", one.log.c_str(), one.contacts.size(), one.judged_seconds);
      for (const Contact& c : one.contacts)
        std::printf("   %.3f s to %.3f s, joint %d, %.1f N·m\n", c.begin, c.end, c.joint + 1, c.peak);
    }
    return all;
  }

  /// False alarms of runs, each judged by thresholds from the others.
  std::size_t false_alarms(const Names& runs) const {
    std::size_t alarms = 0;
    for (const std::string& run : runs) {
      Names others;
      for (const std::string& other : runs) {
        if (other != run) others.push_back(other);
      }
      alarms += judged(others, {run}).front().contacts.size();
    }
    return alarms;
  }

  model::ModelFile file;
  model::Robot robot;

 private:
  std::string folder_;
  data::TorqueAt at_;
};

/// Whether a contact begins between two times or lasts then.
bool found_within(const Contacts& contacts, double from, double to) {
  for (const Contact& contact : contacts.contacts) {
    if (contact.begin < to && contact.end > from) return true;
  }
  return false;
}

#define NEEDS_DATA(folder) HEFT_NEEDS_MEASURED_DATA(std::string(HEFT_DATA_DIR) + "/" + (folder))

TEST(MeasuredContacts, OfAUr5PushedByHandAreFoundAndTheRunsWithoutAreFree) {
  NEEDS_DATA("ur5-kufieta/no9-pushed.csv");
  const Measured ur5("ur5-kufieta", data::TorqueAt::kMotor, {"no1", "no2", "no3-fast", "no6-slow"});
  // The pushes as the torque of joints 1 to 3 shows them to the eye against the same path without.
  const auto pushed = ur5.judged({"no5", "no7", "no8", "no9"}, {"no5-pushed", "no7-pushed", "no9-pushed"});
  const std::vector<std::vector<double>> pushes{
      {12.6, 19.0, 22.0, 24.9, 27.9}, {8.4, 11.6, 14.0, 15.8}, {4.7, 6.2, 10.6, 12.3, 14.0}};
  std::size_t found = 0, all = 0;
  for (std::size_t r = 0; r < pushes.size(); ++r) {
    for (const double time : pushes[r]) {
      ++all;
      found += found_within(pushed[r], time - 0.1, time + 0.4) ? 1 : 0;
    }
  }
  EXPECT_EQ(all, 14U);
  EXPECT_GE(found, 13U);
  for (const char* run : {"no5", "no8", "no9"}) {
    Names others{"no7"};
    for (const char* other : {"no5", "no8", "no9"}) {
      if (std::string(other) != run) others.push_back(other);
    }
    EXPECT_TRUE(ur5.judged(others, {run}).front().contacts.empty()) << run;
  }
}

TEST(MeasuredContacts, OfAUr10eAtRestAreFoundAndNoFreeRunRaisesAnAlarm) {
  NEEDS_DATA("ur10e-dynamic-calibration/push-pose-1.csv");
  const Measured ur10e("ur10e-dynamic-calibration", data::TorqueAt::kMotor, {"exc-10h-20s", "exc-14h-50s"});
  const Names free{"exc-8h-20s",  "exc-12h-20s",   "exc-12h-30s",  "exc-12h-40s",
                   "exc-12h-50s", "ptp-10-points", "jointwise-j2", "jointwise-j5"};
  const Contacts pushed = ur10e.judged(free, {"push-pose-1"}).front();
  for (const double time : {4.8, 8.5, 12.0})
    EXPECT_TRUE(found_within(pushed, time - 0.1, time + 0.2)) << time;
  EXPECT_EQ(ur10e.false_alarms(free), 0U);
}

TEST(MeasuredFreeMotion, OfAnXMate7RaisesNoAlarm) {
  NEEDS_DATA("xmate7pro-nku/robot.urdf");
  const Measured xmate("xmate7pro-nku", data::TorqueAt::kJoint, {"traj1-3periods"});
  EXPECT_EQ(xmate.false_alarms(
                {"traj1-1period", "traj2-1period", "traj2-3periods", "traj1-5s-1khz", "traj2-5s-1khz"}),
            0U);
}

TEST(MeasuredFreeMotion, OfArmsWithTwoRunsRaisesNoAlarmInTheOther) {
  const struct {
    const char *folder, *fitted, *run;
    data::TorqueAt at;
  } arms[] = {{"airbot-play", "chirp", "trapezoidal", data::TorqueAt::kMotor},
              {"kuka-lwr4-flobaroid", "run-1-slow", "run-3-faster", data::TorqueAt::kJoint}};
  for (const auto& arm : arms) {
    NEEDS_DATA(arm.folder);
    const Measured measured(arm.folder, arm.at, {arm.fitted});
    EXPECT_TRUE(measured.judged({arm.fitted}, {arm.run}).front().contacts.empty()) << arm.folder;
  }
}

}  // namespace
}  // namespace heft::monitor
