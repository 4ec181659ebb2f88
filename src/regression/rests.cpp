#include "heft/regression/rests.hpp"

#include <cmath>

namespace heft::regression {
namespace {

constexpr double kLeastTravel = 0.01;  ///< of a joint that moves [rad, m]
constexpr double kMoves = 4.0;         ///< its top speed, in rest speeds

double rest_speed(bool prismatic) { return prismatic ? kSlideRestSpeed : model::kRestSpeed; }

}  // namespace

bool moves(const data::StreamSummary& log, Eigen::Index joint, bool prismatic) {
  return log.travel[joint] >= kLeastTravel && log.top_speed[joint] >= kMoves * rest_speed(prismatic);
}

Eigen::Array<bool, Eigen::Dynamic, 1> resting_rows(const Eigen::Ref<const Eigen::VectorXd>& qd, double sample_rate,
                                                   bool prismatic) {
  using Eigen::Index;
  const double speed = rest_speed(prismatic);
  const auto least = static_cast<Index>(std::ceil(kRestSeconds * sample_rate));
  Eigen::Array<bool, Eigen::Dynamic, 1> rests(qd.size());
  rests.setConstant(false);
  for (Index i = 0; i < qd.size(); ++i) {
    const Index begin = i;
    while (i < qd.size() && std::abs(qd[i]) <= speed) ++i;
    if (i - begin >= least) rests.segment(begin, i - begin).setConstant(true);
  }
  return rests;
}

}  // namespace heft::regression
