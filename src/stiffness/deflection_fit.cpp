#include "heft/stiffness/deflection_fit.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/words.hpp"
#include "heft/statistics/distributions.hpp"

#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Why the readings do not determine a group's compliance.
std::string why_open(const std::vector<LoadedPose>& poses, const std::vector<int>& joints) {
  double torque = 0.0, shown = 0.0;
  for (const LoadedPose& pose : poses) {
    for (const int j : joints) {
      torque = std::max(torque, std::abs(pose.J.col(j).dot(pose.wrench)) / pose.wrench.norm());
      shown = std::max(shown, (pose.rows * pose.J.col(j)).cwiseAbs().maxCoeff());
    }
  }
  constexpr double kNone = 1e-9;
  if (torque < kNone) return "no load turns it: load the tool so that a torque about its axis arises";
  if (shown < kNone) {
    return "no reading sees it move: read a rotation about its axis, or a point off its axis";
  }
  return "the readings cannot distinguish it from other joints: add poses and directions";
}

using Groups = std::vector<std::vector<int>>;

/// A design and its solution: with K_C each depends on the other.
struct Fitted {
  Design design;
  Solution solution;
};

void refuse_too_few_readings(Index readings, Index unknowns, Index compliances) {
  if (readings >= unknowns) return;
  throw NotIdentifiableError(
      fmt::format("{} different readings for {} unknowns ({} compliances{}); expected at least as many "
                  "readings as unknowns, better "
                  "three times as many; repeats of a pose do not count; measure more poses or directions, "
                  "or let joints with "
                  "gears of one size share one compliance (--groups)",
                  readings, unknowns, compliances,
                  unknowns > compliances ? " and what else may have moved the instrument" : ""));
}

void refuse_without_a_compliance(const std::vector<LoadedPose>& poses, const Groups& groups,
                                 const Solution& solution) {
  const auto compliances = static_cast<std::ptrdiff_t>(groups.size());
  if (std::any_of(solution.determined.begin(), solution.determined.begin() + compliances,
                  [](bool d) { return d; })) {
    return;
  }
  std::string list;
  for (const auto& joints : groups) {
    list += fmt::format("; {}: {}", host::joints_in_words(joints), why_open(poses, joints));
  }
  throw NotIdentifiableError("these readings do not determine any compliance" + list);
}

/// Compliance of each of n joints; springs that would give energy back count as rigid.
VectorXd compliance_of_joints(const Solution& solution, const Groups& groups, int n) {
  VectorXd x = VectorXd::Zero(n);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const int j : groups[g]) x[j] = std::max(0.0, solution.x[static_cast<Index>(g)]);
  }
  return x;
}

/// Fits, deflects the arm by what was found and fits at the pose that the load has made, until nothing changes.
/// @return number of rounds
int iterate_with_deflection(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                            const StiffnessOptions& options, double length, Fitted& fitted) {
  constexpr int kMost = 30;
  const Groups groups = groups_of(options, kinematics.num_joints());
  for (int round = 1; round <= kMost; ++round) {
    const VectorXd before = fitted.solution.x;
    fitted.design =
        stiffness_design(kinematics, poses, options,
                         compliance_of_joints(fitted.solution, groups, kinematics.num_joints()), length);
    fitted.solution = solve(fitted.design);
    if ((fitted.solution.x - before).norm() <= 1e-12 * fitted.solution.x.norm()) return round;
  }
  throw NotIdentifiableError(
      fmt::format("the fit with the complementary stiffness did not settle in {} rounds: the arm "
                  "deflects so far under the load that the measured poses change with it; load it less "
                  "or leave --complementary out",
                  kMost));
}

/// What the width of an interval rests on.
struct Noise {
  double variance{1.0};  ///< of a weighted residual; NaN where no reading is to spare
  /// Half the 95 % interval over the standard deviation; of a normal distribution.
  double factor{statistics::kNormal95};
};

/// 1 where standard deviations are stated, else what is left. Residuals larger than stated (three standard deviations of
/// χ²) widen the intervals as well.
Noise noise_of(const Fitted& fitted, const VectorXd& residual) {
  const auto freedom = static_cast<int>(residual.size()) - fitted.solution.rank;
  const double square = residual.cwiseProduct(fitted.design.weight).squaredNorm();
  Noise noise;
  if (!fitted.design.stated_noise || square > freedom + 3.0 * std::sqrt(2.0 * std::max(freedom, 1))) {
    noise.variance = freedom > 0 ? square / freedom : kNaN;
    noise.factor = freedom > 0 ? statistics::interval_factor(freedom) : kNaN;
  }
  return noise;
}

StiffnessEstimate rigid_joint() {
  StiffnessEstimate joint;
  joint.why = "taken as rigid";
  return joint;
}

/// The answer for the joints that share compliance g, which is determined.
StiffnessEstimate estimate_of(const Solution& solution, Index g, const Noise& noise) {
  StiffnessEstimate joint = rigid_joint();
  joint.why.clear();
  joint.determined = true;
  joint.compliance = statistics::Interval::around(
      solution.x[g], std::sqrt(noise.variance * solution.inverse(g, g)), noise.factor);
  if (joint.compliance.upper < 0.0) {
    joint.why =
        "a negative compliance, which no spring has: load, direction or sign of the readings is not as "
        "stated";
    return joint;
  }
  joint.stiffness = statistics::reciprocal(joint.compliance);
  return joint;
}

