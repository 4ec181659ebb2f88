// What poses and instrument alone do: simulated readings of an arm with the stiffnesses found.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/host/decompositions.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"
#include "heft/statistics/distributions.hpp"

#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Poses in the zones of table 5, the wrist near 45° as in table 4 but for the last joint, which 1/k_F does not depend
/// on: at 45° the load (135) puts no torque on joint 5.
std::vector<VectorXd> poses_in_zones(int count, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<VectorXd> poses;
  for (int k = 0; k < count; ++k) {
    const std::array<double, 4>& zone = printed_zones()[static_cast<std::size_t>(k) % 2].second;
    VectorXd q(6);
    q << uniform(-180, 180), uniform(zone[0], zone[1]), uniform(zone[2], zone[3]), uniform(30, 60),
        uniform(30, 60), uniform(-180, 180);
    poses.push_back(q * kDegree);
  }
  return poses;
}

/// Poses anywhere with 1/k_F between two values.
std::vector<VectorXd> poses_between(const model::Kinematics& kinematics, double length, double low,
                                    double high, int count, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> turn(-std::numbers::pi, std::numbers::pi);
  std::vector<VectorXd> poses;
  while (static_cast<int>(poses.size()) < count) {
    VectorXd q(6);
    for (double& v : q) v = turn(random);
    const double dexterity = stiffness::dexterity(kinematics.jacobian(q), length);
    if (dexterity >= low && dexterity < high) poses.push_back(q);
  }
  return poses;
}

void add_noise(std::vector<stiffness::LoadedPose>& poses, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  for (stiffness::LoadedPose& pose : poses) {
    for (Index r = 0; r < pose.values.size(); ++r) pose.values[r] += pose.sigmas[r] * normal(random);
  }
}

/// Half the width that holds the middle 68 % of the values.
double middle_spread(std::vector<double> values) {
  if (values.empty()) return kNaN;
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
  };
  return 0.5 * (at(0.84) - at(0.16));
}

/// Joints that move a reading at all.
bool is_seen(const std::vector<stiffness::LoadedPose>& poses, Index joint) {
  double most = 0.0, of_this = 0.0;
  for (const stiffness::LoadedPose& pose : poses) {
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    most = std::max(most, A.cwiseAbs().maxCoeff());
    of_this = std::max(of_this, A.col(joint).cwiseAbs().maxCoeff());
  }
  return of_this > 1e-9 * most;
}

/// Poses and an instrument to be tried.
struct Case {
  std::string poses, instrument;
  std::vector<VectorXd> where;
  Instrument kind;
  double sigma, sigma_rotation;  ///< of a reading [m], [rad]
};

/// Estimates of each joint over the true value, one a draw.
using Draws = std::array<std::vector<double>, 6>;

/// Fits simulated readings by both methods.
/// @param options  joints that the readings show
void add_draw(const model::Kinematics& kinematics, const std::vector<stiffness::LoadedPose>& poses,
              const stiffness::StiffnessOptions& options, bool whole, const VectorXd& truth, double length,
              Draws& compliance, Draws& stiffness) {
  const stiffness::StiffnessFit fit = stiffness::fit_stiffness(kinematics, poses, options, length);
  for (std::size_t j = 0; j < 6; ++j) {
    if (fit.joints[j].determined) {
      compliance[j].push_back(fit.joints[j].compliance.value / truth[static_cast<Index>(j)]);
    }
  }
  if (!whole) return;
  const stiffness::DirectStiffness direct = stiffness::direct_stiffness(poses, false);
  for (std::size_t j = 0; j < 6; ++j) {
    stiffness[j].push_back(direct.mean[static_cast<Index>(j)] * truth[static_cast<Index>(j)]);
  }
}

Precision precision_of(const model::Kinematics& kinematics, const Case& c, const VectorXd& truth,
                       double length, int draws) {
  std::vector<stiffness::LoadedPose> exact =
      loaded_with(kinematics, c.where, c.kind, c.sigma, c.sigma_rotation, length);
  set_values(exact, truth);
  Precision precision;
  precision.poses = c.poses;
  precision.instrument = c.instrument;
  precision.count = static_cast<int>(c.where.size());
  precision.least_dexterity = kInfinity;
  for (const stiffness::LoadedPose& pose : exact) {
    precision.least_dexterity = std::min(precision.least_dexterity, pose.dexterity);
    precision.most_dexterity = std::max(precision.most_dexterity, pose.dexterity);
  }
  stiffness::StiffnessOptions options;
  std::vector<bool> seen;
  for (Index j = 0; j < 6; ++j) {
    seen.push_back(is_seen(exact, j));
    if (seen.back()) options.groups.push_back({static_cast<int>(j)});
  }
  Draws compliance, stiffness;
  std::mt19937_64 random(1);
  for (int draw = 0; draw < draws; ++draw) {
    std::vector<stiffness::LoadedPose> poses = exact;
    add_noise(poses, random);
    add_draw(kinematics, poses, options, c.kind == Instrument::kWhole, truth, length, compliance, stiffness);
  }
  for (std::size_t j = 0; j < 6; ++j) {
    precision.least_squares[j] = seen[j] ? middle_spread(compliance[j]) : kInfinity;
    precision.direct[j] = middle_spread(stiffness[j]);
  }
  return precision;
}

