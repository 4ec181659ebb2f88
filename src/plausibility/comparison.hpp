/// @file
/// The likelihood of a log's torque under a robot, and its gain when a contradiction is undone.
#pragma once

#include <array>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "joint_moments.hpp"
#include "samples.hpp"

namespace heft::plausibility {

/// Columns of two joints that may be interchanged.
enum class Columns { kTorque, kPosition, kBoth };

/// A contradiction to undo, with the gain of the likelihood.
struct Hypothesis {
  Contradiction kind{Contradiction::kSign};
  int joint{-1}, other{-1};
  double value{0.0};                  ///< kZero: to be added to q [rad]
  std::array<double, 3> gravity{};    ///< kGravity: in the base frame [m/s²]
  double gain{0.0};                   ///< fall of minus twice the log-likelihood
  Columns columns{Columns::kTorque};  ///< kInterchanged
};

/// A joint's moments for every joint of a robot.
std::vector<JointMoments> moments_of(const model::Robot& robot, const Samples& samples);

class Comparison {
 public:
  Comparison(const model::Robot& robot, Samples samples);

  int num_joints() const { return static_cast<int>(given_.size()); }
  const JointMoments& joint(int j) const { return given_[static_cast<std::size_t>(j)]; }
  /// The torque never changes: nothing to compare.
  bool dead(int j) const { return dead_[static_cast<std::size_t>(j)]; }
  /// Torque of that size may be a sensor's zero error: 1 % of the effort limit, or 2 % of the arm's largest [N·m, N].
  double floor(int j) const { return floor_[j]; }
  double torque_rms(int j) const { return rms_[j]; }
  double free_residual(int j) const { return residual_[j]; }
  /// Sum over joints of minus twice the log-likelihood, as the robot is given.
  double misfit() const;
  std::pair<double, double> slope(int j) const { return slope_of(given_, j); }

  std::vector<Hypothesis> signs() const;
  /// Torques of any two joints; positions, or all columns, of neighbours.
  std::vector<Hypothesis> interchanges() const;
  std::vector<Hypothesis> zeros() const;
  std::vector<Hypothesis> gravities() const;
  /// Largest gain with the base some degrees off level, as no description has it.
  double gain_of_tilt() const;
  /// The arm without weight. Joints whose weight changes along the log show whether the torque holds any.
  struct Weightless {
    double gain{0.0};
    struct Joint {
      int joint{0};
      double share{0.0};  ///< of the change of its weight in the measured torque, parameters free
      double rise{1.0};   ///< of the free residual without gravity
    };
    std::vector<Joint> joints;
  };
  Weightless weightless() const;
  /// Gain and slopes under another robot.
  struct Other {
    double gain{0.0};
    std::vector<std::pair<double, double>> slopes;
  };
  Other under(const model::Robot& other) const;

 private:
  double offset(const JointMoments& moments, int torque) const;
  double noise(int torque, std::initializer_list<double> residuals) const;
  std::pair<double, double> slope_of(const std::vector<JointMoments>& moments, int j) const;
  /// @param torques  the torque that each joint is compared with; empty: its own
  double gain_of(const std::vector<JointMoments>& moments, const std::vector<int>& torques = {}) const;
  /// @param gravity  in the base frame [m/s²]
  double gain_under(const Eigen::Vector3d& gravity) const;

  model::Robot robot_;
  Samples samples_;
  std::vector<JointMoments> given_;
  std::vector<bool> dead_;
  Eigen::VectorXd rms_, floor_, residual_;
};

}  // namespace heft::plausibility
