#include "heft/validate/validate.hpp"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "heft/model/at_sensor.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/model/physical_links.hpp"

namespace heft::validate {
namespace {

/// Place of the torque prediction among the acceptance criteria.
constexpr std::size_t kPrediction = 1;
/// Poses in which the mass matrix is looked at.
constexpr int kPoses = 2000;

/// How the logs are read: friction at low speed is judged as it was fitted, behind the same low-pass.
data::StreamOptions streaming_of(const model::Robot& robot, const model::FitRecord* fit) {
  data::StreamOptions streaming;
  if (fit != nullptr && fit->cutoff_hz > 0) {
    streaming.motion.cutoff = fit->cutoff_hz;
    streaming.motion.smooth_position = true;
    streaming.prefer_logged = false;
  }
  streaming.displacement = model::needs_measured_displacement(robot);
  streaming.temperature = model::needs_temperature(robot);
  return streaming;
}

/// What a model whose friction follows the temperature of a joint makes of a log without it, or of another one.
void note_temperatures(const model::Robot& robot, const data::MotionStream& stream,
                       std::vector<std::string>& notes) {
  const std::string& path = stream.summary().path;
  if (!stream.summary().temperature_logged) {
    notes.push_back(fmt::format(
        "{}: no temperatures of the joints (temp1, temp2, ...), which friction of this model goes by: taken as at T0 of "
        "its friction_temperature",
        path));
    return;
  }
  Eigen::ArrayXd low = Eigen::ArrayXd::Constant(robot.num_joints(), std::numeric_limits<double>::infinity());
  Eigen::ArrayXd high = -low;
  stream.for_each([&](const data::MotionChunk& piece) {
    if (piece.row_temperature.rows() == 0) return;
    low = low.min(piece.row_temperature.colwise().minCoeff().transpose().array());
    high = high.max(piece.row_temperature.colwise().maxCoeff().transpose().array());
  });
  for (const JointEffect<double>& effect : robot.effects) {
    if (effect.kind != joint_effect_kind<FrictionTemperature>()) continue;
    const SeenInterval<double>& seen = effect.seen.temperature;
    if (low[effect.joint] <= seen.high && high[effect.joint] >= seen.low) continue;
    notes.push_back(
        fmt::format("{}: joint {} is at {:.3g} to {:.3g} °C, outside of the {:.3g} to {:.3g} °C that this model was fitted "
                    "at: its friction is taken as at the nearest of these",
                    path, effect.joint + 1, low[effect.joint], high[effect.joint], seen.low, seen.high));
  }
}

/// One band for all logs, or their figures could not be put together.
double band_of(const std::vector<data::MotionStream>& streams, const model::FitRecord* fit,
               const Options& options) {
  if (options.band > 0) return options.band;
  if (fit != nullptr && fit->cutoff_hz > 0 && fit->band_hz != 0) return fit->band_hz;
  double band = 0.0;
  if (fit != nullptr && fit->cutoff_hz > 0) return band;
  for (const data::MotionStream& stream : streams)
    band = std::max(band, default_band(stream.summary().bandwidth));
  return band;
}

void find_worst(Validation& result) {
  for (const Score& score : result.scores) {
    Eigen::Index joint = 0;
    // A log without a band is judged on its unfiltered error.
    const double percent =
        (score.band > 0 ? score.in_band_percent_of_max : score.percent_of_max).maxCoeff(&joint);
    if (percent > result.worst_percent) {
      result.worst_percent = percent;
      result.worst_joint = static_cast<int>(joint);
      result.worst_log = score.log;
    }
  }
}

ModelFacts facts_of(const Validation& result) {
  ModelFacts facts;
  if (result.fit) {
    const std::vector<model::BaseParameterRecord>& base = result.fit->base_parameters;
    facts.parameters = static_cast<int>(base.size());
    facts.determined = static_cast<int>(std::count_if(
        base.begin(), base.end(), [](const model::BaseParameterRecord& p) { return p.determined; }));
  }
  facts.physically_consistent = result.physically_consistent;
  facts.mass = model::check_mass_matrix(result.robot, kPoses, 1);
  return facts;
}

}  // namespace

const Criterion& Validation::prediction() const { return criteria[kPrediction]; }

Validation validate(const model::Robot& robot, const model::FitRecord* fit,
                    const std::vector<std::string>& fitted_to, const data::LogSet& logs,
                    const Options& options) {
  Validation result;
  data::refuse_seen(logs, fitted_to, &result.notes);
  result.robot = model::as_measured(robot, logs.torque_at() == data::TorqueAt::kJoint, fit, &result.notes);
  result.model = options.model;
  result.urdf = options.urdf;
  if (fit != nullptr) result.fit = *fit;
  result.torque_at = logs.torque_at();
  const data::StreamOptions streaming = streaming_of(result.robot, fit);
  std::vector<data::MotionStream> streams;
  for (const data::LogSource& log : logs.judge()) {
    streams.push_back(data::stream(log, streaming));
    result.logs.push_back(streams.back().summary());
    result.notes.insert(result.notes.end(), result.logs.back().notes.begin(), result.logs.back().notes.end());
    if (streaming.temperature) note_temperatures(result.robot, streams.back(), result.notes);
  }
  ScoreOptions scoring;
  scoring.band = band_of(streams, fit, options);
  if (fit != nullptr && fit->cutoff_hz > 0 && fit->sign_width > 0) scoring.sign_width = fit->sign_width;
  for (const data::MotionStream& stream : streams) {
    if (options.progress)
      scoring.progress = [&](double done) { options.progress(stream.summary().path, done); };
    if (options.traces) {
      result.traces.emplace_back(stream.summary().samples, result.robot.num_joints());
      scoring.rows = [&](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                         const Eigen::MatrixXd& predicted) {
        result.traces.back().add(time, measured, predicted);
      };
    }
    result.scores.push_back(score(result.robot, stream, scoring));
  }
  result.all = pool(result.scores);
  find_worst(result);
  result.criteria = acceptance_criteria();
  judge(result.criteria[kPrediction], result.worst_percent);
  result.physically_consistent =
      fit != nullptr ? fit->physically_consistent : model::is_physically_consistent(result.robot);
  result.judgement = judge_prediction(result.scores);
  result.judgement.add(options.torque);
  result.judgement.add(judge_model(facts_of(result)));
  return result;
}

Validation validate(const model::ModelFile& file, const model::Robot& robot, const data::LogSet& logs,
                    const Options& options) {
  model::Robot fitted = robot;
  std::vector<std::string> notes;
  model::apply(file, fitted, &notes);
  Options asked = options;
  if (asked.model.empty()) asked.model = file.path;
  Validation result = validate(fitted, file.fit ? &*file.fit : nullptr, file.provenance.logs, logs, asked);
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  return result;
}

}  // namespace heft::validate
