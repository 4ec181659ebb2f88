#include "integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace heft::sim {
namespace {

/// Most steps that may be saved up for one sample.
constexpr double kMostSteps = 1e5;

}  // namespace

Integrator::Integrator(System& system, const SolverSettings& settings)
    : system_(system),
      settings_(settings),
      n_(system.num_positions()),
      m_(system.num_extra()),
      state_(static_cast<std::size_t>(2 * n_ + m_), 0.0),
      events_(static_cast<std::size_t>(std::max(1, system.num_roots())), 0),
      steps_left_(kMostSteps) {}

void Integrator::grant(double steps) {
  steps_left_ = std::min(std::max(kMostSteps, steps), steps_left_ + steps);
}

void Integrator::throw_used_up() const {
  throw SimulationError(
      fmt::format("{}: found a motion that uses up the solver's steps; expected at most {:.6g} steps a "
                  "simulated second; check the joint's inertia, gains and torque limit, add damping, or raise "
                  "\"max_steps_per_second\" of the solver",
                  where(), settings_.max_steps_per_second));
}

void Integrator::throw_no_step(const std::string& solver) const {
  throw SimulationError(
      fmt::format("{}: found no step that is short enough ({}); expected finite torques and "
                  "accelerations; check gains, torques, inertia and the scale of the scenario, loosen the "
                  "tolerances or choose the method \"bdf\"",
                  where(), solver));
}

/// Time, and the joint with the largest acceleration: what is too fast to follow, or torn by a torque without bound.
std::string Integrator::where() const {
  std::vector<double> rate(static_cast<std::size_t>(n_ + std::max(1, m_)), 0.0);
  try {
    system_.evaluate(t_, q(), qd(), z(), rate.data(), rate.data() + n_);
  } catch (const std::exception&) {
    rate.assign(rate.size(), 0.0);
  }
  int hardest = 0;
  double largest = -1.0;
  for (int i = 0; i < n_; ++i) {
    double size = std::abs(rate[static_cast<std::size_t>(i)]);
    if (!std::isfinite(size)) size = std::numeric_limits<double>::infinity();
    if (size > largest) {
      largest = size;
      hardest = i;
    }
  }
  return fmt::format("simulation: joint {} at t = {:.9g} s", system_.joint_of(hardest) + 1, t_);
}

}  // namespace heft::sim
