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

/// Most steps that may be saved up for one sample.
constexpr double kMostSteps = 1e5;

}  // namespace

struct Integrator::Impl {
  System& system;
  SolverSettings settings;
  int n;
  int m;
  bool started{false};
  bool fresh{false};  ///< no step since the last start
  SUNContext context{nullptr};
  void* cvode{nullptr};
  N_Vector y{nullptr};
  N_Vector tolerance{nullptr};
  SUNMatrix matrix{nullptr};
  SUNLinearSolver linear{nullptr};
  SUNNonlinearSolver nonlinear{nullptr};
  std::string solver_message;
  std::string failure;  ///< text of an exception inside a callback

  double t{0.0};
  std::vector<double> state;  ///< true q, q̇, z at t
  // Shift S(t) = s0 + s1 τ + s2 τ²/2 with τ = t − shift_time, per position.
  double shift_time{0.0};
  std::vector<double> s0, s1, s2;
  std::vector<double> scratch;  ///< true state during callbacks
  std::vector<int> events;
  SolverCounts past;  ///< counts before the last start
  double steps_left{kMostSteps};

  Impl(System& sys, const SolverSettings& set)
      : system(sys), settings(set), n(sys.num_positions()), m(sys.num_extra()) {
    const auto dim = static_cast<std::size_t>(2 * n + m);
    state.assign(dim, 0.0);
    scratch.assign(dim, 0.0);
    s0.assign(static_cast<std::size_t>(n), 0.0);
    s1 = s0;
    s2 = s0;
    events.assign(static_cast<std::size_t>(std::max(1, system.num_roots())), 0);
    check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
    y = N_VNew_Serial(2 * n + m, context);
    cvode = CVodeCreate(settings.method == SolverMethod::kAdams ? CV_ADAMS : CV_BDF, context);
    if (y == nullptr || cvode == nullptr)
      throw Error("simulation: CVODE could not be created (out of memory)");
  }

  ~Impl() {
    CVodeFree(&cvode);
    if (nonlinear != nullptr) SUNNonlinSolFree(nonlinear);
    if (linear != nullptr) SUNLinSolFree(linear);
    if (matrix != nullptr) SUNMatDestroy(matrix);
    if (y != nullptr) N_VDestroy(y);
    SUNContext_Free(&context);
  }

  void check(int flag, const char* call) const {
    if (flag >= 0) return;
    if (!failure.empty()) throw SimulationError(failure);
    const std::string where = fmt::format("simulation: joint {} at t = {:.9g} s", hardest_joint() + 1, t);
    if (flag == CV_TOO_MUCH_WORK) {
      throw SimulationError(fmt::format(
          "{}: found a motion that uses up the solver's steps; expected at most {:.6g} steps a "
          "simulated second; check the joint's inertia, gains and torque limit, add damping, or raise "
          "\"max_steps_per_second\" of the solver",
          where, settings.max_steps_per_second));
    }
    throw SimulationError(fmt::format(
        "{}: found no step that is short enough (CVODE, {}, code {}: {}); expected finite torques and "
        "accelerations; check gains, torques, inertia and the scale of the scenario, loosen the "
        "tolerances or choose the method \"bdf\"",
        where, call, flag, solver_message.empty() ? "no further message" : solver_message));
  }

  /// The joint with the largest acceleration: what is too fast to follow, or torn by a torque without bound.
  int hardest_joint() const {
    std::vector<double> rate(static_cast<std::size_t>(n + std::max(1, m)));
    const double* x = state.data();
    try {
      system.evaluate(t, x, x + n, x + 2 * n, rate.data(), rate.data() + n);
    } catch (const std::exception&) {
      return 0;
    }
    int hardest = 0;
    double largest = -1.0;
    for (int i = 0; i < n; ++i) {
      double size = std::abs(rate[static_cast<std::size_t>(i)]);
      if (!std::isfinite(size)) size = std::numeric_limits<double>::infinity();
      if (size > largest) {
        largest = size;
        hardest = i;
      }
    }
    return system.joint_of(hardest);
  }

