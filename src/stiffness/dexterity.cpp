#include "heft/stiffness/dexterity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
/// 1 / k_F below this is zero: J is singular to double precision.
constexpr double kSingular = 1e-13;

/// Where a joint may be.
struct Range {
  double lower, upper;
  bool turns;  ///< revolute
};

std::vector<Range> ranges_of(const model::Robot& robot, bool keep_limits) {
  std::vector<Range> ranges;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const model::RobotJoint& joint = robot.joints[j];
    const bool turns = joint.joint.type == JointType::kRevolute;
    const bool limited = std::isfinite(joint.lower) && std::isfinite(joint.upper);
    if (!turns && !limited) {
      throw InputError(
          fmt::format("joint {} (\"{}\") of robot \"{}\" is prismatic and has no finite position limits; "
                      "poses cannot be sought "
                      "without them",
                      j + 1, joint.name, robot.name));
    }
    if (turns && !(keep_limits && limited)) {
      ranges.push_back({-0.5 * kTurn, 0.5 * kTurn, true});
    } else {
      ranges.push_back({joint.lower, joint.upper, turns});
    }
  }
  return ranges;
}

VectorXd random_pose(const std::vector<Range>& ranges, std::mt19937_64& random) {
  VectorXd q(static_cast<Index>(ranges.size()));
  for (Index j = 0; j < q.size(); ++j) {
    const Range& range = ranges[static_cast<std::size_t>(j)];
    q[j] = std::uniform_real_distribution<double>(range.lower, range.upper)(random);
  }
  return q;
}

/// The joint position that makes a + b cos q + c sin q, known at three places, largest inside the range.
double best_turn(const Range& range, double q, double at_q, double at_third, double at_two_thirds) {
  // Three samples a third of a turn apart: b = (2 f0 - f1 - f2)/3, c = (f1 - f2)/√3, about q.
  const double b = (2.0 * at_q - at_third - at_two_thirds) / 3.0;
  const double c = (at_third - at_two_thirds) / std::numbers::sqrt3;
  const double size = std::hypot(b, c);
  if (!(size > 1e-15 * std::abs(at_q))) return q;
  const auto value = [&](double at) { return b * std::cos(at - q) + c * std::sin(at - q); };
  double best = q, most = value(q);
  // The crest nearest to the middle of the range, and one turn to either side.
  const double crest = q + std::atan2(c, b);
  const double middle = 0.5 * (range.lower + range.upper);
  const double nearest = crest + kTurn * std::round((middle - crest) / kTurn);
  for (const double at : {nearest, nearest - kTurn, nearest + kTurn, range.lower, range.upper}) {
    if (at < range.lower || at > range.upper) continue;
    if (value(at) > most) most = value(at), best = at;
  }
  return best;
}

/// Least value of a function of the pose by Hooke's and Jeeves' pattern search: steps along the joints, then
/// along what they gave together.
template <typename Function>
PoseValue pattern_search(const Function& f, const std::vector<Range>& ranges, VectorXd q) {
  const Index n = q.size();
  const auto inside = [&](VectorXd at) {
    for (Index j = 0; j < n; ++j) {
      const Range& range = ranges[static_cast<std::size_t>(j)];
      at[j] = std::clamp(at[j], range.lower, range.upper);
    }
    return at;
  };
  const auto explored = [&](VectorXd at, double& value, double step) {
    for (Index j = 0; j < n; ++j) {
      for (const double direction : {step, -step}) {
        VectorXd tried = at;
        tried[j] += direction;
        tried = inside(tried);
        const double there = f(tried);
        if (there < value) {
          value = there;
          at = tried;
          break;
        }
      }
    }
    return at;
  };
  double value = f(q);
  for (double step = 0.5; step > 1e-7; step *= 0.5) {
    for (int k = 0; k < 200; ++k) {
      const double before = value;
      const VectorXd moved = explored(q, value, step);
      if (!(value < before * (1.0 - 1e-14))) break;
      const VectorXd ahead = inside(2.0 * moved - q);
      q = moved;
      double there = f(ahead);
      const VectorXd further = explored(ahead, there, step);
      if (there < value) value = there, q = further;
    }
  }
  return {value, q};
}

