#include "heft/diagnose/diagnose.hpp"

#include "findings.hpp"
#include "guards.hpp"
#include "heft/host/error.hpp"
#include "heft/model/couplings.hpp"
#include "search.hpp"
#include "start.hpp"
#include "veto.hpp"

namespace heft::diagnose {
namespace {

using Eigen::MatrixXd;

/// Scores of predictions before and after on one set of logs, pooled and each.
struct BeforeAndAfter {
  std::vector<validate::Score> before, after;
};

BeforeAndAfter scores_of(const JudgedMotion& motion, const MatrixXd& before, const MatrixXd& after,
                         double band) {
  return {motion.scores(before, band), motion.scores(after, band)};
}

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
  const auto without_each = reject_overfitted(search, judged_before);
  result.findings = findings_of(search, without_each);

  result.after = search.engine().robot();
  const MatrixXd train_after = search.engine().predicted();
  const MatrixXd judged_after = judged.predicted(result.after);
  const BeforeAndAfter of_train = scores_of(fitted, train_before, train_after, start.band);
  BeforeAndAfter of_judged = scores_of(judged, judged_before, judged_after, start.band);
  result.train_before = validate::pool(of_train.before);
  result.train_after = validate::pool(of_train.after);
  result.validate_before = validate::pool(of_judged.before);
  result.validate_after = validate::pool(of_judged.after);
  result.validate_each_before = std::move(of_judged.before);
  result.validate_each_after = std::move(of_judged.after);
  const MatrixXd nothing = MatrixXd::Zero(judged_after.rows(), judged_after.cols());
  result.validate_torque = validate::pool(judged.scores(nothing, start.band));
  result.train = fitted.traces(train_before, train_after);
  result.validate = judged.traces(judged_before, judged_after);

  search.check_joints();
  result.not_explained = search.wrong_joints();
  result.unexplained = unexplained_of(search);
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
