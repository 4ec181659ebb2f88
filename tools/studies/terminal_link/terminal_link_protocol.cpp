#include "terminal_link_protocol.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Core>

#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/host/decompositions.hpp"
#include "terminal_link_setup.hpp"

namespace heft::studies {
namespace {

using namespace terminal_link;

constexpr int kFirst = 4;  // k = 5
using Layout = TerminalLayout<Arm, kFirst>;
using Rows = TerminalRows<double, Layout>;
static_assert(Layout::kParameters == kBase);

/// What the measures of the protocol need of the two trajectories.
struct Yardstick {
  std::vector<Base>
      column_rms;  ///< C for each sample count: rms of the true base regressor's columns over that run
  Eigen::Matrix<double, Eigen::Dynamic, kBase> validation_5,
      validation_6;  ///< rows on the validation trajectory
};

Rows rows_at(const Motion& m) { return terminal_link::rows_at<kFirst>(m.q, m.qd, m.qdd); }

Yardstick make_yardstick(const ProtocolSettings& settings) {
  // Rows in the paper's parameters: W_p = W T⁻¹.
  const Eigen::Matrix<double, kBase, kBase>& inverse = publication_map_inverse();
  Yardstick y;
  Base squares = Base::Zero();
  for (int j = 0; j < settings.sample_counts.back(); ++j) {
    const auto w = (as_matrix<kFirst>(rows_at(at(settings.exciting, j * settings.period))) * inverse).eval();
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
    const auto w = (as_matrix<kFirst>(rows_at(at(validation, j * 0.005))) * inverse).eval();
    y.validation_5.row(j) = w.row(0);
    y.validation_6.row(j) = w.row(1);
  }
  return y;
}

double rms(const Eigen::VectorXd& v) { return std::sqrt(v.squaredNorm() / static_cast<double>(v.size())); }

ProtocolPoint judge(ProtocolMethod method, int samples, const Base& estimate, const Yardstick& yardstick,
                    const Base& column_rms) {
  ProtocolPoint point;
  point.method = method;
  point.samples = samples;
  const Base p = to_publication(estimate);
  const Base wrong = p - base_with_payload();
  point.error = relative_error(p, column_rms);
  point.torque_error_5 = 1e3 * rms(yardstick.validation_5 * wrong);
  point.torque_error_6 = 1e3 * rms(yardstick.validation_6 * wrong);
  point.inertia_33 = 1e3 * p[12];
  point.base_parameters.assign(p.data(), p.data() + kBase);
  return point;
}

/// One scenario, one seed: every estimator is fed the same samples.
class Protocol {
 public:
  explicit Protocol(const ProtocolSettings& settings)
      : settings_(settings),
        yardstick_(make_yardstick(settings)),
        noise_(settings.seed),
        nominal_actuation_(nominal_arm(settings.seed)),
        running_{reduced_links(nominal_actuation_)},
        running_estimate_(layout_parameters<kFirst>(running_, nominal_actuation_)) {
    (void)joint_model_.configure(
        fit_joint_model(settings.period, settings.acceleration_noise, settings.seed));
    (void)delayed_.configure(1, 3);
  }

  std::vector<ProtocolPoint> run() {
    for (int j = 0; j < settings_.sample_counts.back(); ++j) {
      take_sample(j);
      if (next_ < settings_.sample_counts.size() && j + 1 == settings_.sample_counts[next_]) {
        judge_all(j + 1, yardstick_.column_rms[next_++]);
      }
    }
    return std::move(points_);
  }

 private:
  void take_sample(int j) {
    const Motion m = at(settings_.exciting, j * settings_.period);
    const Vector epsilon = noise_(settings_.acceleration_noise);
    const Vector measured = m.qdd + epsilon;
    const Vector tau = true_torque(m);
    const Vector u = motor_input(m, tau);
    const Vector measured_tau = settings_.rotor_inertia ? (tau - kRotor.cwiseProduct(epsilon)).eval() : tau;

    std::array<Rows, 2> rows{};
    terminal_rows<Arm, kFirst, 2>(terminal_trigonometry<Arm, kFirst>(m.q), m.q, m.qd,
                                  {measured, joint_model_.update(u)}, 0.0, rows);
    least_squares_.add(rows[0], rows[0], measured_tau);
    by_model_.add(rows[0], rows[1], measured_tau);
    if (!settings_.all_methods) return;
    const Vector forward = forward_acceleration(m, u);
    by_desired_.add(rows[0], rows_at(m), measured_tau);
    by_forward_.add(rows[0], rows_at({m.q, m.qd, forward}), measured_tau);
    const bool have_delayed = delayed_.ready();
    const Vector mean = delayed_.update(measured);
    if (have_delayed) {
      by_delay_.add(rows[0], rows_at({m.q, m.qd, mean}), measured_tau);
    }
    add_literal(rows[0], rows[1], measured_tau);
    if (j >= 200 && j % 50 == 0) update_running_estimate();
  }

  /// Forward dynamics with the running estimate, driven by the motor input, which holds no measured acceleration.
  Vector forward_acceleration(const Motion& m, const Vector& u) const {
    Vector load = u - kRotor.cwiseProduct(m.qd) / kMotorTimeConstant;
    for (int i = 0; i < kN; ++i) {
      JointActuation<double> actuation = nominal_actuation_.actuation[static_cast<std::size_t>(i)];
      if (i >= kFirst) {
        actuation.coulomb_friction = running_estimate_[Layout::friction(i - kFirst)];
        actuation.viscous_friction = running_estimate_[Layout::friction(i - kFirst) + 1];
      }
      load[i] -= friction_torque(actuation, m.qd[i], 0.0);
    }
    Vector forward = Vector::Zero();
    if (predicted_acceleration<Arm>(running_, joint_trigonometry<Arm>(m.q), m.q, m.qd, kRotor, load,
                                    forward) != Status::kOk) {
      forward.setZero();
    }
    return forward;
  }

