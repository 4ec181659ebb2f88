/// @file
/// How well a pose carries motion and force through the joints, and which poses to measure at.
///
/// Source: UPC-ETSEIB (2017), "Experimental identification of the joints stiffness of the UR5 robot arm", sections
/// 2.2.3.3 and 3.2.1, whose equation numbers are given at the functions.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "heft/model/kinematics.hpp"

namespace heft::stiffness {

/// J_N = diag(1/L E, E) J (93): the rows of the tip's velocity over a length, so that all six have one unit.
/// @param J  6 × n
/// @param L  [m] (the unit of J's lengths), positive
Eigen::MatrixXd normalised_jacobian(const Eigen::MatrixXd& J, double L);

/// Condition number of the Frobenius norm k_F = (1/m) √(tr(M Mᵀ) tr((M Mᵀ)⁻¹)) (94), m the smaller of rows
/// and columns; with fewer columns than rows Mᵀ M takes the place of M Mᵀ. 1 for an isotropic matrix,
/// infinite for one that is singular to thirteen digits. ((94) has MᵀM throughout, which for a
/// redundant arm is always singular; for six joints both are the same.)
double frobenius_condition(const Eigen::MatrixXd& M);

/// 1 / k_F of the normalised Jacobian, in [0, 1]; 0 where it is singular.
double dexterity(const Eigen::MatrixXd& J, double L);

/// The normalising length R / R̄ of (104): reach stated by the maker over maximum reach of the model. A
/// ratio without unit, used there as if it were metres (with lengths of J in millimetres); it is kept to
/// rebuild the maps published with it.
double reach_ratio_length(double stated_reach, double maximum_reach);

/// Root mean square of the distances of the joint axes from the tip point (101) [m], over the revolute
/// joints: the characteristic length of the pose. ((100) and (101) as printed lack the square of the norm.)
/// @param J  6 × n geometric Jacobian; 0 where no joint is revolute
double rms_axis_distance(const Eigen::MatrixXd& J);

/// The length with which k_F of this pose is least [m]. Closed form where J has full row rank (then
/// tr(J_N J_Nᵀ) = a/L² + b, tr((J_N J_Nᵀ)⁻¹) = c L² + d, L⁴ = a d / (b c)), a search for arms of fewer than
/// six joints; NaN where J is singular, or has no rotation or no translation to weigh against each other.
double least_condition_length(const Eigen::MatrixXd& J);

/// Settings of a search over all poses. Deterministic: the same seed, the same answer.
struct PoseSearch {
  int starts{24};  ///< random poses to begin from, inside the limits
  std::uint32_t seed{1};
  bool keep_limits{true};  ///< a revolute joint without finite limits has one turn, ±π; without this all have
};

/// A pose and what was sought there.
struct PoseValue {
  double value{0.0};
  Eigen::VectorXd q;
};

/// Largest distance of the tip point from a point of the first axis, over all poses (102) [m], by coordinate
/// search from many random starts with refinement to 1e-10 of the reach.
///
/// Section 3.2.1 has this maximum global by the convexity of the norm. It is not: the norm is convex in
/// the position, not in the joint angles, and its pose is a stationary point that others exceed.
///
/// @param from  the point, in the base frame [m]
/// @throws InputError when a prismatic joint has no finite limits: reach is then unbounded
PoseValue maximum_reach(const model::Kinematics& kinematics, const Eigen::Vector3d& from,
                        const PoseSearch& search = {});
/// The same from the base frame's origin, where a DH table has its first axis.
PoseValue maximum_reach(const model::Kinematics& kinematics, const PoseSearch& search = {});

/// The arm's characteristic length: the length with which k_F is least over all lengths and poses [m], with
/// the pose.
struct CharacteristicLength {
  double length{0.0};     ///< NaN where no pose has one
  double condition{0.0};  ///< k_F there; 1 when the arm can be isotropic
  Eigen::VectorXd q;
};
CharacteristicLength characteristic_length(const model::Kinematics& kinematics,
                                           const PoseSearch& search = {});

/// One side of a map.
struct MapAxis {
  int joint{0};      ///< counted from 0
  double from{0.0};  ///< [rad, m]
  double to{0.0};    ///< > from; a revolute joint's whole turn wraps around, and `to` is then left out
  int steps{181};    ///< number of values, at least 2
};

/// 1 / k_F over two joints with all others held.
struct DexterityMap {
  MapAxis first, second;
  Eigen::VectorXd q;                             ///< the others, n
  double length{1.0};                            ///< L [m]
  bool first_wraps{false}, second_wraps{false};  ///< the side is a whole turn
  Eigen::VectorXd first_values, second_values;   ///< [rad, m]
  Eigen::MatrixXd dexterity;                     ///< rows along `first`, columns along `second`
};

/// @param q  n; entries of the two joints are not used
/// @throws InputError on joints that do not exist or are the same, an empty side, or a length that is not
///         positive
DexterityMap dexterity_map(const model::Kinematics& kinematics, const Eigen::VectorXd& q,
                           const MapAxis& first, const MapAxis& second, double length);

/// A connected region of a map at or above a threshold.
struct DexterityZone {
  /// The smallest rectangle around it. Low ends lie inside the map, a high end goes on beyond the map's where
  /// the zone wraps around [rad, m].
  double first_low{0.0}, first_high{0.0}, second_low{0.0}, second_high{0.0};
  int points{0};      ///< grid points in it
  double share{0.0};  ///< of the map's points
  double best{0.0};   ///< largest 1 / k_F
  Eigen::VectorXd q;  ///< the pose that has it, n
};

/// Regions of grid points at or above `threshold` (neighbours along the two sides, a whole turn closes), the
/// one with the best pose first.
std::vector<DexterityZone> zones(const DexterityMap& map, double threshold);

/// Rows of the compliance regression A x = δd (109): A_rj = J_rj (J_jᵀ w) (110), D A for the directions
/// measured.
/// @param J           6 × n
/// @param wrench      in the frame of J [N, N·m]
/// @param directions  r × 6 in the frame of J: each row picks one displacement; identity for a full pose, [u
///                    0] for a wire along u
/// @return r × n
Eigen::MatrixXd compliance_rows(const Eigen::MatrixXd& J, const Eigen::Matrix<double, 6, 1>& wrench,
                                const Eigen::MatrixXd& directions);

/// A pose that could be measured.
struct PoseCandidate {
  Eigen::VectorXd q;      ///< n
  Eigen::MatrixXd rows;   ///< r × p rows of the regression it would add, each over its standard deviation
  double dexterity{1.0};  ///< 1 / k_F
};

/// Poses spread evenly at random over the robot's joint limits (a revolute joint without limits: one turn),
/// with their dexterity.
/// @param rows  called with each pose; r × p rows over their standard deviations. An empty answer leaves the
///              pose out.
/// @throws InputError when a prismatic joint has no finite limits
std::vector<PoseCandidate> pose_candidates(
    const model::Kinematics& kinematics, double length, int count,
    const std::function<Eigen::MatrixXd(const Eigen::VectorXd& q)>& rows, std::uint32_t seed = 1);

/// Poses chosen to be measured.
struct PoseChoice {
  std::vector<int> chosen;      ///< indices of the candidates
  Eigen::MatrixXd information;  ///< Σ rowsᵀ rows, p × p
  double log_determinant{0.0};  ///< of the information
  int exchanges{0};             ///< poses changed on the way from where the search began
};

/// The `count` poses among the candidates with which the compliances are known best, in the sense of the
/// largest determinant of the information Σ rowsᵀ rows (D-optimal; the units of the compliances do not
/// matter). Exchange of one pose at a time until none helps, from the greedy choice and from seven at random;
/// no pose is taken twice. Cost: about 8 · passes · count · candidates determinants of r × r, a second for 10
/// of 2000 poses.
///
/// @param least_dexterity  candidates with a smaller 1 / k_F are not taken: there K_C and errors of the
///                         kinematics count most
/// @throws InputError when fewer candidates than `count` are left; NotIdentifiableError when no choice of
///         `count` of them determines all p, naming the columns that stay open (a column twelve digits below
///         the largest counts as rounding)
PoseChoice choose_poses(const std::vector<PoseCandidate>& candidates, int count,
                        double least_dexterity = 0.0);

}  // namespace heft::stiffness
