#include "instruments.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/acceleration.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::identify {
namespace {

using Logs = std::vector<const data::MotionStream*>;
using Vector = model::Acceleration::Vector;

/// The arm that is simulated: rigid bodies, rotors, friction with a sign that is smooth over `width`.
class SimulatedArm {
 public:
  explicit SimulatedArm(const model::Robot& robot)
      : dynamics_(robot),
        batch_(robot),
        drives_(drives_of(robot)),
        acceleration_(robot, drives_),
        width_(Eigen::VectorXd::Constant(robot.num_joints(), 1e-3)) {}

  const model::Robot& robot() const { return dynamics_.robot(); }
  void set_width(const Eigen::VectorXd& width) { width_ = width; }

  /// Mass matrix with rotors and gear couplings, n × n.
  Eigen::MatrixXd inertia(const Eigen::VectorXd& q) const { return dynamics_.mass_matrix(q) + drives_; }
  /// The same for many positions, a row of n² numbers each.
  Eigen::MatrixXd inertias(const Eigen::MatrixXd& q) const {
    Eigen::MatrixXd all(q.rows(), q.cols() * q.cols());
    batch_.mass_matrix(q, all);
    all.rowwise() += drives_.reshaped().transpose();
    return all;
  }
  Eigen::MatrixXd gravities(const Eigen::MatrixXd& q) const { return batch_.gravity_torque(q); }
  /// Acceleration that a torque gives beyond gravity, velocity products and friction.
  /// @return false where the inertia is not positive definite
  bool accelerate(const Vector& q, const Vector& qd, const Vector& torque, Vector& qdd) const {
    return acceleration_.solve(q, qd, torque - friction(qd), qdd);
  }
  Vector friction(const Vector& qd) const {
    Vector f(qd.size());
    for (Eigen::Index j = 0; j < qd.size(); ++j) {
      f[j] = joint(j).coulomb_friction * smooth_sign(qd[j], width_[j]) + joint(j).viscous_friction * qd[j] +
             joint(j).friction_offset;
    }
    for (const GearCoupling<double>& c : robot().couplings) {
      const double v = shared_motion(c, qd[c.driving], qd[c.driven]);
      const double torque = c.coulomb_friction * smooth_sign(v, width_[c.driven]) + c.viscous_friction * v;
      f[c.driven] += torque;
      f[c.driving] += c.ratio * torque;
    }
    return f;
  }

 private:
  const JointActuation<double>& joint(Eigen::Index j) const {
    return robot().joints[static_cast<std::size_t>(j)].actuation;
  }
  static double smooth_sign(double v, double width) { return v / std::sqrt(v * v + width * width); }
  /// What rotors and gear couplings add to the mass matrix.
  static Eigen::MatrixXd drives_of(const model::Robot& robot) {
    const Eigen::Index n = robot.num_joints();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index j = 0; j < n; ++j) H(j, j) = robot.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia;
    for (const GearCoupling<double>& c : robot.couplings) {
      // T = I_a (q̈_j + r q̈_i) acts on j with 1 and on i with r.
      H(c.driven, c.driven) += c.rotor_inertia;
      H(c.driving, c.driving) += c.ratio * c.ratio * c.rotor_inertia;
      H(c.driven, c.driving) += c.ratio * c.rotor_inertia;
      H(c.driving, c.driven) += c.ratio * c.rotor_inertia;
    }
    return H;
  }

  model::Dynamics dynamics_;
  model::BatchDynamics batch_;
  Eigen::MatrixXd drives_;
  model::Acceleration acceleration_;
  Eigen::VectorXd width_;
};

