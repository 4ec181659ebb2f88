#include "terminal_link_closed_loop.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/filter/aligned_motion.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/robot_of.hpp"
#include "heft/sim/simulator.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/track/controllers.hpp"
#include "terminal_link_setup.hpp"

namespace heft::studies {
namespace {

using namespace terminal_link;

constexpr double kControlPeriod = 1e-3;
constexpr double kLoopBandwidthHz = 4.0;
constexpr double kRamp = 1.0;
constexpr double kExcitingTime = 22.0, kTrackingTime = 12.0;
constexpr double kCounted = 2.0;  // tracking errors count from here on [s]
constexpr double kFilterHz = 20.0;
constexpr int kDecimation = 5;       // estimator at 5 ms
constexpr double kSignWidth = 0.02;  // of the Coulomb sign in feed-forward [rad/s]
constexpr double kEncoderStep = 2 * std::numbers::pi / 131072;

sim::Body payload_body() {
  sim::Body body;
  body.mass = 0.25;
  body.com = Eigen::Vector3d(0.03, 0.03, 0.03);
  body.inertia = Eigen::Matrix3d::Identity() * (0.25 * 0.04 * 0.04 / 6);  // a cube of 4 cm
  return body;
}

std::shared_ptr<const sim::Reference> reference_of(const FourierTrajectory& t) {
  const Eigen::Index terms = static_cast<Eigen::Index>(t.frequency_hz[0].size());
  sim::FourierMotion motion{Eigen::VectorXd(kN), Eigen::MatrixXd(kN, terms), Eigen::MatrixXd(kN, terms),
                            Eigen::MatrixXd(kN, terms)};
  for (Eigen::Index i = 0; i < kN; ++i) {
    const std::size_t j = static_cast<std::size_t>(i);
    motion.q0[i] = t.q0[j];
    for (Eigen::Index k = 0; k < terms; ++k) {
      motion.amplitude(i, k) = t.amplitude_rad[j][static_cast<std::size_t>(k)];
      motion.frequency_hz(i, k) = t.frequency_hz[j][static_cast<std::size_t>(k)];
      motion.phase(i, k) = t.phase_rad[j][static_cast<std::size_t>(k)];
    }
  }
  return sim::ramp_in(sim::make_fourier(motion), motion.q0, kRamp);
}

/// What a controller knows of the arm.
struct Belief {
  Parameters parameters;
  FrictionFeedForward<double, kN> friction;
};

Belief belief_of(const ArmModel<double, kN>& arm) {
  Belief belief{Parameters{reduced_links(arm)}, {}};
  belief.friction.sign_width = kSignWidth;
  for (int i = 0; i < kN; ++i) {
    belief.friction.coulomb[i] = arm.actuation[static_cast<std::size_t>(i)].coulomb_friction;
    belief.friction.viscous[i] = arm.actuation[static_cast<std::size_t>(i)].viscous_friction;
  }
  return belief;
}

/// The arm as a controller believes it to be.
model::Robot robot_of(const Belief& belief) {
  ArmModel<double, kN> arm = model::KawasakiArm::kModel;
  for (std::size_t j = 0; j < arm.links.size(); ++j) {
    const Eigen::Index i = static_cast<Eigen::Index>(j);
    arm.links[j] = to_inertial_parameters(belief.parameters.links[j]);
    arm.actuation[j] = {kRotor[i], belief.friction.coulomb[i], belief.friction.viscous[i], 0.0};
  }
  return model::robot_of(arm, "kawasaki6r");
}

std::shared_ptr<sim::Controller> controller_of(track::Method method, const Belief& belief,
                                               const Vector& inertia) {
  track::ControllerSettings settings;
  settings.bandwidth_hz = kLoopBandwidthHz;
  settings.inertia = inertia;
  return track::make_controller(method, robot_of(belief), settings);
}

/// Simulates the arm with or without the payload under a controller.
data::Log simulate_arm(const FourierTrajectory& trajectory, double duration, bool payload, int seed,
                       std::shared_ptr<sim::Controller> controller) {
  sim::SimulationSettings s;
  s.robot = model::robot_of(model::KawasakiArm::kModel, "kawasaki6r");
  for (int i = 0; i < kN; ++i)
    s.robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia = kRotor[i];
  s.duration = duration;
  s.sample_rate = 1 / kControlPeriod;
  s.loads = sim::friction_of(s.robot);
  s.reference = reference_of(trajectory);
  s.initial_position.resize(kN);
  s.initial_velocity.resize(kN);
  Eigen::VectorXd acceleration(kN);
  s.reference->evaluate(0.0, s.initial_position, s.initial_velocity, acceleration);
  if (payload) {
    sim::PayloadEvent grasp;
    grasp.body = payload_body();
    s.payload_events = {grasp};
  }
  s.sensors.encoder_quantum = Eigen::VectorXd::Constant(kN, kEncoderStep);
  s.sensors.velocity = sim::VelocitySource::kDifferenced;
  s.sensors.velocity_cutoff_hz = 60;
  s.sensors.torque_noise = (Eigen::VectorXd(kN) << 10e-3, 10e-3, 10e-3, 4e-3, 2e-3, 2e-3).finished();
  s.seed = static_cast<std::uint64_t>(seed);
  s.controller = std::move(controller);
  return sim::simulate(s).log;
}

/// One sample as the estimators get it: everything through the same filter.
struct FilteredSample {
  Vector q, qd, qdd, qdd_desired, sign, tau;  ///< tau less the rotors' share
};

/// Motion from encoders, and torque, as TerminalLinkController takes them.
std::vector<FilteredSample> filtered(const data::Log& log) {
  AlignedMotion<double, kN> aligned;
  (void)aligned.configure(kFilterHz, kSignWidth);
  std::vector<FilteredSample> samples;
  for (Eigen::Index k = 0; k < log.num_samples(); ++k) {
    // A row's torque acts until the next row.
    const Vector tau = log.tau.row(k > 0 ? k - 1 : 0).transpose();
    (void)aligned.update(log.q.row(k).transpose(), log.qd.row(k).transpose(), log.qref.row(k).transpose(),
                         tau, kControlPeriod);
    if (k == 0 || log.time[k] < kRamp + 0.5 || k % kDecimation != 0) continue;
    samples.push_back({aligned.q(), aligned.qd(), aligned.qdd(), aligned.qdd_ref(), aligned.sign(),
                       aligned.tau() - kRotor.cwiseProduct(aligned.qdd())});
  }
  return samples;
}

template <int First>
TerminalRows<double, TerminalLayout<Arm, First>> rows_of(const FilteredSample& s, const Vector& qdd) {
  auto rows = rows_at<First>(s.q, s.qd, qdd);
  using Layout = TerminalLayout<Arm, First>;
  for (int r = 0; r < Layout::kRows; ++r) {
    rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(Layout::friction(r))] = s.sign[First + r];
  }
  return rows;
}

/// The production estimator over the samples of a run. The desired acceleration makes the instruments: it knows
/// nothing of the encoders' noise.
template <int First>
TerminalLinkEstimator<Arm, First> estimated(const std::vector<FilteredSample>& samples, const Belief& nominal,
                                            bool instruments) {
  TerminalLinkEstimator<Arm, First> estimator;
  typename TerminalLinkEstimator<Arm, First>::Config config;
  config.use_instruments = instruments;
  if (First < 3) {
    // Forty-eight parameters are never as far apart as eighteen: the check is for start-up, not for a whole run.
    config.max_amplification = 200;
    config.max_amplification_least_squares = 200;
  }
  (void)estimator.configure(config, nominal.parameters, nominal.friction.coulomb, nominal.friction.viscous);
  typename TerminalLinkEstimator<Arm, First>::Record record;
  for (const FilteredSample& s : samples) {
    (void)estimator.update_rows(rows_of<First>(s, s.qdd), rows_of<First>(s, s.qdd_desired), s.qd, s.tau,
                                record);
  }
  (void)estimator.solve_now();
  return estimator;
}

template <int First>
Belief belief_of(const TerminalLinkEstimator<Arm, First>& estimator, const Belief& nominal) {
  Belief belief = nominal;
  belief.parameters = estimator.reduced();
  estimator.friction(belief.friction.coulomb, belief.friction.viscous);
  return belief;
}

template <typename Estimator>
LayoutVector<4> vector_of(const Estimator& estimator) {
  LayoutVector<4> x;
  for (int i = 0; i < kBase; ++i) x[i] = estimator.estimate()[static_cast<std::size_t>(i)];
  return x;
}

/// e of an estimate against the arm with 250 g, columns scaled over the run itself.
class ErrorMeasure {
 public:
  explicit ErrorMeasure(const std::vector<FilteredSample>& samples) {
    const Eigen::Matrix<double, kBase, kBase>& inverse = publication_map_inverse();
    Base squares = Base::Zero();
    for (const FilteredSample& s : samples) {
      squares += (as_matrix<4>(rows_of<4>(s, s.qdd)) * inverse).cwiseAbs2().colwise().sum().transpose();
    }
    rms_ = (squares / static_cast<double>(samples.size())).cwiseSqrt();
    const Parameters loaded =
        corrected_for_payload(parameters_without_payload(), sim::inertial_parameters(payload_body()));
    truth_ = to_publication(layout_parameters<4>(loaded, model::KawasakiArm::kModel));
  }
  double operator()(const LayoutVector<4>& x) const {
    return rms_.cwiseProduct(to_publication(x) - truth_).norm() /
           rms_.cwiseProduct(truth_ - base_without_payload()).norm();
  }

