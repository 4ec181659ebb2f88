/// @file
/// Where a function that was looked at in a few places is highest.
#pragma once

#include <iterator>
#include <map>

namespace heft::diagnose {

/// Values of a smooth function of one variable by where it was looked at. Every look costs a pass over all rows, so that a few
/// places at once and a parabola cost less than one after the other.
class Peak {
 public:
  void add(double x, double y) {
    seen_[x] = y;
    if (seen_.size() == 1 || y > seen_.at(best_)) best_ = x;
  }
  double best() const { return best_; }

  /// Vertex of the parabola through the best place and its neighbours, which lies between the middles of both intervals; at
  /// the end the best place itself.
  /// @pre one place was looked at
  double vertex() const {
    const auto at = seen_.find(best_);
    if (at == seen_.begin() || std::next(at) == seen_.end()) return best_;
    const auto [left, y_left] = *std::prev(at);
    const auto [right, y_right] = *std::next(at);
    const double a = (best_ - left) * (at->second - y_right), b = (best_ - right) * (at->second - y_left);
    // x - ((x - l) a - (x - r) b) / (2 (a - b)); the best of three equal ones is any.
    return a - b > 0.0 ? best_ - 0.5 * ((best_ - left) * a - (best_ - right) * b) / (a - b) : best_;
  }

 private:
  std::map<double, double> seen_;
  double best_{0.0};
};

}  // namespace heft::diagnose
