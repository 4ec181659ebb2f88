#include "heft/validate/predict.hpp"

#include <algorithm>

#include "heft/core/effects/displacement.hpp"
#include "heft/model/motion_torque.hpp"

namespace heft::validate {

using Eigen::Index;

struct Predictor::Impl {
  Impl(const model::Robot& robot, double start, const PredictOptions& given)
      : on_rows(robot),
        on_grid(robot),
        begin(start),
        width(given.sign_width, std::min(given.sign_width, kPrismaticSignWidth)) {}

  /// One motion for the log's rows, one for the grid: each carries what is remembered from piece to piece.
  Eigen::MatrixXd predict(model::MotionTorque& motion, bool& started, const Eigen::Ref<const Eigen::VectorXd>& stamps,
                          const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                          const Eigen::MatrixXd& tau, const Eigen::MatrixXd& displacement,
                          const Eigen::MatrixXd& temperature) const {
    const Eigen::VectorXd time = stamps.array() - begin;
    if (!started && tau.cols() > 0) motion.start_from(time, q, qd, qdd, tau, width);
    started = true;
    return motion.torque(time, q, qd, qdd, width, displacement, temperature);
  }

  model::MotionTorque on_rows, on_grid;
  double begin;
  model::SignWidth width;
  bool rows_started{false}, grid_started{false};
};

Predictor::Predictor(const model::Robot& robot, double begin, const PredictOptions& options)
    : impl_(std::make_unique<Impl>(robot, begin, options)) {}
Predictor::~Predictor() = default;
Predictor::Predictor(Predictor&&) noexcept = default;
Predictor& Predictor::operator=(Predictor&&) noexcept = default;

Eigen::MatrixXd Predictor::rows(const data::MotionChunk& piece) {
  return impl_->predict(impl_->on_rows, impl_->rows_started, piece.row_time, piece.row_q(), piece.row_qd(),
                        piece.row_qdd(), piece.row_tau, piece.row_displacement, piece.row_temperature);
}

Eigen::MatrixXd Predictor::grid(const data::MotionChunk& piece) {
  const auto own = [&](const Eigen::MatrixXd& whole) -> Eigen::MatrixXd {
    if (whole.cols() == 0) return {};
    return whole.middleRows(piece.begin, piece.count);
  };
  return impl_->predict(impl_->on_grid, impl_->grid_started, piece.time.segment(piece.begin, piece.count), own(piece.q),
                        own(piece.qd), own(piece.qdd), own(piece.tau), own(piece.displacement), own(piece.temperature));
}

Eigen::MatrixXd Predictor::rows(const MotionRows& piece) {
  return impl_->predict(impl_->on_rows, impl_->rows_started, piece.time, piece.q, piece.qd, piece.qdd, piece.tau,
                        piece.displacement, piece.temperature);
}

namespace {

/// What friction's memory goes by where the model says so: displacements as logged, samples × 2 n; no columns where
/// no effect asks for them or the log has no velocities of its own.
Eigen::MatrixXd displacement_as_logged(const model::Robot& robot, const data::Log& log,
                                       const data::MotionReport& motion) {
  if (!model::needs_measured_displacement(robot) || motion.velocity_derived) return {};
  data::StreamOptions options;
  options.displacement = true;
  options.cut_standstill = false;
  const data::MotionStream stream(log, options);
  Eigen::MatrixXd displacement(log.num_samples(), kMeasuredDisplacements * robot.num_joints());
  Index rows = 0;
  stream.for_each([&](const data::MotionChunk& piece) {
    displacement.middleRows(rows, piece.row_time.size()) = piece.row_displacement;
    rows += piece.row_time.size();
  });
  return displacement;
}

}  // namespace

MotionRows rows_of(const model::Robot& robot, const data::Log& log, const data::MotionReport& motion) {
  MotionRows rows{log.time, log.q, log.qd, log.qdd, log.tau, displacement_as_logged(robot, log, motion)};
  if (model::needs_temperature(robot) && log.temperature.cols() == robot.num_joints())
    rows.temperature = log.temperature;
  return rows;
}

Eigen::MatrixXd predict(const model::Robot& robot, const data::Log& log, const data::MotionReport& motion,
                        const PredictOptions& options) {
  if (log.num_samples() == 0) return Eigen::MatrixXd(0, robot.num_joints());
  MotionRows rows = rows_of(robot, log, motion);
  rows.tau.resize(0, 0);
  return Predictor(robot, log.time[0], options).rows(rows);
}

}  // namespace heft::validate