std::vector<SinglePose> single_poses(const model::Kinematics& kinematics, const SimulationStudy& simulation,
                                     const VectorXd& truth, double length) {
  std::vector<VectorXd> where = poses_in_zones(150, 5);
  const std::vector<VectorXd> anywhere = poses_between(kinematics, length, 0.002, 1.0, 450, 6);
  where.insert(where.end(), anywhere.begin(), anywhere.end());
  std::vector<SinglePose> singles;
  for (const stiffness::LoadedPose& pose :
       loaded_with(kinematics, where, Instrument::kWhole, simulation.tracker_noise,
                   simulation.tracker_rotation, length)) {
    // x = A⁻¹ δd: with one pose both methods are the same.
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    const MatrixXd inverse = solve_square(A, pose.sigmas.asDiagonal());
    std::vector<double> relative;
    for (Index j = 0; j < 6; ++j) relative.push_back(inverse.row(j).norm() / truth[j]);
    std::sort(relative.begin(), relative.end());
    singles.push_back(
        {pose.dexterity, static_cast<int>(singles.size()) < 150, 0.5 * (relative[2] + relative[3])});
  }
  return singles;
}

std::vector<Plan> plans_of(const model::Kinematics& kinematics, const SimulationStudy& simulation,
                           const VectorXd& truth, double length) {
  constexpr double kLeast = 0.25;
  std::vector<Plan> plans;
  struct Choice {
    const char* name;
    Instrument instrument;
    double sigma, sigma_rotation;
    std::vector<int> counts;
  };
  for (const Choice& choice :
       {Choice{"wire at the tool", Instrument::kWire, simulation.wire_noise, 0.0, {6, 12}},
        Choice{"wire at the cantilever's end",
               Instrument::kWireAtCantilever,
               simulation.wire_noise,
               0.0,
               {6, 12}},
        Choice{
            "tracker", Instrument::kWhole, simulation.tracker_noise, simulation.tracker_rotation, {3, 6, 10}},
        Choice{"tracker, errors as large as at present",
               Instrument::kWhole,
               simulation.unexplained,
               simulation.unexplained / 0.5,
               {6, 10, 20}}}) {
    const bool sees_last = choice.instrument != Instrument::kWire;
    const Index p = sees_last ? 6 : 5;
    const std::vector<stiffness::PoseCandidate> candidates = stiffness::pose_candidates(
        kinematics, length, 400,
        [&](const VectorXd& q) -> MatrixXd {
          const stiffness::LoadedPose pose =
              loaded_with(kinematics, {q}, choice.instrument, choice.sigma, choice.sigma_rotation, length)
                  .front();
          const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
          return (pose.sigmas.cwiseInverse().asDiagonal() * A).leftCols(p);
        },
        3);
    for (const int count : choice.counts) {
      const stiffness::PoseChoice chosen = stiffness::choose_poses(candidates, count, kLeast);
      const MatrixXd covariance = solve_symmetric(chosen.information, MatrixXd::Identity(p, p));
      Plan plan;
      plan.instrument = choice.name;
      plan.poses = count;
      plan.least_dexterity = kLeast;
      plan.half_width.fill(kInfinity);
      for (Index j = 0; j < p; ++j) {
        plan.half_width[static_cast<std::size_t>(j)] =
            statistics::kNormal95 * std::sqrt(covariance(j, j)) / truth[j];
      }
      plans.push_back(plan);
    }
  }
  return plans;
}

/// Effects put into simulated readings, in a size that would matter.
struct Cause {
  std::string id, size;
  double parameter;
};
const std::vector<Cause>& causes() {
  static const std::vector<Cause> list{{"sensor_offset", "0.08 mm", 0.08e-3},
                                       {"tool_bending", "20 µrad/(N m)", 20e-6},
                                       {"measuring_direction", "30°", 30 * kDegree},
                                       {"load_direction", "30°", 30 * kDegree},
                                       {"arm_of_load", "× 0.5", 0.5},
                                       {"load_is_weight", "", 0.0}};
  return list;
}

