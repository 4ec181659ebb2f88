#include "base_model.hpp"

#include <algorithm>
#include <utility>

#include "heft/data/motion_stream.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/parallel.hpp"
#include "heft/regression/weighted_fit.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using regression::ColumnKind;

Motion rigid_motion(const MotionTable& table) {
  return {table.q, table.qd, table.qdd, table.q, table.qd, table.qdd, table.direction, table.displacement};
}

regression::ModelStructure searched_structure() {
  return {.rotor_inertia = false, .coulomb = true, .viscous = true, .offset = false, .couplings = {}};
}

regression::ModelStructure written_structure(bool joint_sensor) {
  return {.rotor_inertia = !joint_sensor, .coulomb = true, .viscous = true, .offset = true, .couplings = {}};
}

BaseModel::BaseModel(const model::Robot& robot, const regression::ModelStructure& structure)
    : columns_(robot, structure),
      base_(regression::find_base_parameters(columns_)),
      places_(static_cast<std::size_t>(columns_.num_joints())),
      coulomb_(places_.size(), -1),
      viscous_(places_.size(), -1),
      rotor_(places_.size(), -1),
      offset_(places_.size(), -1) {
  for (int c = 0; c < columns(); ++c) {
    const regression::Column& column = columns_[base_.kept[static_cast<std::size_t>(c)]];
    for (int j = 0; j < num_joints(); ++j) {
      const bool reaches = column.kind == ColumnKind::kLink ? column.joint >= j : column.joint == j;
      if (reaches) places_[static_cast<std::size_t>(j)].push_back(c);
    }
    if (column.kind == ColumnKind::kCoulomb) coulomb_[static_cast<std::size_t>(column.joint)] = c;
    if (column.kind == ColumnKind::kViscous) viscous_[static_cast<std::size_t>(column.joint)] = c;
    if (column.kind == ColumnKind::kRotorInertia) rotor_[static_cast<std::size_t>(column.joint)] = c;
    if (column.kind == ColumnKind::kOffset) offset_[static_cast<std::size_t>(column.joint)] = c;
  }
}

bool BaseModel::is_link(int column) const {
  return column < columns() &&
         columns_[base_.kept[static_cast<std::size_t>(column)]].kind == ColumnKind::kLink;
}

BaseRows BaseModel::rows(const Motion& motion) const {
  constexpr Index kPiece = 256;  // rows of a job: they stay in the cache
  BaseRows rows;
  const Index m = motion.q.rows();
  std::vector<std::vector<int>> columns;
  for (const auto& list : places_) {
    rows.emplace_back(m, static_cast<Index>(list.size()));
    columns.emplace_back();
    for (const int place : list) columns.back().push_back(base_.kept[static_cast<std::size_t>(place)]);
  }
  host::for_each_parallel(static_cast<std::size_t>((m + kPiece - 1) / kPiece), [&](std::size_t piece) {
    const Index from = static_cast<Index>(piece) * kPiece, count = std::min(kPiece, m - from);
    model::RegressorRows of_links;
    columns_.fill(motion.link_q, motion.link_qd, motion.link_qdd, from, count, columns, of_links);
    for (std::size_t j = 0; j < places_.size(); ++j) {
      rows[j].middleRows(from, count) = of_links[j];
      put_motor_columns(motion, j, from, count, rows[j]);
    }
  });
  return rows;
}

/// Puts in what goes with the motor's motion, which is not the link's where a joint is elastic.
void BaseModel::put_motor_columns(const Motion& motion, std::size_t j, Index first, Index count, MatrixXd& rows) const {
  const auto joint = static_cast<Index>(j);
  for (std::size_t c = 0; c < places_[j].size(); ++c) {
    const int place = places_[j][c];
    auto values = rows.col(static_cast<Index>(c)).segment(first, count);
    if (place == coulomb_[j]) {
      values = motion.direction.col(joint).segment(first, count);
    } else if (place == viscous_[j]) {
      values = motion.qd.col(joint).segment(first, count);
    } else if (place == rotor_[j]) {
      values = motion.qdd.col(joint).segment(first, count);
    }
  }
}

MatrixXd BaseModel::torque(const BaseRows& rows, const VectorXd& beta, Index begin, Index count) const {
  MatrixXd tau(count, num_joints());
  host::for_each_parallel(rows.size(), [&](std::size_t j) {
    tau.col(static_cast<Index>(j)) = rows[j].middleRows(begin, count) * beta(places_[j]);
  });
  return tau;
}

