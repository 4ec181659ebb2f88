#include "sweep.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace heft::retime {
namespace {

using Eigen::Index;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Coefficients below this, of lines scaled to a bound near 1, are rounding [1/ṡ²].
constexpr double kZero = 1e-13;

constexpr int kMostSteps = 100;

/// Tightens `range` by a·x ≤ b.
void bound(double a, double b, Range& range) {
  if (a > kZero) {
    range.high = std::min(range.high, b / a);
  } else if (a < -kZero) {
    range.low = std::max(range.low, b / a);
  } else if (b < -1e-12) {
    range = {1.0, 0.0};
  }
}

/// The lines that leave s̈ the least room at one ṡ²: the lowest that bounds it from above, the highest that bounds it from below.
struct Room {
  const Line* above{nullptr};
  const Line* below{nullptr};
  bool enough{true};  ///< not below 0 but by rounding

  /// Without s̈, both together: a·ṡ² ≤ b.
  double a() const { return above->x * -below->u + below->x * above->u; }
  double b() const { return above->bound * -below->u + below->bound * above->u; }
};

Room room_at(const std::vector<Line>& lines, double x) {
  double highest = kInfinite, lowest = -kInfinite;
  Room room;
  for (const Line& line : lines) {
    const double u = (line.bound - line.x * x) / line.u;
    if (line.u > kZero && u < highest) highest = u, room.above = &line;
    if (line.u < -kZero && u > lowest) lowest = u, room.below = &line;
  }
  room.enough = !(lowest - highest > 1e-12 * (std::abs(lowest) + std::abs(highest)));
  return room;
}

/// ṡ² at the end of an interval of length d within [low, high].
void add_end(std::vector<Line>& lines, double d, const Range& end) {
  lines.push_back({2.0 * d, 1.0, end.high});
  if (end.low > 0.0) lines.push_back({-2.0 * d, -1.0, -end.low});
  // ṡ² is never negative.
  else lines.push_back({-2.0 * d, -1.0, 0.0});
}

}  // namespace

Range speeds(const std::vector<Line>& lines, double most) {
  Range range{0.0, most};
  for (const Line& line : lines) {
    if (std::abs(line.u) <= kZero) bound(line.x, line.bound, range);
  }
  // The room for s̈ is concave in ṡ², so that the zero of its last straight piece comes nearer until it is reached.
  for (int step = 0; step < kMostSteps && !range.empty(); ++step) {
    const Room room = room_at(lines, range.high);
    if (room.enough) break;
    const double before = range.high;
    if (!(room.a() > 0.0)) return {1.0, 0.0};
    range.high = room.b() / room.a();
    if (!(range.high < before)) break;
  }
  for (int step = 0; step < kMostSteps && !range.empty(); ++step) {
    const Room room = room_at(lines, range.low);
    if (room.enough) break;
    const double before = range.low;
    if (!(room.a() < 0.0)) return {1.0, 0.0};
    range.low = room.b() / room.a();
    if (!(range.low > before)) break;
  }
  return range;
}

Range accelerations(const std::vector<Line>& lines, double x) {
  Range range{-kInfinite, kInfinite};
  for (const Line& line : lines) {
    if (std::abs(line.u) > kZero) bound(line.u, line.bound - line.x * x, range);
  }
  return range;
}

Sweep sweep(const Intervals& path) {
  const Index count = path.s.size() - 1;
  Sweep result{Eigen::VectorXd::Zero(count + 1), Eigen::VectorXd::Zero(count),
               Eigen::VectorXd::Zero(count + 1)};
  Eigen::VectorXd lowest = Eigen::VectorXd::Zero(count + 1);
  std::vector<Line> lines;
  for (Index i = count - 1; i >= 0; --i) {
    lines = path.lines[static_cast<std::size_t>(i)];
    add_end(lines, path.s[i + 1] - path.s[i], {lowest[i + 1], result.highest[i + 1]});
    const Range range = speeds(lines, path.most[i]);
    const bool at_rest = i == 0;
    if (range.empty() || (at_rest && range.low > 1e-12)) {
      result.stopped = i;
      return result;
    }
    lowest[i] = range.low;
    result.highest[i] = range.high;
  }
  for (Index i = 0; i < count; ++i) {
    const double d = path.s[i + 1] - path.s[i];
    const std::vector<Line>& own = path.lines[static_cast<std::size_t>(i)];
    const double largest = accelerations(own, result.x[i]).high;
    const double end = std::clamp(result.x[i] + 2.0 * d * largest, lowest[i + 1], result.highest[i + 1]);
    result.x[i + 1] = end;
    result.u[i] = (end - result.x[i]) / (2.0 * d);
    const double rates = std::sqrt(result.x[i]) + std::sqrt(end);
    if (!(rates > 0.0)) {
      result.stopped = i;
      return result;
    }
    result.duration += 2.0 * d / rates;
  }
  return result;
}

}  // namespace heft::retime
