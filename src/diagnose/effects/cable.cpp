// A cable, a hose or a dress pack over two joints.
#include <algorithm>
#include <cmath>

#include "../arm_search.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Joints that one may run over, counted along the arm: next to each other, or with one between them.
constexpr int kFurthest = 2;
/// Ratios that are tried, in both senses, evenly spaced in the logarithm.
constexpr double kLeastRatio = 0.25, kLargestRatio = 4.0;
constexpr int kRatios = 7;

/// Looks for the ratio: whatever it is, the columns are combinations of both positions and a constant.
class RatioSearch {
 public:
  RatioSearch(const Workbench& bench, int driving, int driven) : bench_(bench) {
    for (const int j : {driven, driving}) {
      parts_.push_back(bench.problem->wide_moments(j, 3, 3, [&](Index from, Eigen::Ref<MatrixXd> values) {
        values << bench.motion->q.col(driven).segment(from, values.rows()),
            bench.motion->q.col(driving).segment(from, values.rows()), VectorXd::Ones(values.rows());
      }));
    }
  }

  /// @return 0 where no ratio gains anything
  double run(int& tried) {
    double step = std::pow(kLargestRatio / kLeastRatio, 1.0 / (kRatios - 1));
    std::vector<double> grid;
    for (int k = 0; k < kRatios; ++k) {
      const double ratio = kLeastRatio * std::pow(step, k);
      grid.insert(grid.end(), {-ratio, ratio});
    }
    tried = static_cast<int>(grid.size());
    take_best(grid);
    // To a few thousandths: what is left of a stiff cable would look like another effect.
    for (int pass = 0; pass < 8 && best_ != 0.0; ++pass) {
      step = std::sqrt(step);
      take_best({best_ / step, best_ * step});
    }
    return best_;
  }

 private:
  void take_best(const std::vector<double>& ratios) {
    std::vector<std::vector<MatrixXd>> shapes;
    for (const double ratio : ratios) {
      const MatrixXd pull = (MatrixXd(3, 2) << 1.0, 0.0, ratio, 0.0, 0.0, 1.0).finished();
      shapes.push_back({pull, ratio * pull});
    }
    const std::vector<double> gains = bench_.problem->gains(parts_, shapes);
    for (std::size_t k = 0; k < ratios.size(); ++k) {
      if (gains[k] > gain_) gain_ = gains[k], best_ = ratios[k];
    }
  }

  const Workbench& bench_;
  std::vector<WideMoments> parts_;
  double best_{0.0}, gain_{0.0};
};

Candidate candidate(const Workbench& bench, int driving, int driven) {
  Candidate c(Cable{});
  c.joint = driving;
  c.pair.driving = driving;
  c.pair.driven = driven;
  const double best = RatioSearch(bench, driving, driven).run(c.tried);
  if (best == 0.0) {
    c.refused = "explains nothing";
    return c;
  }
  c.shape = c.pair.ratio = best;
  const VectorXd x = bench.motion->q.col(driven) + best * bench.motion->q.col(driving);
  // Stiffness, and its part of the neutral position.
  c.columns = columns_of_pair(c.pair, (MatrixXd(x.size(), 2) << x, VectorXd::Ones(x.size())).finished());
  c.trial = judge(bench, c, bench.least_gain);
  if (!c.trial.valid) return c;
  if (c.trial.coefficients[0] < -2.0 * c.trial.std[0]) c.refused = "would be negative";
  const double low = x.minCoeff(), high = x.maxCoeff(), k = c.trial.coefficients[0];
  // As with a spring across one joint.
  if (std::abs(k) * 0.5 * (high - low) < 0.25 * std::abs(k * 0.5 * (high + low) + c.trial.coefficients[1]))
    c.refused = "is an offset rather than a cable";
  return c;
}

std::vector<Candidate> propose_cable(const Workbench& bench, const std::vector<bool>& joints) {
  std::vector<Candidate> found;
  const int n = bench.table->num_joints;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j <= std::min(i + kFurthest, n - 1); ++j) {
      if (joints[static_cast<std::size_t>(i)]) found.push_back(candidate(bench, i, j));
    }
  }
  return found;
}

/// @param c  k and -k x0
double neutral_of(const VectorXd& c) { return c[0] != 0.0 ? -c[1] / c[0] : 0.0; }

void apply_cable(const Candidate& effect, const VectorXd& c, model::Robot& robot) {
  robot.cables.push_back(
      {effect.pair.driving, effect.pair.driven, effect.pair.ratio, std::max(0.0, c[0]), neutral_of(c)});
}

void describe_cable(const Candidate& effect, const VectorXd& c, const model::Robot&, Finding& finding) {
  finding.parameters = {{"k", c[0]}, {"x0", neutral_of(c)}, {"ratio", effect.pair.ratio}};
  finding.driven_joint = effect.pair.driven;
}

}  // namespace

ArmSearch search_of(Cable) { return {propose_cable, apply_cable, describe_cable}; }

}  // namespace heft::diagnose
