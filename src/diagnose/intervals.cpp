#include "intervals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "arm_search.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void describe(const Candidate& own, const VectorXd& c, const model::Robot& robot, Finding& finding) {
  own.effect.visit([&](auto type) {
    using Effect = decltype(type);
    if constexpr (ArmEffect<Effect>) {
      search_of(type).describe(own, c, robot, finding);
    } else {
      const auto parameters = effect_parameters(joint_effect_kind<Effect>(), c, own.shape,
                                                robot.joints[static_cast<std::size_t>(own.joint)].actuation);
      for (std::size_t k = 0; k < Effect::kParameters.size(); ++k) {
        finding.parameters.emplace_back(std::string(Effect::kParameters[k].name), parameters[k]);
      }
      finding.displacement = own.displacement;
    }
  });
}

std::vector<double> half_widths_of(const Candidate& own, std::size_t index, const std::vector<Replica>& replicas,
                                   const std::vector<std::pair<std::string, double>>& stated, double sample) {
  // A tilt is multiplied by masses that are fitted with it, the knots of a curve are no parameters of nature, and when the motor of
  // two joints turns back their low-passes blur.
  if (own.effect.is<BaseTilt>() || own.effect.is<FrictionCurve>() || own.effect.is<WristCoupling>()) return {};
  Candidate moved = own;
  const auto parameters_of = [&](const Replica& replica) {
    moved.shape = replica.effects[index].shape;
    moved.second = replica.effects[index].second;
    Finding described(own.effect);
    describe(moved, replica.effects[index].coefficients, replica.robot, described);
    return described.parameters;
  };
  const auto all = parameters_of(replicas.front());
  const auto change_of = [&](const std::pair<std::string, double>& to, const std::pair<std::string, double>& from) {
    const bool turns = own.effect.is<Ripple>() && to.first == "phase";
    const double change = to.second - from.second;
    return turns ? std::remainder(change, 2.0 * std::numbers::pi) : change;
  };
  MatrixXd changes(static_cast<Index>(all.size()), static_cast<Index>(replicas.size()) - 1);
  for (Index b = 0; b < changes.cols(); ++b) {
    const auto without = parameters_of(replicas[static_cast<std::size_t>(b) + 1]);
    for (std::size_t p = 0; p < all.size(); ++p) changes(static_cast<Index>(p), b) = change_of(without[p], all[p]);
  }
  const VectorXd variance = statistics::jackknife_covariance(changes).diagonal();
  const double factor = statistics::interval_factor(static_cast<int>(changes.cols()) - 1);
  // Position and torque of a row need not be of the same instant between two samples.
  const double known = own.effect.is<Delay>() ? 0.5 * sample : 0.0;
  std::vector<double> half_widths;
  for (std::size_t p = 0; p < all.size(); ++p) {
    const double v = variance[static_cast<Index>(p)];
    half_widths.push_back(v > 0.0 ? factor * std::sqrt(v) + std::abs(change_of(all[p], stated[p])) + known
                                  : std::numeric_limits<double>::quiet_NaN());
  }
  return half_widths;
}

}  // namespace heft::diagnose
