#include "heft/stiffness/stiffness_effects.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"

#include "heft/host/numbers.hpp"
#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// Chance that is allowed, over all effects tried.
constexpr double kChance = 0.05;
/// Share of the error on poses left out that an effect has to take away.
constexpr double kLeastGain = 0.10;

/// The reading's row when it is taken along u.
void point_along(LoadedPose& pose, Index reading, const Vector3d& u) {
  pose.rows.row(reading) << u.transpose(), pose.point.cross(u).transpose();
}

std::vector<double> steps(double from, double to, int count) {
  std::vector<double> values;
  for (int k = 0; k < count; ++k) values.push_back(from + (to - from) * k / (count - 1));
  return values;
}

/// One way to explain the readings: errors on poses left out are M y.
struct Way {
  double parameter{kNaN};
  std::vector<LoadedPose> poses;
  StiffnessOptions options;
  MatrixXd M;
  /// Its product with y is the energy Σ x τ² that the springs would hold in all poses, in an arbitrary unit. Springs
  /// that give it back are none: turned by half a turn a direction fits as well, with compliances below zero.
  VectorXd energy;
};

/// Indices 0..count-1 of the poses in every order, or in random ones when there are too many.
std::vector<std::vector<int>> orders(int count, int most) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  std::vector<std::vector<int>> all;
  double possible = 1.0;
  for (int k = 2; k <= count; ++k) possible *= k;
  if (possible <= most) {
    do {
      all.push_back(order);
    } while (std::next_permutation(order.begin(), order.end()));
    return all;
  }
  std::mt19937 random(1);
  all.push_back(order);
  while (static_cast<int>(all.size()) < most) {
    std::shuffle(order.begin(), order.end(), random);
    all.push_back(order);
  }
  return all;
}

/// Shuffles residuals among poses. Poses with other numbers of readings keep theirs and may change its sign.
class Shuffles {
 public:
  Shuffles(const std::vector<LoadedPose>& poses, int most) {
    Index row = 0;
    bool alike = true;
    for (const LoadedPose& pose : poses) {
      first_.push_back(row);
      count_.push_back(pose.values.size());
      row += pose.values.size();
      alike = alike && count_.back() == count_.front();
    }
    const auto n = static_cast<int>(poses.size());
    if (alike) {
      orders_ = orders(n, most);
      return;
    }
    std::mt19937 random(1);
    std::bernoulli_distribution flip(0.5);
    signs_.push_back(VectorXd::Ones(n));
    while (static_cast<int>(signs_.size()) < most) {
      VectorXd sign(n);
      for (int k = 0; k < n; ++k) sign[k] = flip(random) ? -1.0 : 1.0;
      signs_.push_back(sign);
    }
  }

  std::size_t size() const { return orders_.empty() ? signs_.size() : orders_.size(); }

  /// The first leaves everything as it is.
  VectorXd operator()(std::size_t shuffle, const VectorXd& residual) const {
    VectorXd result(residual.size());
    for (std::size_t k = 0; k < first_.size(); ++k) {
      if (orders_.empty()) {
        result.segment(first_[k], count_[k]) =
            signs_[shuffle][static_cast<Index>(k)] * residual.segment(first_[k], count_[k]);
      } else {
        const auto from = static_cast<std::size_t>(orders_[shuffle][k]);
        result.segment(first_[k], count_[k]) = residual.segment(first_[from], count_[from]);
      }
    }
    return result;
  }

 private:
  std::vector<Index> first_, count_;
  std::vector<std::vector<int>> orders_;
  std::vector<VectorXd> signs_;
};

double rms(const VectorXd& v) { return std::sqrt(v.squaredNorm() / static_cast<double>(v.size())); }

