#include "deflection.hpp"

#include <utility>

#include <Eigen/Cholesky>

#include "heft/model/dynamics.hpp"

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

Deflections deflections(const MotionTable& table, const Eigen::MatrixXd& load, const Eigen::MatrixXd& inertia,
                        const Eigen::VectorXd& stiffness, const Eigen::VectorXd& damping) {
  constexpr int kMost = model::kMaxJoints;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
  const Index m = table.rows(), k = load.cols();
  if (k == 1 && inertia.minCoeff() > 0.0) {
    Deflection one = deflection(table, load, inertia, stiffness[0], damping[0]);
    return {std::move(one.value), std::move(one.rate), std::move(one.acceleration)};
  }
  const double h = 1.0 / table.sample_rate;
  const Vector K = stiffness, D = damping, ahead = 0.5 * h * D + 0.25 * h * h * K;
  Deflections d{Eigen::MatrixXd(m, k), Eigen::MatrixXd(m, k), Eigen::MatrixXd(m, k)};
  Vector e, v, a;
  Matrix M(k, k);
  std::size_t run = 0;
  for (Index i = 0; i < m; ++i) {
    for (Index r = 0; r < k; ++r) {
      for (Index c = 0; c <= r; ++c) M(r, c) = inertia(i, r * k + c);
    }
    const Eigen::LLT<Matrix> own(M);
    if (own.info() != Eigen::Success) return {};
    const Vector f = load.row(i);
    if (run < table.run_begin.size() && table.run_begin[run] == i) {
      ++run;
      e = f.cwiseQuotient(K);
      v.setZero(k);
      a = own.solve(f - K.cwiseProduct(e));
    } else {
      // As for one joint.
      M.diagonal() += ahead;
      const Vector late = v + 0.5 * h * a, far = e + h * v + 0.25 * h * h * a;
      const Vector next = Eigen::LLT<Matrix>(M).solve(f - D.cwiseProduct(late) - K.cwiseProduct(far));
      v = late + 0.5 * h * next;
      e = far + 0.25 * h * h * next;
      a = next;
    }
    d.value.row(i) = e;
    d.rate.row(i) = v;
    d.acceleration.row(i) = a;
  }
  return d;
}

}  // namespace heft::diagnose
