/// @file
/// Core's estimator of a load behind the causal filters, for as many joints as a robot has at run time.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "causal_signals.hpp"
#include "heft/core/status.hpp"
#include "heft/data/log.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::payload {

struct RecursionSettings {
  int first_row{0};
  Eigen::VectorXd noise_std;
  double correlated_samples{1.0};
  double gate{0.0}, standstill_speed{0.0}, friction_prior{1.0};
  bool estimate_friction{true};
  Eigen::VectorXd drive_scale;  ///< n: measured torque in parts of the true one
};

/// What one sample said, n each.
struct Innovation {
  Eigen::VectorXd residual;  ///< torque that the model does not explain, before the load
  Eigen::VectorXd value;
  Eigen::VectorXd variance;  ///< 0 where the row was left out
  std::vector<bool> used;
};

/// Filters and recursive estimator, whose sizes are fixed, behind sizes of run time.
class Recursion {
 public:
  virtual ~Recursion() = default;
  virtual Status configure(const RecursionSettings& settings) = 0;
  virtual void restart() = 0;
  /// Row k of the log through the filters.
  virtual Taken take(const data::Log& log, Eigen::Index k) = 0;
  /// Lets the estimator have the sample taken. @param x  parameters of the arm alone, 14n
  virtual Status update(const Eigen::VectorXd& x, Innovation& out) = 0;
  /// The sample's row of joint i for the estimator's parameters, and for those of the arm.
  virtual Eigen::VectorXd row(int i) const = 0;
  virtual Eigen::VectorXd arm_row(int i) const = 0;
  virtual double prior_variance(int i) const = 0;
  virtual double mass() const = 0;
  virtual double mass_std() const = 0;
};

/// @param dynamics     of the unloaded arm; must outlive the recursion
/// @param cutoff       of the causal low-pass [Hz]
/// @param sample_rate  [Hz]
std::unique_ptr<Recursion> make_recursion(const model::Dynamics& dynamics, double cutoff, double sample_rate);

}  // namespace heft::payload
