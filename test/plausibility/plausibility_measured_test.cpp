// Measured logs of real arms as they are, and altered in the ways people get them wrong. No log that is as it should be
// may be suspected; of the altered ones, where the alteration is more than noise, 95 % must be named rightly.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "comparison.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/identify/identify.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "judge.hpp"
#include "support/measured_data.hpp"

namespace heft::plausibility {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Case {
  std::string folder;
  std::string log;
};

struct Loaded {
  model::Robot robot;
  data::Log log;
  Samples samples;
};

std::string data_folder() { return HEFT_DATA_DIR; }

Loaded load(const Case& c) {
  Loaded loaded;
  loaded.robot = urdf::load_urdf(fmt::format("{}/{}/robot.urdf", data_folder(), c.folder));
  data::LogRequirements needs;
  needs.num_joints = loaded.robot.num_joints();
  needs.torque = true;
  loaded.log = data::read_log(fmt::format("{}/{}/{}.csv", data_folder(), c.folder, c.log), needs);
  loaded.samples = samples_of(data::MotionStream(loaded.log));
  return loaded;
}

std::vector<Case> cases_of(bool all) {
  const std::map<std::string, std::vector<std::string>> few = {
      {"airbot-play", {"chirp"}},
      {"ar5-frankjie", {"first40s"}},
      {"dualarmv2", {"exc-13.5"}},
      {"kr300-weigand", {"run-a"}},
      {"kuka-lwr4-flobaroid", {"run-3-faster"}},
      {"panda-gaz", {"exc-1-first14s"}},
      {"staubli-tx40", {"run-first6s"}},
      {"ur10-petrone", {"exc-first18s"}},
      {"ur10e-dynamic-calibration", {"exc-12h-20s", "exc-14h-50s-load2p805kg"}},
      {"ur5-kufieta", {"no8"}},
      {"xmate3pro-liu", {"exc-first13s"}},
      {"xmate7pro-nku", {"traj1-1period"}}};
  std::vector<Case> list;
  if (!all) {
    for (const auto& [folder, logs] : few) {
      for (const std::string& log : logs) list.push_back({folder, log});
    }
    return list;
  }
  if (!fs::is_directory(data_folder())) return list;
  for (const auto& entry : fs::directory_iterator(data_folder())) {
    if (!fs::exists(entry.path() / "robot.urdf")) continue;
    for (const auto& file : fs::directory_iterator(entry.path())) {
      const std::string stem = file.path().stem().string();
      if (file.path().extension() == ".csv" && stem.find("recorded-qdd") == std::string::npos) {
        list.push_back({entry.path().filename().string(), stem});
      }
    }
  }
  std::sort(list.begin(), list.end(), [](const Case& a, const Case& b) {
    return std::tie(a.folder, a.log) < std::tie(b.folder, b.log);
  });
  return list;
}

Options options_for(const std::string&) {
  Options options;
  options.other_robots = [] {
    std::vector<model::Robot> robots;
    for (const char* name : {"kawasaki6r", "panda", "scara", "ur10e", "ur5", "ur5e"}) {
      robots.push_back(urdf::load_urdf(urdf::resolve_robot(name)));
    }
    return robots;
  };
  return options;
}

std::string text_of(const TorqueCheck& check) {
  std::string text;
  for (const Finding& f : check.findings) text += (f.clear ? "[clear] " : "[doubt] ") + f.message + "; ";
  return text.empty() ? "nothing" : text;
}

struct Tally {
  int right{0}, all{0};
  std::string misses;
  void count(bool is_right, const std::string& what) {
    ++all;
    right += is_right ? 1 : 0;
    if (!is_right) misses += what + "\n";
  }
};

/// Torque that masses make, rows × n.
MatrixXd expected_torque(const model::Robot& robot, const Samples& s) {
  const model::Dynamics dynamics(robot);
  MatrixXd torque(s.q.rows(), s.q.cols());
  for (Index i = 0; i < s.q.rows(); ++i) {
    torque.row(i) =
        dynamics.inverse_dynamics(s.q.row(i).transpose(), s.qd.row(i).transpose(), s.qdd.row(i).transpose())
            .transpose();
  }
  return torque;
}

/// What a joint's torque is not explained by even when every parameter of its row is free.
VectorXd noise_of(const Comparison& comparison) {
  VectorXd noise(comparison.num_joints());
  for (int j = 0; j < comparison.num_joints(); ++j) {
    noise[j] = std::max(comparison.free_residual(j), comparison.floor(j));
  }
  return noise;
}

VectorXd rms(const MatrixXd& change) { return (change.array().square().colwise().mean()).sqrt().transpose(); }

constexpr double kMoreThanNoise = 3.0;

const Finding* first(const TorqueCheck& check, Contradiction kind) {
  for (const Finding& f : check.findings) {
    if (f.kind == kind) return &f;
  }
  return nullptr;
}

class Altered {
 public:
  Altered(const Case& c, std::map<std::string, Tally>& tallies)
      : name_(c.folder + "/" + c.log),
        loaded_(load(c)),
        options_(options_for(c.folder)),
        tallies_(tallies),
        comparison_(loaded_.robot, loaded_.samples),
        noise_(noise_of(comparison_)) {}

