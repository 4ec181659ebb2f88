// A motor that turns with two joints.
#include <algorithm>

#include "../arm_search.hpp"
#include "heft/core/friction/friction.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Candidate candidate(const Workbench& bench, const GearCoupling<double>& pair) {
  const MotionTable& table = *bench.table;
  const auto shared = [&pair](const MatrixXd& of) -> VectorXd {
    return pair.ratio * of.col(pair.driving) + of.col(pair.driven);
  };
  Candidate c(WristCoupling{});
  c.joint = pair.driving;
  c.pair = pair;
  const VectorXd v = shared(bench.motion->qd);
  MatrixXd motor(table.rows(), 2);
  for (Index i = 0; i < table.rows(); ++i) motor(i, 0) = velocity_sign(v[i], table.sign_width[pair.driven]);
  motor.col(1) = v;
  c.columns = columns_of_pair(pair, motor);
  c.trial = judge(bench, c);
  for (Index k = 0; k < c.trial.coefficients.size(); ++k) {
    if (c.trial.coefficients[k] < -2.0 * c.trial.std[k]) c.refused = "would be negative";
  }
  // The motor that both joints turn has inertia too; it stays out unless the log shows it.
  Candidate heavy = c;
  motor.conservativeResize(Eigen::NoChange, 3);
  motor.col(2) = shared(bench.motion->qdd);
  heavy.columns = columns_of_pair(pair, motor);
  heavy.trial = judge(bench, heavy);
  if (heavy.trial.valid && heavy.trial.cv_gain > 1.02 * c.trial.cv_gain &&
      heavy.trial.coefficients.minCoeff() > 0.0 && heavy.trial.coefficients[2] > 3.0 * heavy.trial.std[2]) {
    return heavy;
  }
  return c;
}

std::vector<Candidate> propose_coupling(const Workbench& bench, const std::vector<bool>&) {
  std::vector<Candidate> found;
  for (const GearCoupling<double>& pair : bench.pairs) found.push_back(candidate(bench, pair));
  return found;
}

void apply_coupling(const Candidate& effect, const VectorXd& c, model::Robot& robot) {
  robot.couplings.push_back(
      {effect.pair.driving, effect.pair.driven, effect.pair.ratio, c.size() > 2 ? c[2] : 0.0, c[0], c[1]});
}

void describe_coupling(const Candidate& effect, const VectorXd& c, const model::Robot&, Finding& finding) {
  finding.parameters = {{"Fc", c[0]}, {"Fv", c[1]}};
  if (c.size() > 2) finding.parameters.emplace_back("Ia", c[2]);
  finding.driven_joint = effect.pair.driven;
}

}  // namespace

ArmSearch search_of(WristCoupling) { return {propose_coupling, apply_coupling, describe_coupling}; }

}  // namespace heft::diagnose