/// √(tr(MᵀM) tr((MᵀM)⁻¹)) / m from singular values.
double condition_of(const VectorXd& s) {
  const auto m = static_cast<double>(s.size());
  if (!(s[s.size() - 1] > kSingular * s[0])) return std::numeric_limits<double>::infinity();
  return std::sqrt(s.squaredNorm() * s.cwiseInverse().squaredNorm()) / m;
}

}  // namespace

MatrixXd normalised_jacobian(const MatrixXd& J, double L) {
  MatrixXd N = J;
  N.topRows(3) /= L;
  return N;
}

double frobenius_condition(const MatrixXd& M) {
  if (M.size() == 0) return std::numeric_limits<double>::infinity();
  const MatrixXd tall = M.rows() >= M.cols() ? M : MatrixXd(M.transpose());
  return condition_of(singular_values(triangle_of(tall)));
}

double dexterity(const MatrixXd& J, double L) { return 1.0 / frobenius_condition(normalised_jacobian(J, L)); }

double reach_ratio_length(double stated_reach, double maximum_reach) { return stated_reach / maximum_reach; }

double rms_axis_distance(const MatrixXd& J) {
  // |z × (p_e - p_i)| is the distance of the axis from the tip.
  double sum = 0.0;
  int count = 0;
  for (Index j = 0; j < J.cols(); ++j) {
    if (J.col(j).tail(3).isZero(0.0)) continue;
    sum += J.col(j).head(3).squaredNorm();
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(sum / count);
}

double least_condition_length(const MatrixXd& J) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double a = J.topRows(3).squaredNorm(), b = J.bottomRows(3).squaredNorm();
  if (!(a > 0.0) || !(b > 0.0)) return nan;
  // Where translation and rotation weigh the same, the search begins.
  const double middle = std::sqrt(a / b);
  if (J.cols() >= 6) {
    // (J Jᵀ)⁻¹ has the diagonal of R⁻¹R⁻ᵀ with Jᵀ = Q R, scaled first for its accuracy.
    const MatrixXd N = normalised_jacobian(J, middle);
    if (!std::isfinite(frobenius_condition(N))) return nan;
    const MatrixXd inverse = least_squares(triangle_of(N.transpose()), MatrixXd::Identity(6, 6));
    const double c = inverse.topRows(3).squaredNorm(), d = inverse.bottomRows(3).squaredNorm();
    // k_F² m² = (a/L² + b)(c L² + d), here with L over `middle` and a = b.
    return middle * std::pow(d / c, 0.25);
  }
  const auto condition = [&](double logarithm) {
    return frobenius_condition(normalised_jacobian(J, middle * std::exp(logarithm)));
  };
  if (!std::isfinite(condition(0.0))) return nan;
  // Golden section over a factor of a thousand to either side.
  double low = -7.0, high = 7.0;
  constexpr double kGolden = 0.6180339887498949;
  double x1 = high - kGolden * (high - low), x2 = low + kGolden * (high - low);
  double f1 = condition(x1), f2 = condition(x2);
  while (high - low > 1e-9) {
    if (f1 < f2) {
      high = x2, x2 = x1, f2 = f1;
      x1 = high - kGolden * (high - low), f1 = condition(x1);
    } else {
      low = x1, x1 = x2, f1 = f2;
      x2 = low + kGolden * (high - low), f2 = condition(x2);
    }
  }
  return middle * std::exp(0.5 * (low + high));
}

