#include "heft/data/log_set.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "heft/data/log_part.hpp"
#include "heft/host/error.hpp"
#include "kept_log.hpp"
#include "log_file.hpp"
#include "log_fingerprint.hpp"
#include "refuse_unsound.hpp"
#include "sample_times.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Longest log that is cut in two in memory.
constexpr long kLongestSplit = 100000;
/// A part with fewer samples is nothing to fit to or to judge on.
constexpr int kShortestPart = 50;
/// Fewer rows where a single one would do are states, not a motion.
constexpr long kFewestOfAMotion = 10;

/// Keeps what was found in the rows of a log: unit slips, and what another log could share with it.
/// @throws DataError with the first unit slip
void judge_rows(const LogCheck& check, LogFingerprint fingerprint, const JointLimits& limits, LogSource& source,
                std::vector<std::string>& notes) {
  // A list of poses is no motion: its time stamps say nothing of units.
  const bool states = source.needs.min_samples == 1 && fingerprint.rows() < kFewestOfAMotion;
  const std::vector<LogFinding> findings = states ? std::vector<LogFinding>() : check.findings(limits);
  refuse_errors(findings);
  for (const LogFinding& finding : findings) notes.push_back(finding.message);
  source.unusable_rate = check.unusable_rate();
  source.fingerprint = std::make_shared<const LogFingerprint>(std::move(fingerprint));
}

/// Checks every row of a log and finds out when its samples were taken.
/// @throws DataError as a reader of files does
LogSource inspect(LogSource source, const JointLimits& limits, std::vector<std::string>& notes) {
  if (source.memory) {
    const Log& log = *source.memory;
    LogCheck check(source.path, source.needs.num_joints);
    check.add(log.time, log.q, log.qd, log.qdd, log.tau);
    LogFingerprint fingerprint;
    fingerprint.add(log.q, log.tau);
    judge_rows(check, std::move(fingerprint), limits, source, notes);
    SampleTimes times = sample_times(log);
    source.time_note = times.note(source.path);
    if (times.placed) {
      Log placed = log;
      placed.time = std::move(times.time);
      source.memory = std::make_shared<const Log>(std::move(placed));
    }
  } else {
    const auto kept = std::make_shared<KeptLog>(source.path, source.needs, true);
    for (std::string note : {kept->file().how_read(), kept->file().unused_torque_constants()}) {
      if (!note.empty()) notes.push_back(std::move(note));
    }
    judge_rows(kept->facts().check, kept->take_fingerprint(), limits, source, notes);
    source.time_note = kept->note_on_times();
    source.kept = kept;
  }
  if (!source.time_note.empty()) notes.push_back(source.time_note);
  return source;
}

/// How the file was understood was told when it was looked at.
Log rows_of(const LogSource& source, std::vector<std::string>* notes) {
  if (source.memory) return *source.memory;
  LogFile file(source.path, source.needs);
  Log log = rows_of(file, source.path, notes);
  if (source.kept) source.kept->place(log);
  return log;
}

constexpr const char* kFitted = "the model is fitted to";

/// @param use  what was done with the other logs, as a clause behind "which"
/// @throws DataError when a log to judge on holds samples that were fitted to
void refuse_leakage(const std::vector<LogSource>& train, const std::vector<LogSource>& judge,
                    const std::string& use = kFitted) {
  for (const LogSource& judged : judge) {
    for (const LogSource& trained : train) {
      const std::string shared = shared_samples(judged, trained);
      if (shared.empty()) continue;
      throw DataError(fmt::format(
          "{}: {}, which {}: expected a log that the fit has not seen, of another motion; record one, or cut one "
          "log in two",
          judged.path, shared, use));
    }
  }
}

}  // namespace

const char* to_string(TorqueAt at) { return at == TorqueAt::kJoint ? "joint" : "motor"; }

JointLimits limits_of(std::span<const JointSpec> joints) {
  const auto n = static_cast<Index>(joints.size());
  JointLimits limits{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n), {}};
  for (Index j = 0; j < n; ++j) {
    const JointSpec& joint = joints[static_cast<std::size_t>(j)];
    limits.lower[j] = joint.lower;
    limits.upper[j] = joint.upper;
    limits.velocity[j] = joint.velocity;
    limits.effort[j] = joint.effort;
    limits.prismatic.push_back(joint.type == JointType::kPrismatic);
  }
  return limits;
}

