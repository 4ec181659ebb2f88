#include "missing_motion.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace heft::identify {
namespace {

/// A joint that moves less than this rests [rad, m].
constexpr double kRestingTravel = 5e-3;

/// The motion that would show a parameter.
std::string motion_for(const regression::RegressionColumns& columns, const regression::Column& column) {
  const int joint = column.joint + 1;
  const bool prismatic =
      columns.robot().joints[static_cast<std::size_t>(column.joint)].joint.type == JointType::kPrismatic;
  switch (column.kind) {
    case regression::ColumnKind::kLink:
      if (column.entry == kMass) return fmt::format("accelerate link {} along different directions", joint);
      if (column.entry <= kMcz) {
        return fmt::format(
            "hold and move joint {} in many postures: gravity must pull on link {} from several sides", joint,
            joint);
      }
      return fmt::format(
          "turn link {} fast about several axes: joints up to {} together, with strong accelerations", joint,
          joint);
    case regression::ColumnKind::kRotorInertia:
      return fmt::format("accelerate joint {} strongly, in several postures of the joints beyond it", joint);
    case regression::ColumnKind::kCoulomb:
      return fmt::format("move joint {} in both directions at a slow, even speed", joint);
    case regression::ColumnKind::kViscous:
      return fmt::format("move joint {} at several speeds up to its fastest, in both directions", joint);
    case regression::ColumnKind::kOffset:
      return prismatic
                 ? fmt::format("move joint {} slowly in both directions", joint)
                 : fmt::format("move joint {} slowly in both directions over more than half a turn", joint);
    case regression::ColumnKind::kCouplingInertia:
    case regression::ColumnKind::kCouplingCoulomb:
    case regression::ColumnKind::kCouplingViscous: {
      const auto& pair = columns.structure().couplings[static_cast<std::size_t>(column.coupling)];
      return fmt::format("move joints {} and {} at different speeds, also against each other",
                         pair.driving + 1, pair.driven + 1);
    }
  }
  return {};
}

}  // namespace

std::vector<int> resting_joints(const regression::RegressionColumns& columns,
                                const std::vector<data::StreamSummary>& logs) {
  std::vector<int> resting;
  for (int j = 0; j < columns.num_joints(); ++j) {
    double travel = 0.0;
    for (const data::StreamSummary& log : logs) travel = std::max(travel, log.travel[j]);
    if (travel < kRestingTravel) resting.push_back(j + 1);
  }
  return resting;
}

std::vector<std::string> missing_motion(const Fit& fit, const std::vector<int>& resting) {
  const regression::RegressionColumns& columns = *fit.columns;
  std::vector<std::string> lines;
  for (const int joint : resting) {
    lines.push_back(fmt::format(
        "joint {} never moved: move it (its friction, rotor inertia and the load beyond it stay unknown)",
        joint));
  }
  std::vector<std::pair<std::string, std::string>> by_motion;  // motion, names
  for (int i = 0; i < fit.base.count(); ++i) {
    if (fit.determined[static_cast<std::size_t>(i)]) continue;
    const regression::Column& column = columns[fit.base.kept[static_cast<std::size_t>(i)]];
    if (std::find(resting.begin(), resting.end(), column.joint + 1) != resting.end()) continue;
    const std::string motion = motion_for(columns, column);
    const std::string name = fit.base.name(columns, i);
    const auto found =
        std::find_if(by_motion.begin(), by_motion.end(), [&](const auto& m) { return m.first == motion; });
    if (found == by_motion.end()) {
      by_motion.emplace_back(motion, name);
    } else {
      found->second += ", " + name;
    }
  }
  for (const auto& [motion, names] : by_motion)
    lines.push_back(fmt::format("{}: not determined; {}", names, motion));
  return lines;
}

}  // namespace heft::identify
