#include "judgement.hpp"

#include <algorithm>

#include "heft/validate/judgement.hpp"

namespace heft::identify {

using host::Judgement;
using Rank = host::Verdict;

namespace {

validate::ModelFacts facts_of(const Fit& fit, const model::MassMatrixCheck& mass) {
  // Friction of 0 comes out a little negative as often as not; it is impossible beyond its interval only, and where it
  // is more than what the joint's torque scatters by (at 1 rad/s or m/s).
  bool possible = model::has_physical_links(fit.robot);
  for (int i = 0; i < fit.base.count(); ++i) {
    const regression::Column& column = (*fit.columns)[fit.base.kept[static_cast<std::size_t>(i)]];
    if (column.kind != regression::ColumnKind::kCoulomb && column.kind != regression::ColumnKind::kViscous)
      continue;
    possible = possible && fit.beta[i] + std::max(fit.half_width[i], fit.noise_std[column.joint]) >= 0.0;
  }
  return {fit.base.count(), static_cast<int>(std::count(fit.determined.begin(), fit.determined.end(), true)),
          fit.physically_consistent || possible,
          fit.method == Method::kPhysical ? 0.0 : fit.physical_cost_ratio, mass};
}

}  // namespace

Judgement judge(const Fit& fit, const model::MassMatrixCheck& mass,
                const std::vector<validate::Score>& held_out, const std::vector<validate::Score>& training) {
  Judgement judgement = validate::judge_prediction(held_out.empty() ? training : held_out);
  if (held_out.empty()) {
    judgement.add(Rank::kDoubtful,
                  "the model was not judged on a log that the fit has not seen: give one with --validate");
  }
  judgement.add(validate::judge_model(facts_of(fit, mass)));
  return judgement;
}

}  // namespace heft::identify