/// How fast friction alone brings a joint to rest: viscous rate [1/s] and Coulomb deceleration [rad/s²,
/// m/s²], from the diagonal of the inverse inertia, the largest over some poses. False: an inertia is not
/// positive definite.
bool friction_rates(const SimulatedArm& arm, const Eigen::MatrixXd& poses, Eigen::VectorXd& viscous,
                    Eigen::VectorXd& coulomb) {
  const Eigen::Index n = poses.cols();
  viscous = coulomb = Eigen::VectorXd::Zero(n);
  constexpr Eigen::Index kSomePoses = 20;
  for (Eigen::Index k = 0; k < kSomePoses; ++k) {
    const Eigen::VectorXd q = poses.row(k * (poses.rows() - 1) / (kSomePoses - 1)).transpose();
    Eigen::MatrixXd whole = Eigen::MatrixXd::Identity(n, n);
    if (!solve_positive(arm.inertia(q), whole)) return false;
    const Eigen::VectorXd inverse = whole.diagonal();
    for (Eigen::Index j = 0; j < n; ++j) {
      const JointActuation<double>& a = arm.robot().joints[static_cast<std::size_t>(j)].actuation;
      viscous[j] = std::max(viscous[j], std::abs(a.viscous_friction) * inverse[j]);
      coulomb[j] = std::max(coulomb[j], std::abs(a.coulomb_friction) * inverse[j]);
    }
    for (const GearCoupling<double>& c : arm.robot().couplings) {
      const double shared = inverse[c.driven] + c.ratio * c.ratio * inverse[c.driving];
      for (const int j : {c.driven, c.driving}) {
        viscous[j] += std::abs(c.viscous_friction) * shared;
        coulomb[j] += std::abs(c.coulomb_friction) * shared;
      }
    }
  }
  return true;
}

struct Motion {
  Eigen::VectorXd time;
  Eigen::MatrixXd q, qd, qdd;
};

/// Follows `reference`, whose rows are half an RK4 step apart; false when the simulation fails.
///
///   τ = H(q_r) (q̈_r + 2 ω ė + ω² e) + g(q_r) + f(q̇_r),   q̈ = H(q)⁻¹ (τ − h(q, q̇) − f(q̇)),   e = q_r − q
bool follow(const SimulatedArm& arm, const Motion& reference, double omega, Motion& out) {
  const Eigen::Index n = reference.q.cols();
  const Eigen::Index steps = (reference.time.size() - 1) / 2;
  const double h = reference.time[2] - reference.time[0];
  out.time.resize(steps + 1);
  out.q.resize(steps + 1, n);
  out.qd = out.qdd = out.q;

  /// What the control needs of the reference at one instant.
  struct Target {
    Vector q, qd, feed;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, model::kMaxJoints, model::kMaxJoints> H;
  };
  const Eigen::MatrixXd inertias = arm.inertias(reference.q), gravities = arm.gravities(reference.q);
  const auto target_at = [&](Eigen::Index row) {
    Target t;
    t.q = reference.q.row(row).transpose();
    t.qd = reference.qd.row(row).transpose();
    t.H = inertias.row(row).reshaped(n, n);
    t.feed = t.H * Vector(reference.qdd.row(row).transpose()) + gravities.row(row).transpose() + arm.friction(t.qd);
    return t;
  };
  bool sound = true;
  const auto acceleration = [&](const Target& t, const Vector& q, const Vector& qd) {
    const Vector tau = t.feed + t.H * Vector(2.0 * omega * (t.qd - qd) + omega * omega * (t.q - q));
    Vector result = Vector::Zero(n);
    if (!arm.accelerate(q, qd, tau, result)) sound = false;
    return result;
  };

  Target begin = target_at(0);
  Vector q = begin.q, qd = begin.qd;
  for (Eigen::Index k = 0;; ++k) {
    const Vector a1 = acceleration(begin, q, qd);
    out.time[k] = reference.time[2 * k];
    out.q.row(k) = q.transpose();
    out.qd.row(k) = qd.transpose();
    out.qdd.row(k) = a1.transpose();
    if (!sound || !a1.allFinite() || (q - begin.q).cwiseAbs().maxCoeff() > 10.0) return false;
    if (k == steps) break;
    const Target middle = target_at(2 * k + 1);
    Target end = target_at(2 * k + 2);
    // Classical Runge-Kutta on (q, q̇).
    const Vector v2 = qd + 0.5 * h * a1;
    const Vector a2 = acceleration(middle, q + 0.5 * h * qd, v2);
    const Vector v3 = qd + 0.5 * h * a2;
    const Vector a3 = acceleration(middle, q + 0.5 * h * v2, v3);
    const Vector v4 = qd + h * a3;
    const Vector a4 = acceleration(end, q + h * v3, v4);
    q += h / 6.0 * (qd + 2.0 * v2 + 2.0 * v3 + v4);
    qd += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    begin = std::move(end);
  }
  return true;
}

