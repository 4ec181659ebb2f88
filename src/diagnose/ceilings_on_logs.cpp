#include "ceilings_on_logs.hpp"

#include "ceiling.hpp"
#include "heft/host/error.hpp"

namespace heft::diagnose {
namespace {

using Eigen::MatrixXd;

/// Residuals of a diagnosis' models along logs.
LogResiduals residuals_of(const Diagnosis& diagnosis, const JudgedMotion& motion) {
  const MatrixXd& tau = motion.table().tau;
  return {&motion.table(), tau - motion.predicted(diagnosis.identified),
          tau - motion.predicted(diagnosis.after)};
}

std::vector<data::Log> read_all(const std::vector<data::LogSource>& sources) {
  std::vector<data::Log> logs;
  for (const data::LogSource& source : sources) logs.push_back(data::read(source));
  return logs;
}

}  // namespace

std::vector<Ceiling> ceilings_of(const Diagnosis& diagnosis, const JudgedMotion& fitted, const JudgedMotion& judged) {
  return ceiling_of(diagnosis.after, residuals_of(diagnosis, fitted), residuals_of(diagnosis, judged)).joints;
}

CeilingOnLog ceiling_on(const Diagnosis& diagnosis, const data::LogSet& logs, double band) {
  if (logs.judge().size() != 1 || logs.train().empty())
    throw DataError("a ceiling is judged on one log, and learns from one or more others");
  const Reading reading = reading_of(diagnosis);
  const JudgedMotion others(diagnosis.after, read_all(logs.train()), reading),
      judged(diagnosis.after, read_all(logs.judge()), reading);
  const CeilingEstimate estimate =
      ceiling_of(diagnosis.after, residuals_of(diagnosis, others), residuals_of(diagnosis, judged));
  const MatrixXd predicted = judged.predicted(diagnosis.after);
  CeilingOnLog result;
  result.joints = estimate.joints;
  result.model = judged.scores(predicted, band).front();
  result.with_any_function = judged.scores(predicted + estimate.function, band).front();
  return result;
}

}  // namespace heft::diagnose
