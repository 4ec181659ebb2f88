#include "instrument_sums.hpp"

#include <cmath>
#include <iterator>
#include <vector>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::identify {
namespace {

/// Columns that hold anything but zeros: in the rows of an outer joint those of the links before it do not.
std::vector<int> filled_columns(const Eigen::Ref<const Eigen::MatrixXd>& rows) {
  std::vector<int> filled;
  for (Eigen::Index c = 0; c < rows.cols(); ++c) {
    if (!(rows.col(c).array() == 0.0).all()) filled.push_back(static_cast<int>(c));
  }
  return filled;
}

}  // namespace

InstrumentSums::InstrumentSums(int joints, int columns, double block, int max_blocks)
    : plain_(joints, columns, block, max_blocks), partition_(block) {}

InstrumentSums::InstrumentSums(const regression::BlockFactors& plain)
    : plain_(plain.num_joints(), plain.num_columns(), plain.partition().first_length(), plain.max_blocks()),
      known_(&plain),
      partition_(plain.partition()) {}

void InstrumentSums::coarsen() {
  partition_.coarsen();
  std::map<regression::BlockPartition::Key, std::vector<Moments>> merged;
  for (auto& [key, joints] : blocks_) {
    const auto [place, fresh] = merged.try_emplace(partition_.coarser(key), joints);
    if (fresh) continue;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      place->second[j].A += joints[j].A;
      place->second[j].r += joints[j].r;
    }
  }
  blocks_ = std::move(merged);
}

void InstrumentSums::add(int log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
                         const Eigen::Ref<const Eigen::MatrixXd>& Z,
                         const Eigen::Ref<const Eigen::MatrixXd>& W,
                         const Eigen::Ref<const Eigen::VectorXd>& y) {
  const Eigen::Index b = num_columns();
  if (Z.cols() != b || W.cols() != b || Z.rows() != W.rows() || y.size() != W.rows() || joint < 0 ||
      joint >= num_joints()) {
    throw DataError(fmt::format(
        "instruments: {} × {} rows of joint {} for a regressor of {} × {}; expected {} columns in both",
        Z.rows(), Z.cols(), joint + 1, W.rows(), W.cols(), b));
  }
  if (known_ == nullptr) plain_.add(log, joint, time, W, y);
  // The plain blocks lead: ours are merged when theirs were.
  while (partition_.level() < plain().partition().level()) coarsen();
  const std::vector<int> in_Z = filled_columns(Z), in_W = filled_columns(W);
  const Eigen::MatrixXd filled_Z = Z(Eigen::all, in_Z), filled_W = W(Eigen::all, in_W);
  for (Eigen::Index first = 0; first < time.size();) {
    const regression::BlockPartition::Key key = partition_.key_of(log, time[first]);
    Eigen::Index end = first;
    while (end < time.size() && partition_.key_of(log, time[end]) == key) ++end;
    std::vector<Moments>& joints =
        blocks_
            .try_emplace(key,
                         std::vector<Moments>(static_cast<std::size_t>(num_joints()),
                                              Moments{Eigen::MatrixXd::Zero(b, b), Eigen::VectorXd::Zero(b)}))
            .first->second;
    Moments& moments = joints[static_cast<std::size_t>(joint)];
    const auto rows = filled_Z.middleRows(first, end - first);
    moments.A(in_Z, in_W) += (rows.transpose() * filled_W.middleRows(first, end - first)).eval();
    moments.r(in_Z) += (rows.transpose() * y.segment(first, end - first)).eval();
    first = end;
  }
}

InstrumentSums::Moments InstrumentSums::weighted(int block, const Eigen::VectorXd& weights) const {
  const std::vector<Moments>& joints = std::next(blocks_.begin(), block)->second;
  Moments sum{Eigen::MatrixXd::Zero(num_columns(), num_columns()), Eigen::VectorXd::Zero(num_columns())};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    sum.A += weights[static_cast<Eigen::Index>(j)] * joints[j].A;
    sum.r += weights[static_cast<Eigen::Index>(j)] * joints[j].r;
  }
  return sum;
}

InstrumentSums::Moments InstrumentSums::weighted(const Eigen::VectorXd& weights) const {
  Moments sum{Eigen::MatrixXd::Zero(num_columns(), num_columns()), Eigen::VectorXd::Zero(num_columns())};
  for (int b = 0; b < num_blocks(); ++b) {
    const Moments block = weighted(b, weights);
    sum.A += block.A;
    sum.r += block.r;
  }
  return sum;
}

}  // namespace heft::identify