PoseValue maximum_reach(const model::Kinematics& kinematics, const Eigen::Vector3d& from,
                        const PoseSearch& search) {
  const std::vector<Range> ranges = ranges_of(kinematics.robot(), search.keep_limits);
  const auto squared = [&](const VectorXd& q) { return (kinematics.tip(q).position - from).squaredNorm(); };
  std::mt19937_64 random(search.seed);
  PoseValue best{-1.0, {}};
  for (int start = 0; start < search.starts; ++start) {
    VectorXd q = random_pose(ranges, random);
    double value = squared(q);
    // Along one joint the squared distance is a + b cos q + c sin q, or a parabola: each step finds its very
    // maximum.
    for (int sweep = 0; sweep < 10000; ++sweep) {
      const double before = value;
      for (Index j = 0; j < q.size(); ++j) {
        const Range& range = ranges[static_cast<std::size_t>(j)];
        const auto at = [&](double position) {
          VectorXd tried = q;
          tried[j] = position;
          return squared(tried);
        };
        double position = q[j];
        if (range.turns) {
          position = best_turn(range, q[j], value, at(q[j] + kTurn / 3.0), at(q[j] + 2.0 * kTurn / 3.0));
        } else {
          position = at(range.lower) > at(range.upper) ? range.lower : range.upper;
        }
        const double there = at(position);
        if (there > value) value = there, q[j] = position;
      }
      if (!(value > before * (1.0 + 1e-15))) break;
    }
    if (value > best.value) best = {value, q};
  }
  best.value = std::sqrt(best.value);
  return best;
}

PoseValue maximum_reach(const model::Kinematics& kinematics, const PoseSearch& search) {
  return maximum_reach(kinematics, Eigen::Vector3d::Zero(), search);
}

CharacteristicLength characteristic_length(const model::Kinematics& kinematics, const PoseSearch& search) {
  const std::vector<Range> ranges = ranges_of(kinematics.robot(), search.keep_limits);
  const auto condition = [&](const VectorXd& q) {
    const MatrixXd J = kinematics.jacobian(q);
    const double length = least_condition_length(J);
    return std::isfinite(length) ? frobenius_condition(normalised_jacobian(J, length))
                                 : std::numeric_limits<double>::infinity();
  };
  std::mt19937_64 random(search.seed);
  CharacteristicLength best{
      std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), {}};
  for (int start = 0; start < search.starts; ++start) {
    const PoseValue found = pattern_search(condition, ranges, random_pose(ranges, random));
    if (found.value < best.condition) {
      best = {least_condition_length(kinematics.jacobian(found.q)), found.value, found.q};
    }
  }
  return best;
}

DexterityMap dexterity_map(const model::Kinematics& kinematics, const VectorXd& q, const MapAxis& first,
                           const MapAxis& second, double length) {
  const int n = kinematics.num_joints();
  if (q.size() != n) {
    throw InputError(fmt::format("robot \"{}\" has {} joints; the pose of the map has {} positions",
                                 kinematics.robot().name, n, q.size()));
  }
  for (const MapAxis* side : {&first, &second}) {
    if (side->joint < 0 || side->joint >= n) {
      throw InputError(fmt::format("map over joint {}: robot \"{}\" has joints 1 to {}", side->joint + 1,
                                   kinematics.robot().name, n));
    }
    if (!(side->to > side->from) || side->steps < 2) {
      throw InputError(
          fmt::format("map over joint {}: from {} to {} in {} steps is no range; give an end above the "
                      "beginning and at least 2 steps",
                      side->joint + 1, side->from, side->to, side->steps));
    }
  }
  if (first.joint == second.joint) {
    throw InputError(fmt::format("map over joint {} twice; give two different joints", first.joint + 1));
  }
  if (!(length > 0.0))
    throw InputError(fmt::format("normalising length is {}; it has to be above zero", length));
  DexterityMap map{first, second, q, length, false, false, {}, {}, {}};
  const auto values = [&](const MapAxis& side, bool& wraps) -> VectorXd {
    const bool turns =
        kinematics.robot().joints[static_cast<std::size_t>(side.joint)].joint.type == JointType::kRevolute;
    wraps = turns && std::abs(side.to - side.from - kTurn) < 1e-6;
    const double step = (side.to - side.from) / (wraps ? side.steps : side.steps - 1);
    return VectorXd::NullaryExpr(side.steps,
                                 [&](Index k) { return side.from + static_cast<double>(k) * step; });
  };
  map.first_values = values(first, map.first_wraps);
  map.second_values = values(second, map.second_wraps);
  map.dexterity.resize(first.steps, second.steps);
  VectorXd at = q;
  for (Index i = 0; i < first.steps; ++i) {
    at[first.joint] = map.first_values[i];
    for (Index k = 0; k < second.steps; ++k) {
      at[second.joint] = map.second_values[k];
      map.dexterity(i, k) = stiffness::dexterity(kinematics.jacobian(at), length);
    }
  }
  return map;
}