/// Way::energy of a design.
VectorXd energy_of(const Design& design, const Solution& solution, const std::vector<LoadedPose>& poses,
                   const std::vector<std::vector<int>>& groups) {
  VectorXd squares = VectorXd::Zero(design.B.cols());
  for (const LoadedPose& pose : poses) {
    const VectorXd torque = pose.J.transpose() * pose.wrench;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      for (const int j : groups[g]) squares[static_cast<Index>(g)] += torque[j] * torque[j];
    }
  }
  const MatrixXd W = design.weight.asDiagonal() * design.B;
  return (squares.transpose() * solution.inverse * W.transpose() * design.weight.asDiagonal()).transpose();
}

/// All ways of an effect that let poses be left out.
std::vector<Way> ways_of(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                         const StiffnessOptions& base, const StiffnessEffect& effect, double length) {
  std::vector<Way> ways;
  const std::vector<double> values = effect.values.empty() ? std::vector<double>{kNaN} : effect.values;
  for (const double value : values) {
    Way way;
    way.parameter = value;
    way.poses = effect.change ? effect.change(poses, value) : poses;
    way.options = base;
    way.options.complementary = effect.complementary;
    if (effect.column) {
      way.options.extra = effect.column(way.poses);
      if (way.options.extra.cwiseAbs().maxCoeff() < 1e-12) continue;  // these readings cannot show it
    }
    Design design;
    if (effect.complementary) {
      // The design at the compliances found with K_C: what is left of its dependence on them is of second order.
      const StiffnessFit fit = fit_stiffness(kinematics, way.poses, way.options, length);
      VectorXd x(kinematics.num_joints());
      for (Index j = 0; j < x.size(); ++j) {
        const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
        x[j] = joint.determined ? std::max(0.0, joint.compliance) : 0.0;
      }
      design = stiffness_design(kinematics, way.poses, way.options, x, length);
    } else {
      design = stiffness_design(kinematics, way.poses, way.options, {}, length);
    }
    std::vector<bool> possible;
    const Solution solution = solve(design);
    way.M = left_out_operator(design, solution, &possible);
    if (std::find(possible.begin(), possible.end(), false) != possible.end()) continue;
    way.energy = energy_of(design, solution, way.poses, groups_of(way.options, kinematics.num_joints()));
    ways.push_back(std::move(way));
  }
  return ways;
}

/// Smallest error on poses left out over the ways, and which it is.
std::pair<double, std::size_t> best_of(const std::vector<Way>& ways, const VectorXd& y) {
  std::pair<double, std::size_t> best{kInfinity, 0};
  for (std::size_t k = 0; k < ways.size(); ++k) {
    if (ways[k].energy.dot(y) < 0.0) continue;
    const double error = rms(ways[k].M * y);
    if (error < best.first) best = {error, k};
  }
  return best;
}

/// Quantities of a pose that a residual may go with, one value a reading.
std::vector<std::pair<std::string, VectorXd>> quantities(const model::Robot& robot,
                                                         const std::vector<LoadedPose>& poses,
                                                         const StiffnessFit& fit) {
  const Index m = fit.residual.size();
  const Vector3d down = Vector3d(robot.gravity.data()).normalized();
  std::vector<std::pair<std::string, VectorXd>> list{
      {"dexterity 1/k_F", VectorXd(m)},
      {"predicted deflection", fit.prediction},
      {"direction read against the vertical", VectorXd(m)},
      {"force against the vertical", VectorXd(m)},
      {"height of the tool", VectorXd(m)},
      {"distance of the tool from the first axis", VectorXd(m)},
      {"largest joint torque of the load", VectorXd(m)}};
  Index row = 0;
  for (const LoadedPose& pose : poses) {
    const Vector3d tip = pose.tool.position;
    for (Index r = 0; r < pose.values.size(); ++r, ++row) {
      const Vector3d u = pose.rows.row(r).head<3>().transpose();
      const Vector3d f = pose.wrench.head<3>();
      list[0].second[row] = pose.dexterity;
      list[2].second[row] = u.dot(down);
      list[3].second[row] = f.norm() > 0.0 ? f.normalized().dot(down) : 0.0;
      list[4].second[row] = -tip.dot(down);
      list[5].second[row] = (tip - tip.dot(down) * down).norm();
      list[6].second[row] = (pose.J.transpose() * pose.wrench).cwiseAbs().maxCoeff();
    }
  }
  return list;
}

