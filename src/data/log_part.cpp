#include "heft/data/log_part.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace heft::data {

Log part_of(const Log& log, double from, double to) {
  const double* const begin = log.time.data();
  const double* const end = begin + log.time.size();
  const Eigen::Index first = std::lower_bound(begin, end, from) - begin;
  const Eigen::Index count = std::max<Eigen::Index>(0, std::lower_bound(begin, end, to) - begin - first);
  Log part;
  part.time = log.time.segment(first, count);
  // The stretch that is there, which may be shorter than the one asked for.
  part.path = count > 0 ? fmt::format("{} [{:.1f} s, {:.1f} s]", log.path, part.time[0], part.time[count - 1])
                        : fmt::format("{} [no samples]", log.path);
  for (const auto channel :
       {&Log::q, &Log::qd, &Log::qdd, &Log::tau, &Log::current, &Log::qref, &Log::qdref, &Log::temperature}) {
    if ((log.*channel).cols() > 0) part.*channel = (log.*channel).middleRows(first, count);
  }
  for (const auto& [name, values] : log.extra) part.extra.emplace_back(name, values.segment(first, count));
  return part;
}

}  // namespace heft::data
