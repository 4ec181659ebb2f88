#include "integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <cvode/cvode.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "heft/host/error.hpp"

namespace heft::sim {
namespace {

/// Largest shift before a fresh start. CVODE keeps about sixteen digits of the shifted coordinates, of which
/// three are to remain below the absolute tolerance.
double max_shift(double absolute_tolerance) { return std::clamp(1e13 * absolute_tolerance, 1.0, 1e3); }

class Multistep final : public Integrator {
 public:
  Multistep(System& system, const SolverSettings& settings) : Integrator(system, settings) {
    scratch_.assign(state_.size(), 0.0);
    s0_.assign(static_cast<std::size_t>(n_), 0.0);
    s1_ = s0_;
    s2_ = s0_;
    check(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
    y_ = N_VNew_Serial(2 * n_ + m_, context_);
    cvode_ = CVodeCreate(adams() ? CV_ADAMS : CV_BDF, context_);
    if (y_ == nullptr || cvode_ == nullptr)
      throw Error("simulation: CVODE could not be created (out of memory)");
  }

  ~Multistep() override {
    CVodeFree(&cvode_);
    if (nonlinear_ != nullptr) SUNNonlinSolFree(nonlinear_);
    if (linear_ != nullptr) SUNLinSolFree(linear_);
    if (matrix_ != nullptr) SUNMatDestroy(matrix_);
    if (y_ != nullptr) N_VDestroy(y_);
    SUNContext_Free(&context_);
  }

  void start(double t, const double* q, const double* qd, const double* z) override {
    t_ = t;
    std::copy(q, q + n_, state_.begin());
    std::copy(qd, qd + n_, state_.begin() + n_);
    std::copy(z, z + m_, state_.begin() + 2 * n_);
    begin();
  }

  Stop advance(double t_stop) override { return go(t_stop, t_stop); }
  Stop advance_freely(double t_out, double t_limit) override { return go(t_out, t_limit); }

  void kick(const double* before, const double* after, const double*) override {
    if (settings_.restart_at_samples) {
      begin();
      return;
    }
    rebase_shift(t_);
    double largest = 0.0;
    for (std::size_t k = 0; k < s2_.size(); ++k) {
      s2_[k] += after[k] - before[k];
      largest = std::max({largest, std::abs(s0_[k]), std::abs(s1_[k])});
    }
    if (largest > max_shift(settings_.absolute_tolerance)) begin();
  }

  void add_counts(SolverCounts& counts) const override {
    counts += past_;
    count(counts);
  }

 private:
  bool adams() const { return settings_.method != SolverMethod::kBdf; }

  void check(int flag, const char* call) const {
    if (flag >= 0) return;
    if (!failure_.empty()) throw SimulationError(failure_);
    if (flag == CV_TOO_MUCH_WORK) throw_used_up();
    throw_no_step(fmt::format("CVODE, {}, code {}: {}", call, flag,
                              solver_message_.empty() ? "no further message" : solver_message_));
  }

  void unshift(double at, const double* shifted, double* out) const {
    const double tau = at - shift_time_;
    for (int i = 0; i < n_; ++i) {
      const auto k = static_cast<std::size_t>(i);
      out[i] = shifted[i] + (s0_[k] + tau * (s1_[k] + 0.5 * tau * s2_[k]));
      out[n_ + i] = shifted[n_ + i] + (s1_[k] + tau * s2_[k]);
    }
    for (int i = 2 * n_; i < 2 * n_ + m_; ++i) out[i] = shifted[i];
  }

  void rebase_shift(double at) {
    const double tau = at - shift_time_;
    for (std::size_t k = 0; k < s0_.size(); ++k) {
      s0_[k] += tau * (s1_[k] + 0.5 * tau * s2_[k]);
      s1_[k] += tau * s2_[k];
    }
    shift_time_ = at;
  }

  static int rate(realtype t, N_Vector y, N_Vector ydot, void* self) {
    auto& impl = *static_cast<Multistep*>(self);
    const double* shifted = N_VGetArrayPointer(y);
    double* out = N_VGetArrayPointer(ydot);
    impl.unshift(t, shifted, impl.scratch_.data());
    const double* x = impl.scratch_.data();
    const int n = impl.n_;
    try {
      impl.system_.evaluate(t, x, x + n, x + 2 * n, out + n, out + 2 * n);
    } catch (const std::exception& e) {
      impl.failure_ = e.what();
      return -1;
    }
    bool finite = true;
    for (int i = 0; i < n; ++i) {
      out[i] = shifted[n + i];
      finite = finite && std::isfinite(out[n + i]);
      out[n + i] -= impl.s2_[static_cast<std::size_t>(i)];
    }
    return finite ? 0 : 1;  // 1: CVODE tries a smaller step
  }

  static int root(realtype t, N_Vector y, realtype* g, void* self) {
    auto& impl = *static_cast<Multistep*>(self);
    impl.unshift(t, N_VGetArrayPointer(y), impl.scratch_.data());
    const double* x = impl.scratch_.data();
    try {
      impl.system_.roots(t, x, x + impl.n_, x + 2 * impl.n_, g);
    } catch (const std::exception& e) {
      impl.failure_ = e.what();
      return -1;
    }
    return 0;
  }

  /// Weights from the true state: the shift must not loosen the tolerance.
  static int weights(N_Vector y, N_Vector weight, void* self) {
    auto& impl = *static_cast<Multistep*>(self);
    realtype t = impl.t_;
    CVodeGetCurrentTime(impl.cvode_, &t);
    impl.unshift(t, N_VGetArrayPointer(y), impl.scratch_.data());
    double* w = N_VGetArrayPointer(weight);
    for (std::size_t i = 0; i < impl.scratch_.size(); ++i) {
      w[i] = 1.0 / (impl.settings_.relative_tolerance * std::abs(impl.scratch_[i]) +
                    impl.settings_.absolute_tolerance);
      if (!std::isfinite(w[i])) return -1;
    }
    return 0;
  }

  static void report(int code, const char*, const char*, char* message, void* self) {
    if (code < 0) static_cast<Multistep*>(self)->solver_message_ = message;
  }

  void fill_shifted() {
    double* x = N_VGetArrayPointer(y_);
    for (std::size_t i = 0; i < state_.size(); ++i) x[i] = state_[i];
    std::fill(s0_.begin(), s0_.end(), 0.0);
    std::fill(s1_.begin(), s1_.end(), 0.0);
    std::fill(s2_.begin(), s2_.end(), 0.0);
    shift_time_ = t_;
  }

  void begin() {
    fill_shifted();
    if (!started_) {
      check(CVodeInit(cvode_, &Multistep::rate, t_, y_), "CVodeInit");
      check(CVodeSetUserData(cvode_, this), "CVodeSetUserData");
      check(CVodeSetErrHandlerFn(cvode_, &Multistep::report, this), "CVodeSetErrHandlerFn");
      check(CVodeWFtolerances(cvode_, &Multistep::weights), "CVodeWFtolerances");
      if (adams()) {
        nonlinear_ = SUNNonlinSol_FixedPoint(y_, 0, context_);
        check(CVodeSetNonlinearSolver(cvode_, nonlinear_), "CVodeSetNonlinearSolver");
      } else {
        matrix_ = SUNDenseMatrix(2 * n_ + m_, 2 * n_ + m_, context_);
        linear_ = SUNLinSol_Dense(y_, matrix_, context_);
        check(CVodeSetLinearSolver(cvode_, linear_, matrix_), "CVodeSetLinearSolver");
      }
      if (settings_.max_step > 0.0) check(CVodeSetMaxStep(cvode_, settings_.max_step), "CVodeSetMaxStep");
      if (system_.num_roots() > 0) {
        check(CVodeRootInit(cvode_, system_.num_roots(), &Multistep::root), "CVodeRootInit");
        std::vector<int> falling(static_cast<std::size_t>(system_.num_roots()), -1);
        check(CVodeSetRootDirection(cvode_, falling.data()), "CVodeSetRootDirection");
        check(CVodeSetNoInactiveRootWarn(cvode_), "CVodeSetNoInactiveRootWarn");
      }
      started_ = true;
    } else {
      count(past_);
      check(CVodeReInit(cvode_, t_, y_), "CVodeReInit");
      past_.restarts += 1;
    }
    fresh_ = true;
  }

  void count(SolverCounts& counts) const {
    if (!started_) return;
    long int steps = 0, evaluations = 0, failures = 0, root_evaluations = 0, linear_evaluations = 0;
    CVodeGetNumSteps(cvode_, &steps);
    CVodeGetNumRhsEvals(cvode_, &evaluations);
    CVodeGetNumErrTestFails(cvode_, &failures);
    if (system_.num_roots() > 0) CVodeGetNumGEvals(cvode_, &root_evaluations);
    if (!adams()) CVodeGetNumLinRhsEvals(cvode_, &linear_evaluations);
    counts.steps += steps;
    counts.evaluations += evaluations + linear_evaluations;
    counts.failed_steps += failures;
    counts.event_evaluations += root_evaluations;
  }

  Stop go(double to, double limit) {
    // CVODE cannot start towards a time that is only rounding away; nothing happens on the way there.
    if (fresh_ && to - t_ <= 1e-14 * std::max(1.0, std::abs(to))) {
      t_ = to;
      return Stop::kReached;
    }
    fresh_ = false;
    check(CVodeSetStopTime(cvode_, limit), "CVodeSetStopTime");
    check(CVodeSetMaxNumSteps(cvode_, std::max(1L, static_cast<long>(steps_left_))), "CVodeSetMaxNumSteps");
    long before = 0, after = 0;
    CVodeGetNumSteps(cvode_, &before);
    realtype reached = t_;
    const int flag = CVode(cvode_, to, y_, &reached, CV_NORMAL);
    if (flag < 0) t_ = reached;
    check(flag, "CVode");
    CVodeGetNumSteps(cvode_, &after);
    steps_left_ -= static_cast<double>(after - before);
    t_ = reached;
    unshift(t_, N_VGetArrayPointer(y_), state_.data());
    if (flag == CV_ROOT_RETURN) {
      check(CVodeGetRootInfo(cvode_, events_.data()), "CVodeGetRootInfo");
      return Stop::kEvent;
    }
    return Stop::kReached;
  }

  bool started_{false};
  bool fresh_{false};  ///< no step since the last start
  SUNContext context_{nullptr};
  void* cvode_{nullptr};
  N_Vector y_{nullptr};
  SUNMatrix matrix_{nullptr};
  SUNLinearSolver linear_{nullptr};
  SUNNonlinearSolver nonlinear_{nullptr};
  std::string solver_message_;
  std::string failure_;  ///< text of an exception inside a callback
  // Shift S(t) = s0 + s1 τ + s2 τ²/2 with τ = t − shift_time, per position.
  double shift_time_{0.0};
  std::vector<double> s0_, s1_, s2_;
  std::vector<double> scratch_;  ///< true state during callbacks
  SolverCounts past_;            ///< counts before the last start
};

}  // namespace

std::unique_ptr<Integrator> make_multistep(System& system, const SolverSettings& settings) {
  return std::make_unique<Multistep>(system, settings);
}

}  // namespace heft::sim