  void run() {
    signs();
    interchanges();
    scales();
    zeros();
    gravities();
    columns();
  }

 private:
  int n() const { return loaded_.robot.num_joints(); }
  TorqueCheck check(const Samples& samples) const {
    return check_samples(loaded_.robot, samples, name_, options_);
  }
  void count(const std::string& way, bool right, const std::string& what, const TorqueCheck& result) {
    tallies_[way].count(right, fmt::format("{} {}: {}", name_, what, text_of(result)));
  }

  void signs() {
    for (int j = 0; j < n(); ++j) {
      Samples s = loaded_.samples;
      // A joint at rest is held by friction of either sign.
      if (!comparison_.joint(j).moving() || 2.0 * comparison_.torque_rms(j) < kMoreThanNoise * noise_[j])
        continue;
      s.tau.col(j) *= -1.0;
      const TorqueCheck result = check(s);
      const bool right = result.findings.size() == 1 && result.findings[0].kind == Contradiction::kSign &&
                         result.findings[0].joint == j;
      count("sign", right, fmt::format("sign of {}", j + 1), result);
    }
  }
  void interchanges() {
    const MatrixXd before = expected_torque(loaded_.robot, loaded_.samples);
    for (int j = 0; j + 1 < n(); ++j) {
      const int k = j + 1;
      const double change = rms(loaded_.samples.tau.col(j) - loaded_.samples.tau.col(k))[0];
      if (!comparison_.joint(j).moving() || !comparison_.joint(k).moving() ||
          change < kMoreThanNoise * std::max(noise_[j], noise_[k])) {
        continue;
      }
      Samples s = loaded_.samples;
      s.tau.col(j).swap(s.tau.col(k));
      const auto look = [&](const char* way) {
        const TorqueCheck result = check(s);
        const Finding* found = first(result, Contradiction::kInterchanged);
        count(way, found != nullptr && found->joint == j && found->other == k,
              fmt::format("{} and {}", j + 1, k + 1), result);
      };
      look("interchanged");
      for (MatrixXd* columns : {&s.q, &s.qd, &s.qdd}) columns->col(j).swap(columns->col(k));
      // Friction goes with its joint; what changes is the torque of the masses.
      MatrixXd after = expected_torque(loaded_.robot, s);
      after.col(j).swap(after.col(k));
      if (shows(rms(after - before))) look("all columns");
      s.tau = loaded_.samples.tau;
      look("positions");
    }
  }
  void scales() {
    bool carried = false;
    for (int j = 0; j < n(); ++j)
      carried = carried || (comparison_.joint(j).moving() && comparison_.slope(j).second < 0.6);
    if (!carried) return;
    loaded_joints_move_ = true;
    const auto is_scale = [](const TorqueCheck& r) {
      const Finding* found = first(r, Contradiction::kScale);
      return found != nullptr && found->joint < 0;
    };
    Samples s = loaded_.samples;
    s.tau /= 101.0;
    TorqueCheck result = check(s);
    EXPECT_EQ(first(result, Contradiction::kWeightless), nullptr) << name_ << ": " << text_of(result);
    count("motor side", is_scale(result), "divided by 101", result);
    s.tau = loaded_.samples.tau / 11.0;
    result = check(s);
    EXPECT_EQ(first(result, Contradiction::kWeightless), nullptr) << name_ << ": " << text_of(result);
    count("amperes", is_scale(result), "divided by 11", result);
    s.tau = MatrixXd::Zero(s.tau.rows(), s.tau.cols());
    result = check(s);
    count("zeros", first(result, Contradiction::kNoSignal) != nullptr, "all zeros", result);
  }
  /// More than noise in a joint that moves; one at rest is held by friction of any size.
  bool shows(const VectorXd& change) const {
    for (int j = 0; j < n(); ++j) {
      if (comparison_.joint(j).moving() && change[j] > kMoreThanNoise * noise_[j]) return true;
    }
    return false;
  }
  void zeros() {
    const MatrixXd before = expected_torque(loaded_.robot, loaded_.samples);
    for (int j = 0; j < n(); ++j) {
      if (loaded_.robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic) continue;
      const double turn = j % 2 == 0 ? 0.5 * std::numbers::pi : -0.5 * std::numbers::pi;
      Samples s = loaded_.samples;
      s.q.col(j).array() += turn;
      const VectorXd change = rms(expected_torque(loaded_.robot, s) - before);
      if (!shows(change)) continue;
      const TorqueCheck result = check(s);
      const Finding* found = first(result, Contradiction::kZero);
      // Turning the first joint's zero and turning the base about its axis are one thing.
      const bool as_base = j == 0 && first(result, Contradiction::kGravity) != nullptr;
      count("zero", (found != nullptr && found->joint == j && std::abs(found->value + turn) < 0.1) || as_base,
            fmt::format("zero of {} by {:.2f}", j + 1, turn), result);
    }
  }
  void gravities() {
    const MatrixXd before = expected_torque(loaded_.robot, loaded_.samples);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        model::Robot turned = loaded_.robot;
        const Eigen::Vector3d down = 9.81 * sign * Eigen::Vector3d::Unit(axis);
        if (down.dot(Eigen::Vector3d(turned.gravity.data())) > 90.0) continue;
        turned.gravity = {down[0], down[1], down[2]};
        const VectorXd change = rms(expected_torque(turned, loaded_.samples) - before);
        if (!shows(change)) continue;
        const TorqueCheck result = check_samples(turned, loaded_.samples, name_, options_);
        const Finding* found = first(result, Contradiction::kGravity);
        count("gravity", found != nullptr,
              fmt::format("gravity along {}{}", sign > 0 ? '+' : '-', "xyz"[axis]), result);
      }
    }
  }
  /// Other columns of the log in the place of the torque, and another robot.
  void columns() {
    if (loaded_joints_move_ && loaded_.log.current.cols() == n() &&
        name_.find("dualarm") == std::string::npos) {
      data::Log log = loaded_.log;
      log.tau = log.current;
      const TorqueCheck result = check(samples_of(data::MotionStream(log)));
      const Finding* found = first(result, Contradiction::kScale);
      count("amperes", found != nullptr && found->joint < 0, "the currents", result);
    }
    data::Log log = loaded_.log;
    int columns = 0;
    for (const auto& [header, values] : log.extra) {
      for (int j = 0; j < n(); ++j) {
        if (header == fmt::format("tauref{}", j + 1)) log.tau.col(j) = values, ++columns;
      }
    }
    int moving = 0;
    for (int j = 0; j < n(); ++j) moving += comparison_.joint(j).moving() ? 1 : 0;
    if (columns == n() && moving > 2) {
      const TorqueCheck result = check(samples_of(data::MotionStream(log)));
      count("model torque", first(result, Contradiction::kModelTorque) != nullptr, "the controller's torque",
            result);
    }
    const bool is_ur10 = name_.rfind("ur10", 0) == 0;
    if (is_ur10 && loaded_joints_move_) {
      const model::Robot ur5e = urdf::load_urdf(urdf::resolve_robot("ur5e"));
      const TorqueCheck result = check_samples(ur5e, loaded_.samples, name_, options_);
      count("robot", first(result, Contradiction::kRobot) != nullptr, "as a UR5e", result);
    }
  }

  std::string name_;
  Loaded loaded_;
  Options options_;
  std::map<std::string, Tally>& tallies_;
  Comparison comparison_;
  VectorXd noise_;
  bool loaded_joints_move_{false};
};

