#include "heft/diagnose/diagnose.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "causes.hpp"
#include "ceilings_on_logs.hpp"
#include "curves.hpp"
#include "findings.hpp"
#include "guards.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/couplings.hpp"
#include "other_load.hpp"
#include "refit.hpp"
#include "search.hpp"
#include "start.hpp"
#include "veto.hpp"
#include "written_model.hpp"

namespace heft::diagnose {
namespace {

using Eigen::MatrixXd;

/// A set of logs as the search reads it, with a cut-off for each joint; as anyone reads it for a model file that holds the
/// cut-off; and for a model that does not say how.
struct Motions {
  const JudgedMotion& searched;
  const JudgedMotion& own;
  const JudgedMotion& ordinary;
};

/// Puts the scores of the models beside each other.
struct Scores {
  Diagnosis& result;
  double band;

  std::vector<validate::Score> of(const model::Robot& robot, const JudgedMotion& motion) const {
    return motion.scores(motion.predicted(robot), band);
  }
  /// @param before, after  prediction along the motion of the search
  void put_train(const Motions& motion, const MatrixXd& before, const MatrixXd& after) const {
    result.train_given = validate::pool(of(result.given, motion.ordinary));
    result.train_identified = validate::pool(of(result.identified, motion.ordinary));
    result.train_before = validate::pool(motion.searched.scores(before, band));
    // What changes with time, a payload or a touch, is in no robot.
    result.train_after = validate::pool(result.ordinary_motion ? of(result.after, motion.ordinary)
                                                               : motion.searched.scores(after, band));
    result.train = motion.searched.traces(before, after);
  }
  void put_validate(const Motions& motion, const MatrixXd& before) const {
    const JudgedMotion& judged = result.ordinary_motion ? motion.ordinary : motion.own;
    result.validate_each_given = of(result.given, motion.ordinary);
    result.validate_each_identified = of(result.identified, motion.ordinary);
    result.validate_each_before = motion.searched.scores(before, band);
    result.validate_each_after = of(result.after, judged);
    result.validate_given = validate::pool(result.validate_each_given);
    result.validate_identified = validate::pool(result.validate_each_identified);
    result.validate_before = validate::pool(result.validate_each_before);
    result.validate_after = validate::pool(result.validate_each_after);
    const MatrixXd nothing = MatrixXd::Zero(before.rows(), before.cols());
    result.validate_torque = validate::pool(motion.searched.scores(nothing, band));
    result.validate = motion.searched.traces(before, motion.searched.predicted(result.after));
  }
};

std::vector<data::Log> read_all(const std::vector<data::LogSource>& sources, std::vector<std::string>& notes) {
  std::vector<data::Log> logs;
  for (const data::LogSource& source : sources) {
    logs.push_back(data::read(source));
    if (!source.time_note.empty()) notes.push_back(source.time_note);
  }
  return logs;
}

/// The logs as anyone reads them, and what identify makes of them: neither waits for the search.
struct AsAnyone {
  std::optional<JudgedMotion> train, judged;
  Identified identified{};  ///< but for the logs that it is judged on

