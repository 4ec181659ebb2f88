#include "deflection.hpp"

#include <cmath>

namespace heft::diagnose {

using Eigen::Index;

Deflection deflection(const MotionTable& table, const Eigen::VectorXd& load, const Eigen::VectorXd& inertia,
                      double stiffness, double damping) {
  const Index m = table.rows();
  Deflection d{Eigen::VectorXd(m), Eigen::VectorXd(m), Eigen::VectorXd(m)};
  std::size_t run = 0;
  const double h = 1.0 / table.sample_rate;
  for (Index i = 0; i < m; ++i) {
    if (run < table.run_begin.size() && table.run_begin[run] == i) {
      ++run;
      d.value[i] = load[i] / stiffness;
      d.rate[i] = 0.0;
    } else {
      // Newmark's average acceleration: no damping of its own, stable for any step.
      //   (M + h/2 D + h²/4 K) ë₁ = f₁ - D (ė₀ + h/2 ë₀) - K (e₀ + h ė₀ + h²/4 ë₀)
      const double a0 = d.acceleration[i - 1], v0 = d.rate[i - 1], e0 = d.value[i - 1];
      const double a1 =
          (load[i] - damping * (v0 + 0.5 * h * a0) - stiffness * (e0 + h * v0 + 0.25 * h * h * a0)) /
          (inertia[i] + 0.5 * h * damping + 0.25 * h * h * stiffness);
      d.rate[i] = v0 + 0.5 * h * (a0 + a1);
      d.value[i] = e0 + h * v0 + 0.25 * h * h * (a0 + a1);
      d.acceleration[i] = a1;
      continue;
    }
    d.acceleration[i] = (load[i] - damping * d.rate[i] - stiffness * d.value[i]) / inertia[i];
  }
  return d;
}

}  // namespace heft::diagnose
