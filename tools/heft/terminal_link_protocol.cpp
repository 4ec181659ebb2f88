#include "terminal_link_protocol.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Dense>

#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::tools {
namespace {

constexpr int kN = 6;
constexpr int kFirst = 4;  // k = 5
constexpr int kBase = 18;
using Arm = StaticArm<double, model::KawasakiArm>;
using Layout = TerminalLayout<Arm, kFirst>;
using Vector = Arm::Vector;
using Rows = TerminalRows<double, Layout>;
using Parameters = ReducedParameters<double, model::KawasakiArm>;
using Base = Eigen::Matrix<double, kBase, 1>;
static_assert(Layout::kParameters == kBase);

/// Rotor inertias of scenario B [kg·m²] and the time constant of the motors.
const Vector kRotor = (Vector() << 20e-3, 20e-3, 20e-3, 5e-3, 3e-3, 2e-3).finished();
constexpr double kMotorTimeConstant = 0.03;

struct Motion {
  Vector q, qd, qdd;
};

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
      m.q[i] += a * std::sin(angle);
      m.qd[i] += a * w * std::cos(angle);
      m.qdd[i] -= a * w * w * std::sin(angle);
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

const Parameters& true_parameters() {
  static const Parameters parameters{reduced_links(model::KawasakiArmWithPayload::kModel)};
  return parameters;
}

Vector true_torque(const Motion& m) {
  Vector tau = inverse_dynamics<Arm>(true_parameters(), m.q, m.qd, m.qdd);
  return tau + friction(model::KawasakiArmWithPayload::kModel, m.qd);
}

/// The layout's parameter vector of an arm: friction pairs, last joint first, then links 5 and 6.
Base layout_parameters(const Parameters& parameters, const ArmModel<double, kN>& actuation) {
  Base x;
  for (int r = 0; r < Layout::kRows; ++r) {
    x[Layout::friction(r)] = actuation.actuation[static_cast<std::size_t>(kFirst + r)].coulomb_friction;
    x[Layout::friction(r) + 1] = actuation.actuation[static_cast<std::size_t>(kFirst + r)].viscous_friction;
  }
  int column = Layout::inertial(0);
  for (std::size_t e = 0; e < 10; ++e) {
    if (structural::kReducedPattern<model::KawasakiArm, 4>[e]) {
      x[column++] = parameters.links[4][e];
    }
  }
  for (std::size_t e = 0; e < 10; ++e) {
    if (structural::kReducedPattern<model::KawasakiArm, 5>[e]) {
      x[column++] = parameters.links[5][e];
    }
  }
  return x;
}

/// From the layout's vector to the publication's 18 base parameters (section 7, table for k = 5). Linear.
Base to_publication(const Base& x) {
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

/// Raw coefficients ±10 %: each reduced parameter and friction coefficient of the arm before the payload.
Parameters nominal_parameters(int seed, ArmModel<double, kN>& actuation) {
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
  actuation = arm;
  return Parameters{reduced_links(arm)};
}

/// Fit of K/J and c of (35) by output error on an earlier run without payload: the validation trajectory.
JointAccelerationModel<double, kN>::Config fit_joint_model(const ProtocolSettings& settings) {
  std::mt19937_64 random(static_cast<std::uint64_t>(settings.seed) * 104729U + 5U);
  std::normal_distribution<double> noise(0.0, settings.acceleration_noise);
  const int samples = static_cast<int>(20.0 / settings.period);
  const Parameters before{reduced_links(model::KawasakiArm::kModel)};
  const FourierTrajectory earlier = validation_trajectory();
  std::vector<Vector> u(static_cast<std::size_t>(samples)), measured(u.size());
  for (std::size_t j = 0; j < u.size(); ++j) {
    const Motion m = at(earlier, static_cast<double>(j) * settings.period);
    const Vector tau =
        inverse_dynamics<Arm>(before, m.q, m.qd, m.qdd) + friction(model::KawasakiArm::kModel, m.qd);
    u[j] = tau + kRotor.cwiseProduct(m.qdd) + kRotor.cwiseProduct(m.qd) / kMotorTimeConstant;
    for (int i = 0; i < kN; ++i) {
      measured[j][i] = m.qdd[i] + noise(random);
    }
  }
  // The model is linear in K/J once c is given: scan c, take the best gain, refine by golden section.
  JointAccelerationModel<double, kN>::Config best;
  best.period = settings.period;
  for (int i = 0; i < kN; ++i) {
    const auto misfit = [&](double log_c, double* gain) {
      JointAccelerationModel<double, kN>::Config trial;
      trial.period = settings.period;
      trial.decay.setConstant(std::exp(log_c));
      JointAccelerationModel<double, kN> joint_model;
      (void)joint_model.configure(trial);
      double yy = 0, xy = 0, xx = 0;
      for (std::size_t j = 0; j < u.size(); ++j) {
        const double x = joint_model.update(u[j])[i];
        const double y = measured[j][i];
        yy += y * y;
        xy += x * y;
        xx += x * x;
      }
      const double k = xx > 0 ? xy / xx : 0;
      if (gain) {
        *gain = k;
      }
      return yy - k * xy;
    };
    double best_log = 0, best_misfit = 1e300;
    for (double log_c = -3; log_c <= 6; log_c += 0.25) {
      double gain = 0;
      const double value = misfit(log_c, &gain);
      if (gain > 0 && value < best_misfit) {
        best_misfit = value;
        best_log = log_c;
      }
    }
    double lo = best_log - 0.25, hi = best_log + 0.25;
    for (int step = 0; step < 20; ++step) {
      const double a = hi - 0.618 * (hi - lo), b = lo + 0.618 * (hi - lo);
      if (misfit(a, nullptr) < misfit(b, nullptr)) {
        hi = b;
      } else {
        lo = a;
      }
    }
    double gain = 0;
    misfit(0.5 * (lo + hi), &gain);
    best.decay[i] = std::exp(0.5 * (lo + hi));
    best.gain[i] = gain > 0 ? gain : 1.0;
  }
  return best;
}

Eigen::Matrix<double, 2, kBase> as_matrix(const Rows& rows) {
  Eigen::Matrix<double, 2, kBase> m;
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < kBase; ++c) {
      m(r, c) = rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
    }
  }
  return m;
}

