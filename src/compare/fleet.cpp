#include "heft/compare/fleet.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fitted_model.hpp"
#include "heft/host/error.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/median.hpp"

namespace heft::compare {
namespace {

/// One arm's estimate of a parameter.
struct Estimate {
  std::size_t arm{0};
  double value{0.0}, variance{0.0};
  double freedom{0.0};  ///< behind the variance
  bool odd{false};      ///< named: no longer one of the rest
};

/// A parameter with its estimates.
struct Row {
  Change about;
  std::vector<Estimate> estimates;
};

/// What arms have in common.
struct Common {
  double mean{0.0}, mean_variance{0.0};
  double scatter{0.0};  ///< variance from arm to arm
  double freedom{0.0};
};

/// Of all estimates that are not odd, but for one.
Common common_of(const Row& row, const Estimate* without) {
  double w1 = 0.0, w2 = 0.0, wx = 0.0, wxx = 0.0, count = 0.0;
  const auto for_each = [&](auto&& use) {
    for (const Estimate& e : row.estimates) {
      if (&e != without && !e.odd) use(e);
    }
  };
  for_each([&](const Estimate& e) {
    const double w = 1.0 / e.variance;
    w1 += w, w2 += w * w, wx += w * e.value, count += 1.0;
  });
  const double fixed_mean = wx / w1;
  for_each([&](const Estimate& e) { wxx += std::pow(e.value - fixed_mean, 2) / e.variance; });
  Common common;
  common.freedom = count - 1.0;
  common.scatter = std::max(0.0, (wxx - common.freedom) / (w1 - w2 / w1));
  w1 = wx = 0.0;
  for_each([&](const Estimate& e) {
    const double w = 1.0 / (e.variance + common.scatter);
    w1 += w, wx += w * e.value;
  });
  common.mean = wx / w1;
  common.mean_variance = 1.0 / w1;
  return common;
}

/// The change from the other arms to this one.
Change change_of(const Row& row, const Estimate& e, double error_rate) {
  const Common others = common_of(row, &e);
  const double own = e.variance, scatter = others.scatter;
  const double freedom =
      std::pow(own + scatter, 2) / (own * own / e.freedom + scatter * scatter / others.freedom);
  const double std = std::sqrt(own + scatter + others.mean_variance);
  Change change = row.about;
  change.before = others.mean;
  change.after = e.value;
  change.difference = statistics::Interval::around(e.value - others.mean, std,
                                                   statistics::student_quantile(error_rate, freedom));
  change.p_value = statistics::student_two_sided(std::abs(e.value - others.mean) / std, freedom);
  change.significant = !change.difference.contains(0.0);
  change.relevant = true;
  return change;
}

/// Whether an estimate can be compared with those of other arms.
bool is_known(const Parameter& p) {
  return p.kind != Kind::kEffect && p.std > 0.0 && std::isfinite(p.std) && std::isfinite(p.freedom) &&
         (p.kind != Kind::kLink || p.determined);
}

/// The parameters of the first arm with the estimates of all arms that mean the same by them.
std::vector<Row> rows_of(const std::vector<FittedModel>& arms) {
  std::vector<Row> rows;
  for (const Parameter& first : arms.front().parameters()) {
    const bool friction = first.kind == Kind::kCoulomb || first.kind == Kind::kViscous;
    Row row;
    row.about.kind = first.kind;
    row.about.parameter = first.name;
    row.about.meaning = first.meaning == first.name ? "" : first.meaning;
    row.about.unit = first.unit;
    row.about.joint = first.joint;
    for (std::size_t a = 0; a < arms.size(); ++a) {
      const Parameter* p = arms[a].find(first.name);
      if (p == nullptr || p->meaning != first.meaning || !is_known(*p)) continue;
      if (friction && arms[a].has_other_friction(first.joint)) continue;
      row.estimates.push_back({a, p->value, p->std * p->std, p->freedom, false});
    }
    if (static_cast<int>(row.estimates.size()) >= kLeastArms) rows.push_back(std::move(row));
  }
  return rows;
}

/// Names what differs and takes it from the rest, until nothing more does.
void find_deviations(std::vector<Row>& rows, const std::vector<model::ModelFile>& arms,
                     FleetComparison& result) {
  const double error_rate = (1.0 - kConfidence) / result.comparisons;
  for (Row& row : rows) {
    for (bool found = true; found;) {
      found = false;
      // The one furthest out first: with it gone, those that it only pulled at stay in.
      Estimate* worst = nullptr;
      Change largest;
      const auto rest =
          std::count_if(row.estimates.begin(), row.estimates.end(), [](const Estimate& e) { return !e.odd; });
      if (rest < kLeastArms) break;
      for (Estimate& e : row.estimates) {
        if (e.odd) continue;
        Change change = change_of(row, e, error_rate);
        if (!change.significant || (worst != nullptr && change.p_value >= largest.p_value)) continue;
        worst = &e;
        largest = std::move(change);
      }
      if (worst == nullptr) break;
      worst->odd = found = true;
      result.deviations.push_back({name_of(arms[worst->arm]), std::move(largest)});
    }
  }
  std::stable_sort(
      result.deviations.begin(), result.deviations.end(),
      [](const Deviation& a, const Deviation& b) { return a.change.p_value < b.change.p_value; });
}

FleetParameter summary_of(const Row& row) {
  const Common common = common_of(row, nullptr);
  std::vector<double> spreads;
  for (const Estimate& e : row.estimates) spreads.push_back(std::sqrt(e.variance));
  return {row.about, static_cast<int>(row.estimates.size()), common.mean, std::sqrt(common.scatter),
          statistics::median(spreads)};
}

}  // namespace

std::vector<std::string> FleetComparison::odd_arms() const {
  std::vector<std::string> names;
  for (const Deviation& deviation : deviations) {
    if (std::find(names.begin(), names.end(), deviation.arm) == names.end()) names.push_back(deviation.arm);
  }
  return names;
}

FleetComparison compare_fleet(const std::vector<model::ModelFile>& arms) {
  if (static_cast<int>(arms.size()) < kLeastArms) {
    throw InputError(fmt::format(
        "fleet: found {} models; expected at least {}, one an arm: with fewer, compare two at a time (heft compare)",
        arms.size(), kLeastArms));
  }
  std::vector<FittedModel> models;
  for (const model::ModelFile& arm : arms) {
    models.emplace_back(arm);
    refuse_different_robots(arms.front(), arm, models.front().robot(), models.back().robot());
  }
  std::vector<Row> rows = rows_of(models);
  FleetComparison result;
  result.robot = models.front().robot().name;
  result.arms = static_cast<int>(arms.size());
  for (const Row& row : rows) result.comparisons += static_cast<int>(row.estimates.size());
  if (rows.empty()) {
    result.judgement.add(
        host::Verdict::kBad,
        fmt::format("no parameter is known with an interval in {} of the models", kLeastArms));
    return result;
  }
  find_deviations(rows, arms, result);
  for (const Row& row : rows) result.parameters.push_back(summary_of(row));
  const auto left_out = models.front().parameters().size() - rows.size();
  if (left_out > 0) {
    result.notes.push_back(fmt::format(
        "{} parameters are known in fewer than {} models, or stand for other sums of link parameters there, and are not "
        "compared",
        left_out, kLeastArms));
  }
  return result;
}

}  // namespace heft::compare
