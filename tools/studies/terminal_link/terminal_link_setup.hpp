/// @file
/// Kawasaki and Nishimura's arm, motor and noise as fixed in core/estimate/README.md, sections 9 and 10.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/model/named_arms.hpp"
#include "terminal_link_protocol.hpp"

namespace heft::studies::terminal_link {

inline constexpr int kN = 6;
using Arm = StaticArm<double, model::KawasakiArm>;
using Vector = Arm::Vector;
using Parameters = ReducedParameters<double, model::KawasakiArm>;

/// Rotor inertias of scenario B [kg·m²] and the time constant of the motors [s].
inline const Vector kRotor = (Vector() << 20e-3, 20e-3, 20e-3, 5e-3, 3e-3, 2e-3).finished();
inline constexpr double kMotorTimeConstant = 0.03;

/// Acceleration noise of a run, the same sequence for every use with the same seed.
class Noise {
 public:
  explicit Noise(int seed) : random_(static_cast<std::uint64_t>(seed) * 2654435761U + 1U) {}
  Vector operator()(double sigma) {
    Vector e;
    for (int i = 0; i < kN; ++i) {
      e[i] = sigma * normal_(random_);
    }
    return e;
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0.0, 1.0};
};

struct Motion {
  Vector q, qd, qdd;
};
Motion at(const FourierTrajectory& trajectory, double t);

/// Coulomb and viscous torque of an arm, sharp sign.
Vector friction(const ArmModel<double, kN>& arm, const Vector& qd);
/// Rigid-body torque and friction of the arm with or without the payload.
Vector true_torque(const Motion& motion, bool payload = true);
/// Input of the motors that drives the motion: torque, rotor and back electromotive force.
Vector motor_input(const Motion& motion, const Vector& torque);

const Parameters& parameters_with_payload();
const Parameters& parameters_without_payload();
/// Raw coefficients of the arm before the payload, each ±10 %.
ArmModel<double, kN> nominal_arm(int seed);

/// Fit of K/J and c of (35) by output error on an earlier run without payload, the validation trajectory.
JointAccelerationModel<double, kN>::Config fit_joint_model(double period, double acceleration_noise,
                                                           int seed);

/// Calls f(link, entry, column) for each inertial parameter of a layout.
template <int First, typename F>
void for_inertial(F f) {
  using Layout = TerminalLayout<Arm, First>;
  [&]<int... R>(std::integer_sequence<int, R...>) {
    (
        [&] {
          int column = Layout::inertial(R);
          for (std::size_t entry = 0; entry < 10; ++entry) {
            if (structural::kReducedPattern<model::KawasakiArm, First + R>[entry]) {
              f(static_cast<std::size_t>(First + R), entry, column++);
            }
          }
        }(),
        ...);
  }
  (std::make_integer_sequence<int, kN - First>{});
}

template <int First>
using LayoutVector = Eigen::Matrix<double, TerminalLayout<Arm, First>::kParameters, 1>;

/// A layout's parameter vector of an arm.
template <int First>
LayoutVector<First> layout_parameters(const Parameters& parameters, const ArmModel<double, kN>& arm) {
  using Layout = TerminalLayout<Arm, First>;
  LayoutVector<First> x;
  for (int r = 0; r < Layout::kRows; ++r) {
    x[Layout::friction(r)] = arm.actuation[static_cast<std::size_t>(First + r)].coulomb_friction;
    x[Layout::friction(r) + 1] = arm.actuation[static_cast<std::size_t>(First + r)].viscous_friction;
  }
  for_inertial<First>(
      [&](std::size_t link, std::size_t entry, int column) { x[column] = parameters.links[link][entry]; });
  return x;
}

/// Rows First..n-1 for one acceleration.
template <int First>
TerminalRows<double, TerminalLayout<Arm, First>> rows_at(const Vector& q, const Vector& qd,
                                                         const Vector& qdd) {
  std::array<TerminalRows<double, TerminalLayout<Arm, First>>, 1> rows{};
  terminal_rows<Arm, First, 1>(terminal_trigonometry<Arm, First>(q), q, qd, {qdd}, 0.0, rows);
  return rows[0];
}

/// Rows as a matrix.
template <int First>
auto as_matrix(const TerminalRows<double, TerminalLayout<Arm, First>>& rows) {
  using Layout = TerminalLayout<Arm, First>;
  Eigen::Matrix<double, Layout::kRows, Layout::kParameters> m;
  for (int r = 0; r < Layout::kRows; ++r) {
    for (int c = 0; c < Layout::kParameters; ++c) {
      m(r, c) = rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
    }
  }
  return m;
}

/// Instrumental (or least-squares) system of one method, kept and solved by core.
template <int First>
struct System {
  using Layout = TerminalLayout<Arm, First>;
  using Rows = TerminalRows<double, Layout>;
  NormalEquations<double, Layout> equations;
  StagedSolver<double, Layout> solver;

  System() { equations.reset({}, {}); }
  void add(const Rows& w, const Rows& z, const Vector& tau) {
    for (int r = 0; r < Layout::kRows; ++r) {
      const std::size_t i = static_cast<std::size_t>(r);
      equations.add(r, z[i], w[i], tau[First + r]);
    }
  }
  bool solve() {
    solver.start(equations.matrix(), equations.right_side(), false);
    while (!solver.advance(1000)) {
    }
    return solver.status() == Status::kOk;
  }
  LayoutVector<First> solution() const {
    LayoutVector<First> x;
    for (int i = 0; i < Layout::kParameters; ++i) {
      x[i] = solver.solution()[static_cast<std::size_t>(i)];
    }
    return x;
  }
};

/// What the measures of section 10 need: the 18 base parameters of k = 5 and the error e of an estimate.
inline constexpr int kBase = 18;
using Base = Eigen::Matrix<double, kBase, 1>;
/// From the k = 5 layout to the 18 base parameters of core/estimate/README.md, section 7. Linear.
Base to_publication(const LayoutVector<4>& x);
const Eigen::Matrix<double, kBase, kBase>& publication_map();
const Eigen::Matrix<double, kBase, kBase>& publication_map_inverse();
/// True base parameters with and without payload.
Base base_with_payload();
Base base_without_payload();
/// rms of the columns of the true base regressor over the first samples of a run.
Base column_rms(const FourierTrajectory& trajectory, double period, int samples);
/// e of the protocol.
double relative_error(const Base& estimate, const Base& column_rms);

}  // namespace heft::studies::terminal_link