/// Instrumental (or least-squares) system of one method, solved by production code.
struct System {
  NormalEquations<double, Layout> equations;
  StagedSolver<double, Layout> solver;

  System() { equations.reset({}, {}); }
  void add(const Rows& w, const Rows& z, const Vector& tau) {
    for (int r = 0; r < Layout::kRows; ++r) {
      const std::size_t i = static_cast<std::size_t>(r);
      equations.add(r, z[i], w[i], tau[kFirst + r]);
    }
  }
  bool solve() {
    solver.start(equations.matrix(), equations.right_side(), false);
    while (!solver.advance(1000)) {
    }
    return solver.status() == Status::kOk;
  }
  Base solution() const {
    Base x;
    for (int i = 0; i < kBase; ++i) {
      x[i] = solver.solution()[static_cast<std::size_t>(i)];
    }
    return x;
  }
};

/// What the measures of the protocol need of the two trajectories.
struct Yardstick {
  std::vector<Base> column_rms;  ///< C for each sample count: rms of the true base regressor's columns over that run
  Eigen::Matrix<double, Eigen::Dynamic, kBase> validation_5, validation_6;  ///< rows on the validation trajectory
};

Rows rows_at(const Motion& m) {
  std::array<Rows, 1> rows{};
  terminal_rows<Arm, kFirst, 1>(terminal_trigonometry<Arm, kFirst>(m.q), m.q, m.qd, {m.qdd}, 0.0, rows);
  return rows[0];
}

Yardstick make_yardstick(const ProtocolSettings& settings) {
  // Rows in the publication's parameters: W_p = W T⁻¹.
  const Eigen::Matrix<double, kBase, kBase> inverse = publication_map().inverse();
  Yardstick y;
  Base squares = Base::Zero();
  for (int j = 0; j < settings.sample_counts.back(); ++j) {
    const auto w = (as_matrix(rows_at(at(settings.exciting, j * settings.period))) * inverse).eval();
    squares += w.cwiseAbs2().colwise().sum().transpose();
    if (j + 1 == settings.sample_counts[y.column_rms.size()]) {
      y.column_rms.push_back((squares / (j + 1)).cwiseSqrt());
    }
  }
  const FourierTrajectory validation = validation_trajectory();
  constexpr int kValidation = 4000;  // 20 s at 5 ms
  y.validation_5.resize(kValidation, kBase);
  y.validation_6.resize(kValidation, kBase);
  for (int j = 0; j < kValidation; ++j) {
    const auto w = (as_matrix(rows_at(at(validation, j * 0.005))) * inverse).eval();
    y.validation_5.row(j) = w.row(0);
    y.validation_6.row(j) = w.row(1);
  }
  return y;
}

double rms(const Eigen::VectorXd& v) { return std::sqrt(v.squaredNorm() / static_cast<double>(v.size())); }

Base true_base() {
  return to_publication(layout_parameters(true_parameters(), model::KawasakiArmWithPayload::kModel));
}

Base base_without_payload() {
  return to_publication(
      layout_parameters(Parameters{reduced_links(model::KawasakiArm::kModel)}, model::KawasakiArm::kModel));
}

