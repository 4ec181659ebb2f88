/// @file
/// Logs to fit a model to and logs to judge it on: found, checked for unit slips, kept apart, split.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "heft/core/joint_spec.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_checks.hpp"
#include "heft/data/motion_stream.hpp"

namespace heft::data {

/// Where the torque of a log was measured.
enum class TorqueAt {
  kMotor,  ///< at the drive: rotor inertia and gear friction are in it
  kJoint   ///< by a sensor behind the gear: rigid bodies only
};
/// "motor" or "joint", as in files and on the command line.
const char* to_string(TorqueAt at);

/// Which logs, and what they must hold.
struct LogFiles {
  std::vector<std::string> train{};  ///< to fit to
  std::vector<std::string> judge{};  ///< to judge on
  /// Fraction of a single training log that is fitted to when nothing is given to judge on; the rest judges. 0: all
  /// of it is fitted to.
  double split{0.7};
  /// [N·m/A] one for all joints or one per joint: torque from currents where the log has no torque.
  std::vector<double> torque_constant{};
  TorqueAt torque_at{TorqueAt::kMotor};
  /// Low-pass cut-off for derived motion [Hz]; 0: chosen from the motion.
  double cutoff{0.0};
  std::string robot{};  ///< its name, for the message that the joint count differs
  bool torque{true};    ///< false: a log may lack torque
  /// Fewer end in an error that says so. 1: rows may be single states; fewer than ten are not checked for units.
  int min_samples{2};
  ReadAs as{};  ///< what the files do not say of themselves
};

class KeptLog;
class LogFingerprint;

/// One checked log: a file whose rows are kept beside memory, so that memory does not grow with it, or samples in memory.
/// Cheap to copy.
struct LogSource {
  std::string path;
  LogRequirements needs;
  std::shared_ptr<const Log> memory{};  ///< null: read from the file
  double cutoff{0.0};           ///< low-pass cut-off for derived motion [Hz]; 0: chosen from the motion
  std::string unusable_rate{};  ///< why logged velocity and acceleration are not used; empty: they are
  std::string time_note{};      ///< what is worth telling of its time stamps; may be empty
  std::shared_ptr<const LogFingerprint>
      fingerprint{};  ///< tells whether another log holds samples of this one
  std::shared_ptr<const KeptLog> kept{};  ///< what was read of the file, so that streams need not read it again
};

/// Logs to fit to and logs to judge on.
///
/// Every log was checked for unit slips (LogCheck: degrees, milliseconds, rpm, flipped signs); no log to judge on
/// holds samples of a log to fit to. Where the positions show that samples were not taken when the time stamps say, their
/// times replace the stamps in all that is read; a note says so.
class LogSet {
 public:
  const std::vector<LogSource>& train() const { return train_; }
  const std::vector<LogSource>& judge() const { return judge_; }
  /// All logs as they were given, before one was split: those to fit to, then those to judge on.
  const std::vector<LogSource>& given() const { return given_; }
  /// What is judged on, as a clause: "judged on logs that the fit has not seen".
  const std::string& how() const { return how_; }
  /// Findings about the logs that are worth telling, one line each.
  const std::vector<std::string>& notes() const { return notes_; }
  TorqueAt torque_at() const { return torque_at_; }
  /// Paths of the logs given to fit to: two parts of one log have one path.
  const std::vector<std::string>& train_paths() const { return train_paths_; }
  /// What was asked for as LogFiles::cutoff [Hz]; 0: chosen from the motion.
  double cutoff() const { return cutoff_; }

 private:
  friend class LogSetBuilder;
  std::vector<LogSource> train_, judge_, given_;
  std::vector<std::string> notes_, train_paths_;
  std::string how_;
  TorqueAt torque_at_{TorqueAt::kMotor};
  double cutoff_{0.0};
};

/// Opens and checks log files. One pass over each file; one log in two parts is read into memory, if it has at most
/// 100 000 samples.
/// @param joints  of the robot that made the logs, base first
/// @throws DataError when a file is no log of this robot, holds a unit slip, or when a log to judge on is a log to fit
///         to, a copy of one, a part of one, or overlaps one (whatever their clocks show)
LogSet open_logs(std::span<const JointSpec> joints, const LogFiles& files);

/// The same of logs in memory; no log is split.
/// @throws DataError as open_logs
LogSet log_set(std::span<const JointSpec> joints, std::vector<Log> train, std::vector<Log> judge,
               TorqueAt torque_at = TorqueAt::kMotor);

/// The log piece by piece with its motion derived; memory does not grow with the log.
MotionStream stream(const LogSource& source, const StreamOptions& options = {});

/// The log as a whole. Logged velocities and accelerations that contradict the positions are left out.
/// @param notes  gets what is worth telling; may be null
Log read(const LogSource& source, std::vector<std::string>* notes = nullptr);

/// A log as a whole with velocity and acceleration, derived where the log has none.
struct MotionLog {
  Log log;
  MotionReport motion;
};
/// @param acceleration  false: velocity and acceleration are not needed, nothing is derived
MotionLog read_motion(const LogSource& source, bool acceleration = true,
                      std::vector<std::string>* notes = nullptr);

/// Joint limits in the form that the checks of a log take.
JointLimits limits_of(std::span<const JointSpec> joints);

/// Refuses to judge a model on logs that it was fitted to before.
/// @param fitted_to  paths of those logs, as the model file names them
/// @param notes      gets a line for each that cannot be read, so that only its path was compared; may be null
/// @param use        what was done with them, as a clause behind "which"; empty: "the model is fitted to"
/// @throws DataError when a log to judge on is one of them or shares samples with one
void refuse_seen(const LogSet& logs, const std::vector<std::string>& fitted_to,
                 std::vector<std::string>* notes = nullptr, const std::string& use = {});

/// What two logs share: "" or the judged log's relation to the other, such as "a part of train.csv". Rows count as
/// the same when position and torque agree to the last bit, whatever the time stamps; shared are eight rows or more in
/// a row in which the arm moves, or all rows of one of the logs.
std::string shared_samples(const LogSource& judged, const LogSource& trained);

}  // namespace heft::data
