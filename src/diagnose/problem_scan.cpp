// Many shapes of a candidate against each other, by the gain on all rows.
#include <algorithm>

#include "heft/host/decompositions.hpp"
#include "moments.hpp"
#include "problem.hpp"
#include "products.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

WideMoments Problem::wide_moments(int joint, Index columns, int each, const WriteRows& write) const {
  const auto j = static_cast<std::size_t>(joint);
  const MatrixXd& base = (*rows_)[j];
  const auto p = static_cast<Index>(places_[j].size());
  WideMoments m{joint, each, MatrixXd::Zero(p + 1, columns), MatrixXd::Zero(each, columns)};
  MatrixXd of_base = MatrixXd::Zero(base.cols(), columns), torque = MatrixXd::Zero(1, columns);
  MatrixXd of_own = MatrixXd::Zero(own_[j].cols(), columns);
  MatrixXd values(kProductPiece, columns);
  for (Index from = 0; from < base.rows(); from += kProductPiece) {
    const Index count = std::min(kProductPiece, base.rows() - from);
    auto C = values.topRows(count);
    write(from, C);
    C.array().colwise() *= keep_->col(joint).segment(from, count).array();
    add_transposed_times(base.middleRows(from, count), C, of_base);
    if (of_own.rows() > 0) add_transposed_times(own_[j].middleRows(from, count), C, of_own);
    add_transposed_times(tau_.col(joint).segment(from, count), C, torque);
    for (Index c = 0; c + each <= columns; c += each)
      add_transposed_times(C.middleCols(c, each), C.middleCols(c, each), m.square.middleCols(c, each));
  }
  m.cross.topRows(base.cols()) = of_base;
  if (of_own.rows() > 0) m.cross(own_at_[j], Eigen::all) = of_own;
  m.cross.row(p) = torque;
  return m;
}

std::vector<std::pair<double, VectorXd>> Problem::scan(const WideMoments& m) const {
  const auto j = static_cast<std::size_t>(m.joint);
  const double w = weight(m.joint);
  const Index p = m.cross.rows() - 1, each = m.each;
  MatrixXd B = MatrixXd::Zero(columns_, m.cross.cols());
  for (Index r = 0; r < p; ++r) {
    const int place = places_[j][static_cast<std::size_t>(r)];
    B.row(place) = w / base_->scale[place] * m.cross.row(r);
  }
  solve_lower(base_->factor, B);
  const VectorXd t = w * m.cross.row(p).transpose() - B.transpose() * base_->z;
  std::vector<std::pair<double, VectorXd>> result;
  for (Index c = 0; c + each <= m.cross.cols(); c += each) {
    const MatrixXd S = w * m.square.middleCols(c, each);
    const MatrixXd left = S - B.middleCols(c, each).transpose() * B.middleCols(c, each);
    bool explained = false;
    for (Index k = 0; k < each; ++k) explained = explained || !(left(k, k) > 1e-5 * S(k, k));
    VectorXd c_hat = t.segment(c, each);
    if (explained || !solve_positive(left, c_hat)) {
      result.emplace_back(0.0, VectorXd::Zero(each));
      continue;
    }
    result.emplace_back(c_hat.dot(t.segment(c, each)), c_hat);
  }
  return result;
}

std::vector<double> Problem::gains(std::span<const WideMoments> joints, int without) const {
  const int each = joints.front().each;
  std::vector<double> result;
  for (Index c = 0; c + each <= joints.front().cross.cols(); c += each) {
    ColumnMoments m{each, {}, {{}}, {{}}};
    for (const WideMoments& of_joint : joints) {
      m.joints.push_back(of_joint.joint);
      m.cross[0].emplace_back(of_joint.cross.middleCols(c, each));
      m.square[0].emplace_back(of_joint.square.middleCols(c, each));
    }
    result.push_back(gain(m, without));
  }
  return result;
}

std::vector<double> Problem::gains(const WideMoments& columns, const std::vector<MatrixXd>& combinations,
                                   int without) const {
  std::vector<double> result;
  for (const MatrixXd& T : combinations) {
    const MatrixXd cross = columns.cross * T, square = T.transpose() * columns.square * T;
    result.push_back(gain({static_cast<int>(T.cols()), {columns.joint}, {{cross}}, {{square}}}, without));
  }
  return result;
}

std::vector<double> Problem::gains(std::span<const WideMoments> joints,
                                   const std::vector<std::vector<MatrixXd>>& combinations) const {
  std::vector<double> result;
  for (const std::vector<MatrixXd>& shape : combinations) {
    ColumnMoments m{static_cast<int>(shape.front().cols()), {}, {{}}, {{}}};
    for (std::size_t j = 0; j < joints.size(); ++j) {
      m.joints.push_back(joints[j].joint);
      m.cross[0].emplace_back(joints[j].cross * shape[j]);
      m.square[0].emplace_back(shape[j].transpose() * joints[j].square * shape[j]);
    }
    result.push_back(gain(m));
  }
  return result;
}

}  // namespace heft::diagnose