void expect_named(const std::vector<Case>& cases) {
  std::map<std::string, Tally> tallies;
  for (const Case& c : cases) {
    if (c.log.rfind("target", 0) != 0) Altered(c, tallies).run();  // those are no measured torque
  }
  int right = 0, all = 0;
  for (const auto& [way, tally] : tallies) {
    fmt::print("{:14} {:4} of {:4}\n{}", way, tally.right, tally.all, tally.misses);
    right += tally.right, all += tally.all;
    // Some zeros and swaps change what the parameters of a wrist could be as well.
    EXPECT_GE(tally.right, 0.85 * tally.all) << way << "\n" << tally.misses;
  }
  fmt::print("in all         {:4} of {:4}\n", right, all);
  EXPECT_GE(right, 0.95 * all);
}

TEST(PlausibilityMeasured, NamesWhatIsWrongInEveryLog) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  expect_named(cases_of(true));
}

void expect_nothing(const std::vector<Case>& cases) {
  int looked_at = 0;
  for (const Case& c : cases) {
    const Loaded loaded = load(c);
    const TorqueCheck result =
        check_samples(loaded.robot, loaded.samples, c.folder + "/" + c.log, options_for(c.folder));
    // The files named target hold the torque of the controller's own model, which is to be seen, but not refused.
    const bool is_model = c.log.rfind("target", 0) == 0;
    for (const Finding& f : result.findings) {
      EXPECT_TRUE(is_model && f.kind == Contradiction::kModelTorque && !f.clear)
          << c.folder << "/" << c.log << ": " << text_of(result);
    }
    ++looked_at;
  }
  fmt::print("{} logs\n", looked_at);
  EXPECT_GE(looked_at, static_cast<int>(cases.size()));
}

