#include "arm_error.hpp"

#include <cstddef>
#include <utility>

#include "heft/host/decompositions.hpp"

namespace heft::payload {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ArmError::ArmError(VectorXd prior_variance, std::optional<MatrixXd> model_covariance,
                   std::vector<statistics::Interval> drive_scale)
    : prior_variance_(std::move(prior_variance)),
      model_covariance_(std::move(model_covariance)),
      drive_scale_(std::move(drive_scale)) {
  restart();
}

void ArmError::restart() {
  const Index p = prior_variance_.size();
  information_ = prior_variance_.cwiseInverse().asDiagonal();
  scatter_ = information_;
  dependence_ = MatrixXd::Zero(p, model_covariance_ ? model_covariance_->rows() : 0);
  pull_.assign(drive_scale_.size(), MatrixXd::Zero(p, 10));
}

void ArmError::add(int i, const VectorXd& regressor, const VectorXd& load, double sign, double rate,
                   double variance, double together) {
  VectorXd w = VectorXd::Zero(prior_variance_.size());
  w.head(10) = load;
  w[10 + 2 * i] = sign;
  w[11 + 2 * i] = rate;
  const VectorXd weighted = w / variance;
  const auto at = static_cast<std::size_t>(i);
  const double scale = drive_scale_.empty() ? 1.0 : drive_scale_[at].value;
  information_ += weighted * w.transpose();
  scatter_ += together * weighted * w.transpose();
  if (model_covariance_) dependence_ += weighted * regressor.transpose() / scale;
  if (!drive_scale_.empty()) pull_[at] += weighted * load.transpose();
}

MatrixXd ArmError::inverse() const {
  // A⁻¹ is symmetric: its first ten rows, from its first ten columns.
  MatrixXd rows = MatrixXd::Identity(prior_variance_.size(), 10);
  if (!solve_positive(information_, rows)) rows.setZero();
  return rows.transpose();
}

MatrixXd ArmError::residual() const {
  const MatrixXd rows = inverse();
  return rows * scatter_ * rows.transpose();
}

MatrixXd ArmError::covariance(const VectorXd& load) const {
  const MatrixXd inverse = this->inverse();
  MatrixXd sum = MatrixXd::Zero(10, 10);
  if (model_covariance_) {
    const MatrixXd slope = inverse * dependence_;
    sum += slope * *model_covariance_ * slope.transpose();
  }
  for (std::size_t i = 0; i < drive_scale_.size(); ++i) {
    const VectorXd moved = inverse * (pull_[i] * load) * (drive_scale_[i].std / drive_scale_[i].value);
    sum += moved * moved.transpose();
  }
  return sum;
}

}  // namespace heft::payload
