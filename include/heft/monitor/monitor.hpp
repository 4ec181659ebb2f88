/// @file
/// Did it touch something? Thresholds from motion without contact, then contacts in a log, with the code that runs on
/// the controller (heft/core/monitor/contact_monitor.hpp).
///
/// @code
/// const auto free = data::open_logs(robot.joint_specs(), {.train = {"free-a.csv", "free-b.csv"}, .split = 0});
/// const monitor::Thresholds thresholds = monitor::learn(file, robot, free);
/// const auto logs = data::open_logs(robot.joint_specs(), {.judge = {"run.csv"}});
/// const std::vector<monitor::Contacts> found = monitor::monitor(file, robot, logs, thresholds);
/// std::puts(report::full(found.front()).c_str());
/// @endcode
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/core/monitor/contact_thresholds.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::monitor {

/// Rate of the push by which delays are stated [N·m/s]: a hand that leans on an elbow.
inline constexpr double kPushRate = 30.0;

struct Options {
  /// False alarms that free motion may cause, all joints together [1/h].
  double false_alarms_per_hour{1.0};
  /// Nothing touched the arm in the log that is monitored: contacts found are false alarms.
  bool known_free{false};
  bool traces{false};  ///< keep residual, change and thresholds over time, for plots
  /// What is known against the torque of the logs (heft/plausibility); goes into the judgement.
  host::Judgement torque{};
  std::function<void(const std::string& what, double done)> progress{};  ///< done within 0..1; may be empty
};

/// A number of a joint's threshold as files and JSON name it; all are above 0.
struct ThresholdField {
  const char* name;
  double JointThreshold<double>::*value;
};

/// All of them, in the order in which `heft export` writes them.
inline constexpr std::array<ThresholdField, 8> kThresholdFields{
    {{"moving", &JointThreshold<double>::moving},
     {"turning", &JointThreshold<double>::turning},
     {"rest", &JointThreshold<double>::rest},
     {"moving_change", &JointThreshold<double>::moving_change},
     {"turning_change", &JointThreshold<double>::turning_change},
     {"rest_change", &JointThreshold<double>::rest_change},
     {"rest_speed", &JointThreshold<double>::rest_speed},
     {"top_speed", &JointThreshold<double>::top_speed}}};

/// Thresholds of an arm, one joint an entry, and what they rest on.
struct Thresholds {
  double bandwidth{25.0};    ///< as in ContactThresholds [1/s]
  double adaptation{10.0};   ///< [1/s]
  double turning_time{0.2};  ///< [s]
  double load_rate{1e6};     ///< [N·m/s, N/s]
  double largest_step{2.5};  ///< [thresholds of the change]
  std::vector<JointThreshold<double>> joints;
  std::string torque_at{"motor"};  ///< where the torque was measured: "motor" or "joint"
  double asked_rate{1.0};          ///< false alarms that were allowed [1/h]
  statistics::Interval expected{0.0, kNaN, 0.0,
                                0.0};  ///< false alarms that the tail of free motion lets expect [1/h]
  double hours{0.0};                   ///< of free motion that was looked at
  std::vector<std::string> logs;       ///< learnt from
  host::Judgement judgement;
  std::vector<std::string> notes;  ///< what a user should know besides

  bool usable() const { return judgement.usable(); }
  data::TorqueAt at() const { return torque_at == "joint" ? data::TorqueAt::kJoint : data::TorqueAt::kMotor; }
  /// The model with these thresholds in its field "contact_thresholds", which monitor and `heft export` read.
  model::ModelFile model_file(model::ModelFile model) const;
};

/// Learns thresholds from the training logs of the set, in which nothing touched the arm.
/// Residual and change of each joint have a threshold for rest, one for turning round and one for motion: a scale of what free
/// motion shows there, times a multiple that follows from the tail of the maxima in blocks of one second, each log measured
/// by the scales of the others (src/monitor/thresholds.md).
/// @param file   whose parameters the robot has; logs that it was fitted to show a smaller residual than others, which
///               doubles the thresholds and makes the result doubtful
/// @param robot  with the file's parameters
/// @throws DataError when a log lacks torque; NotIdentifiableError when the logs are shorter than 10 s or no joint moves
Thresholds learn(const model::ModelFile& file, const model::Robot& robot, const data::LogSet& logs,
                 const Options& options = {});

/// The thresholds that a model file holds; none if it holds none.
/// @throws ModelError when they are not what Thresholds::model_file() writes
std::optional<Thresholds> thresholds_of(const model::ModelFile& file);

/// Something that lasted.
struct Contact {
  double begin{0.0}, end{0.0};  ///< [s]; a contact that lasts to the end of the log ends there
  std::vector<int> joints;      ///< whose threshold was exceeded, counted from 0
  int joint{0};                 ///< whose deviation was largest against its threshold when it began
  int direction{0};  ///< of the torque from outside on that joint, along (1) or against (-1) its position
  double peak{0.0};  ///< largest deviation of that joint [N·m, N]
  bool load_change{false};  ///< no contact: from `end` on the flange carries another load
  std::array<double, 4>
      load{};  ///< of a load change: mass added [kg], first moment in the last link frame [kg·m]
};

/// Residual, its change and their thresholds over time, samples × n [N·m, N].
struct DeviationTrace {
  Eigen::VectorXd time;
  Eigen::MatrixXd residual, level_threshold, change, change_threshold;
};

/// What touched the arm in a log.
struct Contacts {
  std::string robot, model, log;           ///< the latter two paths
  double log_seconds{0.0}, log_rate{0.0};  ///< [s], [Hz]
  double judged_seconds{0.0};              ///< without start and gaps, where filters settle
  std::vector<Contact> contacts;
  Thresholds thresholds;
  Eigen::VectorXd threshold, change_threshold;  ///< of residual and change, medians in this log, n [N·m, N]
  /// Time after which a push that grows by kPushRate exceeds one of them, n [s]; NaN: it does not within 10 s.
  Eigen::VectorXd delay;
  bool known_free{false};
  /// Of a log known to be free what was counted, with the exact interval of a count; else what the thresholds expect.
  statistics::Interval false_alarms;
  DeviationTrace trace;  ///< empty unless asked for
  host::Judgement judgement;
  std::vector<std::string> notes;

  bool usable() const { return judgement.usable(); }
};

/// Goes through each log to judge on sample by sample, as a controller would.
/// @param file   whose parameters the robot has
/// @throws DataError when a log lacks torque, or shares samples with one that the model was fitted to or the thresholds
///         were learnt from; ModelError when the thresholds are those of another robot
std::vector<Contacts> monitor(const model::ModelFile& file, const model::Robot& robot,
                              const data::LogSet& logs, const Thresholds& thresholds,
                              const Options& options = {});

/// What a row of a live stream brought about.
struct LiveContact {
  bool ended{false};      ///< false: it begins
  Contact contact;        ///< so far
  double threshold{0.0};  ///< of Contact::joint when it began [N·m, N]
};

/// What a live stream held, from its first row on.
struct LiveSummary {
  double seconds{0.0}, judged_seconds{0.0};  ///< [s]; the latter without start and gaps, where filters settle
  long samples{0};                           ///< taken
  long refused{0};                           ///< refused, by the filters or by whoever read the rows
  std::vector<Contact> contacts;             ///< one that lasted to the end ends there
  /// Why nothing could be judged, as a sentence without a full stop; empty: something was.
  std::string unanswered;
};

/// Finds contacts while rows arrive, with the code that monitor() runs over a log: what begins or ends with a row is known
/// before the next one. The first data::LiveClock::kFirstRows give the sample period and are gone through together, while nothing could
/// be judged yet.
///
/// @code
/// monitor::LiveContacts live(file, robot, *monitor::thresholds_of(file));
/// data::LiveLog rows("-", {.num_joints = robot.num_joints(), .torque = true}, tell);
/// for (data::LiveRow row; rows.next(row);)
///   for (const monitor::LiveContact& event : live.push(row)) std::puts(report::brief(event).c_str());
/// @endcode
class LiveContacts {
 public:
  /// @param file   whose parameters the robot has
  /// @throws ModelError when the thresholds are those of another robot
  LiveContacts(const model::ModelFile& file, const model::Robot& robot, const Thresholds& thresholds);
  ~LiveContacts();

  /// Takes a row. One whose time is not beyond that of the row before starts anew: the clock was set.
  /// @return what begins or ends with it; mostly nothing
  std::vector<LiveContact> push(const data::LiveRow& row);
  /// The stream ends. @param refused  rows that did not get here
  LiveSummary end(long refused = 0);
  /// What a user should know of model and thresholds.
  const std::vector<std::string>& notes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::monitor
