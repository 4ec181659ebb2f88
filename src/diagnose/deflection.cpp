#include "deflection.hpp"

#include <Eigen/Cholesky>

#include "heft/model/dynamics.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

template <int kJoints>
constexpr int kMost = kJoints == Eigen::Dynamic ? model::kMaxJoints : kJoints;
template <int kJoints>
using Vector = Eigen::Matrix<double, kJoints, 1, 0, kMost<kJoints>, 1>;
template <int kJoints>
using Matrix = Eigen::Matrix<double, kJoints, kJoints, 0, kMost<kJoints>, kMost<kJoints>>;

/// @param M  by its lower part
template <int kJoints>
bool is_positive_definite(const Matrix<kJoints>& M) {
  if constexpr (kJoints == 1) return M(0, 0) > 0.0;
  if constexpr (kJoints == 2) return M(0, 0) > 0.0 && M(0, 0) * M(1, 1) > M(1, 0) * M(1, 0);
  if constexpr (kJoints == Eigen::Dynamic) return Eigen::LLT<Matrix<kJoints>>(M).info() == Eigen::Success;
}

/// M⁻¹ f. Of two joints, which a search tries most, by Cramer's rule: one division, where a decomposition takes two roots and
/// four divisions.
template <int kJoints>
Vector<kJoints> solution(const Matrix<kJoints>& M, const Vector<kJoints>& f) {
  if constexpr (kJoints == 1) return f / M(0, 0);
  if constexpr (kJoints == 2) {
    const double inverse = 1.0 / (M(0, 0) * M(1, 1) - M(1, 0) * M(1, 0));
    return {(M(1, 1) * f[0] - M(1, 0) * f[1]) * inverse, (M(0, 0) * f[1] - M(1, 0) * f[0]) * inverse};
  }
  if constexpr (kJoints == Eigen::Dynamic) return Eigen::LLT<Matrix<kJoints>>(M).solve(f);
}

/// @tparam kJoints  1, 2, or Eigen::Dynamic: any number
template <int kJoints>
Deflections deflections_of(const MotionTable& table, const MatrixXd& load, const MatrixXd& inertia, const VectorXd& stiffness,
                           const VectorXd& damping) {
  const Index m = table.rows(), k = load.cols();
  const double h = 1.0 / table.sample_rate;
  const Vector<kJoints> K = stiffness, D = damping, ahead = 0.5 * h * D + 0.25 * h * h * K;
  Deflections d{MatrixXd(m, k), MatrixXd(m, k), MatrixXd(m, k)};
  Vector<kJoints> e, v, a;
  Matrix<kJoints> M(k, k);
  std::size_t run = 0;
  for (Index i = 0; i < m; ++i) {
    for (Index r = 0; r < k; ++r) {
      for (Index c = 0; c <= r; ++c) M(r, c) = inertia(i, r * k + c);
    }
    if (!is_positive_definite<kJoints>(M)) return {};
    const Vector<kJoints> f = load.row(i).transpose();
    if (run < table.run_begin.size() && table.run_begin[run] == i) {
      ++run;
      e = f.cwiseQuotient(K);
      v.setZero(k);
      a = solution<kJoints>(M, f - K.cwiseProduct(e));
    } else {
      // Newmark's average acceleration: no damping of its own, stable for any step.
      //   (M + h/2 D + h²/4 K) ë₁ = f₁ - D (ė₀ + h/2 ë₀) - K (e₀ + h ė₀ + h²/4 ë₀)
      M.diagonal() += ahead;
      const Vector<kJoints> late = v + 0.5 * h * a, far = e + h * v + 0.25 * h * h * a;
      a = solution<kJoints>(M, f - D.cwiseProduct(late) - K.cwiseProduct(far));
      v = late + 0.5 * h * a;
      e = far + 0.25 * h * h * a;
    }
    d.value.row(i) = e;
    d.rate.row(i) = v;
    d.acceleration.row(i) = a;
  }
  return d;
}

}  // namespace

Deflections deflections(const MotionTable& table, const MatrixXd& load, const MatrixXd& inertia, const VectorXd& stiffness,
                        const VectorXd& damping) {
  switch (load.cols()) {
    case 1: return deflections_of<1>(table, load, inertia, stiffness, damping);
    case 2: return deflections_of<2>(table, load, inertia, stiffness, damping);
    default: return deflections_of<Eigen::Dynamic>(table, load, inertia, stiffness, damping);
  }
}

}  // namespace heft::diagnose