 private:
  Base rms_, truth_;
};

/// core/estimate/README.md, section 8: accelerations by differencing the encoders twice, nothing filtered.
std::vector<EncoderEstimate> double_difference_estimates(const data::Log& log, const ErrorMeasure& error) {
  System<4> least_squares, desired;
  std::array<System<4>, 3> delayed;
  std::array<DelayedMean<double, kN, 8>, 3> means;
  for (std::size_t g = 0; g < 3; ++g) (void)means[g].configure(static_cast<int>(g) + 1, 1);
  for (Eigen::Index k = 2; k < log.num_samples(); ++k) {
    const Vector q = log.q.row(k - 1).transpose();
    const Vector qd = (log.q.row(k) - log.q.row(k - 2)).transpose() / (2 * kControlPeriod);
    const Vector qdd = (log.q.row(k) - 2 * log.q.row(k - 1) + log.q.row(k - 2)).transpose() /
                       (kControlPeriod * kControlPeriod);
    const Vector wanted = (log.qref.row(k) - 2 * log.qref.row(k - 1) + log.qref.row(k - 2)).transpose() /
                          (kControlPeriod * kControlPeriod);
    const Vector tau = 0.5 * (log.tau.row(k - 1) + log.tau.row(k - 2)).transpose();
    const Vector net = tau - kRotor.cwiseProduct(qdd);
    std::array<Vector, 3> mean;
    std::array<bool, 3> ready;
    for (std::size_t g = 0; g < 3; ++g) {
      ready[g] = means[g].ready();
      mean[g] = means[g].update(qdd);
    }
    if (log.time[k] < kRamp + 0.5) continue;
    const auto rows = rows_at<4>(q, qd, qdd);
    least_squares.add(rows, rows, net);
    desired.add(rows, rows_at<4>(q, qd, wanted), net);
    for (std::size_t g = 0; g < 3; ++g) {
      if (ready[g]) delayed[g].add(rows, rows_at<4>(q, qd, mean[g]), net);
    }
  }
  const auto take = [&](const char* name, System<4>& system) {
    return EncoderEstimate{name, system.solve() ? error(system.solution()) : std::nan("")};
  };
  return {take("differenced twice, LSM", least_squares),
          take("differenced twice, IVM, acceleration 1 sample ago", delayed[0]),
          take("differenced twice, IVM, acceleration 2 samples ago", delayed[1]),
          take("differenced twice, IVM, acceleration 3 samples ago", delayed[2]),
          take("differenced twice, IVM, desired acceleration", desired)};
}

/// The load as a body of its own, from rows 4..6 of the residual of an arm that was calibrated without it.
void weigh(const std::vector<FilteredSample>& without, const std::vector<FilteredSample>& with,
           const Belief& calibrated, ClosedLoop& out, InertialParameters<double>& payload) {
  const auto residual = [&](const FilteredSample& s) {
    Vector r = s.tau - inverse_dynamics<Arm>(calibrated.parameters, s.q, s.qd, s.qdd);
    r -= calibrated.friction.coulomb.cwiseProduct(s.sign) + calibrated.friction.viscous.cwiseProduct(s.qd);
    return r;
  };
  using Estimator = PayloadEstimator<double, kN>;
  Estimator::Config config;
  config.first_row = 3;
  config.mass_prior = 1;
  config.length_prior = 0.1;
  config.estimate_friction = false;
  config.gate = 0;
  config.forgetting_factor = 1;
  Vector squares = Vector::Zero(), products = Vector::Zero(), last = Vector::Zero();
  constexpr std::size_t kStride = 4;  // 20 ms
  std::size_t count = 0;
  for (std::size_t k = 0; k < without.size(); k += kStride, ++count) {
    const Vector r = residual(without[k]);
    squares += r.cwiseAbs2();
    products += r.cwiseProduct(last);
    last = r;
  }
  config.noise_std = (squares / static_cast<double>(count)).cwiseSqrt();
  // What is left of the residual's correlation at 20 ms widens the interval as that of a first-order process.
  double widening = 1;
  for (int i = 3; i < kN; ++i) {
    const double rho = std::clamp(products[i] / squares[i], 0.0, 0.95);
    widening = std::max(widening, std::sqrt((1 + rho) / (1 - rho)));
  }
  Estimator estimator;
  (void)estimator.configure(config);
  Estimator::Record record;
  for (std::size_t k = 0; k < with.size(); k += kStride) {
    const FilteredSample& s = with[k];
    LinkRegressor<double, kN> Y;
    link_regressor<Arm>(joint_trigonometry<Arm>(s.q), s.q, s.qd, s.qdd, Y);
    (void)estimator.update(Y, s.qd, residual(s), record);
  }
  payload = estimator.payload();
  out.payload_mass = payload[kMass];
  out.payload_half_width = statistics::kNormal95 * widening * estimator.standard_deviation(kMass);
  for (std::size_t a = 0; a < 3; ++a) out.payload_com[a] = payload[kMcx + a] / payload[kMass];
}

}  // namespace