  void unshift(double at, const double* shifted, double* out) const {
    const double tau = at - shift_time;
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      out[i] = shifted[i] + (s0[k] + tau * (s1[k] + 0.5 * tau * s2[k]));
      out[n + i] = shifted[n + i] + (s1[k] + tau * s2[k]);
    }
    for (int i = 2 * n; i < 2 * n + m; ++i) out[i] = shifted[i];
  }

  void rebase_shift(double at) {
    const double tau = at - shift_time;
    for (std::size_t k = 0; k < s0.size(); ++k) {
      s0[k] += tau * (s1[k] + 0.5 * tau * s2[k]);
      s1[k] += tau * s2[k];
    }
    shift_time = at;
  }

  static int rate(realtype t, N_Vector y, N_Vector ydot, void* self) {
    auto& impl = *static_cast<Impl*>(self);
    const double* shifted = N_VGetArrayPointer(y);
    double* out = N_VGetArrayPointer(ydot);
    impl.unshift(t, shifted, impl.scratch.data());
    const double* x = impl.scratch.data();
    const int n = impl.n;
    try {
      impl.system.evaluate(t, x, x + n, x + 2 * n, out + n, out + 2 * n);
    } catch (const std::exception& e) {
      impl.failure = e.what();
      return -1;
    }
    bool finite = true;
    for (int i = 0; i < n; ++i) {
      out[i] = shifted[n + i];
      finite = finite && std::isfinite(out[n + i]);
      out[n + i] -= impl.s2[static_cast<std::size_t>(i)];
    }
    return finite ? 0 : 1;  // 1: CVODE tries a smaller step
  }

  static int root(realtype t, N_Vector y, realtype* g, void* self) {
    auto& impl = *static_cast<Impl*>(self);
    impl.unshift(t, N_VGetArrayPointer(y), impl.scratch.data());
    const double* x = impl.scratch.data();
    try {
      impl.system.roots(t, x, x + impl.n, x + 2 * impl.n, g);
    } catch (const std::exception& e) {
      impl.failure = e.what();
      return -1;
    }
    return 0;
  }

  /// Weights from the true state: the shift must not loosen the tolerance.
  static int weights(N_Vector y, N_Vector weight, void* self) {
    auto& impl = *static_cast<Impl*>(self);
    realtype t = impl.t;
    CVodeGetCurrentTime(impl.cvode, &t);
    impl.unshift(t, N_VGetArrayPointer(y), impl.scratch.data());
    double* w = N_VGetArrayPointer(weight);
    for (std::size_t i = 0; i < impl.scratch.size(); ++i) {
      w[i] = 1.0 / (impl.settings.relative_tolerance * std::abs(impl.scratch[i]) +
                    impl.settings.absolute_tolerance);
      if (!std::isfinite(w[i])) return -1;
    }
    return 0;
  }

  static void report(int code, const char*, const char*, char* message, void* self) {
    if (code < 0) static_cast<Impl*>(self)->solver_message = message;
  }

  void fill_shifted() {
    double* x = N_VGetArrayPointer(y);
    for (std::size_t i = 0; i < state.size(); ++i) x[i] = state[i];
    std::fill(s0.begin(), s0.end(), 0.0);
    std::fill(s1.begin(), s1.end(), 0.0);
    std::fill(s2.begin(), s2.end(), 0.0);
    shift_time = t;
  }

  void begin() {
    fill_shifted();
    if (!started) {
      check(CVodeInit(cvode, &Impl::rate, t, y), "CVodeInit");
      check(CVodeSetUserData(cvode, this), "CVodeSetUserData");
      check(CVodeSetErrHandlerFn(cvode, &Impl::report, this), "CVodeSetErrHandlerFn");
      check(CVodeWFtolerances(cvode, &Impl::weights), "CVodeWFtolerances");
      if (settings.method == SolverMethod::kAdams) {
        nonlinear = SUNNonlinSol_FixedPoint(y, 0, context);
        check(CVodeSetNonlinearSolver(cvode, nonlinear), "CVodeSetNonlinearSolver");
      } else {
        matrix = SUNDenseMatrix(2 * n + m, 2 * n + m, context);
        linear = SUNLinSol_Dense(y, matrix, context);
        check(CVodeSetLinearSolver(cvode, linear, matrix), "CVodeSetLinearSolver");
      }
      if (settings.max_step > 0.0) check(CVodeSetMaxStep(cvode, settings.max_step), "CVodeSetMaxStep");
      if (system.num_roots() > 0) {
        check(CVodeRootInit(cvode, system.num_roots(), &Impl::root), "CVodeRootInit");
        std::vector<int> falling(static_cast<std::size_t>(system.num_roots()), -1);
        check(CVodeSetRootDirection(cvode, falling.data()), "CVodeSetRootDirection");
        check(CVodeSetNoInactiveRootWarn(cvode), "CVodeSetNoInactiveRootWarn");
      }
      started = true;
    } else {
      count(past);
      check(CVodeReInit(cvode, t, y), "CVodeReInit");
      past.restarts += 1;
    }
    fresh = true;
  }

  void count(SolverCounts& counts) const {
    if (!started) return;
    long int steps = 0, evaluations = 0, failures = 0, root_evaluations = 0, linear_evaluations = 0;
    CVodeGetNumSteps(cvode, &steps);
    CVodeGetNumRhsEvals(cvode, &evaluations);
    CVodeGetNumErrTestFails(cvode, &failures);
    if (system.num_roots() > 0) CVodeGetNumGEvals(cvode, &root_evaluations);
    if (settings.method != SolverMethod::kAdams) CVodeGetNumLinRhsEvals(cvode, &linear_evaluations);
    counts.steps += steps;
    counts.evaluations += evaluations + linear_evaluations;
    counts.failed_steps += failures;
    counts.event_evaluations += root_evaluations;
  }

  Stop go(double to, double limit) {
    // CVODE cannot start towards a time that is only rounding away; nothing happens on the way there.
    if (fresh && to - t <= 1e-14 * std::max(1.0, std::abs(to))) {
      t = to;
      return Stop::kReached;
    }
    fresh = false;
    check(CVodeSetStopTime(cvode, limit), "CVodeSetStopTime");
    check(CVodeSetMaxNumSteps(cvode, std::max(1L, static_cast<long>(steps_left))), "CVodeSetMaxNumSteps");
    long before = 0, after = 0;
    CVodeGetNumSteps(cvode, &before);
    realtype reached = t;
    const int flag = CVode(cvode, to, y, &reached, CV_NORMAL);
    if (flag < 0) t = reached;
    check(flag, "CVode");
    CVodeGetNumSteps(cvode, &after);
    steps_left -= static_cast<double>(after - before);
    t = reached;
    unshift(t, N_VGetArrayPointer(y), state.data());
    if (flag == CV_ROOT_RETURN) {
      check(CVodeGetRootInfo(cvode, events.data()), "CVodeGetRootInfo");
      return Stop::kEvent;
    }
    return Stop::kReached;
  }
};

