#include "sample_times.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "row_times.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Standard deviation of the part that positions follow, from which on they do not decide.
constexpr double kUndecided = 0.1;
/// Scatter worth a note when the positions do not decide, in periods.
constexpr double kWorthNoting = 0.05;
/// Stamps that wander further, in periods, are of rows that were written down whenever they came; that is slow, and samples go with it.
constexpr double kMostWander = 0.2;

}  // namespace

bool StampScatter::known() const { return std::isfinite(followed) && std < kUndecided; }

bool StampScatter::keeps_beat() const { return wander < kMostWander; }

std::string StampScatter::note(const std::string& path) const {
  const double percent = 100.0 * scatter;
  if (placed) {
    return fmt::format(
        "{}: time stamps scatter by {:.2g} % of a period about an even clock, and the positions follow {:.0f} % of it: "
        "samples are placed accordingly",
        path, percent, 100.0 * std::clamp(followed, 0.0, 1.0));
  }
  if (known() || !keeps_beat() || scatter <= kWorthNoting) return "";
  return fmt::format(
      "{}: time stamps scatter by {:.2g} % of a period about an even clock, and the motion does not show whether the "
      "samples do: the stamps are used as they are",
      path, percent);
}

SampleTimes sample_times(const Log& log) {
  SampleClock stamps;
  for (Index k = 0; k < log.time.size(); ++k) stamps.add(log.time[k]);
  std::vector<const double*> columns;
  for (Index j = 0; j < log.q.cols(); ++j) columns.push_back(log.q.col(j).data());
  const RowTimes times(
      stamps,
      [&](bool positions) {
        return std::make_unique<MemorySource>(log.time, positions ? columns : std::vector<const double*>());
      },
      log.q.cols());
  SampleTimes result{times.scatter(), log.time};
  times.place(0, result.time);
  return result;
}

}  // namespace heft::data