/// Robot whose torque is that of β: the kept parameters have the values of β, the dropped ones 0.
model::Robot robot_with(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                        const Eigen::VectorXd& beta) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(columns.count());
  x(base.kept) = beta;
  model::Robot robot = columns.robot();
  columns.apply(x, robot);
  return robot;
}

double smoothing_for(const data::StreamSummary& log, const data::MotionChunk& chunk,
                     const InstrumentOptions& options) {
  if (options.smoothing > 0.0) return options.smoothing;
  const double motion = log.cutoff > 0.0 ? log.cutoff : 0.4 * log.sample_rate;
  // With a cut-off that the user stated nobody has asked for the bandwidth; a piece of log shows it well
  // enough.
  const double bandwidth =
      log.bandwidth > 0.0 ? log.bandwidth : data::motion_bandwidth(chunk.q, chunk.sample_rate);
  return bandwidth > 0.0 ? std::min(2.5 * bandwidth, 0.5 * motion) : 0.25 * motion;
}

/// Place of the positions to follow among MotionChunk::extra; -1: the piece has none.
/// @throws DataError where only a reference will do
int reference_in(const data::MotionChunk& chunk, const InstrumentOptions& options, const std::string& path) {
  const Eigen::Index n = chunk.q.cols();
  const bool there = options.reference >= 0 && options.reference < static_cast<int>(chunk.extra.size()) &&
                     chunk.extra[static_cast<std::size_t>(options.reference)].cols() == n;
  if (!there && options.kind == Instruments::kReference) {
    throw DataError(
        fmt::format("{}: no commanded positions qref1 to qref{}; instruments from the reference need the "
                    "column of every joint: log them, or use simulated instruments",
                    path, n));
  }
  return there ? options.reference : -1;
}

/// RK4 step [s]: stable up to 2.8 over the fastest rate.
double step_for(const InstrumentOptions& options, double omega, const Eigen::VectorXd& viscous) {
  if (options.step > 0.0) return options.step;
  return std::clamp(std::min(0.5 / omega, 1.0 / std::max(1e-9, viscous.maxCoeff())), 5e-4, 5e-3);
}

/// Positions to follow on a grid of half steps.
Motion on_half_steps(const Eigen::VectorXd& time, const Eigen::MatrixXd& followed, double step) {
  const double begin = time[0];
  const double span = time[time.size() - 1] - begin;
  const auto steps = static_cast<Eigen::Index>(std::ceil(span / step));
  Motion reference;
  reference.time = Eigen::VectorXd::LinSpaced(2 * steps + 1, begin, begin + span);
  reference.q = data::resample(time, followed, reference.time);
  reference.qd = data::differentiate(reference.time, reference.q);
  reference.qdd = data::differentiate(reference.time, reference.qd);
  return reference;
}

/// Samples that a piece must have to be simulated; a shorter one is its own instrument.
constexpr Eigen::Index kLeastSamples = 8;

/// The arm along `followed`, on the half steps of its integration. @return whether it could be simulated
bool simulate_along(SimulatedArm& arm, const Eigen::VectorXd& time, const Eigen::MatrixXd& followed,
                    const Eigen::MatrixXd& velocity, double smoothing, const InstrumentOptions& options,
                    Motion& out) {
  if (time.size() < kLeastSamples) return false;
  const double omega = 2.0 * std::numbers::pi * (options.control > 0.0 ? options.control : 4.0 * smoothing);
  Eigen::VectorXd viscous, coulomb;
  if (!friction_rates(arm, followed, viscous, coulomb)) return false;
  const double step = step_for(options, omega, viscous);
  // Coulomb friction is smooth over a velocity that it takes up in one step, so that the step is stable for it too; at
  // least 1 % of the top speed.
  const Eigen::VectorXd top_speed = velocity.cwiseAbs().colwise().maxCoeff().transpose();
  arm.set_width((coulomb * step).cwiseMax(0.01 * top_speed).cwiseMax(1e-6));
  return follow(arm, on_half_steps(time, followed, step), omega, out);
}

}  // namespace

