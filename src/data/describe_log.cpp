#include "heft/data/describe_log.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "row_source.hpp"
#include "signal_file.hpp"
#include "streaming_median.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Times the median period from which on a step in time is a gap.
constexpr double kGap = 10.0;
/// What a torque and a constant times the current may differ by: the last digits of a text.
constexpr double kSameRatio = 1e-5;
/// Rows that two logs have to share in a row, from the first on, before their torque counts as repeated.
constexpr long kFewestRepeated = 256;

/// Places of the columns of one group in a row, joint by joint; empty unless all are there.
using Places = std::vector<std::size_t>;

Places places_of(const SignalFile& file, std::string_view group, int num_joints) {
  Places places;
  for (int joint = 1; joint <= num_joints; ++joint) {
    const std::string name = fmt::format("{}{}", group, joint);
    const auto column = std::find_if(file.columns().begin(), file.columns().end(),
                                     [&](const LogColumn& c) { return c.name == name; });
    if (column == file.columns().end()) return {};
    places.push_back(static_cast<std::size_t>(column - file.columns().begin()));
  }
  return places;
}

int highest_joint(const SignalFile& file) {
  int most = 0;
  for (const LogColumn& column : file.columns()) most = std::max(most, joint_of(column.name));
  return most;
}

/// Looks for torque that was not measured: equal to the target, or made of the current.
class TorqueLook {
 public:
  TorqueLook(const SignalFile& file, int num_joints)
      : tau_(places_of(file, "tau", num_joints)),
        target_(places_of(file, "tauref", num_joints)),
        current_(places_of(file, "i", num_joints)),
        q_(places_of(file, "q", num_joints)),
        ratio_(tau_.size(), 0.0) {}

  void add(const std::vector<double>& row) {
    for (std::size_t j = 0; j < tau_.size(); ++j) {
      const double torque = row[tau_[j]];
      moves_ = moves_ || (rows_ > 0 && torque != last_);
      if (j == 0) last_ = torque;
      equals_target_ = equals_target_ && !target_.empty() && torque == row[target_[j]];
      if (!current_.empty() && made_of_current_) look_at_current(j, torque, row[current_[j]]);
    }
    hash(tau_, row, tau_hash_);
    hash(q_, row, q_hash_);
    if (++rows_ >= kFewestRepeated && std::has_single_bit(static_cast<std::uint64_t>(rows_)))
      marks_.push_back({rows_, tau_hash_, q_hash_});
  }
  void finish(LogDescription& description) {
    if (rows_ > 0) marks_.push_back({rows_, tau_hash_, q_hash_});
    if (tau_.empty()) return;
    description.torque = TorqueKind::kMeasured;
    const bool all_ratios =
        std::all_of(ratio_.begin(), ratio_.end(), [](double ratio) { return ratio != 0.0; });
    if (moves_ && !current_.empty() && made_of_current_ && all_ratios) {
      description.torque = TorqueKind::kCurrent;
      description.torque_constant = ratio_;
    }
    if (moves_ && equals_target_) description.torque = TorqueKind::kReference;
  }
  /// Whether the torque of another log begins as this one's, to the last bit, while the positions do not.
  bool repeats(const TorqueLook& other) const {
    if (!moves_ || tau_.empty() || other.tau_.empty()) return false;
    for (const Mark& mark : marks_) {
      for (const Mark& that : other.marks_) {
        if (mark.rows == that.rows && mark.rows >= kFewestRepeated && mark.tau == that.tau &&
            mark.q != that.q)
          return true;
      }
    }
    return false;
  }

 private:
  struct Mark {
    long rows;
    std::uint64_t tau, q;
  };
  static void hash(const Places& places, const std::vector<double>& row, std::uint64_t& hash) {
    for (const std::size_t c : places) {  // FNV-1a on words
      hash = (hash ^ std::bit_cast<std::uint64_t>(row[c])) * 0x100000001b3ULL;
      hash ^= hash >> 29;
    }
  }
  void look_at_current(std::size_t joint, double torque, double current) {
    double& ratio = ratio_[joint];
    if (ratio == 0.0 && current != 0.0) ratio = torque / current;
    made_of_current_ =
        std::abs(torque - ratio * current) <= kSameRatio * (std::abs(torque) + std::abs(current));
  }

  Places tau_, target_, current_, q_;
  std::vector<double> ratio_;
  bool equals_target_{true}, made_of_current_{true}, moves_{false};
  double last_{0.0};
  long rows_{0};
  std::uint64_t tau_hash_{0xcbf29ce484222325ULL}, q_hash_{0xcbf29ce484222325ULL};
  std::vector<Mark> marks_;
};

/// Rows handed to LogCheck block by block.
class SlipLook {
 public:
  SlipLook(const SignalFile& file, int num_joints)
      : check_(file.path(), num_joints), block_time_(kBlockRows), time_(file.time_column()) {
    for (const char* group : {"q", "qd", "qdd", "tau"}) {
      groups_.push_back(places_of(file, group, num_joints));
      blocks_.emplace_back(kBlockRows, static_cast<Index>(groups_.back().size()));
    }
    on_ = file.has_time() && !groups_[0].empty();
  }
  void add(const std::vector<double>& row) {
    if (!on_) return;
    block_time_[used_] = row[time_];
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      for (std::size_t j = 0; j < groups_[g].size(); ++j)
        blocks_[g](used_, static_cast<Index>(j)) = row[groups_[g][j]];
    }
    if (++used_ == kBlockRows) hand_over();
  }
  /// Whatever was found of rows whose time does not increase means nothing.
  std::vector<LogFinding> finish() {
    hand_over();
    return on_ ? check_.findings() : std::vector<LogFinding>();
  }
  void stop() { on_ = false; }

 private:
  void hand_over() {
    if (on_ && used_ > 0) {
      check_.add(block_time_.head(used_), blocks_[0].topRows(used_), blocks_[1].topRows(used_),
                 blocks_[2].topRows(used_), blocks_[3].topRows(used_));
    }
    used_ = 0;
  }

  LogCheck check_;
  Eigen::VectorXd block_time_;
  std::size_t time_;
  std::vector<Places> groups_;
  std::vector<Eigen::MatrixXd> blocks_;
  Index used_{0};
  bool on_{false};
};

