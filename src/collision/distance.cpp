/// Distances between capsules and boxes in closed form.
#include <algorithm>
#include <array>

#include "heft/collision/collision.hpp"

namespace heft::collision {
namespace {

using Eigen::Vector3d;

/// Parameters in [0, 1] of the nearest points of the segments p + s u and r + t v: the minimum of a convex
/// quadratic in s and t over the unit square.
std::array<double, 2> nearest_parameters(const Vector3d& p, const Vector3d& u, const Vector3d& r,
                                         const Vector3d& v) {
  const Vector3d w = p - r;
  const double a = u.squaredNorm(), b = u.dot(v), c = v.squaredNorm(), d = u.dot(w), e = v.dot(w);
  const auto best_t = [&](double s) { return c > 0.0 ? std::clamp((e + s * b) / c, 0.0, 1.0) : 0.0; };
  const auto best_s = [&](double t) { return a > 0.0 ? std::clamp((t * b - d) / a, 0.0, 1.0) : 0.0; };
  const double determinant = a * c - b * b;
  // Parallel segments have a whole line of nearest points: any one of them.
  double s = determinant > 1e-12 * a * c ? std::clamp((b * e - c * d) / determinant, 0.0, 1.0) : 0.5;
  double t = best_t(s);
  // The clamped s is optimal for the clamped t after one turn each (the square is convex), two for parallel ones.
  s = best_s(t);
  t = best_t(s);
  s = best_s(t);
  return {s, t};
}

}  // namespace

Nearest distance(const Vector3d& first_a, const Vector3d& first_b, double first_radius,
                 const Vector3d& second_a, const Vector3d& second_b, double second_radius) {
  const Vector3d u = first_b - first_a, v = second_b - second_a;
  const auto [s, t] = nearest_parameters(first_a, u, second_a, v);
  Nearest result;
  result.on_first = first_a + s * u;
  result.on_second = second_a + t * v;
  result.distance = (result.on_first - result.on_second).norm() - first_radius - second_radius;
  return result;
}

Nearest distance(const LinkFrames& frames, const Capsule& first, const Capsule& second) {
  return distance(frames.at(first.link, first.a), frames.at(first.link, first.b), first.radius,
                  frames.at(second.link, second.a), frames.at(second.link, second.b), second.radius);
}

Nearest distance(const LinkFrames& frames, const Capsule& capsule, const BoxObstacle& box) {
  const Vector3d a = frames.at(capsule.link, capsule.a), d = frames.at(capsule.link, capsule.b) - a;
  const auto on_box = [&](double t) -> Vector3d {
    return (a + t * d).cwiseMax(box.lower).cwiseMin(box.upper);
  };
  // Half the derivative of the squared distance along the axis: piecewise linear, rising, with corners where the
  // axis crosses a plane of a face.
  const auto slope = [&](double t) { return d.dot(a + t * d - on_box(t)); };
  std::array<double, 8> corners{0.0, 1.0};
  std::size_t count = 2;
  for (int k = 0; k < 3; ++k) {
    if (d[k] == 0.0) continue;
    for (const double face : {box.lower[k], box.upper[k]}) {
      const double t = (face - a[k]) / d[k];
      if (t > 0.0 && t < 1.0) corners[count++] = t;
    }
  }
  std::sort(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(count));
  double nearest = slope(0.0) >= 0.0 ? 0.0 : 1.0;
  for (std::size_t k = 0; k + 1 < count; ++k) {
    const double low = slope(corners[k]), high = slope(corners[k + 1]);
    if (!(low < 0.0 && high >= 0.0)) continue;
    nearest = corners[k] + (corners[k + 1] - corners[k]) * (-low / (high - low));
    break;
  }
  Nearest result;
  result.on_first = a + nearest * d;
  result.on_second = on_box(nearest);
  result.distance = (result.on_first - result.on_second).norm() - capsule.radius;
  return result;
}

}  // namespace heft::collision
