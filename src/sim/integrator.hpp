/// @file
/// Integrates a mechanical system q̈ = a(t, q, q̇, z), ż = b(t, q, q̇, z) whose accelerations jump now and then.
/// Derivation: src/sim/integrator.md
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heft/sim/simulator.hpp"

namespace heft::sim {

/// The equations, as the integrator calls them.
class System {
 public:
  virtual ~System() = default;
  virtual int num_positions() const = 0;
  virtual int num_extra() const = 0;
  virtual int num_roots() const = 0;
  /// Joint, counted from 0, whose motion a position describes.
  virtual int joint_of(int position) const { return position; }
  /// Accelerations and the rates of the extra states.
  virtual void evaluate(double t, const double* q, const double* qd, const double* z, double* qdd,
                        double* zd) = 0;
  /// Event functions; an event is one of them falling through zero.
  virtual void roots(double t, const double* q, const double* qd, const double* z, double* g) = 0;
  /// The same where evaluate() was called last, which has what they need.
  virtual void roots_there(double t, const double* q, const double* qd, const double* z, double* g) {
    roots(t, q, qd, z, g);
  }
};

/// Integrates a System from stop to stop.
class Integrator {
 public:
  enum class Stop { kReached, kEvent };

  virtual ~Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Restarts at a state; q, qd, z are copied.
  virtual void start(double t, const double* q, const double* qd, const double* z) = 0;

  /// Steps of the solver that it may take from now on, plus those left over from before up to kMostSteps.
  /// advance() and advance_freely() throw SimulationError when they are used up.
  void grant(double steps);

  /// Goes on to `t_stop`, never evaluating the system beyond it, or to the first event before it.
  virtual Stop advance(double t_stop) = 0;
  /// Goes on to `t_out` and interpolates there; the solver may look ahead, but not beyond `t_limit`.
  virtual Stop advance_freely(double t_out, double t_limit) = 0;

  /// Reports that the accelerations jumped at the present time, the state did not. evaluate() was called last with the
  /// new ones.
  /// @param before,after  accelerations, num_positions() values
  /// @param rates         of the extra states, after
  virtual void kick(const double* before, const double* after, const double* rates) = 0;

  double time() const { return t_; }
  const double* q() const { return state_.data(); }
  const double* qd() const { return state_.data() + n_; }
  const double* z() const { return state_.data() + 2 * n_; }
  /// Accelerations at the present time, of before a kick, where the integrator has them; else null.
  virtual const double* acceleration() const { return nullptr; }
  /// Which event functions fell through zero at the last kEvent.
  const std::vector<int>& events() const { return events_; }
  virtual void add_counts(SolverCounts& counts) const = 0;

 protected:
  Integrator(System& system, const SolverSettings& settings);

  [[noreturn]] void throw_used_up() const;
  /// @param solver  that found no step, and what it says
  [[noreturn]] void throw_no_step(const std::string& solver) const;

  System& system_;
  SolverSettings settings_;
  int n_, m_;  ///< positions, extra states
  double t_{0.0};
  std::vector<double> state_;  ///< q, q̇, z at t_
  std::vector<int> events_;
  double steps_left_;

 private:
  std::string where() const;
};

/// CVODE's multistep methods (Adams, BDF). A fresh start at every sample would throw their history away a thousand times a
/// second. Instead CVODE integrates shifted coordinates r = q − S(t), w = q̇ − Ṡ(t) with S a piecewise polynomial that
/// takes up the step of the acceleration, so that what CVODE sees has a continuous second derivative and its history stays
/// good. See integrator.md.
std::unique_ptr<Integrator> make_multistep(System& system, const SolverSettings& settings);

/// One Runge-Kutta step of order 4 from sample to sample, or, where its error control asks for several, steps of order 5. It has no
/// history that a jump could spoil.
std::unique_ptr<Integrator> make_runge_kutta(System& system, const SolverSettings& settings);

}  // namespace heft::sim
