#include "terminal_link_setup.hpp"

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include <Eigen/Core>

#include "heft/host/decompositions.hpp"

namespace heft::studies::terminal_link {

Motion at(const FourierTrajectory& trajectory, double t) {
  Motion m;
  for (int i = 0; i < kN; ++i) {
    const std::size_t j = static_cast<std::size_t>(i);
    m.q[i] = trajectory.q0[j];
    m.qd[i] = 0;
    m.qdd[i] = 0;
    for (std::size_t k = 0; k < trajectory.frequency_hz[j].size(); ++k) {
      const double w = 2 * std::numbers::pi * trajectory.frequency_hz[j][k];
      const double a = trajectory.amplitude_rad[j][k];
      const double angle = w * t + trajectory.phase_rad[j][k];
      const double s = std::sin(angle), c = std::cos(angle);
      m.q[i] += a * s;
      m.qd[i] += a * w * c;
      m.qdd[i] -= a * w * w * s;
    }
  }
  return m;
}

Vector friction(const ArmModel<double, kN>& arm, const Vector& qd) {
  Vector f;
  for (int i = 0; i < kN; ++i) {
    f[i] = friction_torque(arm.actuation[static_cast<std::size_t>(i)], qd[i], 0.0);
  }
  return f;
}

const Parameters& parameters_with_payload() {
  static const Parameters parameters{reduced_links(model::KawasakiArmWithPayload::kModel)};
  return parameters;
}

const Parameters& parameters_without_payload() {
  static const Parameters parameters{reduced_links(model::KawasakiArm::kModel)};
  return parameters;
}

Vector true_torque(const Motion& m, bool payload) {
  const Vector tau = inverse_dynamics<Arm>(payload ? parameters_with_payload() : parameters_without_payload(),
                                           m.q, m.qd, m.qdd);
  return tau + friction(payload ? model::KawasakiArmWithPayload::kModel : model::KawasakiArm::kModel, m.qd);
}

Vector motor_input(const Motion& m, const Vector& torque) {
  return torque + kRotor.cwiseProduct(m.qdd) + kRotor.cwiseProduct(m.qd) / kMotorTimeConstant;
}

ArmModel<double, kN> nominal_arm(int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) * 7919U + 17U);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  ArmModel<double, kN> arm = model::KawasakiArm::kModel;
  for (std::size_t j = 0; j < kN; ++j) {
    for (double& p : arm.links[j]) {
      p *= 1 + 0.1 * uniform(random);
    }
    arm.actuation[j].coulomb_friction *= 1 + 0.1 * uniform(random);
    arm.actuation[j].viscous_friction *= 1 + 0.1 * uniform(random);
  }
  return arm;
}

JointAccelerationModel<double, kN>::Config fit_joint_model(double period, double acceleration_noise,
                                                           int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) * 104729U + 5U);
  std::normal_distribution<double> noise(0.0, acceleration_noise);
  const int samples = static_cast<int>(20.0 / period);
  const FourierTrajectory earlier = validation_trajectory();
  std::vector<Vector> u(static_cast<std::size_t>(samples)), measured(u.size());
  for (std::size_t j = 0; j < u.size(); ++j) {
    const Motion m = at(earlier, static_cast<double>(j) * period);
    u[j] = motor_input(m, true_torque(m, false));
    for (int i = 0; i < kN; ++i) {
      measured[j][i] = m.qdd[i] + noise(random);
    }
  }
  // The model is linear in K/J once c is given: scan c for all joints at once, take each joint's best, refine by
  // golden section.
  using Model = JointAccelerationModel<double, kN>;
  struct Misfit {
    Vector value, gain;
  };
  const auto misfit = [&](const Vector& log_c) {
    Model::Config trial;
    trial.period = period;
    trial.decay = log_c.array().exp();
    Model joint_model;
    (void)joint_model.configure(trial);
    Vector yy = Vector::Zero(), xy = Vector::Zero(), xx = Vector::Zero();
    for (std::size_t j = 0; j < u.size(); ++j) {
      const Vector& x = joint_model.update(u[j]);
      yy += measured[j].cwiseAbs2();
      xy += x.cwiseProduct(measured[j]);
      xx += x.cwiseAbs2();
    }
    Misfit out;
    for (int i = 0; i < kN; ++i) {
      out.gain[i] = xx[i] > 0 ? xy[i] / xx[i] : 0;
      out.value[i] = yy[i] - out.gain[i] * xy[i];
    }
    return out;
  };
  Vector best_log = Vector::Zero(), best_value = Vector::Constant(1e300);
  for (double log_c = -3; log_c <= 6; log_c += 0.25) {
    const Misfit m = misfit(Vector::Constant(log_c));
    for (int i = 0; i < kN; ++i) {
      if (m.gain[i] > 0 && m.value[i] < best_value[i]) {
        best_value[i] = m.value[i];
        best_log[i] = log_c;
      }
    }
  }
  Vector lo = best_log.array() - 0.25, hi = best_log.array() + 0.25;
  for (int step = 0; step < 16; ++step) {
    const Vector a = hi - 0.618 * (hi - lo), b = lo + 0.618 * (hi - lo);
    const Misfit at_a = misfit(a), at_b = misfit(b);
    for (int i = 0; i < kN; ++i) {
      if (at_a.value[i] < at_b.value[i]) {
        hi[i] = b[i];
      } else {
        lo[i] = a[i];
      }
    }
  }
  const Vector middle = 0.5 * (lo + hi);
  const Misfit last = misfit(middle);
  Model::Config best;
  best.period = period;
  best.decay = middle.array().exp();
  for (int i = 0; i < kN; ++i) {
    best.gain[i] = last.gain[i] > 0 ? last.gain[i] : 1.0;
  }
  return best;
}