namespace {

/// Ends of the shortest stretch that holds all marked values; beyond the last value where it wraps around.
std::pair<double, double> extent(const std::vector<bool>& marked, const VectorXd& values, bool wraps) {
  const auto count = static_cast<Index>(marked.size());
  std::vector<Index> at;
  for (Index k = 0; k < count; ++k) {
    if (marked[static_cast<std::size_t>(k)]) at.push_back(k);
  }
  if (!wraps) return {values[at.front()], values[at.back()]};
  // The widest gap between neighbours on the circle is what the stretch leaves out.
  std::size_t begin = 0;
  Index widest = at.front() + count - at.back();
  for (std::size_t k = 1; k < at.size(); ++k) {
    if (at[k] - at[k - 1] > widest) widest = at[k] - at[k - 1], begin = k;
  }
  const double low = values[at[begin]];
  const double high = begin == 0 ? values[at.back()] : values[at[begin - 1]] + kTurn;
  return {low, high};
}

}  // namespace

std::vector<DexterityZone> zones(const DexterityMap& map, double threshold) {
  const Index rows = map.dexterity.rows(), cols = map.dexterity.cols();
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> open = (map.dexterity.array() >= threshold).matrix();
  std::vector<DexterityZone> found;
  for (Index i = 0; i < rows; ++i) {
    for (Index k = 0; k < cols; ++k) {
      if (!open(i, k)) continue;
      DexterityZone zone;
      std::vector<bool> first(static_cast<std::size_t>(rows)), second(static_cast<std::size_t>(cols));
      std::pair<Index, Index> best{i, k};
      std::vector<std::pair<Index, Index>> todo{{i, k}};
      open(i, k) = false;
      while (!todo.empty()) {
        const auto [r, c] = todo.back();
        todo.pop_back();
        ++zone.points;
        first[static_cast<std::size_t>(r)] = second[static_cast<std::size_t>(c)] = true;
        if (map.dexterity(r, c) > map.dexterity(best.first, best.second)) best = {r, c};
        constexpr std::array<std::array<Index, 2>, 4> kNeighbours{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
        for (const auto& [dr, dc] : kNeighbours) {
          Index nr = r + dr, nc = c + dc;
          if (map.first_wraps) nr = (nr + rows) % rows;
          if (map.second_wraps) nc = (nc + cols) % cols;
          if (nr < 0 || nr >= rows || nc < 0 || nc >= cols || !open(nr, nc)) continue;
          open(nr, nc) = false;
          todo.emplace_back(nr, nc);
        }
      }
      std::tie(zone.first_low, zone.first_high) = extent(first, map.first_values, map.first_wraps);
      std::tie(zone.second_low, zone.second_high) = extent(second, map.second_values, map.second_wraps);
      zone.share = static_cast<double>(zone.points) / static_cast<double>(rows * cols);
      zone.best = map.dexterity(best.first, best.second);
      zone.q = map.q;
      zone.q[map.first.joint] = map.first_values[best.first];
      zone.q[map.second.joint] = map.second_values[best.second];
      found.push_back(std::move(zone));
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const DexterityZone& a, const DexterityZone& b) { return a.best > b.best; });
  return found;
}

MatrixXd compliance_rows(const MatrixXd& J, const Eigen::Matrix<double, 6, 1>& wrench,
                         const MatrixXd& directions) {
  const VectorXd torque = J.transpose() * wrench;
  return directions * J * torque.asDiagonal();
}

std::vector<PoseCandidate> pose_candidates(const model::Kinematics& kinematics, double length, int count,
                                           const std::function<MatrixXd(const VectorXd& q)>& rows,
                                           std::uint32_t seed) {
  const std::vector<Range> ranges = ranges_of(kinematics.robot(), true);
  std::mt19937_64 random(seed);
  std::vector<PoseCandidate> candidates;
  for (int k = 0; k < count; ++k) {
    VectorXd q = random_pose(ranges, random);
    MatrixXd added = rows(q);
    if (added.size() == 0) continue;
    const double value = dexterity(kinematics.jacobian(q), length);
    candidates.push_back({std::move(q), std::move(added), value});
  }
  return candidates;
}

}  // namespace heft::stiffness
