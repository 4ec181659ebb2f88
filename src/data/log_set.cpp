#include "heft/data/log_set.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "heft/data/log_part.hpp"
#include "heft/host/error.hpp"
#include "log_file.hpp"
#include "log_fingerprint.hpp"
#include "refuse_unsound.hpp"
#include "row_source.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Longest log that is cut in two in memory.
constexpr long kLongestSplit = 100000;
/// A part with fewer samples is nothing to fit to or to judge on.
constexpr int kShortestPart = 50;
/// Fewer rows where a single one would do are states, not a motion.
constexpr long kFewestOfAMotion = 10;

/// What cannot be read twice: a pipe, say.
bool reads_once(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) && std::filesystem::is_other(path, ignored);
}

/// Columns of one channel in a file, as factors of their numbers.
struct ChannelColumns {
  std::vector<std::size_t> columns;
  std::vector<double> factors;
};

ChannelColumns columns_of(const LogFile& file, const std::string& prefix, bool there,
                          bool with_torque_constant = false) {
  ChannelColumns channel;
  for (int joint = 1; there && joint <= file.num_joints(); ++joint) {
    channel.columns.push_back(file.find_column(fmt::format("{}{}", prefix, joint)));
    channel.factors.push_back(with_torque_constant ? file.torque_constant(joint - 1) : 1.0);
  }
  return channel;
}

/// Calls `use(time, q, qd, qdd, tau)` for the rows of a file, block by block.
/// @return LogFile::how_read() and unused_torque_constants(), where they say anything
template <typename Use>
std::vector<std::string> for_each_block(const std::string& path, const LogRequirements& needs,
                                        const Use& use) {
  LogFile file(path, needs);
  const bool current = file.torque_from_current();
  const std::array<ChannelColumns, 4> channels{
      columns_of(file, "q", true), columns_of(file, "qd", file.has_channel(&Log::qd)),
      columns_of(file, "qdd", file.has_channel(&Log::qdd)),
      columns_of(file, current ? "i" : "tau", current || file.has_channel(&Log::tau), current)};
  std::array<Eigen::MatrixXd, 4> blocks;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    blocks[c].resize(kBlockRows, static_cast<Index>(channels[c].columns.size()));
  }
  Eigen::VectorXd time(kBlockRows);
  const std::size_t time_column = file.find_column("time");
  std::vector<double> row(file.num_columns());
  Index rows = 0;
  const auto hand_over = [&] {
    use(time.head(rows), blocks[0].topRows(rows), blocks[1].topRows(rows), blocks[2].topRows(rows),
        blocks[3].topRows(rows));
    rows = 0;
  };
  while (file.next(row.data())) {
    time[rows] = row[time_column];
    for (std::size_t c = 0; c < channels.size(); ++c) {
      for (std::size_t j = 0; j < channels[c].columns.size(); ++j) {
        blocks[c](rows, static_cast<Index>(j)) = channels[c].factors[j] * row[channels[c].columns[j]];
      }
    }
    if (++rows == kBlockRows) hand_over();
  }
  if (rows > 0) hand_over();
  file.check_length();
  std::vector<std::string> notes{file.how_read(), file.unused_torque_constants()};
  std::erase(notes, "");
  return notes;
}

/// Looks at every row of a log once: unit slips, and what another log could share with it.
class Inspection {
 public:
  Inspection(const std::string& path, int num_joints) : check_(path, num_joints) {}

  void add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
           const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::Ref<const Eigen::MatrixXd>& qdd,
           const Eigen::Ref<const Eigen::MatrixXd>& tau) {
    check_.add(time, q, qd, qdd, tau);
    fingerprint_->add(q, tau);
  }
  /// @throws DataError with the first unit slip
  void finish(const JointLimits& limits, LogSource& source, std::vector<std::string>& notes) {
    // A list of poses is no motion: its time stamps say nothing of units.
    const bool states = source.needs.min_samples == 1 && fingerprint_->rows() < kFewestOfAMotion;
    const std::vector<LogFinding> findings = states ? std::vector<LogFinding>() : check_.findings(limits);
    refuse_errors(findings);
    for (const LogFinding& finding : findings) notes.push_back(finding.message);
    fingerprint_->finish();
    source.unusable_rate = check_.unusable_rate();
    source.fingerprint = std::move(fingerprint_);
  }

 private:
  LogCheck check_;
  std::shared_ptr<LogFingerprint> fingerprint_{std::make_shared<LogFingerprint>()};
};

/// @throws DataError as a reader of files does
LogSource inspect(LogSource source, const JointLimits& limits, std::vector<std::string>& notes) {
  if (!source.memory && reads_once(source.path)) {
    source.memory = std::make_shared<Log>(read_log(source.path, source.needs, &notes));
  }
  Inspection inspection(source.path, source.needs.num_joints);
  if (source.memory) {
    const Log& log = *source.memory;
    inspection.add(log.time, log.q, log.qd, log.qdd, log.tau);
  } else {
    const std::vector<std::string> told =
        for_each_block(source.path, source.needs,
                       [&](const auto& time, const auto& q, const auto& qd, const auto& qdd,
                           const auto& tau) { inspection.add(time, q, qd, qdd, tau); });
    notes.insert(notes.end(), told.begin(), told.end());
  }
  inspection.finish(limits, source, notes);
  return source;
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
    const Log log = whole.memory ? *whole.memory : read_log(whole.path, whole.needs);
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
  return MotionStream(source.path, source.needs, wanted);
}

namespace {

/// How the file was understood was told when it was looked at.
Log again(const LogSource& source, std::vector<std::string>* notes) {
  LogFile file(source.path, source.needs);
  return rows_of(file, source.path, notes);
}

}  // namespace

Log read(const LogSource& source, std::vector<std::string>* notes) {
  Log log = source.memory ? *source.memory : again(source, notes);
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