std::string shared_samples(const LogSource& judged, const LogSource& trained) {
  std::error_code ignored;
  // Two pipes of one name are not one log.
  if (!judged.memory && !trained.memory && std::filesystem::is_regular_file(judged.path, ignored) &&
      (judged.path == trained.path || std::filesystem::equivalent(judged.path, trained.path, ignored))) {
    return fmt::format("the same file as {}", trained.path);
  }
  if (!judged.fingerprint || !trained.fingerprint) return "";
  switch (judged.fingerprint->relation_to(*trained.fingerprint)) {
    case LogFingerprint::Relation::kNone: return "";
    case LogFingerprint::Relation::kSame: return fmt::format("the same samples as {}", trained.path);
    case LogFingerprint::Relation::kPart: return fmt::format("a part of {}", trained.path);
    case LogFingerprint::Relation::kWhole: return fmt::format("holds all of {}", trained.path);
    case LogFingerprint::Relation::kOverlap: return fmt::format("holds a part of {}", trained.path);
  }
  return "";
}

/// Puts a LogSet together.
class LogSetBuilder {
 public:
  explicit LogSetBuilder(std::span<const JointSpec> joints) : limits_(limits_of(joints)) {
    needs_.num_joints = static_cast<int>(joints.size());
  }

  LogSet open(const LogFiles& files) {
    needs_.robot_name = files.robot;
    needs_.torque = files.torque;
    needs_.min_samples = files.min_samples;
    needs_.torque_constant = files.torque_constant;
    needs_.as = files.as;
    set_.torque_at_ = files.torque_at;
    set_.cutoff_ = files.cutoff;
    set_.train_paths_ = files.train;
    for (const std::string& path : files.train) set_.train_.push_back(of_file(path));
    for (const std::string& path : files.judge) set_.judge_.push_back(of_file(path));
    keep_apart();
    if (!set_.judge_.empty()) {
      set_.how_ = "judged on logs that the fit has not seen";
    } else if (set_.train_.size() != 1 || files.split == 0.0) {
      set_.how_ = "not judged: no log was held back (--validate)";
    } else {
      split(files.split);
    }
    return std::move(set_);
  }

  LogSet of(std::vector<Log> train, std::vector<Log> judge, TorqueAt torque_at) {
    set_.torque_at_ = torque_at;
    add(std::move(train), "training log", set_.train_);
    add(std::move(judge), "log to judge on", set_.judge_);
    for (const LogSource& source : set_.train_) set_.train_paths_.push_back(source.path);
    keep_apart();
    set_.how_ =
        set_.judge_.empty() ? "not judged: no log was held back" : "judged on logs that the fit has not seen";
    return std::move(set_);
  }

 private:
  /// Every log is there: none to judge on may hold samples that are fitted to.
  void keep_apart() {
    refuse_leakage(set_.train_, set_.judge_);
    set_.given_ = set_.train_;
    set_.given_.insert(set_.given_.end(), set_.judge_.begin(), set_.judge_.end());
  }

  LogSource of_file(const std::string& path) {
    return inspect({path, needs_, nullptr, set_.cutoff_}, limits_, set_.notes_);
  }

  void add(std::vector<Log> logs, const char* what, std::vector<LogSource>& sources) {
    for (Log& log : logs) {
      if (log.path.empty()) log.path = fmt::format("{} {}", what, sources.size() + 1);
      if (log.q.cols() != needs_.num_joints) {
        throw DataError(fmt::format("{}: {} joints; expected {}, as the robot has", log.path, log.q.cols(),
                                    needs_.num_joints));
      }
      refuse_unsound(log);
      auto memory = std::make_shared<const Log>(std::move(log));
      sources.push_back(inspect({memory->path, needs_, memory}, limits_, set_.notes_));
    }
  }

