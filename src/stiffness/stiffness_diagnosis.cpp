// Which known effect, if any, explains what springs alone leave.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include <fmt/format.h>

#include "heft/host/numbers.hpp"
#include "heft/stiffness/stiffness_effects.hpp"

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

/// The design of a way. With K_C that at the compliances found with it: what is left of its dependence on them is of
/// second order.
Design design_of(const model::Kinematics& kinematics, const Way& way, double length) {
  if (!way.options.complementary) return stiffness_design(kinematics, way.poses, way.options, {}, length);
  const StiffnessFit fit = fit_stiffness(kinematics, way.poses, way.options, length);
  VectorXd x(kinematics.num_joints());
  for (Index j = 0; j < x.size(); ++j) {
    const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    x[j] = joint.determined ? std::max(0.0, joint.compliance.value) : 0.0;
  }
  return stiffness_design(kinematics, way.poses, way.options, x, length);
}

bool all_of(const std::vector<bool>& values) {
  return std::find(values.begin(), values.end(), false) == values.end();
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
    const Design design = design_of(kinematics, way, length);
    std::vector<bool> possible;
    const Solution solution = solve(design);
    way.M = left_out_operator(design, solution, &possible);
    if (!all_of(possible)) continue;
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

/// What is tried on the residual of the fit without any effect, and with what result.
class Search {
 public:
  Search(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
         const StiffnessOptions& base, double length)
      : kinematics_(kinematics),
        poses_(poses),
        base_(base),
        length_(length),
        design_(stiffness_design(kinematics, poses, base, {}, length)),
        shuffles_(poses, kMostShuffles) {
    result_.before = result_.after = fit_stiffness(kinematics, poses, base, length);
    result_.mean_rms = mean_rms();
    result_.smallest_p = 1.0 / static_cast<double>(shuffles_.size());
  }

  StiffnessDiagnosis run(const std::vector<StiffnessEffect>& effects) {
    correlate();
    for (const StiffnessEffect& effect : effects) try_effect(effect);
    weigh_against_chance();
    sort_trials();
    decide();
    return std::move(result_);
  }

 private:
  static constexpr int kMostShuffles = 999;

  /// Error on poses left out when the mean of the other readings predicts.
  double mean_rms() const {
    Design constant = design_;
    constant.B = VectorXd::Ones(design_.y.size());
    std::vector<bool> possible;
    const MatrixXd M = left_out_operator(constant, solve(constant), &possible);
    return all_of(possible) ? rms(M * design_.y) : kInfinity;
  }

  double error_before() const { return result_.before.left_out_rms; }

  /// Share of the error on poses left out that is gone when this is left.
  double gain_of(double left_out_rms) const { return 1.0 - left_out_rms / error_before(); }

  /// The residual against quantities of the pose.
  void correlate() {
    const VectorXd& residual = result_.before.residual;
    for (const auto& [name, values] : quantities(kinematics_.robot(), poses_, result_.before)) {
      ResidualCorrelation c{name, correlation(residual, values), 1.0};
      std::size_t as_large = 0;
      for (std::size_t s = 0; s < shuffles_.size(); ++s) {
        const double other = correlation(shuffles_(s, residual), values);
        if (std::abs(other) >= std::abs(c.coefficient) - 1e-12) ++as_large;
      }
      c.p_value = static_cast<double>(as_large) / static_cast<double>(shuffles_.size());
      result_.correlations.push_back(c);
    }
  }

  void try_effect(const StiffnessEffect& effect) {
    StiffnessTrial trial;
    trial.id = effect.id;
    trial.meaning = effect.meaning;
    trial.unit = effect.unit;
    trial.parameter = trial.fit_rms = kNaN;
    trial.left_out_rms = kInfinity;
    std::vector<Way> ways = ways_of(kinematics_, poses_, base_, effect, length_);
    const auto [error, best] = best_of(ways, design_.y);
    trial.possible = std::isfinite(error);
    if (trial.possible) {
      const StiffnessFit fit = fit_stiffness(kinematics_, ways[best].poses, ways[best].options, length_);
      trial.left_out_rms = error;
      trial.fit_rms = fit.fit_rms;
      trial.parameter = fit.extra.size() > 0 ? fit.extra[0] : ways[best].parameter;
    } else {
      trial.why =
          ways.empty() ? "these readings do not show it" : "fits only with springs that give energy back";
    }
    result_.trials.push_back(trial);
    ways_.push_back(std::move(ways));
  }

  /// What the best of all effects gains where there is none: the readings of the base model with its residuals shuffled
  /// among the poses (Freedman and Lane, 1983), every effect tried again.
  std::vector<double> chance_gains() const {
    const MatrixXd base_M = left_out_operator(design_, solve(design_), nullptr);
    std::vector<double> gains;
    for (std::size_t s = 0; s < shuffles_.size() && std::isfinite(error_before()); ++s) {
      const VectorXd shuffled = result_.before.prediction + shuffles_(s, result_.before.residual);
      const double base_error = rms(base_M * shuffled);
      double least = kInfinity;
      for (const auto& ways : ways_) least = std::min(least, best_of(ways, shuffled).first);
      gains.push_back(1.0 - least / base_error);
    }
    return gains;
  }

  void weigh_against_chance() {
    const std::vector<double> by_chance = chance_gains();
    for (StiffnessTrial& trial : result_.trials) {
      if (!trial.possible || by_chance.empty()) continue;
      ++tried_;
      const double gain = gain_of(trial.left_out_rms);
      const auto as_good = std::count_if(by_chance.begin(), by_chance.end(),
                                         [&](double other) { return other >= gain - 1e-12; });
      trial.p_value = static_cast<double>(as_good) / static_cast<double>(by_chance.size());
    }
  }

  /// Smallest error on poses left out first.
  void sort_trials() {
    std::vector<std::size_t> order(result_.trials.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return result_.trials[a].left_out_rms < result_.trials[b].left_out_rms;
    });
    std::vector<StiffnessTrial> sorted;
    for (const std::size_t k : order) sorted.push_back(result_.trials[k]);
    result_.trials = sorted;
    if (!order.empty()) best_ways_ = std::move(ways_[order.front()]);
  }

  /// Accepts the best trial or none, and says why.
  void decide() {
    if (!std::isfinite(error_before())) {
      result_.verdict = fmt::format(
          "Cannot be decided: {} poses do not determine the compliances any more when one is left out.",
          design_.names.size());
      return;
    }
    const bool has_best = !result_.trials.empty() && result_.trials.front().possible;
    const StiffnessTrial best = has_best ? result_.trials.front() : StiffnessTrial{};
    if (has_best && gain_of(best.left_out_rms) >= kLeastGain && best.p_value <= kChance) {
      accept(best);
    } else {
      result_.verdict = why_none(best, has_best ? best.id : "none");
    }
  }

  void accept(const StiffnessTrial& best) {
    result_.accepted = 0;
    const Way& way = best_ways_[best_of(best_ways_, design_.y).second];
    result_.after = fit_stiffness(kinematics_, way.poses, way.options, length_);
    result_.verdict = fmt::format(
        "{}: {}. The error on poses left out falls from {:.3g} to {:.3g} mm (p = {:.2g} over {} effects "
        "tried).",
        best.id, best.meaning, 1e3 * error_before(), 1e3 * best.left_out_rms, best.p_value, tried_);
  }

  /// @param id  of the best, in words
  std::string why_none(const StiffnessTrial& best, const std::string& id) const {
    const StiffnessFit& before = result_.before;
    const std::size_t count = design_.names.size();
    const std::string scatter =
        std::isfinite(before.repeatability)
            ? fmt::format("; repeats scatter by {:.3g} mm", 1e3 * before.repeatability)
            : std::string();
    if (error_before() > result_.mean_rms) {
      return fmt::format(
          "Cannot be decided with these {} readings at {} poses: on a pose left out the stiffness model errs "
          "by {:.3g} mm, "
          "the mean of the other readings by {:.3g} mm{}. Of {} effects tried {} does best ({:.3g} mm); "
          "shuffled residuals "
          "do as well {:.0f} times in a hundred.",
          design_.y.size(), count, 1e3 * error_before(), 1e3 * result_.mean_rms, scatter, tried_, id,
          1e3 * best.left_out_rms, 100.0 * best.p_value);
    }
    if (std::isfinite(before.repeatability) && before.fit_rms > 3.0 * before.repeatability) {
      return fmt::format(
          "A residual remains that {} poses do not pin down: the residual is {:.3g} mm{}, and none of {} "
          "effects lowers the error on poses left out ({:.3g} mm) by more than chance; the best, {}, leaves "
          "{:.3g} mm (p = {:.2g}).",
          count, 1e3 * before.fit_rms, scatter, tried_, 1e3 * error_before(), id, 1e3 * best.left_out_rms,
          best.p_value);
    }
    return fmt::format(
        "Nothing is missing that these readings show: none of {} effects lowers the error on poses left out "
        "({:.3g} mm) "
        "by more than chance.",
        tried_, 1e3 * error_before());
  }

  const model::Kinematics& kinematics_;
  const std::vector<LoadedPose>& poses_;
  const StiffnessOptions& base_;
  double length_;
  Design design_;
  Shuffles shuffles_;
  StiffnessDiagnosis result_;
  std::vector<std::vector<Way>> ways_;  ///< of each effect, as tried
  std::vector<Way> best_ways_;          ///< of the effect that did best
  std::size_t tried_{0};                ///< effects that have a fit
};

}  // namespace

StiffnessDiagnosis diagnose_stiffness(const model::Kinematics& kinematics,
                                      const std::vector<LoadedPose>& poses, const StiffnessOptions& options,
                                      const std::vector<StiffnessEffect>& effects, double length) {
  StiffnessOptions base = options;
  base.complementary = false;
  base.extra.resize(0, 0);
  return Search(kinematics, poses, base, length).run(effects);
}

}  // namespace heft::stiffness
