#include "deflection.hpp"

#include <algorithm>
#include <type_traits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "heft/host/parallel.hpp"
#include "heft/model/batch_dynamics.hpp"
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
/// Of each joint and load.
template <int kJoints, int kLoads>
using Loads = Eigen::Array<double, kJoints, kLoads, kJoints == 1 && (kLoads > 1) ? Eigen::RowMajor : Eigen::ColMajor,
                           kMost<kJoints>, kLoads>;
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
template <int kJoints, int kLoads>
Loads<kJoints, kLoads> solution(const Matrix<kJoints>& M, const Loads<kJoints, kLoads>& f) {
  if constexpr (kJoints == 1) return f / M(0, 0);
  if constexpr (kJoints == 2) {
    const double inverse = 1.0 / (M(0, 0) * M(1, 1) - M(1, 0) * M(1, 0));
    Loads<kJoints, kLoads> x;
    x.row(0) = (M(1, 1) * f.row(0) - M(1, 0) * f.row(1)) * inverse;
    x.row(1) = (M(0, 0) * f.row(1) - M(1, 0) * f.row(0)) * inverse;
    return x;
  }
  if constexpr (kJoints == Eigen::Dynamic) return Eigen::LLT<Matrix<kJoints>>(M).solve(f.matrix()).array();
}

/// Newmark's average acceleration: no damping of its own, stable for any step.
///   (M + h/2 D + h²/4 K) ë₁ = f₁ - D (ė₀ + h/2 ë₀) - (K + G₁) (e₀ + h ė₀ + h²/4 ë₀)
/// h²/4 G beside M is left out: 1e-4 of it where gravity swings a link at 3 Hz and samples are 2 ms apart.
/// @tparam kJoints  1, 2, or Eigen::Dynamic: any number
/// @tparam kLoads   how many loads deflect the same joints, each for itself
/// @param load  f of a row, k × kLoads
/// @param put   takes a row with its e, ė, ë
/// @return false: see deflections()
template <int kJoints, int kLoads, typename Load, typename Put>
bool deflect(const MotionTable& table, const MatrixXd& inertia, const VectorXd& stiffness, const VectorXd& damping,
             const MatrixXd& slope, const Load& load, const Put& put) {
  using State = Loads<kJoints, kLoads>;
  const Index k = stiffness.size();
  for (Index a = 0; a < k; ++a) {
    if (!(stiffness[a] + slope.col(a * k + a).mean() > 0.0)) return false;
  }
  const double h = 1.0 / table.sample_rate;
  const Vector<kJoints> ahead = 0.5 * h * damping + 0.25 * h * h * stiffness;
  const State K = stiffness.replicate(1, kLoads), D = damping.replicate(1, kLoads);
  State e = State::Zero(k, kLoads), v = e, a = e;
  Matrix<kJoints> M(k, k), G(k, k);
  std::size_t section = 0;
  for (Index i = 0; i < table.rows(); ++i) {
    for (Index r = 0; r < k; ++r) {
      for (Index c = 0; c <= r; ++c) M(r, c) = inertia(i, r * k + c);
      for (Index c = 0; c < k; ++c) G(r, c) = slope(i, r * k + c);
    }
    if (!is_positive_definite<kJoints>(M)) return false;
    State f = load(i);
    if (section < table.section_begin.size() && table.section_begin[section] == i) {
      ++section;
      G.diagonal() += stiffness;
      e = G.partialPivLu().solve(f.matrix()).array();
      v.setZero();
      a.setZero();
    } else {
      M.diagonal() += ahead;
      const State late = v + 0.5 * h * a, far = e + h * v + 0.25 * h * h * a;
      f -= G.lazyProduct(far.matrix()).array();
      a = solution<kJoints, kLoads>(M, f - D * late - K * far);
      v = late + 0.5 * h * a;
      e = far + 0.25 * h * h * a;
    }
    put(i, e, v, a);
  }
  return true;
}

template <int kJoints>
Deflections deflections_of(const MotionTable& table, const MatrixXd& load, const MatrixXd& inertia, const VectorXd& stiffness,
                           const VectorXd& damping, const MatrixXd& slope) {
  const Index m = table.rows(), k = load.cols();
  Deflections d{MatrixXd(m, k), MatrixXd(m, k), MatrixXd(m, k)};
  const bool possible = deflect<kJoints, 1>(
      table, inertia, stiffness, damping, slope, [&](Index i) { return load.row(i).transpose().array(); },
      [&](Index i, const auto& e, const auto& v, const auto& a) {
        d.value.row(i) = e.matrix().transpose();
        d.rate.row(i) = v.matrix().transpose();
        d.acceleration.row(i) = a.matrix().transpose();
      });
  return possible ? d : Deflections{};
}

