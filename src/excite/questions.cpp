// What a diagnosis left open, read from its JSON result.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "host/json.hpp"
#include "rival_torque.hpp"

namespace heft::excite {
namespace {

using host::JsonValue;

/// Reads one diagnosis.
class Reader {
 public:
  Reader(const model::Robot& robot, const JsonValue& root, const std::string& path)
      : robot_(robot), root_(root), path_(path), joints_(static_cast<std::size_t>(robot.num_joints())) {}

  Questions read() {
    const std::string expected = "the JSON that heft diagnose --json writes";
    const JsonValue effects = root_.at("effects", expected);
    result_.noise = root_.at("train", expected).numbers_or_none("rmse_after", joints_);
    if (result_.noise.size() == 0 || !(result_.noise.minCoeff() > 0.0))
      root_.at("train", expected).fail("found no error above 0 for each joint in rmse_after", expected);
    for (std::size_t k = 0; k < effects.array_size("a list"); ++k) add_effect(effects.at(k));
    if (result_.all.empty() && root_.has("unexplained")) {
      const JsonValue unexplained = root_.at("unexplained", "a list");
      for (std::size_t k = 0; k < unexplained.array_size("a list"); ++k) add_unexplained(unexplained.at(k));
    }
    if (result_.all.empty()) {
      throw NotIdentifiableError(fmt::format(
          "{}: nothing to separate: no effect of a joint has a rival, and nothing is left unexplained; a motion that reveals the "
          "parameters is designed without --separate",
          path_));
    }
    return std::move(result_);
  }

 private:
  Rival rival_of(const JsonValue& entry) const {
    Rival rival;
    rival.kind = entry.at("kind", "the id of an effect").text();
    const JsonValue joint = entry.at("joint", "a joint or null");
    rival.joint = joint.is_null() ? -1 : entry.joint("joint", joints_);
    if (!entry.has("parameters")) return rival;
    const JsonValue parameters = entry.at("parameters", "an object");
    const EffectKind* kind = effect_with_id(rival.kind);
    if (kind == nullptr) return rival;
    kind->visit([&](auto effect) {
      for (const EffectParameter& p : effect.kParameters) {
        const std::string name(p.name);
        if (parameters.has(name.c_str()))
          rival.parameters.emplace_back(name, parameters.at(name.c_str(), "a number").number(true));
      }
    });
    return rival;
  }

  void add_effect(const JsonValue& entry) {
    Question question{{rival_of(entry)}};
    for (const char* list : {"equivalent", "rivals"}) {
      if (!entry.has(list)) continue;
      const JsonValue others = entry.at(list, "a list");
      for (std::size_t k = 0; k < others.array_size("a list"); ++k)
        question.rivals.push_back(rival_of(others.at(k)));
    }
    if (question.rivals.size() < 2) return;
    // An effect of the whole arm beside one of a joint: it is that joint's torque that is in question.
    const auto of_joint = std::find_if(question.rivals.begin(), question.rivals.end(),
                                       [](const Rival& r) { return r.joint >= 0; });
    const int joint = of_joint == question.rivals.end() ? -1 : of_joint->joint;
    const auto unfit = [&](const Rival& rival) {
      const bool known = is_separable(rival.kind) && !rival.parameters.empty();
      if (!known)
        result_.notes.push_back(
            fmt::format("{} is not among what a motion can be designed for{}", rival.kind,
                        rival.parameters.empty() ? ": the file holds no parameters of it" : ""));
      return !known;
    };
    if (joint < 0 || unfit(question.rivals.front())) return;
    std::erase_if(question.rivals, unfit);
    for (Rival& rival : question.rivals) rival.joint = rival.joint < 0 ? joint : rival.joint;
    if (question.rivals.size() > 1) result_.all.push_back(std::move(question));
  }

  /// Position, velocity or load: what a residual of unknown kind goes with.
  void add_unexplained(const JsonValue& entry) {
    if (entry.at("joint", "a joint or null").is_null()) return;
    const int joint = entry.joint("joint", joints_);
    double rms = result_.noise[joint];
    if (entry.has("evidence")) {
      const JsonValue evidence = entry.at("evidence", "an object");
      const double all = evidence.number_or("rms", rms), noise = evidence.number_or("noise_rms", 0.0);
      rms = std::sqrt(std::max(0.0, all * all - noise * noise));
    }
    Question question;
    for (const char* of : {"position", "velocity", "load"})
      question.rivals.push_back({of, joint, {{"rms", rms}}});
    result_.all.push_back(std::move(question));
  }

  const model::Robot& robot_;
  JsonValue root_;
  std::string path_;
  std::size_t joints_;
  Questions result_;
};

}  // namespace

Questions read_questions(const model::Robot& robot, const std::string& path) {
  const host::Json json = host::parse_json(host::read_file(path, "diagnosis"), path);
  return Reader(robot, JsonValue(json, path, ""), path).read();
}

}  // namespace heft::excite
