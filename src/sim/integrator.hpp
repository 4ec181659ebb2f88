/// @file
/// CVODE for a mechanical system q̈ = a(t, q, q̇, z), ż = b(t, q, q̇, z) whose accelerations jump now and then.
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
};

/// Integrates a System from stop to stop.
///
/// Held torques step at every controller sample, and restarting a multistep method each time would throw
/// its history away a thousand times a second. Instead CVODE integrates shifted coordinates
/// r = q − S(t), w = q̇ − Ṡ(t) with S a piecewise polynomial that takes up the step of the acceleration,
/// so that what CVODE sees has a continuous second derivative and its history stays good. See integrator.md.
class Integrator {
 public:
  enum class Stop { kReached, kEvent };

  Integrator(System& system, const SolverSettings& settings);
  ~Integrator();
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Restarts at a state; q, qd, z are copied.
  void start(double t, const double* q, const double* qd, const double* z);

  /// Steps of the solver that it may take from now on, plus those left over from before up to kMostSteps.
  /// advance() and advance_freely() throw SimulationError when they are used up.
  void grant(double steps);

  /// Goes on to `t_stop`, never evaluating the system beyond it, or to the first event before it.
  Stop advance(double t_stop);
  /// Goes on to `t_out` and interpolates there; the solver may look ahead, but not beyond `t_limit`.
  Stop advance_freely(double t_out, double t_limit);

  /// Reports that the accelerations jumped at the present time, the state did not.
  /// @param jump  acceleration after minus acceleration before, num_positions() values
  void kick(const double* jump);

  double time() const;
  const double* q() const;
  const double* qd() const;
  const double* z() const;
  /// Which event functions fell through zero at the last kEvent.
  const std::vector<int>& events() const;
  void add_counts(SolverCounts& counts) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::sim