  /// @param robot, train_logs, validation_logs  have to outlive the work
  Beside work(const model::Robot& robot, const std::vector<data::Log>& train_logs,
              const std::vector<data::Log>& validation_logs, bool joint_sensor) {
    const Reading reading{.cutoff = 0.0, .ordinary = true};
    return {[this, &train_logs, joint_sensor](const Start& begun) {
              identified.base =
                  std::make_shared<const BaseModel>(begun.own, written_structure(joint_sensor));
              identified.beta = identified.base->identified(train_logs);
              identified.robot = identified.base->robot(identified.beta);
            },
            [this, &robot, &train_logs, reading](const Start&) {
              train.emplace(robot, train_logs, reading);
            },
            [this, &robot, &validation_logs, reading](const Start&) {
              judged.emplace(robot, validation_logs, reading);
            }};
  }
};

/// A search that has taken its effects, and the model before.
struct Found {
  std::unique_ptr<Start> start;
  std::unique_ptr<Search> search;
  model::Robot before;
  MatrixXd train_before, judged_before;
  std::unique_ptr<Start> lower;  ///< that behind the lower cut-off, where springs asked for another one
};

/// Progress that never goes back, though parts of a search may be done again.
std::function<void(const std::string&, double)> never_back(std::function<void(const std::string&, double)> progress) {
  if (!progress) return progress;
  return [progress = std::move(progress), furthest = 0.0](const std::string& what, double done) mutable {
    progress(what, furthest = std::max(furthest, done));
  };
}

/// Searches for effects, behind a higher cut-off where springs ask for one.
/// @param start_with  gives the start behind a least cut-off [Hz]
Found found_by(const DiagnoseOptions& options, const std::function<Start(double least_cutoff)>& start_with) {
  const auto begun = [&](double least_cutoff) {
    Found found;
    found.start = std::make_unique<Start>(start_with(least_cutoff));
    found.search = std::make_unique<Search>(*found.start, options);
    found.before = found.search->engine().robot();
    found.train_before = found.search->engine().predicted();
    found.judged_before = found.start->judged->predicted(found.before);
    found.search->trace("base", found.judged_before);
    found.search->check_joints();  // before the search: no effect is sought in a wrong joint
    return found;
  };
  Found found = begun(0.0);
  const double least_cutoff = found.search->forward(true);
  if (least_cutoff == 0.0) return found;
  // What a search along rigid joints sees of two springs depends on the cut-off: once from the start, once with those found.
  Found behind = begun(least_cutoff), with_those = begun(least_cutoff);
  behind.search->forward(false);
  with_those.search->take_springs_of(*found.search);
  with_those.search->forward(false);
  if (with_those.search->engine().mean_log_error() < behind.search->engine().mean_log_error()) behind = std::move(with_those);
  // A spring that is not seen where it swings is none.
  found.search.reset();
  behind.lower = std::move(found.start);
  return behind;
}

/// The model that is written. One behind a cut-off that lets springs swing takes the noise of light joints with it; where that
/// costs more, it is judged, and read, behind the lower one.
std::unique_ptr<WrittenModel> written_of(const Found& found, const Identified& identified) {
  auto written = std::make_unique<WrittenModel>(*found.search, identified);
  if (found.lower == nullptr) return written;
  const auto error = [](const WrittenModel& model) {
    return model.judged().rms_error(model.judged().predicted(model.robot())).array().max(1e-300).log().sum();
  };
  const auto exchange = [&] {
    std::swap(found.start->cutoff, found.lower->cutoff);
    std::swap(found.start->train_as_filed, found.lower->train_as_filed);
    std::swap(found.start->judged_as_filed, found.lower->judged_as_filed);
  };
  const double least = error(*written);
  exchange();
  auto behind_lower = std::make_unique<WrittenModel>(*found.search, identified);
  if (error(*behind_lower) < least) return behind_lower;
  exchange();
  return written;
}

/// Fits what was found to all logs, where they are of one arm with one load.
/// @param asked  whether it is wanted
void fit_again(const WrittenModel& written, const BaseModel& base, const std::vector<data::Log>& train,
               const JudgedMotion& trained, const std::vector<data::Log>& validate, bool asked, Diagnosis& result) {
  result.other_load = other_load(written, base, result.parameters, trained);
  if (result.other_load) {
    result.logs_contradict = true;
    result.notes.push_back(in_words(*result.other_load) +
                           ": the model written is fitted to the training logs alone, and what it predicts of the others is wrong "
                           "by that; give logs with the same load to judge on");
    return;
  }
  if (!asked) return;
  Refit again = refit(written, base, train, trained, validate, reading_of(result));
  result.refitted = std::move(again.refitted);
  if (result.refitted)
    result.refitted->parameters = with_values_of(result.refitted->robot, result.after, base, result.parameters);
  result.logs_contradict = again.contradicts;
  result.notes.push_back(std::move(again.note));
}

/// What a diagnosis says of the model that is written: its errors, what it leaves, and whether all logs fit together.
void say_of_written(const Found& found, const WrittenModel& written, const AsAnyone& as_anyone,
                    const std::vector<data::Log>& train_logs, const std::vector<data::Log>& validation_logs,
                    bool fitted_again, Diagnosis& result) {
  const Start& start = *found.start;
  Search& search = *found.search;
  const JudgedMotion& trained = written.is_ordinary() ? *as_anyone.train : *start.train_as_filed;
  // None of these needs what another one finds. What takes longest comes first.
  const std::array<std::function<void()>, 4> parts{
      [&] { result.ceilings = ceilings_of(result, trained, written.judged()); },
      [&] {
        fit_again(written, *as_anyone.identified.base, train_logs, trained, validation_logs, fitted_again, result);
      },
      [&] {
        const Scores scores{result, start.band};
        scores.put_train({*start.train, *start.train_as_filed, *as_anyone.train}, found.train_before,
                         written.engine().predicted());
        scores.put_validate({*start.judged, *start.judged_as_filed, *as_anyone.judged}, found.judged_before);
      },
      [&] {
        search.check_joints();
        result.not_explained = search.wrong_joints();
        result.unexplained = unexplained_of(search, written.engine());
      }};
  host::for_each_parallel(parts.size(), [&](std::size_t k) { parts[k](); });
  name_causes(train_logs, result);
  result.curves = curves_of(result, start.judged->table());
}

}  // namespace

Diagnosis diagnose(const model::Robot& robot, const data::LogSet& logs, const DiagnoseOptions& asked) {
  if (logs.judge().empty()) {
    throw DataError(
        "no log to judge on: an effect is accepted only if it also lowers the error on a log that the fit has not "
        "seen; give one, or cut one log in two");
  }
  model::refuse_wrong_couplings(robot, asked.couplings);
  DiagnoseOptions options = asked;
  options.progress = never_back(asked.progress);
  options.joint_sensor = asked.joint_sensor || logs.torque_at() == data::TorqueAt::kJoint;
  Diagnosis result;
  const std::vector<data::Log> train = read_all(logs.train(), result.notes), validate = read_all(logs.judge(), result.notes);
  refuse_too_little_motion(robot, train);
  refuse_nothing_to_judge(validate);
  AsAnyone as_anyone;
  const Found found = found_by(options, [&, first = true](double least_cutoff) mutable {
    return start_of(robot, train, validate, options,
                    std::exchange(first, false)
                        ? as_anyone.work(robot, train, validate, options.joint_sensor)
                        : Beside{},
                    as_anyone.identified.robot, least_cutoff);
  });
  const Start& start = *found.start;
  Search& search = *found.search;
  Identified& identified = as_anyone.identified;
  identified.ordinary = &*as_anyone.judged;
  const JudgedMotion& fitted = *start.train;
  result.notes.insert(result.notes.end(), start.notes.begin(), start.notes.end());
  result.joint_sensor = options.joint_sensor;
  result.joint_cutoffs = start.cutoffs;
  result.sign_width = fitted.table().sign_width.maxCoeff();
  result.before = found.before;
  search.backward();
  reject_overfitted(search, found.judged_before);
  search.progress(0.75);
  identified.fit = Engine(identified.base, start.train->shared_table(), start.pairs).base_fit();
  reject_needless(search, identified);
  reject_denied_by_intervals(search, identified);
  search.progress(0.8);
  const std::unique_ptr<WrittenModel> chosen = written_of(found, identified);
  const WrittenModel& written = *chosen;
  result.cutoff = start.cutoff;
  search.progress(0.9);
  if (written.is_judged_on_a_repetition()) {
    result.notes.emplace_back(
        "the validation logs repeat the motion of the training logs: what the model does in other motion they cannot say, so "
        "its masses remain those that heft identify finds; give a log of another motion with --validate");
  }
  result.findings = findings_of(search, written);

  result.given = robot;
  result.identified = identified.robot;
  result.after = written.robot();
  result.ordinary_motion = written.is_ordinary();
  result.parameters = written.engine().parameter_record();
  search.progress(0.95);
  say_of_written(found, written, as_anyone, train, validate, options.refit, result);
  result.refusals = search.refusals().beside(result.findings);
  result.notes.insert(result.notes.end(), search.notes().begin(), search.notes().end());
  result.candidates = search.tried();
  for (const double s : fitted.table().run_seconds) result.seconds += s;
  return result;
}

Diagnosis diagnose(const model::Robot& robot, const std::vector<data::Log>& train,
                   const std::vector<data::Log>& validate, const DiagnoseOptions& options) {
  return diagnose(robot, data::log_set(robot.joint_specs(), train, validate), options);
}

}  // namespace heft::diagnose
