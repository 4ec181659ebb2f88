// The loads of several logs, weighed with one arm.
#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/payload/payload.hpp"
#include "runs.hpp"

namespace heft::payload {

void refuse_rows(const model::Robot& robot, int first_joint) {
  const int n = robot.num_joints();
  if (first_joint >= 1 && first_joint <= n) return;
  throw InputError(
      fmt::format("--rows {}: robot \"{}\" has {} joints; expected 1 to {}", first_joint, robot.name, n, n));
}

namespace {

Weighing weigh(UnloadedArm arm, const data::LogSet& logs, const Options& options) {
  Weighing result;
  result.arm = std::move(arm);
  const std::size_t unloaded = logs.train().size() + result.arm.zeros.size();
  host::Judgement doubts;  // about the torque of the logs without load
  for (std::size_t k = 0; k < std::min(unloaded, options.torque.size()); ++k) doubts.add(options.torque[k]);
  for (std::size_t k = result.arm.zeros.size(); k < logs.judge().size(); ++k) {
    Payload load = estimate(result.arm, logs.judge()[k], options);
    if (const std::size_t at = logs.train().size() + k; at < options.torque.size())
      load.judgement.add(options.torque[at]);
    load.judgement.add(doubts);
    result.loads.push_back(std::move(load));
  }
  return result;
}

}  // namespace

Weighing weigh(const model::Robot& robot, const data::LogSet& logs, std::size_t zeros,
               const Options& options) {
  refuse_rows(robot, options.first_joint);
  return weigh(fit_unloaded(robot, logs, zeros, options), logs, options);
}

Weighing weigh(const model::Robot& robot, const model::ModelFile& file, const data::LogSet& logs,
               std::size_t zeros, const Options& options) {
  refuse_rows(robot, options.first_joint);
  return weigh(arm_from_file(robot, file, logs, zeros, options), logs, options);
}

std::vector<std::string> Weighing::notes() const {
  std::vector<std::string> all = arm.notes;
  for (const Payload& load : loads) all.insert(all.end(), load.log_notes.begin(), load.log_notes.end());
  return all;
}

std::string Weighing::unanswered() const {
  for (const Payload& load : loads) {
    if (std::string why = load.unanswered(); !why.empty()) return why;
  }
  return {};
}

bool Weighing::contradicted() const {
  return std::any_of(loads.begin(), loads.end(),
                     [](const Payload& load) { return !load.contradiction.empty(); });
}

bool Weighing::usable() const {
  return std::all_of(loads.begin(), loads.end(), [](const Payload& load) { return load.usable(); });
}

}  // namespace heft::payload