TEST(PlausibilityMeasured, SuspectsNoLogThatIsAsItShouldBe) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  expect_nothing(cases_of(true));
}

/// The robot of a folder as `identify` finds it in logs.
model::Robot fitted(const std::string& folder, const std::vector<std::string>& logs) {
  const std::string path = fmt::format("{}/{}", data_folder(), folder);
  const model::Robot prior = urdf::load_urdf(path + "/robot.urdf");
  data::LogFiles files;
  for (const std::string& log : logs) files.train.push_back(fmt::format("{}/{}.csv", path, log));
  files.split = 0.0;
  return model::make_robot(identify::identify(prior, data::open_logs(prior.joint_specs(), files)).model_file());
}

// Joints 4 and 5 of a UR5 rest through three quarters of these runs, and friction holds them there with whatever it stopped with. The
// model is not the manufacturer's but a fit, whose masses are known in combinations only.
TEST(PlausibilityMeasured, SuspectsNoJointThatRestsBesideAnIdentifiedModel) {
  HEFT_NEEDS_MEASURED_DATA(data_folder() + "/ur5-kufieta");
  const model::Robot ur5 = fitted("ur5-kufieta", {"no1", "no2", "no3-fast", "no6-slow"});
  for (const char* run : {"no6-slow", "no7"}) {
    const Loaded loaded = load({"ur5-kufieta", run});
    const TorqueCheck result = check_samples(ur5, loaded.samples, run, options_for("ur5-kufieta"));
    EXPECT_TRUE(result.findings.empty()) << text_of(result);
  }
}

