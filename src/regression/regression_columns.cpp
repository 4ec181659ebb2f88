#include "heft/regression/regression_columns.hpp"

#include <array>

#include <fmt/format.h>

#include "heft/model/couplings.hpp"

namespace heft::regression {
namespace {

constexpr std::array<const char*, 10> kEntryNames{"m",   "mcx", "mcy", "mcz", "Ixx",
                                                  "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};

std::string entry_unit(int entry) {
  if (entry == kMass) return "kg";
  return entry <= kMcz ? "kg·m" : "kg·m²";
}

const GearCoupling<double>* find_coupling(const std::vector<GearCoupling<double>>& couplings,
                                          const GearCoupling<double>& like) {
  for (const GearCoupling<double>& coupling : couplings) {
    if (coupling.driving == like.driving && coupling.driven == like.driven) return &coupling;
  }
  return nullptr;
}

/// Place of a column that is not of a coupling in the full regressor of the dynamics.
int full_column(const Column& column, int n) {
  switch (column.kind) {
    case ColumnKind::kLink: return 10 * column.joint + column.entry;
    case ColumnKind::kRotorInertia: return 10 * n + column.joint;
    case ColumnKind::kCoulomb: return 11 * n + column.joint;
    case ColumnKind::kViscous: return 12 * n + column.joint;
    default: return 13 * n + column.joint;
  }
}

}  // namespace

RegressionColumns::RegressionColumns(const model::Robot& robot, ModelStructure structure)
    : structure_(std::move(structure)), dynamics_(robot), batch_(robot) {
  const int n = dynamics_.num_joints();
  model::refuse_wrong_couplings(robot, structure_.couplings);
  const auto prismatic = [&robot](int joint) {
    return robot.joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
  };
  for (int j = 0; j < n; ++j) {
    for (int e = 0; e < kParametersPerLink; ++e) {
      columns_.push_back({fmt::format("{}{}", kEntryNames[static_cast<std::size_t>(e)], j + 1), entry_unit(e),
                          ColumnKind::kLink, j, e, -1});
    }
  }
  const auto block = [&](bool wanted, ColumnKind kind, const char* name, const char* revolute_unit,
                         const char* prismatic_unit) {
    for (int j = 0; wanted && j < n; ++j) {
      columns_.push_back(
          {fmt::format("{}{}", name, j + 1), prismatic(j) ? prismatic_unit : revolute_unit, kind, j, -1, -1});
    }
  };
  block(structure_.rotor_inertia, ColumnKind::kRotorInertia, "Ia", "kg·m²", "kg");
  block(structure_.coulomb, ColumnKind::kCoulomb, "Fc", "N·m", "N");
  block(structure_.viscous, ColumnKind::kViscous, "Fv", "N·m·s/rad", "N·s/m");
  block(structure_.offset, ColumnKind::kOffset, "off", "N·m", "N");
  for (std::size_t k = 0; k < structure_.couplings.size(); ++k) {
    const GearCoupling<double>& coupling = structure_.couplings[k];
    const std::string pair = fmt::format("{}+{}", coupling.driving + 1, coupling.driven + 1);
    const int index = static_cast<int>(k);
    columns_.push_back({"Ia" + pair, "kg·m²", ColumnKind::kCouplingInertia, coupling.driven, -1, index});
    columns_.push_back({"Fc" + pair, "N·m", ColumnKind::kCouplingCoulomb, coupling.driven, -1, index});
    columns_.push_back({"Fv" + pair, "N·m·s/rad", ColumnKind::kCouplingViscous, coupling.driven, -1, index});
  }
}

Eigen::MatrixXd RegressionColumns::regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                             const Eigen::VectorXd& qdd) const {
  const Eigen::Index n = num_joints();
  const Eigen::MatrixXd full = dynamics_.regressor(q, qd, qdd);
  Eigen::MatrixXd Y = Eigen::MatrixXd::Zero(n, count());
  Y.leftCols(10 * n) = full.leftCols(10 * n);
  Eigen::Index next = 10 * n;
  const std::array<bool, 4> wanted{structure_.rotor_inertia, structure_.coulomb, structure_.viscous,
                                   structure_.offset};
  for (Eigen::Index block = 0; block < 4; ++block) {
    if (!wanted[static_cast<std::size_t>(block)]) continue;
    Y.middleCols(next, n) = full.middleCols((10 + block) * n, n);
    next += n;
  }
  for (const GearCoupling<double>& coupling : structure_.couplings) {
    const double v = shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]);
    const double a = shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
    for (const double value : {a, velocity_sign(v, 0.0), v}) {
      Y(coupling.driven, next) = value;
      Y(coupling.driving, next) = coupling.ratio * value;
      ++next;
    }
  }
  return Y;
}

