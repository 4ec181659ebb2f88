#include "kept_log.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numeric>
#include <string_view>

#include <fmt/format.h>
#include <sys/stat.h>

#include "heft/host/error.hpp"

namespace heft::data {

using Eigen::Index;

void LogFacts::add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
                   const Eigen::Ref<const Eigen::MatrixXd>& tau, const Eigen::Ref<const Eigen::MatrixXd>& qd,
                   const Eigen::Ref<const Eigen::MatrixXd>& qdd) {
  for (Index k = 0; k < time.size(); ++k) clock.add(time[k]);
  ranges.add(q, tau);
  check.add(time, q, qd, qdd, tau);
  if (qd.cols() == q.cols()) noise.add(q, qd);
  for (std::size_t joint = 0; joint < spans.size(); ++joint) {
    for (Index k = 0; k < time.size(); ++k)
      spans[joint].add(time[k], std::abs(qd(k, static_cast<Index>(joint))));
  }
}

KeptLog::KeptLog(const std::string& path, const LogRequirements& needs, bool compared)
    : path_(path), needs_(needs), mark_(mark_of(path)), file_(std::make_unique<LogFile>(path, needs)) {
  choose_columns();
  read_rows(compared);
  file_->check_length();
  file_->close();
  place_samples();
}

KeptLog::Mark KeptLog::mark_of(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return {};
  return {true,
          static_cast<std::uint64_t>(status.st_dev),
          static_cast<std::uint64_t>(status.st_ino),
          static_cast<std::uint64_t>(status.st_size),
          status.st_mtim.tv_sec,
          status.st_mtim.tv_nsec};
}

/// Positions, torques, velocities and accelerations, then what else questions ask for.
void KeptLog::choose_columns() {
  const int n = file_->num_joints();
  const auto add = [&](std::string_view prefix, bool there, bool current = false) {
    if (!there) return Index{0};
    for (int joint = 1; joint <= n; ++joint) {
      columns_.push_back({file_->find_column(fmt::format("{}{}", prefix, joint)),
                          current ? file_->torque_constant(joint - 1) : 1.0});
    }
    return Index{n};
  };
  const bool current = file_->torque_from_current();
  joints_ = add("q", true);
  torques_ = add(current ? "i" : "tau", current || file_->has_channel(&Log::tau), current);
  rates_ = add("qd", file_->has_channel(&Log::qd));
  accelerations_ = add("qdd", file_->has_channel(&Log::qdd));
  static constexpr std::array<std::string_view, 8> kOthers{"i",    "qref", "qdref",  "temp",
                                                           "tauref", "iref", "qlink", "taulink"};
  for (const std::string_view prefix : kOthers) {
    for (int joint = 1; joint <= n; ++joint) {
      const FileColumn column{file_->find_column(fmt::format("{}{}", prefix, joint)), 1.0};
      if (column.column < file_->num_columns() &&
          std::find(columns_.begin(), columns_.end(), column) == columns_.end())
        columns_.push_back(column);
    }
  }
}

void KeptLog::read_rows(bool compared) {
  facts_.emplace(path_, joints_, torques_, rates_ == joints_ && accelerations_ == joints_);
  rows_.emplace(columns_.size());
  Eigen::VectorXd time(kBlockRows);
  Eigen::MatrixXd values(kBlockRows, static_cast<Index>(columns_.size()));
  Index filled = 0;
  // Facts are sums over blocks of this size, in whatever parts the rows come.
  const auto hand_over = [&] {
    const auto group = [&](Index first, Index columns) { return values.block(0, first, filled, columns); };
    const auto q = group(0, joints_), tau = group(joints_, torques_);
    facts_->add(time.head(filled), q, tau, group(joints_ + torques_, rates_),
                group(joints_ + torques_ + rates_, accelerations_));
    if (compared) facts_->fingerprint.add(q, tau);
    rows_->add(time.head(filled), values.topRows(filled));
    filled = 0;
  };
  file_->for_each_rows(columns_, [&](const FileRows& rows) {
    for (Index used = 0; used < rows.time.size();) {
      const Index count = std::min(rows.time.size() - used, kBlockRows - filled);
      time.segment(filled, count) = rows.time.segment(used, count);
      values.middleRows(filled, count) = rows.values.middleRows(used, count);
      filled += count;
      used += count;
      if (filled == kBlockRows) hand_over();
    }
  });
  if (filled > 0) hand_over();
}

/// Stamps are used as they are where there is no room for times beside them, nor for the rows.
void KeptLog::place_samples() {
  if (!rows_->is_usable()) return;
  std::vector<int> positions(static_cast<std::size_t>(joints_));
  std::iota(positions.begin(), positions.end(), 0);
  times_.emplace(
      facts_->clock,
      [&](bool with_positions) {
        return std::make_unique<StoreSource>(*rows_, with_positions ? positions : std::vector<int>());
      },
      joints_);
  if (times_->scatter().placed) facts_->clock = times_->clock();
}

std::string KeptLog::note_on_times() const {
  if (times_ && times_->has_room()) return times_->scatter().note(path_);
  if (facts_->clock.is_even()) return "";
  return fmt::format(
      "{}: no space to find out when its samples were taken: the time stamps are used as they are; let TMPDIR name a "
      "folder with more space",
      path_);
}

void KeptLog::place(Log& log) const {
  if (times_) times_->place(0, log.time);
}

std::unique_ptr<RowSource> KeptLog::placed(std::unique_ptr<RowSource> source) const {
  if (!times_ || !times_->scatter().placed) return source;
  return std::make_unique<PlacedSource>(std::move(source), *times_);
}

std::unique_ptr<RowSource> KeptLog::source(const std::vector<FileColumn>& columns) const {
  std::error_code ignored;
  if (!rows_->is_usable() && std::filesystem::exists(path_, ignored) && std::filesystem::is_other(path_, ignored)) {
    throw DataError(fmt::format(
        "{}: no space for a copy of its rows, and it can be read once only; store it as a file, or let TMPDIR name a "
        "folder with more space",
        path_));
  }
  if (!rows_->is_usable() || mark_of(path_) != mark_) return nullptr;
  std::vector<int> places;
  for (const FileColumn& column : columns) {
    const auto place = std::find(columns_.begin(), columns_.end(), column);
    if (place == columns_.end()) return nullptr;
    places.push_back(static_cast<int>(place - columns_.begin()));
  }
  return placed(std::make_unique<StoreSource>(*rows_, std::move(places)));
}

}  // namespace heft::data
