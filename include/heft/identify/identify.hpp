/// @file
/// What are the arm's parameters? A model fitted to logs and judged on logs that the fit has not seen.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/score.hpp"
#include "heft/validate/torque_trace.hpp"

namespace heft::identify {

struct Options {
  /// Method, structure, instruments. The rotor inertia is left out where the torque was measured behind the gears, and
  /// the cut-off is that of the LogSet.
  FitOptions fit{};
  double band{0.0};    ///< low-pass for the figures in band [Hz]; 0: chosen from the motion
  bool traces{false};  ///< keep torque over time, for plots
  /// What is known against the torque of the logs before (heft/plausibility); goes into the judgement.
  host::Judgement torque{};
  std::function<void(const std::string& what, double done)> progress{};  ///< done within 0..1; may be empty
};

/// A model with what speaks for and against it.
struct Identification {
  Fit fit;
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  std::vector<std::string> log_paths;                       ///< given to fit to
  std::vector<data::StreamSummary> train_logs, judge_logs;  ///< as used: two parts where one log was split
  std::vector<validate::Score> train, held_out;             ///< one a log; held_out may be empty
  validate::Score trained;                                  ///< `train` pooled
  std::vector<validate::TorqueTrace> train_traces, held_out_traces;  ///< one a log, if asked for
  model::MassMatrixCheck mass;                                       ///< of the fitted arm in random poses
  std::string how;  ///< what was judged on, as in LogSet::how
  host::Judgement judgement;
  std::vector<std::string> notes;  ///< about the logs; those of the fit are in fit.notes

  /// Whether the judgement is not bad: determined enough, and no worse than stated limits on unseen logs.
  bool usable() const { return judgement.usable(); }
  /// What the model file keeps of the fit.
  model::FitRecord record() const;
  /// The model with standard deviations, the record of the fit, its logs and its notes.
  model::ModelFile model_file() const;
};

/// Fits a model to LogSet::train and judges it on LogSet::judge.
/// @param robot  kinematics, and the prior for what the logs leave open
/// @throws NotIdentifiableError, DataError as fit() does
Identification identify(const model::Robot& robot, const data::LogSet& logs, const Options& options = {});

}  // namespace heft::identify
