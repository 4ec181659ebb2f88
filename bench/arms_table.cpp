// The table of all measured arms: torque error on runs that neither fit nor diagnosis has seen, joint by joint, of the
// URDF alone, of rigid bodies with Coulomb and viscous friction, of identify, of diagnose, and what any function of the
// motion could reach. Which runs train, validate and judge is stated here, once, and was fixed before a figure was seen.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/data/log_part.hpp"
#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/identify/identify.hpp"
#include "heft/page/table.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "heft/validate/validate.hpp"

namespace {

using namespace heft;
namespace fs = std::filesystem;

/// A stretch of a recorded run, as shares of its length.
struct Stretch {
  const char* run;
  double from{0.0}, to{1.0};
};

struct Arm {
  const char* folder;
  bool is_new;  ///< nobody had looked at its logs when the rules of the diagnosis were set
  data::TorqueAt torque_at;
  std::vector<Stretch> train, validate, judged;
};

constexpr data::TorqueAt kMotor = data::TorqueAt::kMotor, kJoint = data::TorqueAt::kJoint;

/// One run alone: its first half trains, what follows validates, the last part judges.
Arm single_run(const char* folder, bool is_new, data::TorqueAt at, const char* run) {
  return {folder, is_new, at, {{run, 0.0, 0.48}}, {{run, 0.48, 0.72}}, {{run, 0.72, 1.0}}};
}

std::vector<Arm> all_arms() {
  return {{"airbot-play", true, kMotor, {{"chirp", 0.0, 0.7}}, {{"chirp", 0.7, 1.0}}, {{"trapezoidal"}}},
          single_run("ar5-frankjie", true, kJoint, "first40s"),
          {"dualarmv2",
           true,
           kMotor,
           {{"exc-13.5"}},
           {{"exc-52.2", 0.0, 0.4}},
           {{"exc-52.2", 0.4, 1.0}, {"sweep-j2"}, {"sweep-j4"}, {"sweep-j6"}}},
          {"ur5-kufieta",
           true,
           kMotor,
           {{"no1"}, {"no3-fast"}, {"no5"}},
           {{"no7"}},
           {{"no2"}, {"no6-slow"}, {"no8"}, {"no9"}}},
          {"xmate7pro-nku",
           true,
           kJoint,
           {{"traj1-3periods"}},
           {{"traj1-1period"}},
           {{"traj2-1period"}, {"traj2-3periods"}}},
          {"kr300-weigand", false, kMotor, {{"run-a", 0.0, 0.65}}, {{"run-a", 0.65, 1.0}}, {{"run-b"}}},
          {"kuka-lwr4-flobaroid",
           false,
           kJoint,
           {{"run-3-faster", 0.0, 0.65}},
           {{"run-3-faster", 0.65, 1.0}},
           {{"run-1-slow"}}},
          single_run("panda-gaz", false, kJoint, "exc-1-first14s"),
          {"staubli-tx40",  // 6 s: a diagnosis asks for 2 s to validate on
           false,
           kMotor,
           {{"run-first6s", 0.0, 0.38}},
           {{"run-first6s", 0.38, 0.72}},
           {{"run-first6s", 0.72, 1.0}}},
          single_run("ur10-petrone", false, kMotor, "exc-first18s"),
          {"ur10e-dynamic-calibration",
           false,
           kMotor,
           {{"exc-12h-50s"}, {"exc-12h-40s"}, {"exc-8h-20s"}},
           {{"exc-14h-50s"}},
           {{"exc-10h-20s"},
            {"exc-12h-20s"},
            {"exc-12h-30s"},
            {"ptp-10-points"},
            {"jointwise-j2"},
            {"jointwise-j5"}}},
          single_run("xmate3pro-liu", false, kJoint, "exc-first13s")};
}

std::string in_words(const std::vector<Stretch>& stretches) {
  std::vector<std::string> words;
  for (const Stretch& s : stretches) {
    words.push_back(s.from > 0.0 || s.to < 1.0
                        ? fmt::format("{} ({:.0f} to {:.0f} %)", s.run, 100.0 * s.from, 100.0 * s.to)
                        : std::string(s.run));
  }
  return fmt::format("{}", fmt::join(words, ", "));
}

/// Rows of a log between two shares of its length.
data::Log stretch_of(const data::Log& log, const Stretch& s) {
  constexpr double kBeyond = 1.0;  // [s]: the last row as well
  const double begin = log.time[0], span = log.time[log.time.size() - 1] - begin;
  return data::part_of(log, begin + s.from * span, begin + s.to * span + (s.to < 1.0 ? 0.0 : kBeyond));
}

std::vector<data::Log> read(const fs::path& folder, const std::vector<Stretch>& stretches, int joints) {
  data::LogRequirements needs;
  needs.num_joints = joints;
  needs.torque = true;
  std::vector<data::Log> logs;
  for (const Stretch& s : stretches) {
    data::Log log = data::read_log((folder / (std::string(s.run) + ".csv")).string(), needs);
    log.qdd.resize(0, 0);  // recorded accelerations of these arms are late, scaled or noise: their READMEs
    logs.push_back(s.from > 0.0 || s.to < 1.0 ? stretch_of(log, s) : std::move(log));
  }
  return logs;
}

/// Errors of one joint on one judged run, one for each model of a column; NaN: none.
struct JointErrors {
  std::vector<double> raw, in_band;
};

enum Column { kUrdf, kPlain, kIdentify, kIdentifyAll, kDiagnose, kNoRefit, kCeiling, kColumns };
constexpr const char* kNames[kColumns] = {"URDF",     "plain",   "identify", "identify all",
                                          "diagnose", "--no-refit", "ceiling"};

struct JudgedRun {
  std::string name;
  double band{0.0};
  std::vector<JointErrors> joints;
};

struct Outcome {
  const Arm* arm{nullptr};
  std::vector<JudgedRun> runs;
  std::string effects, refitted;
  double seconds_identify{0.0}, seconds_diagnose{0.0};
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

validate::Score score_of(const model::Robot& robot, const model::FitRecord* fit, const data::LogSet& judged,
                         std::size_t run, double band) {
  validate::Options options;
  options.band = band;
  return validate::validate(robot, fit, {}, judged, options).scores[run];
}

identify::Identification identified(const model::Robot& robot, const data::LogSet& logs, bool plain) {
  identify::Options options;
  if (plain)
    options.fit.structure = {
        .rotor_inertia = false, .coulomb = true, .viscous = true, .offset = false, .couplings = {}};
  return identify::identify(robot, logs, options);
}

/// What is left of the errors of diagnose's model, fitted to the training logs, if any function of the motion may be added.
void fill_ceiling(const diagnose::Diagnosis& diagnosis, const std::vector<data::Log>& seen,
                  const std::vector<data::Log>& judged, data::TorqueAt torque_at, Outcome& outcome) {
  for (std::size_t r = 0; r < judged.size(); ++r) {
    JudgedRun& run = outcome.runs[r];
    const data::LogSet logs = data::log_set(diagnosis.after.joint_specs(), seen, {judged[r]}, torque_at);
    const diagnose::CeilingOnLog ceiling = diagnose::ceiling_on(diagnosis, logs, run.band);
    const auto share = [](const Eigen::VectorXd& with, const Eigen::VectorXd& without) -> Eigen::VectorXd {
      return with.cwiseQuotient(without);
    };
    const Eigen::VectorXd raw = share(ceiling.with_any_function.rmse, ceiling.model.rmse),
                          in_band = share(ceiling.with_any_function.rmse_in_band, ceiling.model.rmse_in_band);
    for (std::size_t j = 0; j < run.joints.size(); ++j) {
      JointErrors& errors = run.joints[j];
      errors.raw[kCeiling] = errors.raw[kNoRefit] * raw[static_cast<Eigen::Index>(j)];
      errors.in_band[kCeiling] = errors.in_band[kNoRefit] * in_band[static_cast<Eigen::Index>(j)];
    }
  }
}

Outcome outcome_of(const Arm& arm, const fs::path& data) {
  const fs::path folder = data / arm.folder;
  const model::Robot robot = urdf::load_urdf((folder / "robot.urdf").string());
  const auto logs = [&](const std::vector<Stretch>& s) { return read(folder, s, robot.num_joints()); };
  const std::vector<data::Log> train = logs(arm.train), validation = logs(arm.validate),
                               judged = logs(arm.judged);
  std::vector<data::Log> both = train;
  both.insert(both.end(), validation.begin(), validation.end());
  const auto specs = robot.joint_specs();

  Outcome outcome;
  outcome.arm = &arm;
  auto start = std::chrono::steady_clock::now();
  const data::LogSet set = data::log_set(specs, train, validation, arm.torque_at);
  const identify::Identification fit = identified(robot, set, false);
  outcome.seconds_identify = seconds_since(start);
  const identify::Identification plain = identified(robot, set, true);
  const identify::Identification of_all =
      identified(robot, data::log_set(specs, both, judged, arm.torque_at), false);
  start = std::chrono::steady_clock::now();
  const diagnose::Diagnosis diagnosis = diagnose::diagnose(robot, set);
  outcome.seconds_diagnose = seconds_since(start);
  for (const diagnose::Finding& f : diagnosis.findings)
    outcome.effects += fmt::format("{}{} {}{}", outcome.effects.empty() ? "" : ", ", f.effect.id(),
                                   f.joint + 1, f.left_out.empty() ? "" : " (not written)");

  outcome.refitted = diagnosis.refitted
                         ? fmt::format("fitted again, {:.0f} % of the way, {:.3f} of the errors on left-out stretches",
                                       100.0 * diagnosis.refitted->part, diagnosis.refitted->ratio)
                         : "not fitted again";

  const data::LogSet judges = data::log_set(specs, {}, judged, arm.torque_at);
  const auto fill = [&](Column column, const model::Robot& model, const model::FitRecord* record) {
    for (std::size_t r = 0; r < judged.size(); ++r) {
      JudgedRun& run = outcome.runs[r];
      const validate::Score score = score_of(model, record, judges, r, run.band);
      run.band = score.band;
      for (std::size_t j = 0; j < run.joints.size(); ++j) {
        run.joints[j].raw[column] = score.rmse[static_cast<Eigen::Index>(j)];
        run.joints[j].in_band[column] = score.rmse_in_band[static_cast<Eigen::Index>(j)];
      }
    }
  };
  for (const Stretch& s : arm.judged) {
    const JointErrors none{std::vector<double>(kColumns, NAN), std::vector<double>(kColumns, NAN)};
    outcome.runs.push_back(
        {s.run, 0.0, std::vector<JointErrors>(static_cast<std::size_t>(robot.num_joints()), none)});
  }
  fill(kUrdf, robot, nullptr);  // chooses the band of each run, which all models are judged in
  const auto fill_fit = [&](Column column, const identify::Identification& i) {
    const model::FitRecord record = i.record();
    fill(column, i.fit.robot, &record);
  };
  fill_fit(kPlain, plain);
  fill_fit(kIdentify, fit);
  fill_fit(kIdentifyAll, of_all);
  const model::ModelFile file = diagnosis.model_file();
  fill(kDiagnose, diagnosis.written(), &*file.fit);
  fill(kNoRefit, diagnosis.after, &*file.fit);
  fill_ceiling(diagnosis, both, judged, arm.torque_at, outcome);
  return outcome;
}

/// Geometric mean of the ratio of two columns over the joints of all judged runs of an arm.
double mean_ratio(const Outcome& outcome, Column above, Column below, bool in_band) {
  double sum = 0.0;
  int count = 0;
  for (const JudgedRun& run : outcome.runs) {
    for (const JointErrors& joint : run.joints) {
      const std::vector<double>& e = in_band ? joint.in_band : joint.raw;
      const double ratio = e[above] / e[below];
      if (std::isfinite(ratio) && ratio > 0.0) sum += std::log(ratio), ++count;
    }
  }
  return count > 0 ? std::exp(sum / count) : NAN;
}

/// Joints of judged runs whose error is over a hundredth above another column's.
int count_worse(const Outcome& outcome, Column above, Column below, bool in_band, int* of = nullptr) {
  int worse = 0;
  for (const JudgedRun& run : outcome.runs) {
    for (const JointErrors& joint : run.joints) {
      const std::vector<double>& e = in_band ? joint.in_band : joint.raw;
      if (of != nullptr) ++*of;
      if (e[above] > 1.01 * e[below]) ++worse;
    }
  }
  return worse;
}

void print(const Outcome& outcome) {
  const Arm& arm = *outcome.arm;
  fmt::print(
      "\n{}{}, torque at the {}\n  trained on {}; validated on {}; judged on {}\n  identify {:.1f} s, diagnose {:.1f} s; found: {}; {}\n",
      arm.folder, arm.is_new ? " (new)" : "", to_string(arm.torque_at), in_words(arm.train),
      in_words(arm.validate), in_words(arm.judged), outcome.seconds_identify, outcome.seconds_diagnose,
      outcome.effects.empty() ? "nothing" : outcome.effects, outcome.refitted);
  for (const bool in_band : {true, false}) {
    std::vector<std::string> headers{"run", "joint"};
    headers.insert(headers.end(), std::begin(kNames), std::end(kNames));
    headers.insert(headers.end(), {"diagnose / identify", "worse"});
    page::Table table(headers);
    for (const JudgedRun& run : outcome.runs) {
      for (std::size_t j = 0; j < run.joints.size(); ++j) {
        const std::vector<double>& e = in_band ? run.joints[j].in_band : run.joints[j].raw;
        std::vector<std::string> cells{
            j == 0 ? run.name + (in_band ? fmt::format(" ({:.2g} Hz)", run.band) : "") : "",
            fmt::format("{}", j + 1)};
        for (const double value : e) cells.push_back(page::number(value, 3));
        const double ratio = e[kDiagnose] / e[kIdentify];
        cells.push_back(fmt::format("{:.3f}", ratio));
        cells.emplace_back(ratio > 1.01 ? "*" : "");
        table.add_row(cells);
      }
    }
    fmt::print("  rmse {} [N·m]\n{}", in_band ? "in band" : "as logged", table.to_text(4));
  }
  std::fflush(stdout);
}

void print_means(const std::vector<Outcome>& outcomes) {
  fmt::print(
      "\nAll arms: geometric means of ratios over the joints of the judged runs; joints over 1 % worse\n");
  page::Table table({"arm", "in band: diagnose / identify", "worse", "of", "diagnose / identify all", "worse",
                     "--no-refit / identify", "worse", "ceiling / identify", "as logged: diagnose / identify",
                     "worse", "identify [s]", "diagnose [s]"});
  const auto add_mean = [&](const std::string& name, const std::vector<const Outcome*>& of) {
    const auto mean = [&](Column above, Column below, bool in_band) {
      double sum = 0.0;
      for (const Outcome* o : of)
        sum += std::log(mean_ratio(*o, above, below, in_band)) / static_cast<double>(of.size());
      return fmt::format("{:.3f}", std::exp(sum));
    };
    int joints = 0, in_band = 0, all = 0, once = 0, raw = 0;
    double identify = 0.0, diagnose = 0.0;
    for (const Outcome* o : of) {
      in_band += count_worse(*o, kDiagnose, kIdentify, true, &joints);
      all += count_worse(*o, kDiagnose, kIdentifyAll, true);
      once += count_worse(*o, kNoRefit, kIdentify, true);
      raw += count_worse(*o, kDiagnose, kIdentify, false);
      identify += o->seconds_identify;
      diagnose += o->seconds_diagnose;
    }
    table.add_row({name, mean(kDiagnose, kIdentify, true), fmt::format("{}", in_band),
                   fmt::format("{}", joints), mean(kDiagnose, kIdentifyAll, true), fmt::format("{}", all),
                   mean(kNoRefit, kIdentify, true), fmt::format("{}", once),
                   mean(kCeiling, kIdentify, true), mean(kDiagnose, kIdentify, false), fmt::format("{}", raw),
                   fmt::format("{:.1f}", identify), fmt::format("{:.1f}", diagnose)});
  };
  std::vector<const Outcome*> all, new_arms;
  for (const Outcome& o : outcomes) {
    add_mean(o.arm->folder, {&o});
    all.push_back(&o);
    if (o.arm->is_new) new_arms.push_back(&o);
  }
  if (!new_arms.empty()) add_mean("new arms", new_arms);
  add_mean("all arms", all);
  fmt::print("{}", table.to_text(2));
}

}  // namespace

int main(int argc, char** argv) {
  const fs::path data = HEFT_DATA_DIR;
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  const std::vector<Arm> arms = all_arms();
  std::vector<Outcome> outcomes;
  for (const Arm& arm : arms) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), arm.folder) == wanted.end()) continue;
    if (!fs::exists(data / arm.folder)) {
      fmt::print(
          "\n{}: left out, {} does not exist (the measured logs are not part of the sources: -DHEFT_DATA_DIR=FOLDER)\n",
          arm.folder, (data / arm.folder).string());
      continue;
    }
    try {
      outcomes.push_back(outcome_of(arm, data));
      print(outcomes.back());
    } catch (const std::exception& error) {
      fmt::print("\n{}: left out: {}\n", arm.folder, error.what());
    }
  }
  if (outcomes.empty()) return 0;
  print_means(outcomes);
  return 0;
}
