#include "refit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "heft/data/log_part.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/model/without_effects.hpp"
#include "heft/validate/predict.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Logs = std::vector<data::Log>;

/// Shortest half of a validation log that is judged on [s]: behind the ends, which no error counts, some motion is left.
constexpr double kShortest = 2.0;

/// The log less the torque of the effects.
data::Log less_effects(data::Log log, const model::Robot& robot) {
  data::StreamOptions options;
  options.displacement = true;
  const data::MotionStream stream(log, options);
  validate::Predictor with(robot, stream.summary().begin),
      without(model::without_effects(robot), stream.summary().begin);
  MatrixXd effects(log.tau.rows(), log.tau.cols());
  Index at = 0;
  stream.for_each([&](const data::MotionChunk& piece) {
    effects.middleRows(at, piece.row_time.size()) = with.rows(piece) - without.rows(piece);
    at += piece.row_time.size();
  });
  log.tau -= effects;
  return log;
}

model::Robot fitted(const model::Robot& written, const BaseModel& base, const Logs& logs) {
  Logs corrected;
  for (const data::Log& log : logs) corrected.push_back(less_effects(log, written));
  model::Robot robot = base.robot(base.identified(corrected));
  robot.effects = written.effects;
  robot.elasticities = written.elasticities;
  robot.couplings = written.couplings;
  robot.torque_delay = written.torque_delay;
  return robot;
}

Logs together(Logs first, const Logs& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

}  // namespace

std::optional<Refit> refit(const WrittenModel& written, const BaseModel& base, const Logs& train,
                           const Logs& validate, const Reading& reading) {
  const model::Robot robot = written.robot();
  std::array<Logs, 2> halves;
  for (const data::Log& log : validate) {
    const double begin = log.time[0], end = log.time[log.time.size() - 1], middle = 0.5 * (begin + end);
    if (middle - begin < kShortest) return {};
    halves[0].push_back(data::part_of(log, begin, middle));
    halves[1].push_back(data::part_of(log, middle, end));
  }
  double sum = 0.0;
  int count = 0;
  for (const std::size_t half : {0U, 1U}) {
    const JudgedMotion judged(robot, halves[1 - half], reading);
    const model::Robot other = fitted(robot, base, together(train, halves[half]));
    const VectorXd after = judged.rms_error(judged.predicted(other)),
                   before = judged.rms_error(judged.predicted(robot));
    for (Index j = 0; j < after.size(); ++j) {
      if (!(after[j] > 0.0 && before[j] > 0.0)) continue;
      sum += std::log(after[j] / before[j]);
      ++count;
    }
  }
  const double ratio = count > 0 ? std::exp(sum / count) : 1.0;
  if (!(ratio < 1.0)) return {};
  return Refit{fitted(robot, base, together(train, validate)), ratio};
}

}  // namespace heft::diagnose
