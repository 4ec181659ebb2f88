#include "heft/validate/acceptance.hpp"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/numbers.hpp"

namespace heft::validate {
namespace {

using Eigen::Index;
using host::Judgement;
using Rank = host::Verdict;

}  // namespace

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kMet: return "met";
    case Verdict::kMissed: return "missed";
    case Verdict::kNotJudged: return "not judged";
  }
  return "";
}

std::vector<Criterion> acceptance_criteria() {
  const auto criterion = [](const char* id, const char* name, const char* meaning, double limit,
                            bool at_least) {
    return Criterion{id, name, meaning, kNaN, limit, at_least, Verdict::kNotJudged, {}};
  };
  return {
      criterion("parameter_recovery", "parameter recovery",
                "largest relative error of a base parameter against the simulated truth", 15.0, false),
      criterion("torque_prediction", "torque prediction",
                "torque error (RMSE in band) on a motion not trained on, against the joint's largest torque",
                3.0, false),
      criterion("tracking_error", "tracking error",
                "reduction of computed torque's tracking error against nominal parameters", 40.0, true),
      criterion("payload_generalisation", "payload generalisation",
                "identified with 5 kg, judged with 8 kg and the difference known: torque error (RMSE in "
                "band) against the joint's "
                "largest torque",
                5.0, false),
      criterion("repeatability", "repeatability",
                "largest standard deviation over mean of a base parameter, over repeated experiments", 10.0,
                false)};
}

void judge(Criterion& criterion, double value) {
  criterion.value = value;
  if (!std::isfinite(value)) {
    criterion.verdict = Verdict::kNotJudged;
    return;
  }
  const bool met = criterion.at_least ? value > criterion.limit : value < criterion.limit;
  criterion.verdict = met ? Verdict::kMet : Verdict::kMissed;
}

Judgement judge(const std::vector<Criterion>& criteria) {
  Judgement judgement;
  for (const Criterion& criterion : criteria) {
    if (criterion.verdict == Verdict::kMissed) {
      judgement.add(Rank::kBad,
                    fmt::format("{}: {:.3g} %, the limit is {} {:g} %", criterion.name, criterion.value,
                                criterion.at_least ? "above" : "below", criterion.limit));
    } else if (criterion.verdict == Verdict::kNotJudged) {
      judgement.add(Rank::kDoubtful, fmt::format("{}: not judged", criterion.name));
    }
  }
  return judgement;
}

Eigen::VectorXd relative_errors(const Eigen::VectorXd& estimate, const Eigen::VectorXd& truth) {
  return (estimate - truth).cwiseAbs().cwiseQuotient(truth.cwiseAbs());
}

Eigen::VectorXd relative_scatter(const std::vector<Eigen::VectorXd>& estimates) {
  if (estimates.empty()) return {};
  const Index size = estimates.front().size();
  if (estimates.size() < 2) return Eigen::VectorXd::Constant(size, kNaN);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(size), squares = mean;
  for (const Eigen::VectorXd& estimate : estimates) mean += estimate;
  mean /= static_cast<double>(estimates.size());
  for (const Eigen::VectorXd& estimate : estimates) squares += (estimate - mean).cwiseAbs2();
  const Eigen::VectorXd deviation = (squares / static_cast<double>(estimates.size() - 1)).cwiseSqrt();
  return deviation.cwiseQuotient(mean.cwiseAbs());
}

}  // namespace heft::validate
