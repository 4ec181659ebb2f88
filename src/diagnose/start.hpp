/// @file
/// What a diagnosis starts from: the arm without effects, the cut-off, the logs along it and the first fit.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "motion_scores.hpp"

namespace heft::diagnose {

struct Start {
  model::Robot given;  ///< as it came
  model::Robot robot;  ///< of it rigid bodies, Coulomb and viscous friction: what a search begins with
  model::Robot own;    ///< of it what the written model has without an effect
  std::vector<GearCoupling<double>> pairs;  ///< of joints that may share a motor
  double cutoff{0.0};  ///< of the low-pass on q, the lowest of all joints; what a model file can hold [Hz]
  Eigen::VectorXd cutoffs;  ///< n: of the low-pass on each joint's position, for the search [Hz]
  double band{0.0};         ///< of the figures in band [Hz]
  std::shared_ptr<const JudgedMotion> train, judged;  ///< a cut-off for each joint
  /// The same logs with one cut-off for all joints, as they are read for a model file that holds it.
  std::shared_ptr<const JudgedMotion> train_as_filed, judged_as_filed;
  /// Σ over joints of ln(rms error) without effects, by the cut-off tried [Hz]; empty where one was asked for.
  std::map<double, double> residual_behind;
  std::unique_ptr<Engine> engine;  ///< fit without effects
  std::vector<std::string> notes;

  bool one_cutoff() const { return cutoffs.minCoeff() == cutoffs.maxCoeff(); }
};

/// Work on the same logs that waits for nothing in a start.
using Beside = std::vector<std::function<void(const Start&)>>;

/// @param beside  done at the same time; of the start it sees what it is given as it comes: `given`, `robot`, `own`, `pairs`
/// @param identified    what identify makes of the training logs; may be a result of `beside`
/// @param least_cutoff  for all joints [Hz]
/// @throws DataError, NotIdentifiableError
Start start_of(const model::Robot& robot, const std::vector<data::Log>& train,
               const std::vector<data::Log>& validate, const DiagnoseOptions& options,
               const Beside& beside, const model::Robot& identified, double least_cutoff = 0.0);

}  // namespace heft::diagnose