double correlation(const VectorXd& a, const VectorXd& b) {
  const VectorXd x = a.array() - a.mean(), y = b.array() - b.mean();
  const double norm = x.norm() * y.norm();
  return norm > 1e-12 * a.norm() * b.norm() && norm > 0.0 ? x.dot(y) / norm : 0.0;
}

}  // namespace

std::vector<StiffnessEffect> known_stiffness_effects(const model::Robot& robot) {
  const Vector3d down = Vector3d(robot.gravity.data()).normalized();
  std::vector<StiffnessEffect> effects;
  effects.push_back(
      {.id = "complementary", .meaning = "the load turns with the arm (K_C)", .complementary = true});
  effects.push_back({.id = "sensor_offset",
                     .meaning = "a constant in every displacement",
                     .unit = "m",
                     .column = [](const std::vector<LoadedPose>& poses) {
                       std::vector<double> column;
                       for (const LoadedPose& pose : poses) {
                         for (Index r = 0; r < pose.values.size(); ++r)
                           column.push_back(is_rotation(pose, r) ? 0 : 1);
                       }
                       return VectorXd(
                           Eigen::Map<const VectorXd>(column.data(), static_cast<Index>(column.size())));
                     }});
  effects.push_back({.id = "tool_bending",
                     .meaning = "what carries load and target turns with the moment on it",
                     .unit = "rad/(N m)",
                     .column = [](const std::vector<LoadedPose>& poses) {
                       std::vector<double> column;
                       for (const LoadedPose& pose : poses) {
                         for (Index r = 0; r < pose.values.size(); ++r) {
                           column.push_back(pose.rows.row(r).tail<3>().dot(pose.wrench.tail<3>()));
                         }
                       }
                       return VectorXd(
                           Eigen::Map<const VectorXd>(column.data(), static_cast<Index>(column.size())));
                     }});
  const double degree = std::numbers::pi / 180.0;
  // All around: a sign that was lost is half a turn.
  const std::vector<double> turns = steps(-175.0 * degree, 180.0 * degree, 72);
  effects.push_back({.id = "measuring_direction",
                     .meaning = "read along another direction than stated, turned about the tool's z axis",
                     .unit = "rad",
                     .change =
                         [](std::vector<LoadedPose> poses, double angle) {
                           for (LoadedPose& pose : poses) {
                             const Eigen::AngleAxisd turn(angle, pose.tool.rotation.col(2));
                             for (Index r = 0; r < pose.values.size(); ++r) {
                               if (is_rotation(pose, r)) continue;
                               point_along(pose, r, turn * Vector3d(pose.rows.row(r).head<3>().transpose()));
                             }
                           }
                           return poses;
                         },
                     .values = turns});
  effects.push_back({.id = "load_direction",
                     .meaning = "the force points elsewhere than stated, turned about the tool's z axis",
                     .unit = "rad",
                     .change =
                         [](std::vector<LoadedPose> poses, double angle) {
                           for (LoadedPose& pose : poses) {
                             const Eigen::AngleAxisd turn(angle, pose.tool.rotation.col(2));
                             pose.wrench.head<3>() = turn * Vector3d(pose.wrench.head<3>());
                           }
                           return poses;
                         },
                     .values = turns});
  effects.push_back({.id = "arm_of_load",
                     .meaning = "the moment is this many times what is stated",
                     .unit = "times",
                     .change =
                         [](std::vector<LoadedPose> poses, double factor) {
                           for (LoadedPose& pose : poses) pose.wrench.tail<3>() *= factor;
                           return poses;
                         },
                     .values = steps(-2.0, 2.0, 41)});
  effects.push_back({.id = "load_is_weight",
                     .meaning = "the force points down, whatever is stated",
                     .change = [down](std::vector<LoadedPose> poses, double) {
                       for (LoadedPose& pose : poses) {
                         const Vector3d stated = pose.wrench.head<3>();
                         pose.wrench.head<3>() = stated.norm() * down;
                         // Lever of the stated load, at right angles to it, carried over to the weight.
                         if (stated.norm() > 0.0) {
                           const Vector3d lever =
                               stated.cross(Vector3d(pose.wrench.tail<3>())) / stated.squaredNorm();
                           pose.wrench.tail<3>() = lever.cross(Vector3d(pose.wrench.head<3>()));
                         }
                         pose.follows = WrenchFrame::kBase;
                       }
                       return poses;
                     }});
  return effects;
}

