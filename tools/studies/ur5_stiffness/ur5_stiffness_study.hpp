/// @file
/// The computations behind heft reproduce ur5-stiffness: UPC-ETSEIB (2017) on its own numbers. Numbers in brackets are
/// its equations; full citation: urdf/ur5-stiffness/README.md.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/data/deflections.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/stiffness/cartesian_stiffness.hpp"
#include "heft/stiffness/deflection_fit.hpp"
#include "heft/stiffness/dexterity.hpp"
#include "heft/stiffness/stiffness_effects.hpp"
#include "ur5_dh_table.hpp"

namespace heft::studies {

/// One column of tables 7 to 12 and 14 to 19 [mm].
struct PrintedReading {
  int table{0}, pose{0}, repeat{0};
  double unloaded{0.0}, loaded{0.0};
  double printed{0.0};  ///< the deflection as the table has it
  double difference() const { return unloaded - loaded; }
};

/// What was measured, as it comes with heft.
struct Ur5Measurements {
  std::vector<data::Deflection> tool;        ///< displacement of the tool point, 36 rows
  std::vector<data::Deflection> cantilever;  ///< of the end of the cantilever, 36 rows
  std::vector<PrintedReading> printed;       ///< both, 72
  std::vector<Eigen::VectorXd> outside;      ///< table 13, nine poses [rad]
};

/// @throws DataError when a file is not there or not as it should be
Ur5Measurements read_ur5_measurements();

/// How far the arm reaches.
struct ReachStudy {
  Eigen::VectorXd pose;               ///< whose distance is published as the reach
  double distance{0.0}, height{0.0};  ///< of the tip there, from the base's origin [m]
  double slope{0.0};                  ///< largest derivative of the distance there [m/rad]
  double curvature{0.0};         ///< largest second derivative there [m/rad²]: above zero, so no maximum
  stiffness::PoseValue maximum;  ///< [m]
  double turned_wrist{0.0};      ///< distance with the fifth joint at 180° [m]
  double ratio{0.0}, printed_ratio{0.8488}, turned_ratio{0.0};  ///< 850 mm over these distances
  /// Largest difference of the distance from the base to heft's own ur5, over poses [m].
  double urdf_distance{0.0};
  double planar_arm{0.0};  ///< largest relative error of (71), (77), (81) on a planar arm of two joints
};

/// A zone of table 5, and what the map says about it. Angles in degrees.
struct ZoneMatch {
  std::string name;
  std::array<double, 4> printed{};          ///< θ2 from, to, θ3 from, to
  std::array<double, 4> found{};            ///< of the region of the map that covers most of it
  double overlap{0.0};                      ///< common area over joint area of the two rectangles
  double low{0.0}, median{0.0}, high{0.0};  ///< 1/k_F in the printed zone, lengths as printed
  double best{0.0};                         ///< with a sound length
};

/// 1/k_F at a pose.
struct PoseDexterity {
  std::string name;
  double as_printed{0.0};  ///< lengths in mm over L = 0.8488
  double sound{0.0};       ///< with a length in metres
  bool measured{false};
  bool in_zone{false};  ///< θ2 and θ3 are in a zone of table 5, turns taken off
};

struct DexterityStudy {
  stiffness::DexterityMap as_printed, sound;
  double threshold{0.0035};  ///< from where the text calls values high
  std::vector<stiffness::DexterityZone> zones;
  double matching_threshold{0.0};  ///< with which the zones are most like table 5
  std::vector<ZoneMatch> matches;
  /// Share of the high places of `as_printed` that are among as many highest of `sound`.
  double zones_that_stay{0.0};
  double length{0.0};  ///< root mean square distance of the axes over the measured poses [m]
  stiffness::CharacteristicLength least;  ///< with the least condition number over all poses
  double in_metres{0.0};                  ///< largest 1/k_F of the map with L = 0.8488 m
  double straight{0.0}, folded{0.0};      ///< largest 1/k_F of the map where θ3 is 0° and 180°
  double share_called_bad{0.0};           ///< of the map with 1/k_F in 0.001 to 0.005, "low" by the text
  double share_called_good{0.0};          ///< in 0.0035 to 0.005, "high" by the text
  std::vector<PoseDexterity> poses;       ///< six of table 6, nine of table 13
};

struct StiffnessStudy {
  std::vector<stiffness::LoadedPose> tool, both;
  double length{0.0};           ///< that a radian counts as [m]
  stiffness::StiffnessFit own;  ///< every joint its own, readings at the tool
  stiffness::StiffnessFit two;  ///< joints 1 to 3 and 4 to 6 have gears of one size each
  stiffness::StiffnessFit two_both;
  stiffness::StiffnessFit zeros;  ///< every joint its own, what was not read counted as read and zero
  struct LeftOut {
    std::string pose;
    std::array<double, 6> own{};  ///< compliance of each joint [rad/(N m)], NaN: not determined
    std::array<double, 2> two{};
  };
  std::vector<LeftOut> left_out;
  stiffness::DirectStiffness direct;
  int direct_negative{0};  ///< of its values
  stiffness::StiffnessDiagnosis of_own, of_tool, of_both;
  std::vector<std::string> unseen_at_tool, unseen_in_both;  ///< effects that move none of the readings
  /// Compliances of the two sizes, the truth of all simulations.
  Eigen::VectorXd truth;
  stiffness::CartesianStiffness cartesian;  ///< at pose 3 with that truth
  stiffness::PrincipalDeflections principal;
};

/// How well a set of poses and an instrument determine the joints. Spreads are half the width that holds the middle 68 % of
/// all draws, over the true value.
struct Precision {
  std::string poses, instrument;
  int count{0};
  double least_dexterity{0.0}, most_dexterity{0.0};
  std::array<double, 6> least_squares{};  ///< infinite: the joint cannot be seen
  std::array<double, 6> direct{};         ///< NaN: the method needs what was not read
};

/// One simulated pose, whole deflection read.
struct SinglePose {
  double dexterity{0.0};
  bool in_zone{false};
  double error{0.0};  ///< median over the joints of the relative standard deviation of the compliance
};

/// Poses chosen to be measured, and what they would give.
struct Plan {
  std::string instrument;
  int poses{0};
  double least_dexterity{0.0};
  std::array<double, 6> half_width{};  ///< of the 95 % interval over the value; infinite: not seen
};

/// Had this been the cause: how often it would have been found and named.
struct Power {
  std::string effect, size;
  double at_six{0.0}, at_twelve{0.0}, at_twenty{0.0};  ///< shares of the draws
};

struct SimulationStudy {
  double wire_noise{0.0};   ///< standard deviation of a mean of six readings [m]
  double unexplained{0.0};  ///< standard deviation of what the six poses leave [m]
  double tracker_noise{0.01e-3}, tracker_rotation{0.03e-3};  ///< [m], [rad]
  int draws{0};
  std::vector<Precision> precisions;
  std::vector<SinglePose> singles;
  std::vector<Plan> plans;
  std::vector<Power> powers;
  int power_draws{0};
};

/// A published claim that the published numbers do not support.
struct Fault {
  std::string id;     ///< short, for machines
  std::string kind;   ///< "result", "data" or "slip"
  std::string where;  ///< section, equation or table
  std::string says;   ///< in our words
  std::string found;  ///< the evidence, with numbers
  std::vector<double> values;
  bool confirmed{true};  ///< the evidence supports it
};

struct Ur5Study {
  Ur5Measurements measurements;
  ReachStudy reach;
  DexterityStudy dexterity;
  StiffnessStudy stiffness;
  SimulationStudy simulation;
  std::vector<Fault> faults;
  std::string verdict;
};

ReachStudy study_reach(const model::Kinematics& kinematics);
DexterityStudy study_dexterity(const model::Kinematics& kinematics, const Ur5Measurements& measurements);
StiffnessStudy study_stiffness(const model::Kinematics& kinematics, const Ur5Measurements& measurements);
/// @param seeds     draws are a multiple of it
/// @param progress  share done, from the calling thread; may be empty
SimulationStudy study_simulation(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                                 const StiffnessStudy& stiffness, double length, int seeds,
                                 const std::function<void(double)>& progress);
/// Looks for the contradictions with the measurements' own numbers.
std::vector<Fault> find_faults(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                               const ReachStudy& reach, const DexterityStudy& dexterity,
                               const StiffnessStudy& stiffness);
/// Everything; seconds.
Ur5Study run_ur5_study(int seeds, const std::function<void(double)>& progress = {});

}  // namespace heft::studies