std::vector<StiffnessEstimate> estimates_of(const std::vector<LoadedPose>& poses, const Groups& groups,
                                            const Solution& solution, const Noise& noise, int n) {
  std::vector<StiffnessEstimate> joints(static_cast<std::size_t>(n), rigid_joint());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    StiffnessEstimate shared = rigid_joint();
    if (solution.determined[g]) shared = estimate_of(solution, static_cast<Index>(g), noise);
    else shared.why = why_open(poses, groups[g]);
    shared.group = static_cast<int>(g);
    for (const int j : groups[g]) joints[static_cast<std::size_t>(j)] = shared;
  }
  return joints;
}

/// Largest change of a compliance when rows count nothing, in standard deviations; infinite where the others do not
/// determine all.
double shift_without(const Design& others, const Solution& solution, Index compliances, double variance) {
  const Solution without = solve(others);
  if (without.rank < solution.rank) return kInfinity;
  double shift = 0.0;
  for (Index g = 0; g < compliances && std::isfinite(shift); ++g) {
    const double deviation = std::sqrt(variance * solution.inverse(g, g));
    if (solution.determined[static_cast<std::size_t>(g)] && deviation > 0.0) {
      shift = std::max(shift, std::abs(without.x[g] - solution.x[g]) / deviation);
    }
  }
  return shift;
}

/// Errors that a fit makes on poses it was not given.
struct LeftOut {
  VectorXd errors;             ///< m [m; rotations times the length]
  std::vector<bool> possible;  ///< of each name
};

/// Leaves out all poses of one name.
PoseInfluence influence_of(std::size_t name, const Fitted& fitted, const VectorXd& scaled_residual,
                           const LeftOut& left_out, Index compliances, double variance) {
  PoseInfluence influence;
  influence.name = fitted.design.names[name];
  Design others = fitted.design;
  double residual = 0.0, error = 0.0;
  int count = 0;
  for (Index r = 0; r < scaled_residual.size(); ++r) {
    if (fitted.design.name_of_row[static_cast<std::size_t>(r)] != static_cast<int>(name)) continue;
    others.weight[r] = 0.0;
    residual += scaled_residual[r] * scaled_residual[r];
    error += left_out.errors[r] * left_out.errors[r];
    ++count;
  }
  influence.residual = std::sqrt(residual / count);
  influence.left_out = left_out.possible[name] ? std::sqrt(error / count) : kInfinity;
  influence.shift = shift_without(others, fitted.solution, compliances, variance);
  return influence;
}

/// Dexterity of the poses, by name.
void add_dexterity(const std::vector<LoadedPose>& poses, std::vector<PoseInfluence>& influences) {
  for (PoseInfluence& influence : influences) {
    for (const LoadedPose& pose : poses) {
      if (pose.name == influence.name) influence.dexterity = pose.dexterity;
    }
  }
}

/// Standard deviation of the mean of the repeats, pooled over the readings, names in their order [m]; NaN without repeats.
double repeatability_of(const std::vector<LoadedPose>& poses, const std::vector<std::string>& names,
                        double length) {
  double pooled = 0.0;
  int count = 0;
  for (const std::string& name : names) {
    for (const LoadedPose& pose : poses) {
      if (pose.name != name) continue;
      for (Index r = 0; r < pose.values.size(); ++r) {
        if (!std::isfinite(pose.scatter[r])) continue;
        const double scale = is_rotation(pose, r) ? length : 1.0;
        pooled += std::pow(scale * pose.scatter[r], 2) / pose.repeats;
        ++count;
      }
    }
  }
  return count > 0 ? std::sqrt(pooled / count) : kNaN;
}

}  // namespace

bool StiffnessEstimate::has_stiffness() const {
  return determined && std::isfinite(stiffness.value) && std::isfinite(stiffness.upper);
}

StiffnessFit fit_stiffness(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                           const StiffnessOptions& options, double length) {
  const int n = kinematics.num_joints();
  const Groups groups = groups_of(options, n);
  const auto p = static_cast<Index>(groups.size());
  Fitted fitted{stiffness_design(kinematics, poses, options, {}, length), {}};
  const Design& design = fitted.design;
  const Solution& solution = fitted.solution;
  const Index m = design.B.rows();
  refuse_too_few_readings(m, design.B.cols(), p);
  fitted.solution = solve(design);

  StiffnessFit fit;
  fit.readings = static_cast<int>(m);
  fit.unknowns = static_cast<int>(design.B.cols());
  if (options.complementary) {
    fit.iterations = iterate_with_deflection(kinematics, poses, options, length, fitted);
  }
  refuse_without_a_compliance(poses, groups, solution);

  fit.prediction = design.B * solution.x;
  fit.residual = design.y - fit.prediction;
  const VectorXd scaled = fit.residual.cwiseProduct(design.scale);
  fit.fit_rms = std::sqrt(scaled.squaredNorm() / static_cast<double>(m));
  fit.stated_noise = design.stated_noise;
  fit.condition = solution.condition;
  const Noise noise = noise_of(fitted, fit.residual);
  fit.joints = estimates_of(poses, groups, solution, noise, n);
  fit.extra = solution.x.tail(options.extra.cols());
  fit.extra_deviation = (noise.variance * solution.inverse.diagonal().tail(options.extra.cols())).cwiseSqrt();

  LeftOut left_out;
  left_out.errors = left_out_operator(design, solution, &left_out.possible) * design.y;
  for (std::size_t name = 0; name < design.names.size(); ++name) {
    fit.poses.push_back(influence_of(name, fitted, scaled, left_out, p, noise.variance));
  }
  add_dexterity(poses, fit.poses);
  const bool all_possible =
      std::all_of(left_out.possible.begin(), left_out.possible.end(), [](bool possible) { return possible; });
  fit.left_out_rms =
      all_possible ? std::sqrt(left_out.errors.squaredNorm() / static_cast<double>(m)) : kInfinity;
  fit.repeatability = repeatability_of(poses, design.names, length);
  return fit;
}

}  // namespace heft::stiffness