ProtocolPoint judge(ProtocolMethod method, int samples, const Base& estimate, const Yardstick& yardstick,
                    const Base& column_rms) {
  ProtocolPoint point;
  point.method = method;
  point.samples = samples;
  const Base p = to_publication(estimate);
  const Base wrong = p - true_base();
  point.error = column_rms.cwiseProduct(wrong).norm() /
                column_rms.cwiseProduct(true_base() - base_without_payload()).norm();
  point.torque_error_5 = 1e3 * rms(yardstick.validation_5 * wrong);
  point.torque_error_6 = 1e3 * rms(yardstick.validation_6 * wrong);
  point.inertia_33 = 1e3 * p[12];
  point.base_parameters.assign(p.data(), p.data() + kBase);
  return point;
}

}  // namespace

const char* to_string(ProtocolMethod method) {
  switch (method) {
    case ProtocolMethod::kLeastSquares: return "least squares";
    case ProtocolMethod::kInstrumentModel: return "IV, joint model (35)";
    case ProtocolMethod::kLiteralQuasiDiagonal: return "(32) as printed";
    case ProtocolMethod::kInstrumentDelayed: return "IV, delayed mean";
    case ProtocolMethod::kInstrumentDesired: return "IV, desired acceleration";
    case ProtocolMethod::kInstrumentForward: return "IV, forward dynamics";
  }
  return "unknown";
}

std::vector<ProtocolPoint> run_protocol(const ProtocolSettings& settings) {
  const Yardstick yardstick = make_yardstick(settings);
  std::mt19937_64 random(static_cast<std::uint64_t>(settings.seed) * 2654435761U + 1U);
  std::normal_distribution<double> noise(0.0, 1.0);

  JointAccelerationModel<double, kN> joint_model;
  (void)joint_model.configure(fit_joint_model(settings));
  DelayedMean<double, kN, 8> delayed;
  (void)delayed.configure(1, 3);

  ArmModel<double, kN> nominal_actuation;
  Parameters running = nominal_parameters(settings.seed, nominal_actuation);
  Base running_friction_source = layout_parameters(running, nominal_actuation);

  System least_squares, by_model, by_delay, by_desired, by_forward;
  Eigen::Matrix<double, kBase, kBase> literal = Eigen::Matrix<double, kBase, kBase>::Zero();
  Base literal_right = Base::Zero();

  std::vector<ProtocolPoint> points;
  std::size_t next = 0;
  for (int j = 0; j < settings.sample_counts.back(); ++j) {
    const Motion m = at(settings.exciting, j * settings.period);
    Vector epsilon;
    for (int i = 0; i < kN; ++i) {
      epsilon[i] = settings.acceleration_noise * noise(random);
    }
    const Vector measured = m.qdd + epsilon;
    const Vector tau = true_torque(m);
    const Vector u = tau + kRotor.cwiseProduct(m.qdd) + kRotor.cwiseProduct(m.qd) / kMotorTimeConstant;
    const Vector measured_tau = settings.rotor_inertia ? (tau - kRotor.cwiseProduct(epsilon)).eval() : tau;

    // Forward dynamics with the running estimate, driven by the motor input, which holds no measured acceleration.
    Vector forward = Vector::Zero();
    {
      Vector load = u - kRotor.cwiseProduct(m.qd) / kMotorTimeConstant;
      for (int i = 0; i < kN; ++i) {
        JointActuation<double> actuation = nominal_actuation.actuation[static_cast<std::size_t>(i)];
        if (i >= kFirst) {
          actuation.coulomb_friction = running_friction_source[Layout::friction(i - kFirst)];
          actuation.viscous_friction = running_friction_source[Layout::friction(i - kFirst) + 1];
        }
        load[i] -= friction_torque(actuation, m.qd[i], 0.0);
      }
      if (predicted_acceleration<Arm>(running, joint_trigonometry<Arm>(m.q), m.q, m.qd, kRotor, load, forward) !=
          Status::kOk) {
        forward.setZero();
      }
    }

    std::array<Rows, 2> rows{};
    const auto trig = terminal_trigonometry<Arm, kFirst>(m.q);
    const auto instrument_rows = [&](const Vector& acceleration) {
      std::array<Rows, 1> z{};
      terminal_rows<Arm, kFirst, 1>(trig, m.q, m.qd, {acceleration}, 0.0, z);
      return z[0];
    };
    terminal_rows<Arm, kFirst, 2>(trig, m.q, m.qd, {measured, joint_model.update(u)}, 0.0, rows);
    least_squares.add(rows[0], rows[0], measured_tau);
    by_model.add(rows[0], rows[1], measured_tau);
    by_desired.add(rows[0], instrument_rows(m.qdd), measured_tau);
    by_forward.add(rows[0], instrument_rows(forward), measured_tau);
    const bool have_delayed = delayed.ready();
    const Vector mean = delayed.update(measured);
    if (have_delayed) {
      by_delay.add(rows[0], instrument_rows(mean), measured_tau);
    }
    {
      // (32), (33) as printed: Σ W̃ᵀ (Ŵ Ŵᵀ) W̃.
      const auto w = as_matrix(rows[0]);
      const auto z = as_matrix(rows[1]);
      const Eigen::Matrix2d weight = z * z.transpose();
      literal += w.transpose() * weight * w;
      literal_right += w.transpose() * weight * measured_tau.tail<2>();
    }
    if (j >= 200 && j % 50 == 0 && by_forward.solve() && by_forward.solver.amplification() < 60) {
      running_friction_source = by_forward.solution();
      int column = Layout::inertial(0);
      for (std::size_t link : {std::size_t{4}, std::size_t{5}}) {
        for (std::size_t e = 0; e < 10; ++e) {
          const bool kept = link == 4 ? structural::kReducedPattern<model::KawasakiArm, 4>[e]
                                      : structural::kReducedPattern<model::KawasakiArm, 5>[e];
          if (kept) {
            running.links[link][e] = running_friction_source[column++];
          }
        }
      }
    }

    if (next < settings.sample_counts.size() && j + 1 == settings.sample_counts[next]) {
      const Base& column_rms = yardstick.column_rms[next++];
      const auto take = [&](ProtocolMethod method, System& system) {
        if (system.solve()) {
          points.push_back(judge(method, j + 1, system.solution(), yardstick, column_rms));
          points.back().amplification = system.solver.amplification();
        }
      };
      take(ProtocolMethod::kLeastSquares, least_squares);
      take(ProtocolMethod::kInstrumentModel, by_model);
      take(ProtocolMethod::kInstrumentDelayed, by_delay);
      take(ProtocolMethod::kInstrumentDesired, by_desired);
      take(ProtocolMethod::kInstrumentForward, by_forward);
      points.push_back(
          judge(ProtocolMethod::kLiteralQuasiDiagonal, j + 1, literal.ldlt().solve(literal_right), yardstick,
                column_rms));
    }
  }
  return points;
}

