#include "engine.hpp"

#include <cstddef>
#include <limits>

#include "heft/model/motion_torque.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;

/// Torque that a joint at rest is held with at the begin of each log: what is measured less what all but friction's
/// memory makes up.
void Engine::find_holding_torque() {
  const auto runs = static_cast<Index>(table_.runs.size());
  held_.resize(runs, table_.num_joints);
  for (Index r = 0; r < runs; ++r) {
    const Index begin = table_.run_begin[static_cast<std::size_t>(r)];
    Index end = begin;
    while (end < table_.run_begin[static_cast<std::size_t>(r) + 1] && table_.time[end] < model::kSeenAtRest) {
      ++end;
    }
    const MatrixXd left = table_.tau.middleRows(begin, end - begin) - predicted(begin, end - begin);
    for (int j = 0; j < table_.num_joints; ++j) {
      const bool rests = end > begin && motion_.qd.col(j).segment(begin, end - begin).cwiseAbs().maxCoeff() <
                                            model::kRestSpeed;
      held_(r, j) = rests ? left.col(j).mean() : std::numeric_limits<double>::quiet_NaN();
    }
    for (std::size_t e = 0; e < accepted.size(); ++e) {
      Candidate& effect = accepted[e];
      if (!effect.has_memory() || first_column_[e] < 0) continue;
      // Two of them hold in step, each with its part: as if the first one did it all.
      const std::ptrdiff_t first = first_memory(e);
      effect.level = first >= 0 ? accepted[static_cast<std::size_t>(first)].level : fitted(e)[0];
      held_(r, effect.joint) +=
          fitted(e)[0] * effect.columns.values[0].col(0).segment(begin, end - begin).mean();
    }
  }
}

/// What the model leaves of the torque where a joint rests between two motions.
void Engine::find_resting_torque() {
  const Index rows = table_.rows();
  left_at_rest_.setZero(rows, table_.num_joints);
  for (Index end = 0, begin = 0; begin < rows; begin = end + 1) {
    for (end = begin; end < rows && (table_.resting.row(end).array() > 0.0).any();) ++end;
    if (end == begin) continue;
    left_at_rest_.middleRows(begin, end - begin) =
        (table_.tau.middleRows(begin, end - begin) - predicted(begin, end - begin))
            .cwiseProduct(table_.resting.middleRows(begin, end - begin));
  }
}

}  // namespace heft::diagnose
