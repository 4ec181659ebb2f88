#include "heft/diagnose/diagnose.hpp"

#include "ceilings_on_logs.hpp"
#include "findings.hpp"
#include "guards.hpp"
#include "heft/host/error.hpp"
#include "heft/model/couplings.hpp"
#include "search.hpp"
#include "start.hpp"
#include "veto.hpp"
#include "written_model.hpp"

namespace heft::diagnose {
namespace {

using Eigen::MatrixXd;

/// Scores of a robot on logs that are read as for a model that does not say how.
std::vector<validate::Score> ordinary_scores(const model::Robot& robot, const std::vector<data::Log>& logs,
                                             double band) {
  const JudgedMotion motion(robot, logs, {.cutoff = 0.0, .ordinary = true});
  return motion.scores(motion.predicted(robot), band);
}

/// Puts the scores of the models beside each other.
struct Scores {
  Diagnosis& result;
  double band;

  /// The model as given and what identify makes of the training logs: both as anyone would judge them.
  void put_ordinary(const std::vector<data::Log>& train, const std::vector<data::Log>& validate) const {
    result.train_given = validate::pool(ordinary_scores(result.given, train, band));
    result.validate_each_given = ordinary_scores(result.given, validate, band);
    result.validate_given = validate::pool(result.validate_each_given);
    result.train_identified = validate::pool(ordinary_scores(result.identified, train, band));
    result.validate_each_identified = ordinary_scores(result.identified, validate, band);
    result.validate_identified = validate::pool(result.validate_each_identified);
  }
  void put_train(const JudgedMotion& motion, const MatrixXd& before, const MatrixXd& after) const {
    result.train_before = validate::pool(motion.scores(before, band));
    result.train_after = validate::pool(motion.scores(after, band));
    result.train = motion.traces(before, after);
  }
  void put_validate(const JudgedMotion& motion, const MatrixXd& before, const MatrixXd& after) const {
    result.validate_each_before = motion.scores(before, band);
    result.validate_each_after = motion.scores(after, band);
    result.validate_before = validate::pool(result.validate_each_before);
    result.validate_after = validate::pool(result.validate_each_after);
    const MatrixXd nothing = MatrixXd::Zero(after.rows(), after.cols());
    result.validate_torque = validate::pool(motion.scores(nothing, band));
    result.validate = motion.traces(before, after);
  }
};

std::vector<data::Log> read_all(const std::vector<data::LogSource>& sources) {
  std::vector<data::Log> logs;
  for (const data::LogSource& source : sources) logs.push_back(data::read(source));
  return logs;
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
  options.joint_sensor = asked.joint_sensor || logs.torque_at() == data::TorqueAt::kJoint;
  const std::vector<data::Log> train = read_all(logs.train()), validate = read_all(logs.judge());
  refuse_too_little_motion(robot, train);
  refuse_nothing_to_judge(validate);
  Start start = start_of(robot, train, validate, options);
  Search search(start, options);
  const JudgedMotion &fitted = *start.train, &judged = *start.judged;
  Diagnosis result;
  result.notes = start.notes;
  result.joint_sensor = options.joint_sensor;
  result.cutoff = start.cutoff;
  result.sign_width = fitted.table().sign_width.maxCoeff();
  result.before = search.engine().robot();
  const MatrixXd train_before = search.engine().predicted();
  const MatrixXd judged_before = judged.predicted(result.before);
  search.trace("base", judged_before);

  search.check_joints();  // before the search: no effect is sought in a wrong joint
  search.forward();
  search.backward();
  reject_overfitted(search, judged_before);
  const auto base = std::make_shared<const BaseModel>(start.own, written_structure(options.joint_sensor));
  const WrittenModel written(search, base);
  result.findings = findings_of(search, written);

  result.given = robot;
  result.identified = base->robot(base->identified(train));
  result.after = written.engine().robot();
  const Scores scores{result, start.band};
  scores.put_ordinary(train, validate);
  scores.put_train(fitted, train_before, written.engine().predicted());
  scores.put_validate(judged, judged_before, judged.predicted(result.after));

  search.check_joints();
  result.not_explained = search.wrong_joints();
  result.unexplained = unexplained_of(search, written.engine());
  put_ceilings(fitted, judged, train, result);
  result.refusals = search.refusals(result.findings);
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
