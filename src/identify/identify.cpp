#include "heft/identify/identify.hpp"

#include <algorithm>

#include "heft/identify/fit_record.hpp"
#include "judgement.hpp"

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
  result.mass = model::check_mass_matrix(result.fit.robot, kManyPoses, 1);

  double band = options.band;
  for (const auto* summaries : {&result.train_logs, &result.judge_logs}) {
    for (const data::StreamSummary& summary : *summaries) {
      if (options.band == 0.0) band = std::max(band, validate::default_band(summary.bandwidth));
    }
  }
  result.train = judge_each(train, result.fit.robot, band, options, result.train_traces);
  result.held_out = judge_each(judged, result.fit.robot, band, options, result.held_out_traces);
  result.trained = validate::pool(result.train);
  result.judgement = judge(result.fit, result.mass, result.held_out, result.train);
  result.judgement.add(options.torque);
  return result;
}

model::FitRecord Identification::record() const {
  return fit_record(fit, data::to_string(torque_at), &trained);
}

model::ModelFile Identification::model_file() const {
  model::ModelFile file = fit.model_file();
  file.fit = record();
  file.provenance.logs = log_paths;
  file.provenance.notes = fit.notes;
  return file;
}

}  // namespace heft::identify