StiffnessDiagnosis diagnose_stiffness(const model::Kinematics& kinematics,
                                      const std::vector<LoadedPose>& poses, const StiffnessOptions& options,
                                      const std::vector<StiffnessEffect>& effects, double length) {
  StiffnessOptions base = options;
  base.complementary = false;
  base.extra.resize(0, 0);
  StiffnessDiagnosis diagnosis;
  diagnosis.before = diagnosis.after = fit_stiffness(kinematics, poses, base, length);
  const Design design = stiffness_design(kinematics, poses, base, {}, length);
  const VectorXd y = design.y;

  {
    Design constant = design;
    constant.B = VectorXd::Ones(y.size());
    std::vector<bool> possible;
    const MatrixXd M = left_out_operator(constant, solve(constant), &possible);
    diagnosis.mean_rms =
        std::find(possible.begin(), possible.end(), false) == possible.end() ? rms(M * y) : kInfinity;
  }

  constexpr int kMostShuffles = 999;
  const Shuffles shuffles(poses, kMostShuffles);
  diagnosis.smallest_p = 1.0 / static_cast<double>(shuffles.size());
  for (const auto& [name, values] : quantities(kinematics.robot(), poses, diagnosis.before)) {
    ResidualCorrelation c{name, correlation(diagnosis.before.residual, values), 1.0};
    std::size_t as_large = 0;
    for (std::size_t s = 0; s < shuffles.size(); ++s) {
      const double other = correlation(shuffles(s, diagnosis.before.residual), values);
      if (std::abs(other) >= std::abs(c.coefficient) - 1e-12) ++as_large;
    }
    c.p_value = static_cast<double>(as_large) / static_cast<double>(shuffles.size());
    diagnosis.correlations.push_back(c);
  }

  const double before = diagnosis.before.left_out_rms;
  std::vector<std::vector<Way>> ways;
  for (const StiffnessEffect& effect : effects) {
    StiffnessTrial trial;
    trial.id = effect.id;
    trial.meaning = effect.meaning;
    trial.unit = effect.unit;
    trial.parameter = trial.fit_rms = kNaN;
    trial.left_out_rms = kInfinity;
    std::vector<Way> of_effect = ways_of(kinematics, poses, base, effect, length);
    const auto [error, best] = best_of(of_effect, y);
    trial.possible = std::isfinite(error);
    if (!trial.possible) {
      trial.why = of_effect.empty() ? "these readings do not show it"
                                    : "fits only with springs that give energy back";
    }
    if (trial.possible) {
      const StiffnessFit fit =
          fit_stiffness(kinematics, of_effect[best].poses, of_effect[best].options, length);
      trial.left_out_rms = error;
      trial.fit_rms = fit.fit_rms;
      trial.parameter = fit.extra.size() > 0 ? fit.extra[0] : of_effect[best].parameter;
    }
    diagnosis.trials.push_back(trial);
    ways.push_back(std::move(of_effect));
  }

  // What the best of all effects gains where there is none: the readings of the base model with its residuals
  // shuffled among the poses (Freedman and Lane), every effect tried again.
  const MatrixXd base_M = left_out_operator(design, solve(design), nullptr);
  std::vector<double> chance_gains;
  for (std::size_t s = 0; s < shuffles.size() && std::isfinite(before); ++s) {
    const VectorXd shuffled = diagnosis.before.prediction + shuffles(s, diagnosis.before.residual);
    const double base_error = rms(base_M * shuffled);
    double least = kInfinity;
    for (const auto& of_effect : ways) least = std::min(least, best_of(of_effect, shuffled).first);
    chance_gains.push_back(1.0 - least / base_error);
  }
  std::size_t tried = 0;
  for (std::size_t k = 0; k < diagnosis.trials.size(); ++k) {
    StiffnessTrial& trial = diagnosis.trials[k];
    if (!trial.possible || chance_gains.empty()) continue;
    ++tried;
    const double gain = 1.0 - trial.left_out_rms / before;
    trial.p_value = static_cast<double>(std::count_if(chance_gains.begin(), chance_gains.end(),
                                                      [&](double other) { return other >= gain - 1e-12; })) /
                    static_cast<double>(chance_gains.size());
  }
  std::vector<std::size_t> order(diagnosis.trials.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return diagnosis.trials[a].left_out_rms < diagnosis.trials[b].left_out_rms;
  });
  std::vector<StiffnessTrial> sorted;
  for (const std::size_t k : order) sorted.push_back(diagnosis.trials[k]);
  diagnosis.trials = sorted;

  const std::size_t count = design.names.size();
  const std::string unexplained =
      std::isfinite(diagnosis.before.repeatability)
          ? fmt::format("; repeats scatter by {:.3g} mm", 1e3 * diagnosis.before.repeatability)
          : std::string();
  if (!std::isfinite(before)) {
    diagnosis.verdict = fmt::format(
        "Cannot be decided: {} poses do not determine the compliances any more when one is left out.", count);
    return diagnosis;
  }
  const bool has_best = !diagnosis.trials.empty() && diagnosis.trials.front().possible;
  const StiffnessTrial best = has_best ? diagnosis.trials.front() : StiffnessTrial{};
  const double gain = has_best ? 1.0 - best.left_out_rms / before : 0.0;
  if (has_best && gain >= kLeastGain && best.p_value <= kChance) {
    diagnosis.accepted = 0;
    const std::vector<Way>& of_best = ways[order.front()];
    const Way& way = of_best[best_of(of_best, y).second];
    diagnosis.after = fit_stiffness(kinematics, way.poses, way.options, length);
    diagnosis.verdict = fmt::format(
        "{}: {}. The error on poses left out falls from {:.3g} to {:.3g} mm (p = {:.2g} over {} effects "
        "tried).",
        best.id, best.meaning, 1e3 * before, 1e3 * best.left_out_rms, best.p_value, tried);
  } else if (before > diagnosis.mean_rms) {
    diagnosis.verdict = fmt::format(
        "Cannot be decided with these {} readings at {} poses: on a pose left out the stiffness model errs "
        "by {:.3g} mm, "
        "the mean of the other readings by {:.3g} mm{}. Of {} effects tried {} does best ({:.3g} mm); "
        "shuffled residuals "
        "do as well {:.0f} times in a hundred.",
        y.size(), count, 1e3 * before, 1e3 * diagnosis.mean_rms, unexplained, tried,
        has_best ? best.id : "none", 1e3 * best.left_out_rms, 100.0 * best.p_value);
  } else if (std::isfinite(diagnosis.before.repeatability) &&
             diagnosis.before.fit_rms > 3.0 * diagnosis.before.repeatability) {
    diagnosis.verdict = fmt::format(
        "A residual remains that {} poses do not pin down: the residual is {:.3g} mm{}, and none of {} "
        "effects lowers the error on poses left out ({:.3g} mm) by more than chance; the best, {}, leaves "
        "{:.3g} mm (p = {:.2g}).",
        count, 1e3 * diagnosis.before.fit_rms, unexplained, tried, 1e3 * before, has_best ? best.id : "none",
        1e3 * best.left_out_rms, best.p_value);
  } else {
    diagnosis.verdict = fmt::format(
        "Nothing is missing that these readings show: none of {} effects lowers the error on poses left out "
        "({:.3g} mm) "
        "by more than chance.",
        tried, 1e3 * before);
  }
  return diagnosis;
}

}  // namespace heft::stiffness
