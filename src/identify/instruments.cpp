#include "instruments.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::identify {
namespace {

using Eigen::Index;
using Logs = std::vector<const data::MotionStream*>;

/// Stretches of a piece that are simulated at once, and so many states, a row each.
constexpr Index kStretches = 8;
using States = Eigen::Matrix<double, kStretches, Eigen::Dynamic, Eigen::ColMajor, kStretches, model::kMaxJoints>;

/// The arm that is simulated: rigid bodies, rotors, friction with a sign that is smooth over `width`.
class SimulatedArm {
 public:
  explicit SimulatedArm(const model::Robot& robot)
      : dynamics_(robot),
        batch_(robot),
        drives_(drives_of(robot)),
        still_(States::Zero(kStretches, robot.num_joints())),
        width_(Eigen::VectorXd::Constant(robot.num_joints(), 1e-3)) {}

  const model::Robot& robot() const { return dynamics_.robot(); }
  void set_width(const Eigen::VectorXd& width) { width_ = width; }

  /// Mass matrix with rotors and gear couplings, n × n.
  Eigen::MatrixXd inertia(const Eigen::VectorXd& q) const { return dynamics_.mass_matrix(q) + drives_; }
  /// H(q) a + g(q).
  void still_torque(const States& q, const States& a, States& torque) const {
    batch_.inverse_dynamics(q, still_, a, torque);
    torque += a * drives_;
  }
  /// Acceleration that a torque gives beyond gravity and velocity products.
  /// @throws ModelError where the inertia is not positive definite
  void accelerate(const States& q, const States& qd, const States& torque, States& qdd) const {
    batch_.forward_dynamics(q, qd, torque, drives_, qdd);
  }
  States friction(const States& qd) const {
    States f(kStretches, qd.cols());
    for (Index j = 0; j < qd.cols(); ++j) {
      const auto v = qd.col(j).array();
      f.col(j) = joint(j).coulomb_friction * smooth_sign(v, width_[j]) + joint(j).viscous_friction * v + joint(j).friction_offset;
    }
    for (const GearCoupling<double>& c : robot().couplings) {
      const Speeds v = qd.col(c.driven) + c.ratio * qd.col(c.driving);
      const Speeds torque = c.coulomb_friction * smooth_sign(v, width_[c.driven]) + c.viscous_friction * v;
      f.col(c.driven).array() += torque;
      f.col(c.driving).array() += c.ratio * torque;
    }
    return f;
  }

 private:
  using Speeds = Eigen::Array<double, kStretches, 1>;