/// Median of the periods between rows. Very long logs are read again for it.
double median_period(const std::string& path, const ReadAs& as) {
  StreamingMedian median;
  do {
    SignalFile file(path, as);
    double last = 0.0;
    while (file.next()) {
      if (file.rows() > 1 && file.time() > last) median.add(file.time() - last);
      last = file.time();
    }
  } while (!median.finish_pass());
  return median.value();
}

std::vector<Question> questions_of(const SignalFile& file, int n) {
  const auto has = [&](const char* group) { return n > 0 && !places_of(file, group, n).empty(); };
  const std::string base = !file.has_time() ? "time" : !has("q") ? "positions q1.." : "";
  const bool torque = has("tau") || has("i");
  const auto with = [&](bool there, const char* what) {
    return there ? base : base + (base.empty() ? "" : ", ") + what;
  };
  return {
      {"dynamics, retime, simulate --replay", base},
      {"identify, diagnose, validate, payload, monitor",
       with(torque, "torque tau1.., or currents i1.. with --torque-constant")},
      {"identify --instruments reference",
       with(torque && has("qref"), torque ? "references qref1.." : "torque tau1.., references qref1..")},
      {"torque-constants", with(has("tauref") && (has("iref") || has("i")),
                                "target torque tauref1.., target or measured current iref1.. or i1..")},
      {"stiffness",
       with(has("tau") && has("qlink"),
            "torque tau1.. and positions behind the gear qlink1.. (motor side alone: --validate)")},
  };
}

struct Described {
  LogDescription description;
  std::optional<TorqueLook> torque;
};

void look_at_time(const SignalFile& file, double& last, LogDescription& d) {
  const double time = file.time();
  if (file.rows() == 1) {
    d.begin = time;
  } else if (!(time > last)) {
    ++d.backwards;
  } else if (time - last > d.longest_period) {
    d.longest_period = time - last;
    d.longest_from = last;
  }
  last = d.end = time;
}

Described describe(const std::string& path, const ReadAs& as) {
  SignalFile file(path, as);
  Described result;
  LogDescription& d = result.description;
  d.path = path;
  d.num_joints = highest_joint(file);
  for (std::size_t c = 0; c < file.columns().size(); ++c) {
    const LogColumn& column = file.columns()[c];
    d.columns.push_back({column.name, column.origin, column.factor, column.shift, file.is_known(c)});
  }
  TorqueLook torque(file, d.num_joints);
  std::optional<SlipLook> slips;
  if (d.num_joints > 0) slips.emplace(file, d.num_joints);
  double last = 0.0;
  while (file.next()) {
    const std::vector<double>& row = file.values();
    for (std::size_t c = 0; c < row.size(); ++c) {
      d.columns[c].least = std::min(d.columns[c].least, row[c]);
      d.columns[c].most = std::max(d.columns[c].most, row[c]);
    }
    if (file.has_time()) look_at_time(file, last, d);
    if (d.backwards > 0 && slips) slips->stop();
    if (slips) slips->add(row);
    torque.add(row);
  }
  d.rows = file.rows();
  d.format = file.reader().format();
  d.understood = understood(file.columns());
  d.notes = file.notes();
  for (std::size_t c = 0; c < d.columns.size(); ++c) d.columns[c].numbers = !file.is_dropped(c);
  if (slips) d.findings = slips->finish();
  torque.finish(d);
  d.questions = questions_of(file, d.num_joints);
  if (file.has_time() && d.rows > 1) d.period = median_period(path, as);
  result.torque = std::move(torque);
  return result;
}

/// Gaps are known once the median is.
long gaps_of(const LogDescription& d, const ReadAs& as) {
  if (!(d.longest_period > kGap * d.period)) return 0;
  SignalFile file(d.path, as);
  long gaps = 0;
  double last = 0.0;
  while (file.next()) {
    if (file.rows() > 1 && file.time() - last > kGap * d.period) ++gaps;
    last = file.time();
  }
  return gaps;
}

}  // namespace

bool LogDescription::usable() const {
  const bool asked = !questions.empty() && questions.front().missing.empty();
  const bool wrong = std::any_of(findings.begin(), findings.end(), [](const LogFinding& finding) {
    return finding.severity == Severity::kError;
  });
  const bool text = std::any_of(columns.begin(), columns.end(),
                                [](const DescribedColumn& c) { return c.known && !c.numbers; });
  return asked && rows > 1 && backwards == 0 && !wrong && !text;
}

std::vector<LogDescription> describe_logs(const std::vector<std::string>& paths, const ReadAs& as) {
  std::vector<Described> all;
  for (const std::string& path : paths) {
    all.push_back(describe(path, as));
    all.back().description.gaps = gaps_of(all.back().description, as);
  }
  std::vector<LogDescription> descriptions;
  for (std::size_t k = 0; k < all.size(); ++k) {
    LogDescription d = all[k].description;
    for (std::size_t other = 0; other < all.size() && d.torque != TorqueKind::kReference; ++other) {
      if (other == k || !all[k].torque->repeats(*all[other].torque)) continue;
      d.torque = TorqueKind::kRepeated;
      d.repeated_in = paths[other];
      break;
    }
    descriptions.push_back(std::move(d));
  }
  return descriptions;
}

}  // namespace heft::data