template <int kJoints>
std::vector<ManyDeflections> by_loads(const MotionTable& table, const std::vector<MatrixXd>& loads, const MatrixXd& inertia,
                                      const VectorXd& stiffness, const VectorXd& damping, const MatrixXd& slope) {
  constexpr int kLoads = 8;
  const Index m = table.rows(), k = stiffness.size(), count = loads.front().cols();
  std::vector<ManyDeflections> found(loads.size(), {MatrixXd(m, count), MatrixXd(m, count)});
  const auto groups = static_cast<std::size_t>((count + kLoads - 1) / kLoads);
  std::vector<char> possible(groups, false);
  host::for_each_parallel(groups, [&](std::size_t group) {
    const Index from = static_cast<Index>(group) * kLoads, width = std::min<Index>(kLoads, count - from);
    Loads<kJoints, kLoads> f(k, kLoads);
    f.setZero();
    possible[group] = deflect<kJoints, kLoads>(
        table, inertia, stiffness, damping, slope,
        [&](Index i) {
          for (Index b = 0; b < k; ++b) {
            for (Index c = 0; c < width; ++c) f(b, c) = loads[static_cast<std::size_t>(b)](i, from + c);
          }
          return f;
        },
        [&](Index i, const auto& e, const auto&, const auto& a) {
          for (Index b = 0; b < k; ++b) {
            ManyDeflections& of = found[static_cast<std::size_t>(b)];
            for (Index c = 0; c < width; ++c) {
              of.value(i, from + c) = e(b, c);
              of.acceleration(i, from + c) = a(b, c);
            }
          }
        });
  });
  return std::all_of(possible.begin(), possible.end(), [](char is) { return is; }) ? found : std::vector<ManyDeflections>{};
}

/// Calls f with the number of joints that code is made for.
template <typename F>
auto for_joints(Index count, const F& f) {
  switch (count) {
    case 1: return f(std::integral_constant<int, 1>{});
    case 2: return f(std::integral_constant<int, 2>{});
    default: return f(std::integral_constant<int, Eigen::Dynamic>{});
  }
}

}  // namespace

Index LinkTorque::column(int i, int j) const {
  const auto k = static_cast<Index>(joints.size());
  return mass.cols() / k * (std::find(joints.begin(), joints.end(), j) - joints.begin()) + i;
}

MatrixXd LinkTorque::among(std::span<const int> some, const MatrixXd& of) const {
  const auto count = static_cast<Index>(some.size());
  MatrixXd all(of.rows(), count * count);
  for (Index a = 0; a < count; ++a) {
    for (Index b = 0; b < count; ++b)
      all.col(a * count + b) = of.col(column(some[static_cast<std::size_t>(a)], some[static_cast<std::size_t>(b)]));
  }
  return all;
}

LinkTorque link_torque(const model::Robot& robot, const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd,
                       const std::vector<int>& joints) {
  constexpr double kStep = 1e-5;  // [rad, m]; errors of a difference to one side: 1e-5 of it by curvature, 1e-10 by rounding
  constexpr Index kPiece = 256;   // rows of a job
  const Index m = q.rows(), n = q.cols(), k = static_cast<Index>(joints.size());
  const model::BatchDynamics dynamics(robot);
  LinkTorque by{joints, MatrixXd(m, k), MatrixXd(m, n * k), MatrixXd(m, n * k)};
  host::for_each_parallel(static_cast<std::size_t>((m + kPiece - 1) / kPiece), [&](std::size_t piece) {
    const Index from = static_cast<Index>(piece) * kPiece, count = std::min(kPiece, m - from);
    MatrixXd place = q.middleRows(from, count), mass(count, n * n);
    const auto rates = qd.middleRows(from, count), accelerations = qdd.middleRows(from, count);
    const MatrixXd torque = dynamics.inverse_dynamics(place, rates, accelerations);
    dynamics.mass_matrix(place, mass);
    for (Index b = 0; b < k; ++b) {
      const Index joint = joints[static_cast<std::size_t>(b)];
      by.torque.col(b).segment(from, count) = torque.col(joint);
      by.mass.block(from, n * b, count, n) = mass.middleCols(n * joint, n);
      place.col(joint).array() += kStep;
      by.slope.block(from, n * b, count, n) = (dynamics.inverse_dynamics(place, rates, accelerations) - torque) / kStep;
      place.col(joint) = q.col(joint).segment(from, count);
    }
  });
  return by;
}

Deflections deflections(const MotionTable& table, const MatrixXd& load, const MatrixXd& inertia, const VectorXd& stiffness,
                        const VectorXd& damping, const MatrixXd& slope) {
  return for_joints(load.cols(),
                    [&](auto k) { return deflections_of<k>(table, load, inertia, stiffness, damping, slope); });
}

std::vector<ManyDeflections> deflections_by_loads(const MotionTable& table, const std::vector<MatrixXd>& loads,
                                                  const MatrixXd& inertia, const VectorXd& stiffness, const VectorXd& damping,
                                                  const MatrixXd& slope) {
  return for_joints(stiffness.size(),
                    [&](auto k) { return by_loads<k>(table, loads, inertia, stiffness, damping, slope); });
}

}  // namespace heft::diagnose
