/// @file
/// Simulated cases of a robot with an effect that its model does not declare: what diagnosis has to find.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"

namespace heft::test {

/// A force at the tool in the world frame, with flanks of 60 ms.
struct ContactEvent {
  double start;     ///< [s]
  double duration;  ///< [s]
  Eigen::Vector3d force;
};

/// What was put into a case.
struct UndeclaredEffect {
  std::string kind;     ///< id, or "outside:..."
  int joint{-1};        ///< counted from 0; −1 where it has none
  std::string variant;  ///< "bias", "asymmetric", "picked_up", "dropped" or empty
  std::map<std::string, double> parameters;
  std::vector<double> com;           ///< of a payload, in the last link frame [m]
  std::vector<ContactEvent> events;  ///< of contacts
  int main_joint{0};                 ///< where it shows most
};

/// A case: what a diagnosis is given, and the truth.
struct UndeclaredCase {
  std::string name;
  std::string arm;
  std::string kind;  ///< of the first effect; "none"; "outside"
  double rate{500.0};
  bool has_qd{false};
  std::string urdf;           ///< text of the nominal robot
  model::Robot robot;         ///< nominal: inertials 10-25 % off, no friction
  data::Log train, validate;  ///< time, q, tau and with has_qd qd
  model::Robot truth;         ///< true inertials and declared friction
  model::Robot complete;      ///< truth with the effects that a robot can hold: no payload change, no contact
  std::vector<UndeclaredEffect> effects;
  Eigen::VectorXd noise;        ///< standard deviation of the torque noise [N·m, N]
  Eigen::VectorXd noise_floor;  ///< RMS of noise and rounding in the validation log
  /// RMSE of rigid body + Coulomb + viscous on the two logs, fitted by weighted least squares to the
  /// training log with the exact motion; what an exact differentiation would leave.
  Eigen::VectorXd baseline_train, baseline_validate;
  /// sqrt(baseline² − noise_floor²) / noise_floor per joint, on the validation log and on the training log.
  Eigen::VectorXd excess, excess_train;
};

/// The fifteen ids in alphabetical order.
const std::vector<std::string>& undeclared_kinds();
/// "outside:vibrating_base", ...
const std::vector<std::string>& outside_kinds();
/// Names of the arms: scara4, arm6, arm7.
const std::vector<std::string>& undeclared_arms();

/// How the arm of a case moves; both its logs alike.
enum class CaseMotion {
  kExciting,  ///< Fourier paths at full and at crawling speed, in some cases with brisk moves
  kWork       ///< from pose to pose with rests, each log with poses of its own
};

/// Makes a case. The same arguments give the same case. Takes seconds.
/// @param kind  an id, "none", an outside kind, or several ids with a plus between ("stribeck+spring")
/// @param arm   scara4 (joint 3 prismatic), arm6 or arm7
/// @throws std::invalid_argument for a name that does not exist, for wrist_coupling on scara4, and where other effects have
/// left no joint, and for a base that moves where the arm is not on the floor.
/// @param gravity  in the frame of the base: how the arm is mounted [m/s²]
UndeclaredCase make_undeclared_case(const std::string& kind, const std::string& arm, std::uint64_t seed,
                                    CaseMotion motion = CaseMotion::kExciting,
                                    const std::array<double, 3>& gravity = {0.0, 0.0, -9.81});

}  // namespace heft::test