model::Robot BaseModel::robot(const VectorXd& beta) const {
  // Nearest in the norm of the parameters: x = x0 + Fᵀ (F Fᵀ)⁻¹ (β - G x0), F the columns of G that may move.
  const MatrixXd& G = base_.regrouping;
  MatrixXd F = G;
  for (int p = 0; p < columns_.count(); ++p) {
    const bool own = std::find(base_.kept.begin(), base_.kept.end(), p) != base_.kept.end();
    if (columns_[p].kind == ColumnKind::kRotorInertia && !own) F.col(p).setZero();
  }
  const VectorXd x0 = columns_.values(columns_.robot());
  VectorXd change = beta.head(columns()) - G * x0;
  solve_positive(F * F.transpose(), change);
  const VectorXd x = x0 + F.transpose() * change;
  model::Robot robot = columns_.robot();
  columns_.apply(x, robot);
  return robot;
}

namespace {

/// Logs as identify reads them.
class Streams {
 public:
  explicit Streams(const std::vector<data::Log>& logs) {
    for (const data::Log& log : logs) streams_.emplace_back(log);
    for (const data::MotionStream& stream : streams_) list_.push_back(&stream);
  }
  const std::vector<const data::MotionStream*>& list() const { return list_; }

 private:
  std::vector<data::MotionStream> streams_;
  std::vector<const data::MotionStream*> list_;
};

}  // namespace

VectorXd BaseModel::identified(const std::vector<data::Log>& logs) const {
  return identified(regression::compressed(columns_, base_, Streams(logs).list(), {}));
}

VectorXd BaseModel::identified(regression::BlockFactors rows) const {
  const VectorXd prior = base_.regrouping * columns_.values(columns_.robot());
  regression::WeightedFit fit(std::move(rows));
  regression::weigh_joints(prior, regression::kRidgeFromCondition, true, fit);
  return fit.solution.beta;
}

regression::BlockFactors BaseModel::rows_in_parts(const std::vector<data::Log>& logs, int parts,
                                                  const std::function<int(int log, double time)>& part) const {
  constexpr double kLength = 1.0;  // [s]; all rows of a part get one time, so that it is one block
  regression::BlockFactors factors(num_joints(), columns(), kLength, parts);
  regression::for_each_observation(
      columns_, base_.kept, Streams(logs).list(), {}, [&](const regression::ObservationRows& rows) {
        for (Index first = 0; first < rows.time.size();) {
          const int of = part(rows.log, rows.time[first]);
          Index end = first + 1;
          while (end < rows.time.size() && part(rows.log, rows.time[end]) == of) ++end;
          const Index count = end - first;
          factors.add(of, rows.joint, VectorXd::Zero(count), rows.W.middleRows(first, count),
                      rows.tau.segment(first, count));
          first = end;
        }
      });
  return factors;
}

MatrixXd BaseModel::hidden_masses() const {
  const auto entry_of = [&](int column) { return 10 * columns_[column].joint + columns_[column].entry; };
  std::vector<VectorXd> found;
  for (int p = 0; p < columns_.count(); ++p) {
    if (columns_[p].kind != ColumnKind::kLink || std::find(base_.kept.begin(), base_.kept.end(), p) != base_.kept.end())
      continue;
    // The kept columns of G are the identity: x_p is made up for by them.
    VectorXd direction = VectorXd::Zero(10 * num_joints());
    direction[entry_of(p)] = 1.0;
    bool of_links = true;
    for (int b = 0; b < columns(); ++b) {
      const double share = base_.regrouping(b, p);
      if (share == 0.0) continue;
      of_links = of_links && is_link(b);
      if (is_link(b)) direction[entry_of(base_.kept[static_cast<std::size_t>(b)])] -= share;
    }
    if (of_links) found.push_back(std::move(direction));
  }
  MatrixXd directions(10 * num_joints(), static_cast<Index>(found.size()));
  for (std::size_t k = 0; k < found.size(); ++k) directions.col(static_cast<Index>(k)) = found[k];
  return directions;
}

VectorXd BaseModel::prior() const {
  VectorXd beta = base_.regrouping * columns_.values(columns_.robot());
  for (int c = 0; c < columns(); ++c) {
    const ColumnKind kind = columns_[base_.kept[static_cast<std::size_t>(c)]].kind;
    if (kind != ColumnKind::kLink && kind != ColumnKind::kRotorInertia) beta[c] = 0.0;
  }
  return beta;
}

MatrixXd BaseModel::link_share(int link) const { return base_.regrouping.middleCols(10 * link, 10); }

std::vector<MatrixXd> BaseModel::columns_of(const BaseRows& rows, const MatrixXd& share) const {
  std::vector<MatrixXd> all;
  for (std::size_t j = 0; j < rows.size(); ++j) all.emplace_back(rows[j] * share(places_[j], Eigen::all));
  return all;
}

}  // namespace heft::diagnose