regression::InstrumentMotion simulated_motion(const regression::RegressionColumns& columns,
                                              const regression::BaseParameters& base,
                                              const Eigen::VectorXd& beta, const Logs& logs,
                                              const InstrumentOptions& options,
                                              std::shared_ptr<SimulationReport> report) {
  const auto robot = std::make_shared<const model::Robot>(robot_with(columns, base, beta));
  std::vector<data::StreamSummary> summaries;
  for (const data::MotionStream* log : logs) summaries.push_back(log->summary());
  return [robot, summaries, options, report](int log, data::MotionChunk& chunk) {
    SimulatedArm arm(*robot);  // pieces are simulated side by side
    const data::StreamSummary& summary = summaries[static_cast<std::size_t>(log)];
    if (report) ++report->pieces;
    const int reference = reference_in(chunk, options, summary.path);
    const double smoothing = smoothing_for(summary, chunk, options);
    // A reference has no measurement noise; its low-pass only has to make it differentiable.
    const double cutoff = reference >= 0 ? summary.cutoff : smoothing;
    const Eigen::MatrixXd& raw = reference >= 0 ? chunk.extra[static_cast<std::size_t>(reference)] : chunk.q;
    const Eigen::MatrixXd followed = cutoff > 0.0 && cutoff < 0.45 * chunk.sample_rate
                                         ? data::low_pass_zero_phase(raw, chunk.sample_rate, cutoff)
                                         : raw;
    const Eigen::MatrixXd velocity = data::differentiate(chunk.time, followed);
    Motion motion;
    if (simulate_along(arm, chunk.time, followed, velocity, smoothing, options, motion)) {
      chunk.q = data::resample(motion.time, motion.q, chunk.time);
      chunk.qd = data::resample(motion.time, motion.qd, chunk.time);
      chunk.qdd = data::resample(motion.time, motion.qdd, chunk.time);
    } else {
      if (report) ++report->failed;
      chunk.q = followed;
      chunk.qd = velocity;
      chunk.qdd = data::differentiate(chunk.time, velocity);
    }
  };
}

regression::InstrumentMotion delayed_motion(const Logs& logs,
                                            const regression::ObservationOptions& observation,
                                            const InstrumentOptions& options) {
  std::vector<double> cutoffs;
  for (const data::MotionStream* log : logs) {
    double cutoff = log->summary().cutoff;
    if (observation.cutoff > 0.0 && (cutoff <= 0.0 || observation.cutoff < cutoff))
      cutoff = observation.cutoff;
    cutoffs.push_back(cutoff);
  }
  return [cutoffs, options](int log, data::MotionChunk& chunk) {
    const double cutoff = cutoffs[static_cast<std::size_t>(log)];
    // Without a filter the differences over five samples are what correlates noise.
    const double delay = options.delay > 0.0 ? options.delay
                         : cutoff > 0.0      ? 2.2 / cutoff
                                             : 5.0 / chunk.sample_rate;
    const Eigen::Index size = chunk.time.size();
    const Eigen::Index shift = std::clamp<Eigen::Index>(
        static_cast<Eigen::Index>(std::lround(delay * chunk.sample_rate)), 1, size - 1);
    for (Eigen::MatrixXd* signal : {&chunk.q, &chunk.qd, &chunk.qdd}) {
      Eigen::MatrixXd moved(size, signal->cols());
      moved.bottomRows(size - shift) = signal->topRows(size - shift);
      moved.topRows(shift) = signal->row(0).replicate(shift, 1);
      *signal = std::move(moved);
    }
  };
}

}  // namespace heft::identify
