#include "heft/model/batch_dynamics.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/error.hpp"
#include "heft/model/sized.hpp"
#include "lanes/lane_arm.hpp"

namespace heft::model {

using Eigen::Index;
using Eigen::MatrixXd;

LaneArm::~LaneArm() = default;

namespace {

bool processor_has(Lanes lanes) {
#if defined(HEFT_WIDE_LANES)
  __builtin_cpu_init();
  switch (lanes) {
    case Lanes::kBaseline: return true;
    case Lanes::kAvx2: return __builtin_cpu_supports("avx2") != 0;
    case Lanes::kAvx512:
      return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
             __builtin_cpu_supports("avx512vl") != 0;
  }
  return false;
#else
  return lanes == Lanes::kBaseline;
#endif
}

MakeLaneArm* maker(Lanes lanes) {
#if defined(HEFT_WIDE_LANES)
  if (lanes == Lanes::kAvx512) return make_avx512_arm;
  if (lanes == Lanes::kAvx2) return make_avx2_arm;
#else
  static_cast<void>(lanes);
#endif
  return make_baseline_arm;
}

using States = BatchDynamics::States;

/// States and results of at least as many rows as there are lanes: where there are fewer, copies whose last row is
/// repeated.
class Padded {
 public:
  Padded(const States& states, std::ptrdiff_t width) {
    if (states.rows() >= width) {
      data_ = states.data(), step_ = states.outerStride(), rows_ = states.rows();
      return;
    }
    copy_ = states;
    copy_.conservativeResize(width, Eigen::NoChange);
    for (Index row = states.rows(); row < width; ++row) copy_.row(row) = states.row(states.rows() - 1);
    data_ = copy_.data(), step_ = copy_.outerStride(), rows_ = width;
  }
  Padded(const Padded&) = delete;
  Padded& operator=(const Padded&) = delete;

  const double* data() const { return data_; }
  Index step() const { return step_; }
  Index rows() const { return rows_; }

 private:
  MatrixXd copy_;
  const double* data_{nullptr};
  Index step_{0}, rows_{0};
};

LaneStates lane_states(const Padded& q, const Padded& qd, const Padded& qdd) {
  return {q.data(), qd.data(), qdd.data(), q.step(), qd.step(), qdd.step(), q.rows()};
}

}  // namespace

const char* to_string(Lanes lanes) {
  switch (lanes) {
    case Lanes::kBaseline: return "baseline";
    case Lanes::kAvx2: return "AVX2";
    case Lanes::kAvx512: return "AVX-512";
  }
  return "?";
}

bool is_available(Lanes lanes) { return processor_has(lanes); }

Lanes widest_lanes() {
  static const Lanes widest = [] {
    for (const Lanes lanes : {Lanes::kAvx512, Lanes::kAvx2}) {
      if (is_available(lanes)) return lanes;
    }
    return Lanes::kBaseline;
  }();
  return widest;
}

struct BatchDynamics::Impl {
  Impl(const Robot& robot, Lanes chosen) : name(robot.name), n(robot.num_joints()), lanes(chosen) {
    if (!is_available(chosen)) {
      throw ModelError(fmt::format("robot \"{}\": dynamics in {} lanes; expected instructions that this build and "
                                   "processor have, which are those of {} at most",
                                   robot.name, to_string(chosen), to_string(widest_lanes())));
    }
    arm.reset(with_joint_count(n, robot.name, [&](auto joints) -> LaneArm* {
      const DynamicArm<double, joints> scalar(to_arm_model<joints>(robot));
      return maker(chosen)(joints, &scalar);
    }));
    rotors.setZero(n, n);
    for (Index j = 0; j < n; ++j) rotors(j, j) = robot.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia;
  }