// Fits with impossible links, and sound logs of another kind of motion than those of the fit.
TEST(PlausibilityMeasured, SuspectsNoMotionThatAFitHasNotSeen) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  struct Unseen {
    std::string folder;
    std::vector<std::string> seen;
    std::string unseen;
  };
  for (const Unseen& u : std::vector<Unseen>{
           {"dualarmv2", {"exc-13.5", "exc-52.2", "sweep-j2"}, "sweep-j4"},
           {"ur10e-dynamic-calibration", {"exc-10h-20s", "exc-12h-20s", "exc-12h-30s", "exc-12h-40s", "exc-12h-50s"}, "ptp-10-points"}}) {
    const model::Robot robot = fitted(u.folder, u.seen);
    ASSERT_FALSE(model::has_physical_links(robot)) << u.folder;
    const Loaded loaded = load({u.folder, u.unseen});
    const TorqueCheck result = check_samples(robot, loaded.samples, u.unseen, options_for(u.folder));
    EXPECT_TRUE(result.findings.empty()) << u.folder << ": " << text_of(result);
    // The sign of a joint that moves is named all the same.
    Samples altered = loaded.samples;
    altered.tau.col(3) *= -1.0;
    const TorqueCheck wrong = check_samples(robot, altered, u.unseen, options_for(u.folder));
    EXPECT_NE(first(wrong, Contradiction::kSign), nullptr) << u.folder << ": " << text_of(wrong);
  }
}

/// What the check of a stream says of a log whose rows arrive, and with which row.
struct Heard {
  bool refused{false};
  double after{0.0};  ///< since the first row [s]
};
Heard hear(const model::Robot& robot, const data::Log& log) {
  LiveCheck check(robot, "-");
  Heard heard;
  std::optional<TorqueCheck> found;
  for (Index k = 0; k < log.num_samples() && !found; ++k) {
    data::LiveRow row{log.time[k], log.q.row(k), {}, log.tau.row(k)};
    if (log.qd.cols() > 0) row.qd = log.qd.row(k);
    found = check.push(row);
    heard.after = log.time[k] - log.time[0];
  }
  if (!found) found = check.end();
  heard.refused = found && found->refused();
  return heard;
}

TEST(PlausibilityMeasured, RefusesNoStreamThatIsAsItShouldBeInEveryLog) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  const std::vector<Case> cases = cases_of(true);
  EXPECT_GT(cases.size(), 10U);
  for (const Case& c : cases) {
    const Loaded loaded = load(c);
    EXPECT_FALSE(hear(loaded.robot, loaded.log).refused) << c.folder << "/" << c.log;
  }
}

// Joint 2 of an arm on a table carries most.
TEST(PlausibilityMeasured, AStreamOfAUr10eWithAWrongSignIsRefusedInTheFirstSecondsOfMotion) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  Loaded loaded = load({"ur10e-dynamic-calibration", "exc-14h-50s-load2p805kg"});
  loaded.log.tau.col(1) *= -1.0;
  const Heard heard = hear(loaded.robot, loaded.log);
  EXPECT_TRUE(heard.refused);
  EXPECT_LT(heard.after, 10.0) << "it moves from 3.5 s on";
}

TEST(PlausibilityMeasured, NamesWhatIsWrong) {
  HEFT_NEEDS_MEASURED_DATA(data_folder());
  expect_named(cases_of(false));
}

TEST(PlausibilityMeasured, SeesThatABaseIsTurned) {
  const std::string folder = data_folder() + "/ar5-frankjie";
  HEFT_NEEDS_MEASURED_DATA(folder);
  const model::Robot robot = urdf::load_urdf(folder + "/robot-asgiven.urdf");
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  const TorqueCheck result = check_torque(robot, data::read_log(folder + "/first40s.csv", needs));
  ASSERT_FALSE(result.findings.empty());
  EXPECT_EQ(result.findings[0].kind, Contradiction::kGravity);
  EXPECT_NE(result.findings[0].message.find("along +x of the base"), std::string::npos) << text_of(result);
}

}  // namespace
}  // namespace heft::plausibility