/// Share of the draws in which a cause is accepted under its own name.
double share_named(const model::Kinematics& kinematics, const std::vector<stiffness::LoadedPose>& nominal,
                   const std::vector<stiffness::StiffnessEffect>& effects, const Cause& cause,
                   const VectorXd& truth, double length, int draws) {
  const auto effect =
      std::find_if(effects.begin(), effects.end(), [&](const auto& e) { return e.id == cause.id; });
  std::vector<stiffness::LoadedPose> exact =
      effect->change ? effect->change(nominal, cause.parameter) : nominal;
  set_values(exact, truth);
  if (effect->column) {
    const VectorXd column = effect->column(nominal);
    Index row = 0;
    for (stiffness::LoadedPose& pose : exact) {
      for (double& v : pose.values) v += cause.parameter * column[row++];
    }
  }
  stiffness::StiffnessOptions options;
  options.groups = gear_sizes();
  std::mt19937_64 random(11);
  int named = 0;
  for (int draw = 0; draw < draws; ++draw) {
    std::vector<stiffness::LoadedPose> poses = nominal;
    for (std::size_t k = 0; k < poses.size(); ++k) poses[k].values = exact[k].values;
    add_noise(poses, random);
    const stiffness::StiffnessDiagnosis d =
        stiffness::diagnose_stiffness(kinematics, poses, options, effects, length);
    named += d.accepted >= 0 && d.trials[static_cast<std::size_t>(d.accepted)].id == cause.id ? 1 : 0;
  }
  return static_cast<double>(named) / draws;
}

/// Poses of the tables and others, with the wire, a whole deflection as good as the wire, and a tracker.
std::vector<Case> cases_of(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                           const SimulationStudy& study, double length) {
  const std::vector<VectorXd> measured = poses_of(measurements.tool);
  std::vector<VectorXd> at_45 = measured;
  for (VectorXd& q : at_45) q.tail<3>().setConstant(45 * kDegree);
  const double wire = study.wire_noise, wire_rotation = wire / 0.5;
  return {{"six of table 6", "wire", measured, Instrument::kWire, wire, 0.0},
          {"nine of table 13", "wire", measurements.outside, Instrument::kWire, wire, 0.0},
          {"six of table 6", "whole", measured, Instrument::kWhole, wire, wire_rotation},
          {"nine of table 13", "whole", measurements.outside, Instrument::kWhole, wire, wire_rotation},
          {"six of table 6, wrist at 45°", "whole", at_45, Instrument::kWhole, wire, wire_rotation},
          {"ten in the zones", "tracker", poses_in_zones(10, 1), Instrument::kWhole, study.tracker_noise,
           study.tracker_rotation},
          {"ten with 1/k_F below 0.1", "tracker", poses_between(kinematics, length, 0.01, 0.1, 10, 2),
           Instrument::kWhole, study.tracker_noise, study.tracker_rotation},
          {"ten with 1/k_F below 0.02", "tracker", poses_between(kinematics, length, 0.002, 0.02, 10, 3),
           Instrument::kWhole, study.tracker_noise, study.tracker_rotation}};
}

/// Nominal readings of the wire in which causes are to be found.
struct Readings {
  std::vector<stiffness::LoadedPose> poses;
  double Power::*share;
};

std::vector<Readings> readings_of(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                                  double wire, double length) {
  const auto with_wire = [&](const std::vector<VectorXd>& poses) {
    return loaded_with(kinematics, poses, Instrument::kWire, wire, 0.0, length);
  };
  return {{with_wire(poses_of(measurements.tool)), &Power::at_six},
          {with_wire(poses_in_zones(12, 7)), &Power::at_twelve},
          {with_wire(poses_in_zones(20, 8)), &Power::at_twenty}};
}

}  // namespace

SimulationStudy study_simulation(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                                 const StiffnessStudy& stiffness, double length, int seeds,
                                 const std::function<void(double)>& progress) {
  SimulationStudy study;
  study.wire_noise = stiffness.two.repeatability;
  study.unexplained = stiffness.two.fit_rms * std::sqrt(6.0 / 4.0);  // six readings, two unknowns
  study.draws = 15 * seeds;
  study.power_draws = std::max(10, seeds / 2);
  const VectorXd& truth = stiffness.truth;
  const std::vector<Case> cases = cases_of(kinematics, measurements, study, length);
  const std::vector<Readings> readings = readings_of(kinematics, measurements, study.wire_noise, length);
  const std::vector<stiffness::StiffnessEffect> effects =
      stiffness::known_stiffness_effects(kinematics.robot());
  for (const Cause& cause : causes()) study.powers.push_back({cause.id, cause.size});

  study.precisions.resize(cases.size());
  const std::size_t powers = causes().size() * readings.size();
  host::for_each_parallel(
      cases.size() + powers + 2,
      [&](std::size_t job) {
        if (job < powers) {
          const Readings& r = readings[job % readings.size()];
          const std::size_t cause = job / readings.size();
          study.powers[cause].*r.share =
              share_named(kinematics, r.poses, effects, causes()[cause], truth, length, study.power_draws);
        } else if (job < powers + cases.size()) {
          study.precisions[job - powers] =
              precision_of(kinematics, cases[job - powers], truth, length, study.draws);
        } else if (job == powers + cases.size()) {
          study.plans = plans_of(kinematics, study, truth, length);
        } else {
          study.singles = single_poses(kinematics, study, truth, length);
        }
      },
      progress);
  return study;
}

}  // namespace heft::studies