std::vector<double> true_base_parameters() {
  const Base p = true_base();
  return {p.data(), p.data() + kBase};
}

std::vector<double> nominal_base_parameters(int seed) {
  ArmModel<double, kN> actuation;
  const Parameters nominal = nominal_parameters(seed, actuation);
  const Base p = to_publication(layout_parameters(nominal, actuation));
  return {p.data(), p.data() + kBase};
}

const std::vector<std::string>& base_parameter_names() {
  static const std::vector<std::string> names = {
      "α5x",           "α5z + α6z",         "Ī5_11 − Ī5_33 + Ī6_22", "Ī5_22 + Ī6_22", "Ī5_12",  "Ī5_13",
      "Ī5_23 − r α6z", "F5",                "d5",                    "α6x",           "α6y",    "Ī6_11 − Ī6_22",
      "Ī6_33",         "Ī6_12",             "Ī6_13",                 "Ī6_23",         "F6",     "d6"};
  return names;
}

std::pair<double, double> variation_torque() {
  ProtocolSettings settings;
  settings.exciting = exciting_trajectory();
  settings.sample_counts = {200};
  const Yardstick y = make_yardstick(settings);
  const Base change = true_base() - base_without_payload();
  return {1e3 * rms(y.validation_5 * change), 1e3 * rms(y.validation_6 * change)};
}

FourierTrajectory random_exciting_trajectory(int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) * 48271U + 3U);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  constexpr std::array<double, kN> kRmsAcceleration = {3, 4, 5, 12, 9, 14};
  FourierTrajectory t;
  for (std::size_t i = 0; i < kN; ++i) {
    t.q0.push_back(2 * unit(random) - 1);
    std::vector<double> f, a, p;
    double power = 0;
    for (int k = 0; k < 6; ++k) {
      f.push_back(0.25 + 1.35 * unit(random));
      const double w = 2 * std::numbers::pi * f.back();
      a.push_back((0.3 + 0.7 * unit(random)) / (w * w));
      p.push_back(2 * std::numbers::pi * unit(random));
      power += 0.5 * a.back() * a.back() * w * w * w * w;
    }
    const double factor = kRmsAcceleration[i] / std::sqrt(power);
    for (double& amplitude : a) {
      amplitude *= factor;
    }
    t.frequency_hz.push_back(f);
    t.amplitude_rad.push_back(a);
    t.phase_rad.push_back(p);
  }
  return t;
}

}  // namespace heft::tools