  void check(const char* what, Index rows, Index columns, Index expected_rows, Index expected_columns) const {
    if (rows == expected_rows && columns == expected_columns) return;
    throw ModelError(fmt::format("robot \"{}\": {} of {} × {} values; expected {} × {}", name, what, rows, columns,
                                 expected_rows, expected_columns));
  }
  void check(const States& q, const States& qd, const States& third, const char* name_of_third) const {
    check("q", q.rows(), q.cols(), q.rows(), n);
    check("qd", qd.rows(), qd.cols(), q.rows(), n);
    check(name_of_third, third.rows(), third.cols(), q.rows(), n);
  }

  /// Calls compute(result, step) with `result` itself, or with a larger one whose upper rows become it.
  template <typename F>
  void into(Result result, F&& compute) const {
    if (result.rows() >= arm->width()) {
      compute(result.data(), result.outerStride());
      return;
    }
    MatrixXd more(arm->width(), result.cols());
    compute(more.data(), more.outerStride());
    result = more.topRows(result.rows());
  }

  std::string name;
  int n;
  Lanes lanes;
  std::unique_ptr<LaneArm> arm;
  MatrixXd rotors;  ///< n × n, their inertia
};

BatchDynamics::BatchDynamics(const Robot& robot, Lanes lanes) : impl_(std::make_unique<Impl>(robot, lanes)) {}
BatchDynamics::~BatchDynamics() = default;
BatchDynamics::BatchDynamics(BatchDynamics&&) noexcept = default;
BatchDynamics& BatchDynamics::operator=(BatchDynamics&&) noexcept = default;

int BatchDynamics::num_joints() const { return impl_->n; }
Lanes BatchDynamics::lanes() const { return impl_->lanes; }

void BatchDynamics::inverse_dynamics(const States& q, const States& qd, const States& qdd, Result tau) const {
  impl_->check(q, qd, qdd, "qdd");
  impl_->check("result", tau.rows(), tau.cols(), q.rows(), impl_->n);
  if (q.rows() == 0) return;
  const LaneArm& arm = *impl_->arm;
  const Padded all_q(q, arm.width()), all_qd(qd, arm.width()), all_qdd(qdd, arm.width());
  impl_->into(tau, [&](double* to, Index step) {
    arm.inverse_dynamics(lane_states(all_q, all_qd, all_qdd), to, step);
  });
}

MatrixXd BatchDynamics::inverse_dynamics(const States& q, const States& qd, const States& qdd) const {
  MatrixXd tau(q.rows(), impl_->n);
  inverse_dynamics(q, qd, qdd, tau);
  return tau;
}

MatrixXd BatchDynamics::gravity_torque(const States& q) const {
  const MatrixXd still = MatrixXd::Zero(q.rows(), q.cols());
  return inverse_dynamics(q, still, still);
}

void BatchDynamics::regressor_rows(const States& q, const States& qd, const States& qdd,
                                   const std::vector<std::vector<int>>& columns, RegressorRows& rows) const {
  impl_->check(q, qd, qdd, "qdd");
  const auto n = static_cast<Index>(impl_->n);
  impl_->check("lists of columns", static_cast<Index>(columns.size()), 1, n, 1);
  const LaneArm& arm = *impl_->arm;
  const Padded all_q(q, arm.width()), all_qd(qd, arm.width()), all_qdd(qdd, arm.width());
  const Index link_columns = kParametersPerLink * n;
  std::vector<Index> counts;
  for (const std::vector<int>& list : columns) counts.push_back(static_cast<Index>(list.size()));
  rows.resize(q.rows(), counts, all_q.rows());
  std::vector<double*> places(static_cast<std::size_t>(n * link_columns), rows.spare());
  for (Index j = 0; j < n; ++j) {
    const std::vector<int>& list = columns[static_cast<std::size_t>(j)];
    RegressorRows::Matrix matrix = rows[static_cast<std::size_t>(j)];
    for (std::size_t c = 0; c < list.size(); ++c) {
      const Index column = list[c];
      if (column < 0 || column >= 14 * n) {
        throw ModelError(fmt::format("robot \"{}\": column {} of the regressor; expected 0 to {}", impl_->name,
                                     column, 14 * n - 1));
      }
      auto to = matrix.col(static_cast<Index>(c));
      if (column < link_columns) {
        if (column / kParametersPerLink < j) {
          to.setZero();
        } else {
          places[static_cast<std::size_t>(j * link_columns + column)] = to.data();
        }
        continue;
      }
      if ((column - link_columns) % n != j) {
        to.setZero();
        continue;
      }
      switch ((column - link_columns) / n) {
        case 0: to = qdd.col(j); break;
        case 1: to = qd.col(j).unaryExpr([](double v) { return velocity_sign(v, 0.0); }); break;
        case 2: to = qd.col(j); break;
        default: to.setOnes(); break;
      }
    }
  }
  if (q.rows() == 0) return;
  arm.regressor(lane_states(all_q, all_qd, all_qdd), places.data());
}

std::vector<MatrixXd> BatchDynamics::regressor_rows(const States& q, const States& qd, const States& qdd,
                                                    const std::vector<int>& columns) const {
  std::vector<int> wanted = columns;
  for (int c = 0; columns.empty() && c < 14 * impl_->n; ++c) wanted.push_back(c);
  RegressorRows rows;
  regressor_rows(q, qd, qdd, std::vector<std::vector<int>>(static_cast<std::size_t>(impl_->n), wanted), rows);
  std::vector<MatrixXd> matrices;
  for (std::size_t j = 0; j < rows.size(); ++j) matrices.emplace_back(rows[j]);
  return matrices;
}

void BatchDynamics::mass_matrix(const States& q, Result mass) const {
  impl_->check(q, q, q, "q");
  const Index n = impl_->n;
  impl_->check("result", mass.rows(), mass.cols(), q.rows(), n * n);
  if (q.rows() == 0) return;
  const Padded all_q(q, impl_->arm->width());
  impl_->into(mass, [&](double* to, Index step) {
    impl_->arm->mass_matrix(lane_states(all_q, all_q, all_q), to, step);
  });
}

void BatchDynamics::forward_dynamics(const States& q, const States& qd, const States& tau, Result qdd) const {
  forward_dynamics(q, qd, tau, impl_->rotors, std::move(qdd));
}

void BatchDynamics::forward_dynamics(const States& q, const States& qd, const States& tau, const MatrixXd& drives,
                                     Result qdd) const {
  impl_->check(q, qd, tau, "torque");
  impl_->check("drives", drives.rows(), drives.cols(), impl_->n, impl_->n);
  impl_->check("result", qdd.rows(), qdd.cols(), q.rows(), impl_->n);
  if (q.rows() == 0) return;
  const LaneArm& arm = *impl_->arm;
  const Padded all_q(q, arm.width()), all_qd(qd, arm.width()), all_tau(tau, arm.width());
  std::ptrdiff_t done = 0;
  impl_->into(qdd, [&](double* to, Index step) {
    done = arm.forward_dynamics(lane_states(all_q, all_qd, all_tau), drives.data(), to, step);
  });
  if (done >= all_q.rows()) return;
  // One state of the pack. Alone it fills a pack.
  const Index last = std::min<Index>(done + arm.width(), q.rows());
  for (Index row = done; row < last; ++row) {
    const Padded one_q(q.row(row), arm.width()), one_qd(qd.row(row), arm.width()),
        one_tau(tau.row(row), arm.width());
    MatrixXd unused(arm.width(), impl_->n);
    if (arm.forward_dynamics(lane_states(one_q, one_qd, one_tau), drives.data(), unused.data(),
                             unused.outerStride()) < arm.width()) {
      throw ModelError(fmt::format("robot \"{}\": the mass matrix at state {} is not positive definite; expected "
                                   "links whose inertia is physically possible",
                                   impl_->name, row));
    }
  }
}

}  // namespace heft::model
