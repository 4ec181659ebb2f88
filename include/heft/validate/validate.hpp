/// @file
/// How well does a model predict the torque of logs that it has not seen?
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/judgement.hpp"
#include "heft/validate/predict.hpp"
#include "heft/validate/score.hpp"
#include "heft/validate/torque_trace.hpp"

namespace heft::validate {

struct Options {
  double band{
      0.0};  ///< low-pass for the figures in band [Hz]; 0: that of the fit, else chosen from the motion
  /// What is known against the torque of the logs before (heft/plausibility); goes into the judgement.
  host::Judgement torque{};
  bool traces{false};   ///< keep torque over time, for plots
  std::string model{};  ///< path of the model file; empty: the parameters come from a URDF
  std::string urdf{};   ///< name of that URDF, for words
  std::function<void(const std::string& log, double done)> progress{};  ///< done within 0..1; may be empty
};

/// A model judged.
struct Validation {
  model::Robot robot;                   ///< whose joint torque was compared, see model::as_measured()
  std::string model, urdf;              ///< as in Options
  std::optional<model::FitRecord> fit;  ///< of the model file; none: the parameters of a URDF
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  std::vector<data::StreamSummary> logs;  ///< judged on
  std::vector<Score> scores;              ///< one a log
  Score all;                              ///< the scores pooled
  std::vector<TorqueTrace> traces;        ///< one a log, if asked for
  /// The largest error of a joint, in band where there is one [% of its largest torque], and where it is.
  double worst_percent{0.0};
  int worst_joint{0};  ///< counted from 0
  std::string worst_log;
  bool physically_consistent{true};  ///< see model::is_physically_consistent
  std::vector<Criterion> criteria;   ///< the acceptance criteria; logs alone decide the prediction
  host::Judgement judgement;
  std::vector<std::string> notes;

  /// The criterion that logs can show.
  const Criterion& prediction() const;
  /// Whether the judgement is not bad.
  bool usable() const { return judgement.usable(); }
};

/// Judges a robot's parameters on all logs of LogSet::judge.
/// @param robot  as it was fitted; where the torque was measured is taken care of
/// @param fit    of the model file that its parameters come from: friction at low speed is judged behind the same
///               low-pass and with the same sign as it was fitted; null: parameters of a URDF
/// @param fitted_to  logs that the parameters were fitted to, as Provenance names them
/// @throws DataError when a log to judge on is one of those or shares samples with one, or has no torque
Validation validate(const model::Robot& robot, const model::FitRecord* fit,
                    const std::vector<std::string>& fitted_to, const data::LogSet& logs,
                    const Options& options = {});
/// Judges a model file on logs of a robot.
/// @throws ModelError when the file does not belong to the robot
Validation validate(const model::ModelFile& file, const model::Robot& robot, const data::LogSet& logs,
                    const Options& options = {});

}  // namespace heft::validate
