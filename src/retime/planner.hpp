/// @file
/// Limits of a path as lines in ṡ² and s̈, swept until friction is that of the motion found.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "heft/retime/retime.hpp"
#include "sweep.hpp"

namespace heft::retime {

/// Limits less their margin, n each; infinite: none.
struct JointLimits {
  Eigen::VectorXd velocity, acceleration, torque;
};

/// The joint that comes nearest to a limit.
struct Nearest {
  double use{0.0};  ///< share of the limit
  int joint{0};     ///< 0-based
  Limit limit{Limit::kTorque};
};

/// A motion and what it uses of the limits.
struct Plan {
  Sweep motion;
  Eigen::VectorXd velocity_use, acceleration_use, torque_use;  ///< n
  std::vector<Nearest> nearest;                                ///< in each interval
  double excess{0.0};                                          ///< by which the largest use exceeds 1
  double lowered{0.0};                                         ///< largest share by which a limit was lowered
  double unlowered{0.0};  ///< duration before limits were lowered between the places [s]
  int sweeps{0};
};

/// Shares of limits: by which they are lowered, or exceeded.
struct Cuts {
  Eigen::MatrixXd torque, acceleration;  ///< in each interval, k × n
  Eigen::VectorXd velocity;              ///< at each place, k + 1
};

class Planner {
 public:
  /// All have to outlive the planner.
  Planner(const model::Dynamics& dynamics, const Path& path, const JointLimits& limits);
  /// @throws NotIdentifiableError naming joint and place when no motion keeps the limits
  Plan plan();
  const Eigen::VectorXd& places() const { return s_; }

 private:
  /// The path at one place.
  struct Place {
    Eigen::VectorXd q, dq, ddq;
  };
  Place place_at(double s) const;
  Eigen::VectorXd torque(const Place& place, double x, double u) const;
  void refuse_what_cannot_be_held() const;
  [[noreturn]] void refuse_stop(Eigen::Index at) const;
  /// What velocity limits allow at each place.
  Eigen::VectorXd fastest() const;
  void add_lines(const Place& place, double x, double u, double ahead, Eigen::Index interval,
                 std::vector<Line>& lines) const;
  Intervals intervals(const Eigen::VectorXd& x, const Eigen::VectorXd& u) const;
  /// What the motion uses of the limits at places within every interval; tightens where it is too much.
  void check(Plan& plan);
  void look(Eigen::Index interval, double share, Plan& plan, Cuts& excess) const;

  const model::Dynamics& dynamics_;
  const Path& path_;
  const JointLimits& limits_;
  Eigen::VectorXd s_;
  std::vector<Place> places_;
  double smallest_{0.0};  ///< ṡ² at which friction is taken where the arm rests: it is about to move
  Cuts cuts_;
};

}  // namespace heft::retime
