/// @file
/// What a stiffness model leaves unexplained in measured deflections, and whether something known explains it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/stiffness/deflection_fit.hpp"

namespace heft::stiffness {

/// Something that may act between springs in the joints and the readings of the instrument.
struct StiffnessEffect {
  std::string id;       ///< "sensor_offset"
  std::string meaning;  ///< in a few words
  std::string unit{};   ///< of its parameter; empty without one
  /// The poses as they are if the effect is there with this parameter; empty: as they are.
  std::function<std::vector<LoadedPose>(std::vector<LoadedPose> poses, double parameter)> change{};
  /// Values of the parameter that are tried; empty for an effect without nonlinear parameter.
  std::vector<double> values{};
  /// A further column of the regression, one row a reading; its factor is then the parameter. Empty: none.
  std::function<Eigen::VectorXd(const std::vector<LoadedPose>& poses)> column{};
  bool complementary{false};  ///< with K_C
};

/// The effects known: `complementary` (K_C), `sensor_offset` (a constant in every displacement), `tool_bending` (the
/// bracket that carries load or target turns with the moment on it), `measuring_direction` and `load_direction` (turned
/// about the tool's z axis against what is stated), `load_is_weight` (the force points down, whatever is stated, and
/// the moment keeps its lever), `arm_of_load` (the moment is larger or smaller than stated).
std::vector<StiffnessEffect> known_stiffness_effects(const model::Robot& robot);

/// How the residual goes with a quantity of the pose.
struct ResidualCorrelation {
  std::string with;         ///< "dexterity 1/k_F"
  double coefficient{0.0};  ///< Pearson, over readings
  double p_value{1.0};      ///< by permutation of poses; of this quantity alone
};

/// An effect that was tried.
struct StiffnessTrial {
  std::string id, meaning, unit;
  bool possible{true};       ///< a fit with it exists
  std::string why{};         ///< where it does not: the reason
  double parameter{0.0};     ///< best value; NaN without one
  double fit_rms{0.0};       ///< [m]
  double left_out_rms{0.0};  ///< error on poses left out [m]
  /// That the best of all effects does as well where there is none; by permutation of residuals.
  double p_value{1.0};
};

/// What a closer look at the residual says.
struct StiffnessDiagnosis {
  StiffnessFit before, after;  ///< `after` is `before` when nothing was accepted
  /// Error on poses left out when the mean of the other readings predicts: a model should beat it.
  double mean_rms{0.0};
  std::vector<ResidualCorrelation> correlations;
  std::vector<StiffnessTrial> trials;  ///< smallest error on poses left out first
  int accepted{-1};                    ///< of `trials`
  double smallest_p{1.0};              ///< the smallest p value that these poses can give
  std::string verdict;
};

/// Fits, looks at the residual, tries every effect together with the compliances and judges it by leaving out one pose
/// after the other. An effect is accepted when the error on poses left out falls by a tenth at least and by more than
/// the best of all effects tried does on residuals that are shuffled among the poses (one time in twenty).
///
/// @param options  groups of the base model; `extra` and `complementary` are what the effects set
/// @throws NotIdentifiableError as fit_stiffness
StiffnessDiagnosis diagnose_stiffness(const model::Kinematics& kinematics,
                                      const std::vector<LoadedPose>& poses, const StiffnessOptions& options,
                                      const std::vector<StiffnessEffect>& effects, double length = 1.0);

}  // namespace heft::stiffness