Integrator::Integrator(System& system, const SolverSettings& settings)
    : impl_(std::make_unique<Impl>(system, settings)) {}

Integrator::~Integrator() = default;

void Integrator::start(double t, const double* q, const double* qd, const double* z) {
  Impl& impl = *impl_;
  const auto n = static_cast<std::size_t>(impl.n);
  impl.t = t;
  std::copy(q, q + impl.n, impl.state.begin());
  std::copy(qd, qd + impl.n, impl.state.begin() + static_cast<std::ptrdiff_t>(n));
  std::copy(z, z + impl.m, impl.state.begin() + static_cast<std::ptrdiff_t>(2 * n));
  impl.begin();
}

void Integrator::grant(double steps) {
  impl_->steps_left = std::min(std::max(kMostSteps, steps), impl_->steps_left + steps);
}

Integrator::Stop Integrator::advance(double t_stop) { return impl_->go(t_stop, t_stop); }

Integrator::Stop Integrator::advance_freely(double t_out, double t_limit) {
  return impl_->go(t_out, t_limit);
}

void Integrator::kick(const double* jump) {
  Impl& impl = *impl_;
  if (impl.settings.restart_at_samples) {
    impl.begin();
    return;
  }
  impl.rebase_shift(impl.t);
  double largest = 0.0;
  for (std::size_t k = 0; k < impl.s2.size(); ++k) {
    impl.s2[k] += jump[k];
    largest = std::max({largest, std::abs(impl.s0[k]), std::abs(impl.s1[k])});
  }
  if (largest > max_shift(impl.settings.absolute_tolerance)) impl.begin();
}

double Integrator::time() const { return impl_->t; }
const double* Integrator::q() const { return impl_->state.data(); }
const double* Integrator::qd() const { return impl_->state.data() + impl_->n; }
const double* Integrator::z() const { return impl_->state.data() + 2 * impl_->n; }
const std::vector<int>& Integrator::events() const { return impl_->events; }

void Integrator::add_counts(SolverCounts& counts) const {
  counts.restarts += impl_->past.restarts;
  counts.steps += impl_->past.steps;
  counts.evaluations += impl_->past.evaluations;
  counts.failed_steps += impl_->past.failed_steps;
  counts.event_evaluations += impl_->past.event_evaluations;
  impl_->count(counts);
}

}  // namespace heft::sim