  const JointActuation<double>& joint(Index j) const { return robot().joints[static_cast<std::size_t>(j)].actuation; }
  static Speeds smooth_sign(const Speeds& v, double width) { return v / (v.square() + width * width).sqrt(); }
  /// What rotors and gear couplings add to the mass matrix.
  static Eigen::MatrixXd drives_of(const model::Robot& robot) {
    const Index n = robot.num_joints();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    for (Index j = 0; j < n; ++j) H(j, j) = robot.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia;
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
  States still_;  ///< velocities, all 0
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

/// Steps of a piece in stretches that are simulated at once. Each begins so much earlier that its wrong start is gone: the
/// control is critically damped.
class Stretches {
 public:
  /// @param steps  of the piece
  /// @param rate   what the control forgets by in one step, ω h
  Stretches(Index steps, double rate) : own_(steps / kStretches + 1) {
    constexpr double kForgotten = 30.0;  // 31 e⁻³⁰ = 3e-12 of the wrong start is left
    const auto before = static_cast<Index>(std::ceil(kForgotten / rate));
    length_ = std::min(steps, own_ + before);
    for (Index s = 0; s < kStretches; ++s) begin_[s] = std::clamp<Index>(own_ * s - before, 0, steps - length_);
  }
  /// Steps of each.
  Index length() const { return length_; }
  /// Rows of a matrix over the half steps of the piece, that of each stretch's half step.
  States rows_at(const Eigen::MatrixXd& all, Index half_step) const {
    States rows(kStretches, all.cols());
    for (Index s = 0; s < kStretches; ++s) rows.row(s) = all.row(2 * begin_[s] + half_step);
    return rows;
  }
  /// Puts what each found at its step k into its rows.
  void put(const States& found, Index k, Eigen::MatrixXd& all) const {
    for (Index s = 0; s < kStretches; ++s) {
      const Index row = begin_[s] + k;
      if (row >= own_ * s && row < own_ * (s + 1)) all.row(row) = found.row(s);
    }
  }

 private:
  Index own_, length_{0};
  std::array<Index, kStretches> begin_{};
};

/// Follows `reference`, whose rows are half an RK4 step apart; false when the simulation fails.
///
///   τ = H(q_r) (q̈_r + 2 ω ė + ω² e) + g(q_r) + f(q̇_r),   q̈ = H(q)⁻¹ (τ − h(q, q̇) − f(q̇)),   e = q_r − q
bool follow(const SimulatedArm& arm, const Motion& reference, double omega, Motion& out) {
  const Index n = reference.q.cols(), steps = (reference.time.size() - 1) / 2;
  const double h = reference.time[2] - reference.time[0];
  const Stretches stretches(steps, omega * h);
  out.time = reference.time(Eigen::seqN(0, steps + 1, 2));
  out.q.resize(steps + 1, n);
  out.qd = out.qdd = out.q;

  /// What the control needs of the reference at one instant.
  struct Target {
    States q, qd, qdd, friction;
  };
  const auto target_at = [&](Index half_step) {
    const auto of = [&](const Eigen::MatrixXd& all) { return stretches.rows_at(all, half_step); };
    Target t{of(reference.q), of(reference.qd), of(reference.qdd), {}};
    t.friction = arm.friction(t.qd);
    return t;
  };
  const auto acceleration = [&](const Target& t, const States& q, const States& qd) {
    const States asked = t.qdd + 2.0 * omega * (t.qd - qd) + omega * omega * (t.q - q);
    States torque(kStretches, n), result(kStretches, n);
    arm.still_torque(t.q, asked, torque);
    torque += t.friction - arm.friction(qd);
    arm.accelerate(q, qd, torque, result);
    return result;
  };

  Target begin = target_at(0);
  States q = begin.q, qd = begin.qd;
  for (Index k = 0;; ++k) {
    const States a1 = acceleration(begin, q, qd);
    stretches.put(q, k, out.q);
    stretches.put(qd, k, out.qd);
    stretches.put(a1, k, out.qdd);
    if (!a1.allFinite() || (q - begin.q).cwiseAbs().maxCoeff() > 10.0) return false;
    if (k == stretches.length()) break;
    const Target middle = target_at(2 * k + 1);
    Target end = target_at(2 * k + 2);
    // Classical Runge-Kutta on (q, q̇).
    const States v2 = qd + 0.5 * h * a1;
    const States a2 = acceleration(middle, q + 0.5 * h * qd, v2);
    const States v3 = qd + 0.5 * h * a2;
    const States a3 = acceleration(middle, q + 0.5 * h * v2, v3);
    const States v4 = qd + h * a3;
    const States a4 = acceleration(end, q + h * v3, v4);
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

/// RK4 step [s] at most: stable up to 2.8 over the fastest rate.
double longest_step(const InstrumentOptions& options, double omega, const Eigen::VectorXd& viscous) {
  if (options.step > 0.0) return options.step;
  return std::clamp(std::min(0.5 / omega, 1.0 / std::max(1e-9, viscous.maxCoeff())), 5e-4, 5e-3);
}

/// How the steps of a simulation go with the rows of a piece: one over `stride` rows, or several from one row to the next.
struct Steps {
  Index first{0};   ///< row of the piece where they begin
  Index stride{1};  ///< rows a step; 1 where there are several a row
  Index a_row{1};   ///< steps a row; 1 where there are several rows a step
};

/// The longest steps that end on every kept row, two of them at least from one to the next: the low-pass that follows works
/// at their rate.
Steps steps_on(const regression::KeptRows& kept, double period, double longest) {
  Steps steps;
  if (period > longest) {
    steps.a_row = static_cast<Index>(std::ceil(period / longest));
  } else {
    for (Index stride = 2; 2 * stride <= kept.step && static_cast<double>(stride) * period <= longest; ++stride) {
      if (kept.step % stride == 0) steps.stride = stride;
    }
  }
  steps.first = kept.first % steps.stride;
  return steps;
}

/// Positions to follow on a grid of half steps. @param period  between rows of the piece [s]
Motion on_half_steps(const Eigen::VectorXd& time, const Eigen::MatrixXd& followed, double period, const Steps& steps) {
  const Index rows = (time.size() - 1 - steps.first) / steps.stride;  // behind the first
  const Index halves = 2 * steps.a_row * rows;
  const double begin = time[steps.first], span = static_cast<double>(rows * steps.stride) * period;
  Motion reference;
  reference.time = Eigen::VectorXd::LinSpaced(halves + 1, begin, begin + span);
  if (steps.stride % 2 == 0) {
    reference.q = followed(Eigen::seqN(steps.first, halves + 1, steps.stride / 2), Eigen::all);
  } else {
    reference.q = data::resample(time, followed, reference.time);
  }
  reference.qd = data::differentiate(reference.time, reference.q);
  reference.qdd = data::differentiate(reference.time, reference.qd);
  return reference;
}

/// Samples that a piece must have to be simulated; a shorter one is its own instrument.
constexpr Eigen::Index kLeastSamples = 8;

/// The arm along `followed`. @return whether it could be simulated
bool simulate_along(SimulatedArm& arm, const data::MotionChunk& chunk, const regression::KeptRows& kept,
                    const Eigen::MatrixXd& followed, double smoothing, const InstrumentOptions& options,
                    regression::ThinnedMotion& motion) {
  if (chunk.time.size() < kLeastSamples + kept.step) return false;
  const double omega = 2.0 * std::numbers::pi * (options.control > 0.0 ? options.control : 4.0 * smoothing);
  Eigen::VectorXd viscous, coulomb;
  if (!friction_rates(arm, followed, viscous, coulomb)) return false;
  const double period = 1.0 / chunk.sample_rate;
  const Steps steps = steps_on(kept, period, longest_step(options, omega, viscous));
  const Motion reference = on_half_steps(chunk.time, followed, period, steps);
  // Coulomb friction is smooth over a velocity that it takes up in one step, so that the step is stable for it too; at
  // least 1 % of the top speed.
  const double step = reference.time[2] - reference.time[0];
  const Eigen::VectorXd top_speed = reference.qd.cwiseAbs().colwise().maxCoeff().transpose();
  arm.set_width((coulomb * step).cwiseMax(0.01 * top_speed).cwiseMax(1e-6));
  Motion found;
  try {
    if (!follow(arm, reference, omega, found)) return false;
  } catch (const ModelError&) {
    return false;  // the inertia is not positive definite somewhere along the motion
  }
  motion.first = steps.first;
  motion.stride = steps.stride;
  if (steps.a_row == 1) {
    motion.q = std::move(found.q), motion.qd = std::move(found.qd), motion.qdd = std::move(found.qdd);
  } else {
    const auto rows = Eigen::seqN(0, (found.q.rows() - 1) / steps.a_row + 1, steps.a_row);
    motion.q = found.q(rows, Eigen::all), motion.qd = found.qd(rows, Eigen::all), motion.qdd = found.qdd(rows, Eigen::all);
  }
  return true;
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
  return [robot, summaries, options, report](int log, const data::MotionChunk& chunk, const regression::KeptRows& kept) {
    SimulatedArm arm(*robot);  // pieces are simulated side by side
    const data::StreamSummary& summary = summaries[static_cast<std::size_t>(log)];
    if (report) ++report->pieces;
    const int reference = reference_in(chunk, options, summary.path);
    const double smoothing = smoothing_for(summary, chunk, options);
    // A reference has no measurement noise; its low-pass only has to make it differentiable.
    const double cutoff = reference >= 0 ? summary.cutoff : smoothing;
    const Eigen::MatrixXd& raw = reference >= 0 ? chunk.extra[static_cast<std::size_t>(reference)] : chunk.q;
    Eigen::MatrixXd followed = cutoff > 0.0 && cutoff < 0.45 * chunk.sample_rate
                                   ? data::low_pass_zero_phase(raw, chunk.sample_rate, cutoff)
                                   : raw;
    regression::ThinnedMotion motion;
    if (!simulate_along(arm, chunk, kept, followed, smoothing, options, motion)) {
      if (report) ++report->failed;
      motion.qd = data::differentiate(chunk.time, followed);
      motion.qdd = data::differentiate(chunk.time, motion.qd);
      motion.q = std::move(followed);
    }
    return motion;
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
  return [cutoffs, options](int log, const data::MotionChunk& chunk, const regression::KeptRows&) {
    const double cutoff = cutoffs[static_cast<std::size_t>(log)];
    // Without a filter the differences over five samples are what correlates noise.
    const double delay = options.delay > 0.0 ? options.delay
                         : cutoff > 0.0      ? 2.2 / cutoff
                                             : 5.0 / chunk.sample_rate;
    const Eigen::Index size = chunk.time.size();
    const Eigen::Index shift = std::clamp<Eigen::Index>(
        static_cast<Eigen::Index>(std::lround(delay * chunk.sample_rate)), 1, size - 1);
    const auto delayed = [&](const Eigen::MatrixXd& signal) {
      Eigen::MatrixXd moved(size, signal.cols());
      moved.bottomRows(size - shift) = signal.topRows(size - shift);
      moved.topRows(shift) = signal.row(0).replicate(shift, 1);
      return moved;
    };
    return regression::ThinnedMotion{0, 1, delayed(chunk.q), delayed(chunk.qd), delayed(chunk.qdd)};
  };
}

}  // namespace heft::identify
