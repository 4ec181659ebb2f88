/// @file
/// How the arm effects are found: one file each under effects/.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "candidates.hpp"
#include "heft/core/effects/arm_effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/parallel.hpp"

namespace heft::diagnose {

/// What a diagnosis does with an arm effect.
struct ArmSearch {
  /// Candidates, judged.
  /// @param joints  n: where an effect that sits in one joint is tried; the others do not look at it
  std::vector<Candidate> (*propose)(const Workbench& bench, const std::vector<bool>& joints);
  /// Puts what was fitted into a robot.
  /// @param c  coefficients of the effect's columns
  void (*apply)(const Candidate& effect, const Eigen::VectorXd& c, model::Robot& robot);
  /// Fills in the finding's parameters, words and events.
  /// @param robot  the fitted one, with the effect
  void (*describe)(const Candidate& effect, const Eigen::VectorXd& c, const model::Robot& robot,
                   Finding& finding);
};

// A new entry of ArmEffectTypes needs its line here and its file.
ArmSearch search_of(ElasticJoint);
ArmSearch search_of(Delay);
ArmSearch search_of(BaseTilt);
ArmSearch search_of(PayloadChange);
ArmSearch search_of(WristCoupling);
ArmSearch search_of(Cable);
ArmSearch search_of(Contact);

/// Springs of two joints as one candidate, whose parts they are: joints that share inertia swing together, and a spring that is
/// sought alone stands in for that of the other one.
/// @param first   the spring of one joint, found alone
/// @param others  n: joints that may have the second one
std::vector<Candidate> spring_pairs(const Workbench& bench, const Candidate& first, const std::vector<bool>& others);

/// Another column of a spring's, its motor's inertia, and none of it.
/// @param acceleration  of the motor, m
void append_motor(Columns& columns, int joint, const Eigen::VectorXd& acceleration);
void remove_motor(Columns& columns);
/// A motor's inertia without a spring, not judged yet.
Candidate motor_alone(int joint, const Eigen::VectorXd& acceleration);

/// Time after a change of direction whose rows say nothing about a delay of this size [s].
double delay_reach(double delay);

/// Columns of a tilt with the masses of the present fit, and Candidate::hidden.
void put_tilt_columns(const Workbench& bench, Candidate& tilt);

// For the files under effects/ -----------------------------------------------------------------------------

/// 0, 1, ... n - 1.
std::vector<int> all_joints(int n);

/// Columns of a torque of two joints' sum: it reaches the driven joint whole, the driving one times the ratio.
/// @param torque  m × k
Columns columns_of_pair(const GearCoupling<double>& pair, const Eigen::MatrixXd& torque);

/// @param least  see Problem::judge()
Trial judge(const Workbench& bench, const Candidate& candidate, double least = 0.0);

/// Takes the best of several shapes where it is better than what there is.
/// @param write  (joint, from, values): puts in some rows of a joint's columns, one a shape
/// @return gain of each
template <typename Shapes, typename Write>
std::vector<double> take_best(const Workbench& bench, const Shapes& shapes, const Write& write,
                              typename Shapes::value_type& best, double& best_gain) {
  std::vector<WideMoments> joints(static_cast<std::size_t>(bench.table->num_joints));
  host::for_each_parallel(joints.size(), [&](std::size_t s) {
    const auto j = static_cast<int>(s);
    joints[s] = bench.problem->wide_moments(
        j, static_cast<Eigen::Index>(shapes.size()), 1,
        [&](Eigen::Index from, Eigen::Ref<Eigen::MatrixXd> values) { write(j, from, values); });
  });
  std::vector<double> gains = bench.problem->gains(joints);
  for (std::size_t i = 0; i < gains.size(); ++i) {
    if (gains[i] > best_gain) best_gain = gains[i], best = shapes[i];
  }
  return gains;
}

}  // namespace heft::diagnose
