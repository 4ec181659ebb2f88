#include "level_outline.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>

namespace heft::page {
namespace {

/// The grid with a margin of points that are below the level and lie on its border: every outline closes.
class Margined {
 public:
  Margined(const std::vector<double>& x, const std::vector<double>& y, const Eigen::MatrixXd& values,
           double level)
      : x_(x), y_(y), values_(values), level_(level) {}

  int columns() const { return static_cast<int>(x_.size()) + 2; }
  int rows() const { return static_cast<int>(y_.size()) + 2; }
  /// Above the level by this much; below zero in the margin.
  double excess(int i, int j) const {
    if (i == 0 || j == 0 || i == columns() - 1 || j == rows() - 1) return -1.0;
    const double value = values_(i - 1, j - 1);
    return std::isfinite(value) ? value - level_ : -std::numeric_limits<double>::max();
  }
  std::array<double, 2> place(int i, int j) const {
    const auto clamped = [](int k, std::size_t size) {
      return static_cast<std::size_t>(std::clamp(k - 1, 0, static_cast<int>(size) - 1));
    };
    return {x_[clamped(i, x_.size())], y_[clamped(j, y_.size())]};
  }

 private:
  const std::vector<double>& x_;
  const std::vector<double>& y_;
  const Eigen::MatrixXd& values_;
  double level_;
};

/// An edge of the grid: its lower left end, and whether it goes up.
struct Edge {
  int i, j;
  bool up;
  auto operator<=>(const Edge&) const = default;
};

std::array<double, 2> crossing(const Margined& grid, const Edge& e) {
  const double a = grid.excess(e.i, e.j), b = grid.excess(e.i + (e.up ? 0 : 1), e.j + (e.up ? 1 : 0));
  const auto p = grid.place(e.i, e.j), q = grid.place(e.i + (e.up ? 0 : 1), e.j + (e.up ? 1 : 0));
  const double part = std::clamp(a / (a - b), 0.0, 1.0);
  return {p[0] + part * (q[0] - p[0]), p[1] + part * (q[1] - p[1])};
}

}  // namespace

std::vector<Outline> level_outlines(const std::vector<double>& x, const std::vector<double>& y,
                                    const Eigen::MatrixXd& values, double level) {
  const Margined grid(x, y, values, level);
  // Marching squares. Round a cell against the clock the region is left at some edges and entered at others; the
  // outline goes from a leaving to an entering one.
  std::map<Edge, Edge> next;
  for (int i = 0; i + 1 < grid.columns(); ++i) {
    for (int j = 0; j + 1 < grid.rows(); ++j) {
      const std::array<double, 4> corner{grid.excess(i, j), grid.excess(i + 1, j), grid.excess(i + 1, j + 1),
                                         grid.excess(i, j + 1)};
      const std::array<Edge, 4> edge{Edge{i, j, false}, Edge{i + 1, j, true}, Edge{i, j + 1, false},
                                     Edge{i, j, true}};
      // At a saddle the mean decides whether the two high corners are joined.
      const bool joined = corner[0] / 4 + corner[1] / 4 + corner[2] / 4 + corner[3] / 4 >= 0.0;
      for (std::size_t k = 0; k < 4; ++k) {
        const bool leaves = corner[k] >= 0.0 && corner[(k + 1) % 4] < 0.0;
        if (!leaves) continue;
        for (std::size_t step = 1; step < 4; ++step) {
          const std::size_t m = (k + (joined ? step : 4 - step)) % 4;
          if (corner[m] < 0.0 && corner[(m + 1) % 4] >= 0.0) {
            next.emplace(edge[k], edge[m]);
            break;
          }
        }
      }
    }
  }
  std::vector<Outline> outlines;
  while (!next.empty()) {
    Outline outline;
    const Edge first = next.begin()->first;
    for (Edge at = first;;) {
      const auto found = next.find(at);
      if (found == next.end()) break;
      outline.push_back(crossing(grid, at));
      at = found->second;
      next.erase(found);
    }
    if (outline.size() > 2) outlines.push_back(std::move(outline));
  }
  return outlines;
}

}  // namespace heft::page
