#include "heft/identify/instrumental.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <fmt/format.h>
#include <unsupported/Eigen/SpecialFunctions>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/regression/block_groups.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::identify {
namespace {

using Logs = std::vector<const data::MotionStream*>;

// ---------------------------------------------------------------------------------------------- simulation

/// The arm that is simulated: rigid bodies, rotors, friction with a sign that is smooth over `width`.
class SimulatedArm {
 public:
  explicit SimulatedArm(const model::Robot& robot)
      : dynamics_(robot), width_(Eigen::VectorXd::Constant(robot.num_joints(), 1e-3)) {}

  const model::Robot& robot() const { return dynamics_.robot(); }
  void set_width(const Eigen::VectorXd& width) { width_ = width; }

  /// Mass matrix with rotors and gear couplings, n × n.
  Eigen::MatrixXd inertia(const Eigen::VectorXd& q) const {
    Eigen::MatrixXd H = dynamics_.mass_matrix(q);
    for (Eigen::Index j = 0; j < H.rows(); ++j) H(j, j) += joint(j).rotor_inertia;
    for (const GearCoupling<double>& c : robot().couplings) {
      // T = I_a (q̈_j + r q̈_i) acts on j with 1 and on i with r.
      H(c.driven, c.driven) += c.rotor_inertia;
      H(c.driving, c.driving) += c.ratio * c.ratio * c.rotor_inertia;
      H(c.driven, c.driving) += c.ratio * c.rotor_inertia;
      H(c.driving, c.driven) += c.ratio * c.rotor_inertia;
    }
    return H;
  }
  Eigen::VectorXd gravity(const Eigen::VectorXd& q) const { return dynamics_.gravity_torque(q); }
  /// Gravity and velocity products.
  Eigen::VectorXd bias(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const {
    return dynamics_.inverse_dynamics(q, qd, Eigen::VectorXd::Zero(q.size()));
  }
  Eigen::VectorXd friction(const Eigen::VectorXd& qd) const {
    Eigen::VectorXd f(qd.size());
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

  model::Dynamics dynamics_;
  Eigen::VectorXd width_;
};

/// How fast friction alone brings a joint to rest: viscous rate [1/s] and Coulomb deceleration [rad/s²,
/// m/s²], from the diagonal of the inverse inertia, the largest over some poses. False: an inertia is not
/// positive definite.
bool friction_rates(const SimulatedArm& arm, const Eigen::MatrixXd& poses, Eigen::VectorXd& viscous,
                    Eigen::VectorXd& coulomb) {
  const Eigen::Index n = poses.cols();
  viscous = coulomb = Eigen::VectorXd::Zero(n);
  constexpr Eigen::Index kPoses = 20;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    const Eigen::VectorXd q = poses.row(k * (poses.rows() - 1) / (kPoses - 1)).transpose();
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
    Eigen::VectorXd q, qd, qdd, feed;
    Eigen::MatrixXd H;
  };
  const auto target_at = [&](Eigen::Index row) {
    Target t;
    t.q = reference.q.row(row).transpose();
    t.qd = reference.qd.row(row).transpose();
    t.qdd = reference.qdd.row(row).transpose();
    t.H = arm.inertia(t.q);
    t.feed = t.H * t.qdd + arm.gravity(t.q) + arm.friction(t.qd);
    return t;
  };
  bool sound = true;
  const auto acceleration = [&](const Target& t, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& qd) -> Eigen::VectorXd {
    const Eigen::VectorXd tau = t.feed + t.H * (2.0 * omega * (t.qd - qd) + omega * omega * (t.q - q));
    Eigen::MatrixXd result = tau - arm.bias(q, qd) - arm.friction(qd);
    if (!solve_positive(arm.inertia(q), result)) sound = false;
    return result;
  };

  Target begin = target_at(0);
  Eigen::VectorXd q = begin.q, qd = begin.qd;
  for (Eigen::Index k = 0;; ++k) {
    const Eigen::VectorXd a1 = acceleration(begin, q, qd);
    out.time[k] = reference.time[2 * k];
    out.q.row(k) = q.transpose();
    out.qd.row(k) = qd.transpose();
    out.qdd.row(k) = a1.transpose();
    if (!sound || !a1.allFinite() || (q - begin.q).cwiseAbs().maxCoeff() > 10.0) return false;
    if (k == steps) break;
    const Target middle = target_at(2 * k + 1);
    Target end = target_at(2 * k + 2);
    // Classical Runge-Kutta on (q, q̇).
    const Eigen::VectorXd v2 = qd + 0.5 * h * a1;
    const Eigen::VectorXd a2 = acceleration(middle, q + 0.5 * h * qd, v2);
    const Eigen::VectorXd v3 = qd + 0.5 * h * a2;
    const Eigen::VectorXd a3 = acceleration(middle, q + 0.5 * h * v2, v3);
    const Eigen::VectorXd v4 = qd + h * a3;
    const Eigen::VectorXd a4 = acceleration(end, q + h * v3, v4);
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

// ---------------------------------------------------------------------------------------------- estimate

/// Smallest first-stage t-ratio of strong instruments: the usual F > 10, and some more since it is the least
/// of many.
constexpr double kWeakRatio = 4.0;

/// Coordinates in which the determined directions of the weighted rows are orthonormal: β = start + T u.
struct Frame {
  Eigen::MatrixXd T;        ///< b × k
  Eigen::MatrixXd from;     ///< k × b: u of β, Tᵀ WᵀW
  Eigen::VectorXd u_plain;  ///< k: least squares
  int left_out{0};
  double residual{0.0};  ///< ‖√w (y − W β_LS)‖²
};

Frame frame_of(const regression::TriangularFactor& data, const Eigen::VectorXd& start,
               double condition_limit) {
  const Eigen::MatrixXd R = data.R();
  Eigen::VectorXd scale = R.colwise().norm();
  scale = (scale.array() > 0.0).select(scale, 1.0);
  const Svd svd = svd_of(R * scale.cwiseInverse().asDiagonal());
  const Eigen::VectorXd& s = svd.values;
  const double limit = condition_limit > 0.0 ? std::min(condition_limit, 1e10) : 1e10;
  const Eigen::Index k = s[0] > 0.0 ? (s.array() * limit >= s[0]).count() : 0;
  Frame frame;
  frame.left_out = static_cast<int>(s.size() - k);
  // W D⁻¹ = U S Vᵀ, T = D⁻¹ V S⁻¹: W T = U.
  frame.T = scale.cwiseInverse().asDiagonal() * svd.V.leftCols(k) * s.head(k).cwiseInverse().asDiagonal();
  frame.from = svd.U.leftCols(k).transpose() * R;
  frame.u_plain = svd.U.leftCols(k).transpose() * (data.z() - R * start);
  frame.residual = data.squared_error(start + frame.T * frame.u_plain);
  return frame;
}

/// Everything of the two estimates in the frame: at the estimate, and without each group.
struct Comparison {
  Frame frame;
  Eigen::MatrixXd K;        ///< Tᵀ ZᵀW T, k × k; the identity if instruments were the motion itself
  Eigen::VectorXd u;        ///< k: instrumental
  Eigen::MatrixXd without;  ///< k × B: u without group g, minus u
  Eigen::MatrixXd plain_without;  ///< the same for least squares
  double relevance{0.0};          ///< smallest singular value of K
  double relevance_ratio{0.0};    ///< over its standard deviation
};

Comparison compare(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit, double length, bool with_plain) {
  Comparison c;
  c.frame = frame_of(sums.plain().weighted(weights), start, condition_limit);
  const Eigen::MatrixXd& T = c.frame.T;
  const Eigen::Index k = T.cols();
  const InstrumentSums::Moments all = sums.weighted(weights);
  c.K = T.transpose() * all.A * T;
  c.u = least_squares(c.K, T.transpose() * (all.r - all.A * start));
  const Eigen::VectorXd beta = start + T * c.u;
  const Eigen::VectorXd plain_beta = start + T * c.frame.u_plain;

  // Smallest singular value s = lᵀ K v, by way of KᵀK: good to 1e-8.
  Eigen::VectorXd v = Eigen::VectorXd::Zero(k), l = v;
  if (k > 0) {
    v = eigensystem_of(c.K.transpose() * c.K).vectors.col(0);
    l = (c.K * v).normalized();
    c.relevance = (c.K * v).norm();
  }
  double relevance_squares = 0.0;

  const std::vector<std::vector<int>> groups = regression::groups_of(sums.plain(), length);
  std::vector<Eigen::VectorXd> moved, plain_moved;
  for (const std::vector<int>& members : groups) {
    // Without group g: (K − K_g) δ = −Tᵀ (r_g − A_g β), since Tᵀ (r − A β) = 0.
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(T.rows(), T.rows());
    Eigen::VectorXd r = Eigen::VectorXd::Zero(T.rows());
    Eigen::MatrixXd plain_A = A;
    Eigen::VectorXd gradient = r;
    for (const int b : members) {
      const InstrumentSums::Moments block = sums.weighted(b, weights);
      A += block.A;
      r += block.r;
      for (int j = 0; j < sums.num_joints(); ++j) {
        const regression::TriangularFactor& factor = sums.plain().factor(b, j);
        if (factor.rows() == 0) continue;
        plain_A += weights[j] * factor.information();
        gradient += weights[j] * factor.gradient(plain_beta);
      }
    }
    // A ratio's scatter: what the group has beyond its share of the motion. That some stretches show more of
    // a direction than others is no weakness.
    const Eigen::VectorXd direction = T * v;
    const double beyond = (T * l).dot(A * direction) - c.relevance * direction.dot(plain_A * direction);
    relevance_squares += beyond * beyond;
    moved.push_back(least_squares(c.K - T.transpose() * A * T, T.transpose() * (A * beta - r)));
    if (with_plain) {
      plain_moved.push_back(least_squares(Eigen::MatrixXd::Identity(k, k) - T.transpose() * plain_A * T,
                                          -(T.transpose() * gradient)));
    }
  }
  c.relevance_ratio = relevance_squares > 0.0 ? c.relevance / std::sqrt(relevance_squares) : 0.0;
  c.without.resize(k, static_cast<Eigen::Index>(moved.size()));
  for (std::size_t g = 0; g < moved.size(); ++g) c.without.col(static_cast<Eigen::Index>(g)) = moved[g];
  c.plain_without.resize(k, static_cast<Eigen::Index>(plain_moved.size()));
  for (std::size_t g = 0; g < plain_moved.size(); ++g)
    c.plain_without.col(static_cast<Eigen::Index>(g)) = plain_moved[g];
  return c;
}

}  // namespace

// ---------------------------------------------------------------------------------------------- instruments

regression::InstrumentMotion simulated_motion(const regression::RegressionColumns& columns,
                                              const regression::BaseParameters& base,
                                              const Eigen::VectorXd& beta, const Logs& logs,
                                              const InstrumentOptions& options,
                                              std::shared_ptr<SimulationReport> report) {
  auto arm = std::make_shared<SimulatedArm>(robot_with(columns, base, beta));
  std::vector<data::StreamSummary> summaries;
  for (const data::MotionStream* log : logs) summaries.push_back(log->summary());
  return [arm, summaries, options, report](int log, data::MotionChunk& chunk) {
    const data::StreamSummary& summary = summaries[static_cast<std::size_t>(log)];
    const Eigen::Index n = chunk.q.cols();
    if (report) ++report->pieces;
    const bool has_reference = options.reference >= 0 &&
                               options.reference < static_cast<int>(chunk.extra.size()) &&
                               chunk.extra[static_cast<std::size_t>(options.reference)].cols() == n;
    if (options.kind == Instruments::kReference && !has_reference) {
      throw DataError(
          fmt::format("{}: no commanded positions qref1 to qref{}; instruments from the reference need the "
                      "column of every joint: log them, or use simulated instruments",
                      summary.path, n));
    }
    const double smoothing = smoothing_for(summary, chunk, options);
    // A reference has no measurement noise; its low-pass only has to make it differentiable.
    const double cutoff = has_reference ? summary.cutoff : smoothing;
    const Eigen::MatrixXd& raw =
        has_reference ? chunk.extra[static_cast<std::size_t>(options.reference)] : chunk.q;
    const Eigen::MatrixXd followed = cutoff > 0.0 && cutoff < 0.45 * chunk.sample_rate
                                         ? data::low_pass_zero_phase(raw, chunk.sample_rate, cutoff)
                                         : raw;
    // On its own grid already: what is used when there can be no simulation.
    const Eigen::MatrixXd grid_qd = data::differentiate(chunk.time, followed);
    const auto give_up = [&] {
      if (report) ++report->failed;
      chunk.q = followed;
      chunk.qd = grid_qd;
      chunk.qdd = data::differentiate(chunk.time, grid_qd);
    };
    if (chunk.time.size() < 8) return give_up();

    const double omega = 2.0 * std::numbers::pi * (options.control > 0.0 ? options.control : 4.0 * smoothing);
    Eigen::VectorXd viscous, coulomb;
    if (!friction_rates(*arm, followed, viscous, coulomb)) return give_up();
    // RK4 is stable up to 2.8 over the fastest rate.
    const double step =
        options.step > 0.0
            ? options.step
            : std::clamp(std::min(0.5 / omega, 1.0 / std::max(1e-9, viscous.maxCoeff())), 5e-4, 5e-3);
    // So is Coulomb friction, smooth over a velocity that it takes up in one step; at least 1 % of the top
    // speed.
    arm->set_width(
        (coulomb * step).cwiseMax(0.01 * grid_qd.cwiseAbs().colwise().maxCoeff().transpose()).cwiseMax(1e-6));

    const double begin = chunk.time[0];
    const double span = chunk.time[chunk.time.size() - 1] - begin;
    const auto steps = static_cast<Eigen::Index>(std::ceil(span / step));
    Motion reference;
    reference.time = Eigen::VectorXd::LinSpaced(2 * steps + 1, begin, begin + span);
    reference.q = data::resample(chunk.time, followed, reference.time);
    reference.qd = data::differentiate(reference.time, reference.q);
    reference.qdd = data::differentiate(reference.time, reference.qd);
    Motion motion;
    if (!follow(*arm, reference, omega, motion)) return give_up();
    chunk.q = data::resample(motion.time, motion.q, chunk.time);
    chunk.qd = data::resample(motion.time, motion.qd, chunk.time);
    chunk.qdd = data::resample(motion.time, motion.qdd, chunk.time);
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

// ---------------------------------------------------------------------------------------------- sums

InstrumentSums::InstrumentSums(int joints, int columns, double block, int max_blocks)
    : plain_(joints, columns, block, max_blocks), length_(block) {}

void InstrumentSums::merge() {
  length_ *= 2.0;
  std::map<std::pair<int, long>, std::vector<Moments>> merged;
  for (auto& [key, joints] : blocks_) {
    const long half = key.second >= 0 ? key.second / 2 : (key.second - 1) / 2;
    const auto [place, fresh] = merged.try_emplace({key.first, half}, joints);
    if (fresh) continue;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      place->second[j].A += joints[j].A;
      place->second[j].r += joints[j].r;
    }
  }
  blocks_ = std::move(merged);
}

void InstrumentSums::add(int log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
                         const Eigen::Ref<const Eigen::MatrixXd>& Z,
                         const Eigen::Ref<const Eigen::MatrixXd>& W,
                         const Eigen::Ref<const Eigen::VectorXd>& y) {
  const Eigen::Index b = num_columns();
  if (Z.cols() != b || W.cols() != b || Z.rows() != W.rows() || y.size() != W.rows() || joint < 0 ||
      joint >= num_joints()) {
    throw DataError(fmt::format(
        "instruments: {} × {} rows of joint {} for a regressor of {} × {}; expected {} columns in both",
        Z.rows(), Z.cols(), joint + 1, W.rows(), W.cols(), b));
  }
  plain_.add(log, joint, time, W, y);
  // The plain blocks lead: ours are merged when theirs were.
  while (length_ < plain_.block_length()) merge();
  for (Eigen::Index first = 0; first < time.size();) {
    const long index = static_cast<long>(std::floor(time[first] / length_));
    Eigen::Index end = first;
    while (end < time.size() && static_cast<long>(std::floor(time[end] / length_)) == index) ++end;
    std::vector<Moments>& joints =
        blocks_
            .try_emplace({log, index},
                         std::vector<Moments>(static_cast<std::size_t>(num_joints()),
                                              Moments{Eigen::MatrixXd::Zero(b, b), Eigen::VectorXd::Zero(b)}))
            .first->second;
    Moments& moments = joints[static_cast<std::size_t>(joint)];
    const auto rows = Z.middleRows(first, end - first);
    moments.A.noalias() += rows.transpose() * W.middleRows(first, end - first);
    moments.r.noalias() += rows.transpose() * y.segment(first, end - first);
    first = end;
  }
}

InstrumentSums::Moments InstrumentSums::weighted(int block, const Eigen::VectorXd& weights) const {
  const std::vector<Moments>& joints = std::next(blocks_.begin(), block)->second;
  Moments sum{Eigen::MatrixXd::Zero(num_columns(), num_columns()), Eigen::VectorXd::Zero(num_columns())};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    sum.A += weights[static_cast<Eigen::Index>(j)] * joints[j].A;
    sum.r += weights[static_cast<Eigen::Index>(j)] * joints[j].r;
  }
  return sum;
}

InstrumentSums::Moments InstrumentSums::weighted(const Eigen::VectorXd& weights) const {
  Moments sum{Eigen::MatrixXd::Zero(num_columns(), num_columns()), Eigen::VectorXd::Zero(num_columns())};
  for (int b = 0; b < num_blocks(); ++b) {
    const Moments block = weighted(b, weights);
    sum.A += block.A;
    sum.r += block.r;
  }
  return sum;
}

// ---------------------------------------------------------------------------------------------- fit

InstrumentalEstimate solve_instrumental(const InstrumentSums& sums, const Eigen::VectorXd& weights,
                                        const Eigen::VectorXd& start, double condition_limit, double length,
                                        double edge_factor) {
  const Comparison c = compare(sums, weights, start, condition_limit, length, false);
  InstrumentalEstimate estimate;
  estimate.beta = start + c.frame.T * c.u;
  estimate.covariance =
      c.frame.T * statistics::jackknife_covariance(c.without, edge_factor) * c.frame.T.transpose();
  estimate.groups = static_cast<int>(c.without.cols());
  estimate.left_out = c.frame.left_out;
  estimate.relevance = c.relevance;
  estimate.relevance_ratio = c.relevance_ratio;
  return estimate;
}

InstrumentalFit fit_instrumental(const regression::RegressionColumns& columns,
                                 const regression::BaseParameters& base, const Logs& logs,
                                 const regression::ObservationOptions& observation,
                                 const Eigen::VectorXd& start_beta, const Eigen::VectorXd& start_noise,
                                 const InstrumentOptions& options,
                                 const std::function<void(double)>& progress) {
  if (start_beta.size() != base.count() || start_noise.size() != columns.num_joints()) {
    throw DataError(
        fmt::format("instruments: a start of {} parameters and {} noise levels; expected {} and {}",
                    start_beta.size(), start_noise.size(), base.count(), columns.num_joints()));
  }
  const double floor = std::max(1e-9 * start_noise.maxCoeff(), 1e-12);
  const Eigen::VectorXd weights = start_noise.cwiseMax(floor).cwiseAbs2().cwiseInverse();
  const bool simulated = options.kind != Instruments::kDelayed;
  const int limit = simulated ? std::max(1, options.max_iterations) : 1;
  const auto fresh = [&] {
    return InstrumentSums(columns.num_joints(), base.count(), options.block, options.max_blocks);
  };
  InstrumentalFit fit{{}, fresh(), start_noise, 0, false, {}};
  Eigen::VectorXd beta = start_beta;
  auto report = std::make_shared<SimulationReport>();
  while (fit.iterations < limit && !fit.converged) {
    *report = {};
    const regression::InstrumentMotion motion =
        simulated ? simulated_motion(columns, base, beta, logs, options, report)
                  : delayed_motion(logs, observation, options);
    fit.sums = fresh();
    regression::for_each_observation(
        columns, base.kept, logs, observation,
        [&](const regression::ObservationRows& rows) {
          fit.sums.add(rows.log, rows.joint, rows.time, rows.Z, rows.W, rows.tau);
        },
        motion);
    fit.estimate = solve_instrumental(fit.sums, weights, start_beta, options.condition_limit);
    const regression::TriangularFactor data = fit.sums.plain().weighted(weights);
    const double moved = (data.R() * (fit.estimate.beta - beta)).norm() /
                         std::sqrt(std::max(1.0, static_cast<double>(data.rows())));
    beta = fit.estimate.beta;
    ++fit.iterations;
    fit.converged = !simulated || moved < options.tolerance;
    if (progress) progress(static_cast<double>(fit.iterations) / limit);
  }
  if (progress) progress(1.0);

  for (int j = 0; j < columns.num_joints(); ++j) {
    const regression::TriangularFactor joint = fit.sums.plain().joint(j);
    if (joint.rows() > 0)
      fit.noise_std[j] = std::sqrt(joint.squared_error(beta) / static_cast<double>(joint.rows()));
  }
  if (fit.estimate.relevance_ratio < kWeakRatio) {
    fit.notes.push_back(
        fmt::format("instruments are weak: in one direction they show {:.1f} % of the motion, {:.1f} times "
                    "the scatter of that figure "
                    "(expected above {:.0f}); the estimate and its interval cannot be trusted there: record "
                    "more, or use other "
                    "instruments",
                    100.0 * fit.estimate.relevance, fit.estimate.relevance_ratio, kWeakRatio));
  }
  if (report->failed > 0) {
    fit.notes.push_back(
        fmt::format("{} of {} pieces of log could not be simulated (the fitted mass matrix is not positive "
                    "definite there); their "
                    "instruments are the smoothed motion itself, which serves nearly as well",
                    report->failed, report->pieces));
  }
  return fit;
}

// ---------------------------------------------------------------------------------------------- test

BiasTest test_bias(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit, double length, double edge_factor) {
  const Comparison c = compare(sums, weights, start, condition_limit, length, true);
  BiasTest test;
  const auto B = static_cast<int>(c.without.cols());
  const auto k = static_cast<int>(c.u.size());
  const Eigen::VectorXd d = c.u - c.frame.u_plain;
  // W T is orthonormal, so ‖d‖ is the weighted torque that the two predict differently.
  test.torque_difference = c.frame.residual > 0.0 ? d.norm() / std::sqrt(c.frame.residual) : 0.0;
  constexpr int kLeastGroups = 10;
  constexpr int kGroupsPerDirection = 5;
  if (k == 0 || B < kLeastGroups) {
    test.verdict = fmt::format(
        "no verdict on bias: {} independent stretches of log, at least {} are needed; record longer", B,
        kLeastGroups);
    return test;
  }

  // Noise in the rows, W = W₀ + E: WᵀW − ZᵀW ≈ EᵀE, here I − K. It moves least squares by −EᵀE β. The
  // directions where that is most are tested.
  const Eigensystem noise = eigensystem_of(Eigen::MatrixXd::Identity(k, k) - 0.5 * (c.K + c.K.transpose()));
  const Eigen::VectorXd whole = c.frame.from * start + c.u;
  const Eigen::VectorXd expected = noise.values.cwiseProduct(noise.vectors.transpose() * whole).cwiseAbs();
  std::vector<Eigen::Index> order(static_cast<std::size_t>(k));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return expected[a] > expected[b]; });
  order.resize(static_cast<std::size_t>(std::max(1, std::min(k, B / kGroupsPerDirection))));
  const Eigen::MatrixXd P = noise.vectors(Eigen::all, order);
  const Eigen::VectorXd part = P.transpose() * d;
  const Eigen::MatrixXd V =
      statistics::jackknife_covariance(P.transpose() * (c.without - c.plain_without), edge_factor);