  /// One log becomes two, both behind the low-pass that its whole motion asks for.
  void split(double share) {
    const LogSource whole = set_.train_.front();
    const MotionStream motion = stream(whole);
    const StreamSummary& summary = motion.summary();
    if (summary.samples > kLongestSplit) {
      set_.how_ = "not judged: the log is too long to be cut in two; give another with --validate";
      return;
    }
    const Log log = rows_of(whole, nullptr);
    const double cut = summary.moving_from + share * (summary.moving_to - summary.moving_from);
    auto first = std::make_shared<const Log>(part_of(log, summary.begin, cut));
    auto second = std::make_shared<const Log>(part_of(log, cut, summary.end + 1.0));
    // Too short a log has no part to spare; the fit says what is wrong with it.
    if (first->time.size() < kShortestPart || second->time.size() < kShortestPart) {
      set_.how_ = "not judged: the log is too short to be cut in two";
      return;
    }
    set_.train_ = {{first->path, whole.needs, first, summary.cutoff, whole.unusable_rate}};
    set_.judge_ = {{second->path, whole.needs, second, summary.cutoff, whole.unusable_rate}};
    set_.how_ = fmt::format("fitted to the first {:.0f} % of the motion, judged on the rest", 100.0 * share);
  }

  JointLimits limits_;
  LogRequirements needs_;
  LogSet set_;
};

LogSet open_logs(std::span<const JointSpec> joints, const LogFiles& files) {
  return LogSetBuilder(joints).open(files);
}

LogSet log_set(std::span<const JointSpec> joints, std::vector<Log> train, std::vector<Log> judge,
               TorqueAt torque_at) {
  return LogSetBuilder(joints).of(std::move(train), std::move(judge), torque_at);
}

void refuse_seen(const LogSet& logs, const std::vector<std::string>& fitted_to,
                 std::vector<std::string>* notes, const std::string& use) {
  if (logs.judge().empty()) return;
  std::vector<LogSource> seen;
  for (const std::string& path : fitted_to) {
    LogSource source{path, logs.judge().front().needs};
    source.needs.min_samples = 1;
    std::error_code ignored;
    bool read = false;
    if (std::filesystem::is_regular_file(path, ignored)) {
      try {
        std::vector<std::string> unwanted;
        source = inspect(source, {}, unwanted);
        read = true;
      } catch (const InputError&) {
        // Another file has that name today.
      }
    }
    if (!read && notes != nullptr) {
      notes->push_back(fmt::format(
          "{}: the model was fitted to this log, which cannot be read here; whether a log to judge on holds samples of "
          "it is not known",
          path));
    }
    seen.push_back(std::move(source));
  }
  refuse_leakage(seen, logs.judge(), use.empty() ? kFitted : use);
}

MotionStream stream(const LogSource& source, const StreamOptions& options) {
  StreamOptions wanted = options;
  if (wanted.motion.cutoff == 0.0) wanted.motion.cutoff = source.cutoff;
  if (source.memory) return MotionStream(*source.memory, wanted);
  if (source.kept) return MotionStream(source.kept, wanted);
  return MotionStream(source.path, source.needs, wanted);
}

Log read(const LogSource& source, std::vector<std::string>* notes) {
  Log log = rows_of(source, notes);
  if (source.unusable_rate.empty()) return log;
  if (notes != nullptr)
    notes->push_back(fmt::format("{}: {}; it is not used", source.path, source.unusable_rate));
  log.qdd.resize(0, 0);
  if (source.unusable_rate.starts_with("qd") && !source.unusable_rate.starts_with("qdd")) log.qd.resize(0, 0);
  return log;
}

MotionLog read_motion(const LogSource& source, bool acceleration, std::vector<std::string>* notes) {
  MotionLog result{read(source, notes), {}};
  if (!acceleration || (result.log.qd.cols() > 0 && result.log.qdd.cols() > 0)) return result;
  MotionOptions options;
  options.cutoff = source.cutoff;
  result.motion = derive_motion(result.log, options);
  if (notes == nullptr) return result;
  std::string derived = result.motion.velocity_derived ? "velocity" : "";
  if (result.motion.acceleration_derived) derived += derived.empty() ? "acceleration" : " and acceleration";
  notes->push_back(fmt::format(
      "{}: {} derived from position{}", source.path, derived,
      result.motion.cutoff > 0.0
          ? fmt::format(", zero-phase low-pass {:.3g} Hz{}", result.motion.cutoff,
                        result.motion.cutoff_chosen ? " (chosen from the motion; --band sets it)" : "")
          : std::string(", not filtered")));
  if (!result.motion.gaps.empty()) {
    notes->push_back(fmt::format("{}: {} gaps in time; derived values inside them mean nothing", source.path,
                                 result.motion.gaps.size()));
  }
  return result;
}

}  // namespace heft::data