ClosedLoop run_closed_loop(int seed) {
  ClosedLoop out;
  const sim::Body body = payload_body();
  out.payload_true = body.mass;
  out.payload_com_true = {body.com[0], body.com[1], body.com[2]};
  out.duration = kTrackingTime;

  const ArmModel<double, kN> nominal_model = nominal_arm(seed);
  const Belief nominal = belief_of(nominal_model);
  const FourierTrajectory exciting = exciting_trajectory(), validation = validation_trajectory();
  const Vector inertia = track::mean_inertia(robot_of(nominal), *reference_of(validation), kTrackingTime);

  std::array<std::vector<FilteredSample>, 2> samples;
  data::Log loaded;
  host::for_each_parallel(2, [&](std::size_t i) {
    data::Log log = simulate_arm(exciting, kExcitingTime, i == 1, seed + static_cast<int>(i),
                                 controller_of(track::Method::kComputedTorque, nominal, inertia));
    samples[i] = filtered(log);
    if (i == 1) loaded = std::move(log);
  });

  const ErrorMeasure error(samples[1]);
  const auto k5 = estimated<4>(samples[1], nominal, true);
  out.source = to_string(k5.source());
  out.estimates = double_difference_estimates(loaded, error);
  out.estimates.push_back({"filtered, LSM", error(vector_of(estimated<4>(samples[1], nominal, false)))});
  out.estimates.push_back({"filtered, IVM, desired acceleration", error(vector_of(k5))});
  out.estimates.push_back({"nominal values", error(layout_parameters<4>(nominal.parameters, nominal_model))});

  const Belief by_k5 = belief_of<4>(k5, nominal);
  const Belief calibrated = belief_of<3>(estimated<3>(samples[0], nominal, true), nominal);
  InertialParameters<double> payload{};
  weigh(samples[0], samples[1], calibrated, out, payload);
  Belief with_mass = calibrated;
  with_mass.parameters = corrected_for_payload(calibrated.parameters, payload);
  const Belief whole = belief_of<0>(estimated<0>(samples[1], nominal, true), nominal);

  struct Contender {
    const char* name;
    const char* knows;
    track::Method method;
    const Belief* belief;
  };
  const std::vector<Contender> contenders = {
      {"PD", "nothing of the arm", track::Method::kPd, &nominal},
      {"PD + gravity", "gravity torque of the nominal arm", track::Method::kPdGravity, &nominal},
      {"computed torque, nominal", "nominal values within ±10 %, no payload", track::Method::kComputedTorque,
       &nominal},
      {"computed torque, k = 5", "rows 5 and 6 as estimated; joints 1 to 4 know nothing of the payload",
       track::Method::kComputedTorque, &by_k5},
      {"computed torque, k = 4 + payload mass",
       "rows 4 to 6 as estimated without payload, and the payload weighed and carried into every row",
       track::Method::kComputedTorque, &with_mass},
      {"computed torque, k = 1", "all rows as estimated with the payload", track::Method::kComputedTorque,
       &whole}};
  out.runs.resize(contenders.size());
  host::for_each_parallel(contenders.size(), [&](std::size_t i) {
    const Contender& c = contenders[i];
    const data::Log log =
        simulate_arm(validation, kTrackingTime, true, seed + 10, controller_of(c.method, *c.belief, inertia));
    Eigen::Index first = 0;
    while (log.time[first] < kCounted) ++first;
    const Eigen::Index rows = log.num_samples() - first;
    out.runs[i] = {c.name, log.time.tail(rows), (log.qref - log.q).bottomRows(rows),
                   log.tau.bottomRows(rows)};
  });
  for (const Contender& c : contenders) out.run_notes.emplace_back(c.knows);
  return out;
}

}  // namespace heft::studies