Base to_publication(const LayoutVector<4>& x) {
  using Layout = TerminalLayout<Arm, 4>;
  static_assert(Layout::kParameters == kBase);
  // Link 5 keeps hx, hz, S11, S12, S13, S23, S33 (axis y); link 6 keeps hx, hy, S11, S12, S22, S13, S23 (axis z).
  const int a = Layout::inertial(0);
  const int b = Layout::inertial(1);
  const double hx5 = x[a], hz5 = x[a + 1], s11 = x[a + 2], s12 = x[a + 3], s13 = x[a + 4], s23 = x[a + 5],
               s33 = x[a + 6];
  const double hx6 = x[b], hy6 = x[b + 1], t11 = x[b + 2], t12 = x[b + 3], t22 = x[b + 4], t13 = x[b + 5],
               t23 = x[b + 6];
  // I = tr(Σ) E − Σ with the entries along the joint axis zero: I11 = S33 and so on.
  const double i22_6 = t11;
  Base p;
  p << hx5, hz5, s33 - s11 + i22_6, s11 + s33 + i22_6, -s12, -s13, -s23, x[Layout::friction(0)],
      x[Layout::friction(0) + 1], hx6, hy6, t22 - t11, t11 + t22, -t12, -t13, -t23, x[Layout::friction(1)],
      x[Layout::friction(1) + 1];
  return p;
}

const Eigen::Matrix<double, kBase, kBase>& publication_map() {
  static const Eigen::Matrix<double, kBase, kBase> map = [] {
    Eigen::Matrix<double, kBase, kBase> m;
    for (int i = 0; i < kBase; ++i) {
      m.col(i) = to_publication(Base::Unit(i));
    }
    return m;
  }();
  return map;
}

const Eigen::Matrix<double, kBase, kBase>& publication_map_inverse() {
  static const Eigen::Matrix<double, kBase, kBase> inverse =
      solve_square(publication_map(), Eigen::MatrixXd::Identity(kBase, kBase));
  return inverse;
}

Base base_with_payload() {
  return to_publication(
      layout_parameters<4>(parameters_with_payload(), model::KawasakiArmWithPayload::kModel));
}

Base base_without_payload() {
  return to_publication(layout_parameters<4>(parameters_without_payload(), model::KawasakiArm::kModel));
}

Base column_rms(const FourierTrajectory& trajectory, double period, int samples) {
  const Eigen::Matrix<double, kBase, kBase>& inverse = publication_map_inverse();
  Base squares = Base::Zero();
  for (int j = 0; j < samples; ++j) {
    const Motion m = at(trajectory, j * period);
    squares += (as_matrix<4>(rows_at<4>(m.q, m.qd, m.qdd)) * inverse).cwiseAbs2().colwise().sum().transpose();
  }
  return (squares / samples).cwiseSqrt();
}

double relative_error(const Base& estimate, const Base& rms) {
  return rms.cwiseProduct(estimate - base_with_payload()).norm() /
         rms.cwiseProduct(base_with_payload() - base_without_payload()).norm();
}

}  // namespace heft::studies::terminal_link
