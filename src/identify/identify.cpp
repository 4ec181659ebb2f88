#include "heft/identify/identify.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "heft/identify/fit_record.hpp"
#include "heft/identify/sums.hpp"
#include "judgement.hpp"
#include "sums_checks.hpp"

namespace heft::identify {
namespace {

/// Poses in which the mass matrix of the identified arm is looked at.
constexpr int kManyPoses = 10000;

using Streams = std::vector<data::MotionStream>;

Streams open(const std::vector<data::LogSource>& sources, const Options& options,
             std::vector<data::StreamSummary>& summaries, std::vector<std::string>& notes) {
  data::StreamOptions streaming;
  if (options.fit.instruments == Instruments::kReference) streaming.extra = {"qref"};
  Streams streams;
  for (const data::LogSource& source : sources) {
    streams.push_back(data::stream(source, streaming));
    summaries.push_back(streams.back().summary());
    notes.insert(notes.end(), summaries.back().notes.begin(), summaries.back().notes.end());
  }
  return streams;
}

/// Scores of each log, with the torque over time where it is wanted.
std::vector<validate::Score> judge_each(const Streams& streams, const model::Robot& robot, double band,
                                        const Options& options, std::vector<validate::TorqueTrace>& traces) {
  std::vector<validate::Score> scores;
  for (const data::MotionStream& stream : streams) {
    validate::ScoreOptions scoring;
    scoring.band = band;
    if (options.progress) {
      scoring.progress = [&](double done) { options.progress("judging " + stream.summary().path, done); };
    }
    if (options.traces) {
      traces.emplace_back(stream.summary().samples, robot.num_joints());
      scoring.rows = [&](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                         const Eigen::MatrixXd& predicted) { traces.back().add(time, measured, predicted); };
    }
    scores.push_back(validate::score(robot, stream, scoring));
  }
  return scores;
}

/// The model as it stands, scored on the logs that can be read.
void judge_model(const Streams& train, const Streams& judged, const Options& options,
                 Identification& result) {
  result.mass = model::check_mass_matrix(result.fit.robot, kManyPoses, 1);
  double band = options.band;
  for (const auto* summaries : {&result.train_logs, &result.judge_logs}) {
    for (const data::StreamSummary& summary : *summaries) {
      if (options.band == 0.0) band = std::max(band, validate::default_band(summary.bandwidth));
    }
  }
  result.train = judge_each(train, result.fit.robot, band, options, result.train_traces);
  result.held_out = judge_each(judged, result.fit.robot, band, options, result.held_out_traces);
  if (!result.train.empty()) result.trained = validate::pool(result.train);
  result.judgement = judge(result.fit, result.mass, result.held_out, result.train);
  result.judgement.add(options.torque);
}

/// What was known against the torque of the logs when the sums were made: one reason, for one log of many.
host::Judgement torque_of(const Sums& sums) {
  const LogShare* worst = nullptr;
  int doubted = 0;
  for (const LogShare& log : sums.logs) {
    if (log.torque.reasons.empty()) continue;
    ++doubted;
    if (worst == nullptr || log.torque.verdict > worst->torque.verdict) worst = &log;
  }
  host::Judgement judgement;
  if (worst == nullptr) return judgement;
  judgement.add(worst->torque.verdict,
                fmt::format("the torque of {} of {} logs contradicts the robot, for one in {}: {}", doubted,
                            sums.logs.size(), worst->summary.path, worst->torque.reasons.front()));
  return judgement;
}

}  // namespace

Identification identify(const model::Robot& robot, const data::LogSet& logs, const Options& options) {
  Identification result;
  result.torque_at = logs.torque_at();
  result.log_paths = logs.train_paths();
  result.how = logs.how();
  const Streams train = open(logs.train(), options, result.train_logs, result.notes);
  const Streams judged = open(logs.judge(), options, result.judge_logs, result.notes);

  FitOptions fitting = options.fit;
  fitting.observation.cutoff = logs.cutoff();
  // A sensor behind the gear does not see the rotor; friction of bearings and seals, cables and its own zero it does.
  if (logs.torque_at() == data::TorqueAt::kJoint) fitting.structure.rotor_inertia = false;
  if (options.progress) fitting.progress = [&](double done) { options.progress("fitting", done); };
  std::vector<const data::MotionStream*> pointers;
  for (const data::MotionStream& stream : train) pointers.push_back(&stream);
  result.fit = fit(robot, pointers, fitting);
  judge_model(train, judged, options, result);
  return result;
}

Identification identify(const model::Robot& robot, const Sums& sums, const data::LogSet& judge,
                        const Options& options) {
  Identification result;
  result.torque_at = sums.torque_at;
  for (const LogShare& log : sums.logs) {
    result.log_paths.push_back(log.summary.path);
    result.train_logs.push_back(log.summary);
    result.notes.insert(result.notes.end(), log.summary.notes.begin(), log.summary.notes.end());
  }
  const Streams judged = open(judge.judge(), options, result.judge_logs, result.notes);
  refuse_fitted_logs(sums, result.judge_logs);
  result.how = judged.empty() ? fmt::format("fitted to the sums of {} logs, not judged: no log was held back",
                                            sums.logs.size())
                              : judge.how();
  FitOptions fitting = options.fit;
  if (options.progress) fitting.progress = [&](double done) { options.progress("fitting", done); };
  result.fit = fit(robot, sums, fitting);
  Options judging = options;
  judging.torque.add(torque_of(sums));
  judge_model({}, judged, judging, result);
  return result;
}

model::FitRecord Identification::record() const {
  return fit_record(fit, data::to_string(torque_at), train.empty() ? nullptr : &trained);
}

model::ModelFile Identification::model_file() const {
  model::ModelFile file = fit.model_file();
  file.fit = record();
  file.provenance.logs = log_paths;
  file.provenance.notes = fit.notes;
  return file;
}

}  // namespace heft::identify