void RegressionColumns::fill(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                             Eigen::Index first, Eigen::Index count, const std::vector<std::vector<int>>& columns,
                             model::RegressorRows& rows) const {
  // Couplings are no columns of the full regressor; any column keeps their place.
  const int n = num_joints();
  std::vector<std::vector<int>> full(columns.size());
  for (std::size_t j = 0; j < columns.size(); ++j) {
    for (const int c : columns[j]) full[j].push_back((*this)[c].coupling < 0 ? full_column((*this)[c], n) : 14 * n - 1);
  }
  batch_.regressor_rows(q.middleRows(first, count), qd.middleRows(first, count), qdd.middleRows(first, count), full,
                        rows);
  for (std::size_t j = 0; j < columns.size(); ++j) {
    for (std::size_t c = 0; c < columns[j].size(); ++c) {
      if ((*this)[columns[j][c]].coupling < 0) continue;
      auto entry = rows[j].col(static_cast<Eigen::Index>(c));
      for (Eigen::Index row = 0; row < count; ++row)
        entry[row] = coupled_entry(static_cast<int>(j), columns[j][c], qd.row(first + row), qdd.row(first + row));
    }
  }
}

double RegressionColumns::coupled_entry(int joint, int index, const Eigen::RowVectorXd& qd,
                                        const Eigen::RowVectorXd& qdd) const {
  const Column& column = (*this)[index];
  const GearCoupling<double>& coupling = structure_.couplings[static_cast<std::size_t>(column.coupling)];
  const Eigen::RowVectorXd& motion = column.kind == ColumnKind::kCouplingInertia ? qdd : qd;
  double value = shared_motion(coupling, motion[coupling.driving], motion[coupling.driven]);
  if (column.kind == ColumnKind::kCouplingCoulomb) value = velocity_sign(value, 0.0);
  if (joint == coupling.driven) return value;
  return joint == coupling.driving ? coupling.ratio * value : 0.0;
}

Eigen::VectorXd RegressionColumns::values(const model::Robot& robot) const {
  Eigen::VectorXd x(count());
  for (int i = 0; i < count(); ++i) {
    const Column& column = (*this)[i];
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(column.joint)];
    const GearCoupling<double>* coupling =
        column.coupling < 0
            ? nullptr
            : find_coupling(robot.couplings, structure_.couplings[static_cast<std::size_t>(column.coupling)]);
    switch (column.kind) {
      case ColumnKind::kLink: x[i] = joint.link[static_cast<std::size_t>(column.entry)]; break;
      case ColumnKind::kRotorInertia: x[i] = joint.actuation.rotor_inertia; break;
      case ColumnKind::kCoulomb: x[i] = joint.actuation.coulomb_friction; break;
      case ColumnKind::kViscous: x[i] = joint.actuation.viscous_friction; break;
      case ColumnKind::kOffset: x[i] = joint.actuation.friction_offset; break;
      case ColumnKind::kCouplingInertia: x[i] = coupling == nullptr ? 0.0 : coupling->rotor_inertia; break;
      case ColumnKind::kCouplingCoulomb: x[i] = coupling == nullptr ? 0.0 : coupling->coulomb_friction; break;
      case ColumnKind::kCouplingViscous: x[i] = coupling == nullptr ? 0.0 : coupling->viscous_friction; break;
    }
  }
  return x;
}

void RegressionColumns::apply(const Eigen::VectorXd& values, model::Robot& robot) const {
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {};
  robot.couplings = structure_.couplings;
  for (int i = 0; i < count(); ++i) {
    const Column& column = (*this)[i];
    model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(column.joint)];
    const auto coupling = [&]() -> GearCoupling<double>& {
      return robot.couplings[static_cast<std::size_t>(column.coupling)];
    };
    switch (column.kind) {
      case ColumnKind::kLink: joint.link[static_cast<std::size_t>(column.entry)] = values[i]; break;
      case ColumnKind::kRotorInertia: joint.actuation.rotor_inertia = values[i]; break;
      case ColumnKind::kCoulomb: joint.actuation.coulomb_friction = values[i]; break;
      case ColumnKind::kViscous: joint.actuation.viscous_friction = values[i]; break;
      case ColumnKind::kOffset: joint.actuation.friction_offset = values[i]; break;
      case ColumnKind::kCouplingInertia: coupling().rotor_inertia = values[i]; break;
      case ColumnKind::kCouplingCoulomb: coupling().coulomb_friction = values[i]; break;
      case ColumnKind::kCouplingViscous: coupling().viscous_friction = values[i]; break;
    }
  }
}

}  // namespace heft::regression
