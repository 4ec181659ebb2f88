/// @file
/// A model from logs: base parameters with intervals that hold, link parameters that reproduce them, and what
/// the logs do not determine.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/weighted_fit.hpp"

namespace heft::identify {

enum class Method {
  kOls,      ///< every joint's rows count alike
  kWls,      ///< rows weighted by the noise of their joint
  kIrls,     ///< weighted, and outliers count less (Huber, then Tukey)
  kIv,       ///< instrumental variables
  kTls,      ///< total least squares: errors in the motion as well as in the torque
  kPhysical  ///< weighted, with physically possible links
};
const char* to_string(Method method);  ///< "ols", "wls", ...

/// Where instruments come from.
enum class Instruments {
  kSimulated,  ///< motion of the fitted model under control along the smoothed motion, iterated
  kDelayed,    ///< the measured motion some time earlier
  kReference   ///< simulated along the commanded positions of the log instead of the smoothed motion
};

struct FitOptions {
  Method method{Method::kWls};
  regression::ModelStructure structure{};
  regression::ObservationOptions observation{0.0, 4.0, 0.0};
  Instruments instruments{Instruments::kSimulated};
  /// kReference: place of the commanded positions among MotionChunk::extra (StreamOptions::extra "qref").
  int reference{0};
  /// Condition number of the weighted, column-scaled base regressor from which on a ridge towards the robot's
  /// own parameters steadies the fit; 0: never.
  double ridge_from_condition{regression::kRidgeFromCondition};
  bool test_bias{true};  ///< run the Durbin-Wu-Hausman test (kWls, kOls): one more pass over the logs
  /// Look for link parameters that reproduce the base parameters; without, `Fit::robot` is the robot as given.
  bool link_parameters{true};
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// Whether plain least squares is biased by noise in the regressor (Durbin-Wu-Hausman).
struct BiasTest {
  double statistic{0.0};  ///< Wald statistic, robust to correlated residuals
  int degrees_of_freedom{0};
  double p_value{1.0};
  bool biased{false};  ///< p below 0.01 and the difference matters for the predicted torque
  /// rms of what the two estimates predict differently, in parts of the residual.
  double torque_difference{0.0};
  std::string verdict;  ///< in words
};

/// A fitted model and how far to trust it.
struct Fit {
  Method method{Method::kWls};
  std::shared_ptr<const regression::RegressionColumns> columns;
  regression::BaseParameters base;

  Eigen::VectorXd beta;          ///< b base parameters
  Eigen::VectorXd std;           ///< b standard deviations, for residuals correlated in time
  Eigen::VectorXd half_width;    ///< b, of the 95 % intervals
  Eigen::MatrixXd covariance;    ///< b × b
  std::vector<bool> determined;  ///< b: by the logs (not by the ridge or the prior)
  Eigen::VectorXd relative;      ///< b: half-width against |value|

  double condition{0.0};           ///< of the weighted base regressor, columns scaled to norm 1
  double condition_unscaled{0.0};  ///< of the same without scaling
  bool ridge{false};               ///< a ridge towards the prior was used
  Eigen::VectorXd noise_std;       ///< n: scatter of the residual behind the low-pass [N·m, N]
  Eigen::VectorXi rows;            ///< n: rows used per joint
  int blocks{0};                   ///< behind the intervals
  double block_length{0.0};        ///< [s]
  double cutoff{0.0};              ///< of torque and columns [Hz]
  long samples{0};                 ///< rows of all logs

  /// Link parameters and actuation that reproduce β. With kPhysical, or where a physical set explains the data
  /// as well, physically possible links; else those nearest to the robot's own.
  model::Robot robot;
  bool physically_consistent{false};  ///< see model::is_physically_consistent
  /// Squared error of the best physical fit over that of the free one; 1: physics costs nothing.
  double physical_cost_ratio{1.0};
  /// Links (from 1) whose inertia in the robot is physically impossible; the nearest possible one was the prior.
  std::vector<int> repaired_prior;
  /// Links (from 1) at the edge of what is physically possible, the one that costs most first.
  std::vector<int> at_boundary;

  std::optional<BiasTest> bias;
  /// What the logs do not determine and the motion that would, one line each; empty: nothing.
  std::vector<std::string> missing;
  std::vector<std::string> notes;

  /// As a model file with the standard deviations of the parameters that are determined by themselves; NaN for those
  /// that are felt only together with others.
  model::ModelFile model_file() const;
};

/// Fits a model.
///
/// Noise in the torque is taken as unknown per joint and correlated in time; intervals are from the block
/// jackknife with Student's t.
///
/// @param robot  kinematics, and the prior for what the data leave open
/// @param logs   at least one
/// @throws NotIdentifiableError when no joint moved, or too few rows are left for the unknowns; the message names
///         the motion to record. DataError when joints do not match or the logs have fewer samples than unknowns.
Fit fit(const model::Robot& robot, const std::vector<const data::MotionStream*>& logs,
        const FitOptions& options = {});

}  // namespace heft::identify