  /// (32), (33) as printed: Σ W̃ᵀ (Ŵ Ŵᵀ) W̃.
  void add_literal(const Rows& row, const Rows& instrument, const Vector& tau) {
    const auto w = as_matrix<kFirst>(row);
    const auto z = as_matrix<kFirst>(instrument);
    const Eigen::Matrix2d weight = z * z.transpose();
    literal_ += w.transpose() * weight * w;
    literal_right_ += w.transpose() * weight * tau.tail<2>();
  }

  /// The arm of the forward dynamics, once its own estimate is well conditioned.
  void update_running_estimate() {
    constexpr double kMostAmplification = 60.0;
    if (!by_forward_.solve() || !(by_forward_.solver.amplification() < kMostAmplification)) return;
    running_estimate_ = by_forward_.solution();
    for_inertial<kFirst>([&](std::size_t link, std::size_t entry, int column) {
      running_.links[link][entry] = running_estimate_[column];
    });
  }

  void judge_all(int samples, const Base& column_rms) {
    const auto take = [&](ProtocolMethod method, System<kFirst>& system) {
      if (system.solve()) {
        points_.push_back(judge(method, samples, system.solution(), yardstick_, column_rms));
        points_.back().amplification = system.solver.amplification();
      }
    };
    take(ProtocolMethod::kLeastSquares, least_squares_);
    take(ProtocolMethod::kInstrumentModel, by_model_);
    if (!settings_.all_methods) return;
    take(ProtocolMethod::kInstrumentDelayed, by_delay_);
    take(ProtocolMethod::kInstrumentDesired, by_desired_);
    take(ProtocolMethod::kInstrumentForward, by_forward_);
    points_.push_back(judge(ProtocolMethod::kLiteralQuasiDiagonal, samples,
                            solve_symmetric(literal_, literal_right_), yardstick_, column_rms));
  }

  const ProtocolSettings& settings_;
  Yardstick yardstick_;
  Noise noise_;
  JointAccelerationModel<double, kN> joint_model_;
  DelayedMean<double, kN, 8> delayed_;
  ArmModel<double, kN> nominal_actuation_;
  Parameters running_;     ///< arm of the forward dynamics
  Base running_estimate_;  ///< the same as a vector
  System<kFirst> least_squares_, by_model_, by_delay_, by_desired_, by_forward_;
  Eigen::Matrix<double, kBase, kBase> literal_ = Eigen::Matrix<double, kBase, kBase>::Zero();
  Base literal_right_ = Base::Zero();
  std::vector<ProtocolPoint> points_;
  std::size_t next_{0};  ///< of settings.sample_counts
};

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

std::vector<ProtocolPoint> run_protocol(const ProtocolSettings& settings) { return Protocol(settings).run(); }

std::vector<double> true_base_parameters() {
  const Base p = base_with_payload();
  return {p.data(), p.data() + kBase};
}

std::vector<double> nominal_base_parameters(int seed) {
  const ArmModel<double, kN> arm = nominal_arm(seed);
  const Base p = to_publication(layout_parameters<kFirst>(Parameters{reduced_links(arm)}, arm));
  return {p.data(), p.data() + kBase};
}

const std::vector<std::string>& base_parameter_names() {
  static const std::vector<std::string> names = {"α5x",           "α5z + α6z", "Ī5_11 − Ī5_33 + Ī6_22",
                                                 "Ī5_22 + Ī6_22", "Ī5_12",     "Ī5_13",
                                                 "Ī5_23 − r α6z", "F5",        "d5",
                                                 "α6x",           "α6y",       "Ī6_11 − Ī6_22",
                                                 "Ī6_33",         "Ī6_12",     "Ī6_13",
                                                 "Ī6_23",         "F6",        "d6"};
  return names;
}

std::pair<double, double> variation_torque() {
  ProtocolSettings settings;
  settings.exciting = exciting_trajectory();
  settings.sample_counts = {200};
  const Yardstick y = make_yardstick(settings);
  const Base change = base_with_payload() - base_without_payload();
  return {1e3 * rms(y.validation_5 * change), 1e3 * rms(y.validation_6 * change)};
}

namespace {

FourierTrajectory random_trajectory(std::mt19937_64& random) {
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

}  // namespace

double condition_number(const FourierTrajectory& trajectory) {
  const Eigen::Matrix<double, kBase, kBase>& inverse = publication_map_inverse();
  Eigen::Matrix<double, kBase, kBase> normal = Eigen::Matrix<double, kBase, kBase>::Zero();
  for (int j = 0; j < 1000; ++j) {
    const auto w = (as_matrix<kFirst>(rows_at(at(trajectory, j * 0.02))) * inverse).eval();
    normal += w.transpose() * w;
  }
  const Base scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, kBase, kBase> scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Base eigenvalues = eigenvalues_of(scaled);
  return std::sqrt(eigenvalues[kBase - 1] / eigenvalues[0]);
}

FourierTrajectory random_exciting_trajectory(int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed) * 48271U + 3U);
  FourierTrajectory best = random_trajectory(random);
  double smallest = condition_number(best);
  for (int draw = 1; draw < 10; ++draw) {
    const FourierTrajectory candidate = random_trajectory(random);
    const double condition = condition_number(candidate);
    if (condition < smallest) {
      smallest = condition;
      best = candidate;
    }
  }
  return best;
}

}  // namespace heft::studies