  // Rank-revealing once more: a direction in which the two estimates do not differ at all (an offset is its
  // own instrument) has no variance either.
  const Eigen::VectorXd scale =
      V.diagonal().cwiseSqrt().cwiseMax(1e-12 * std::sqrt(c.frame.residual) + 1e-300);
  const Eigensystem eigen =
      eigensystem_of(scale.cwiseInverse().asDiagonal() * V * scale.cwiseInverse().asDiagonal());
  const Eigen::VectorXd along = eigen.vectors.transpose() * part.cwiseQuotient(scale);
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (eigen.values[i] < 1e-8) continue;
    test.statistic += along[i] * along[i] / eigen.values[i];
    ++test.degrees_of_freedom;
  }
  if (test.degrees_of_freedom > 0) {
    const double dof = test.degrees_of_freedom;
    test.p_value = statistics::fisher_tail(test.statistic * (B - dof) / (dof * (B - 1)), dof, B - dof);
  }
  test.biased = test.p_value < 0.01 && test.torque_difference > 0.1;
  // How far apart the two would be by chance alone.
  const double chance =
      std::sqrt(statistics::jackknife_covariance(c.without - c.plain_without, edge_factor).trace() /
                std::max(c.frame.residual, 1e-300));
  const std::string figures = fmt::format("p = {:.2g}, torque differs by {:.1f} % of the residual",
                                          test.p_value, 100.0 * test.torque_difference);
  if (test.biased) {
    test.verdict = fmt::format(
        "plain least squares is biased by noise in the measured motion: use --method iv ({})", figures);
  } else if (test.p_value < 0.01) {
    test.verdict = fmt::format(
        "no significant bias: the parameters differ with instruments, but the predicted torque barely does "
        "({})",
        figures);
  } else if (chance > 0.5) {
    test.verdict = fmt::format(
        "no verdict on bias: the instruments are too weak, chance alone moves the torque by {:.0f} % of "
        "the residual ({})",
        100.0 * chance, figures);
  } else {
    test.verdict = fmt::format("no bias found ({})", figures);
  }
  return test;
}

}  // namespace heft::identify
