#include "heft/model/motion_torque.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "drive_torque.hpp"
#include "heft/host/error.hpp"
#include "heft/model/batch_dynamics.hpp"

namespace heft::model {
namespace {

using Eigen::Index;

/// Over the elastic joints, on the stack.
template <int kSize>
inline constexpr int kMost = kSize < 0 ? kMaxJoints : kSize;
template <int kSize>
using Deflections = Eigen::Matrix<double, kSize, 1, 0, kMost<kSize>, 1>;
template <int kSize>
using Coupled = Eigen::Matrix<double, kSize, kSize, 0, kMost<kSize>, kMost<kSize>>;

/// Rows so far apart that a joint rings longer than this between them [rad] say nothing of its ringing.
constexpr double kLongestRinging = 300.0;
/// Phase of the fastest mode that one step of the integration covers [rad]: error 0.3⁵/120 of the amplitude.
constexpr double kStepPhase = 0.3;

bool has_memory(const Robot& robot) {
  return std::any_of(robot.effects.begin(), robot.effects.end(),
                     [](const JointEffect<double>& effect) { return joint_effect_has_memory(effect.kind); });
}

/// e and ė of every elastic joint.
template <int kSize>
struct Deflection {
  Deflections<kSize> e, ed;
};

/// Springs and dampers of the elastic joints, and their play.
template <int kSize>
struct Springs {
  using Vector = Deflections<kSize>;
  Vector K, D, gap;

  /// S(e, ė)
  Vector torque(const Vector& e, const Vector& ed) const {
    Vector torque = e;
    for (Index i = 0; i < e.size(); ++i)
      torque[i] = spring_torque(Elasticity<double>{0, K[i], D[i], 0.0, gap[i]}, e[i], ed[i]);
    return torque;
  }
};

/// M ë = r(t) - S(e, ė) from `state` over h, r going from `r0` to `r1` in a straight line. Classical Runge-Kutta.
template <int kSize>
void integrate(const Coupled<kSize>& inverse_mass, const Springs<kSize>& springs, const Deflections<kSize>& r0,
               const Deflections<kSize>& r1, double h, int steps, Deflection<kSize>& state) {
  using Vector = Deflections<kSize>;
  const auto acceleration = [&](double share, const Vector& e, const Vector& ed) -> Vector {
    const Vector torque = r0 + share * (r1 - r0) - springs.torque(e, ed);
    return inverse_mass.lazyProduct(torque);
  };
  const double dt = h / steps;
  for (int k = 0; k < steps; ++k) {
    const double from = static_cast<double>(k) / steps;
    const double half = from + 0.5 / steps;
    const double to = from + 1.0 / steps;
    const Vector a1 = acceleration(from, state.e, state.ed);
    const Vector v2 = state.ed + 0.5 * dt * a1;
    const Vector a2 = acceleration(half, state.e + 0.5 * dt * state.ed, v2);
    const Vector v3 = state.ed + 0.5 * dt * a2;
    const Vector a3 = acceleration(half, state.e + 0.5 * dt * v2, v3);
    const Vector v4 = state.ed + dt * a3;
    const Vector a4 = acceleration(to, state.e + dt * v3, v4);
    state.e += dt / 6.0 * (state.ed + 2.0 * v2 + 2.0 * v3 + v4);
    state.ed += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
  }
}

}  // namespace

struct MotionTorque::Impl {
  explicit Impl(const Robot& given) : dynamics(given), in_lanes(given), robot(dynamics.robot()) {
    if (!(robot.torque_delay >= 0) || !std::isfinite(robot.torque_delay)) {
      throw ModelError(fmt::format("robot \"{}\": torque delay {} s; expected zero or a positive one",
                                   robot.name, robot.torque_delay));
    }
    const auto count = static_cast<Index>(robot.elasticities.size());
    K.resize(count), D.resize(count), gap.resize(count);
    for (Index i = 0; i < count; ++i) {
      const Elasticity<double>& elasticity = robot.elasticities[static_cast<std::size_t>(i)];
      K[i] = elasticity.stiffness;
      D[i] = elasticity.damping;
      gap[i] = elasticity.gap;
    }
    reset();
  }

  void reset() {
    started = false;
    memory.assign(robot.effects.size(), 0.0);
    const auto count = static_cast<Index>(robot.elasticities.size());
    e = ed = r = Deflections<Eigen::Dynamic>::Zero(count);
    past_time.resize(0);
    past_torque.resize(0, robot.num_joints());
  }

  int joint(Index i) const { return robot.elasticities[static_cast<std::size_t>(i)].joint; }

  /// x, ẋ of the elastic joints for a deflection.
  template <typename Vector>
  void put_link(const Vector& deflection, const Vector& rate) {
    for (Index i = 0; i < K.size(); ++i) {
      link_q[joint(i)] = motor_q[joint(i)] - deflection[i];
      link_qd[joint(i)] = motor_qd[joint(i)] - rate[i];
    }
  }

  /// Rows and columns of the elastic joints.
  template <int kSize>
  Coupled<kSize> elastic_part(const Eigen::MatrixXd& M) const {
    Coupled<kSize> part = Coupled<kSize>::Zero(K.size(), K.size());
    for (Index i = 0; i < K.size(); ++i) {
      for (Index j = 0; j < K.size(); ++j) part(i, j) = M(joint(i), joint(j));
    }
    return part;
  }

  /// Deflection at the row `motor_*`, `h` after the last one; leaves the rigid bodies' torque in `load`.
  template <int kSize>
  void deflect(double h) {
    using Vector = Deflections<kSize>;
    const Index count = K.size();
    const Springs<kSize> springs{K, D, gap};
    const Vector &stiffness = springs.K, &damping = springs.D;
    const auto rigid = [&](const Vector& deflection, const Vector& rate) -> Vector {
      put_link(deflection, rate);
      load = dynamics.inverse_dynamics(link_q, link_qd, motor_qdd);
      Vector part = Vector::Zero(count);
      for (Index i = 0; i < count; ++i) part[i] = load[joint(i)];
      return part;
    };
    const auto settle = [&](Deflection<kSize>& state) -> Vector {
      // K e = τ_rigid(θ - e, θ̇, θ̈): the torque hardly changes with e.
      constexpr int kRounds = 4;
      Vector torque = rigid(state.e, state.ed);
      for (int round = 0; round < kRounds; ++round) {
        state.e = torque.cwiseQuotient(stiffness) + 0.5 * torque.cwiseSign().cwiseProduct(springs.gap);
        torque = rigid(state.e, state.ed);
      }
      return torque;
    };
    Deflection<kSize> state{e, ed};
    Vector torque = Vector::Zero(count), second = Vector::Zero(count);
    bool at_rest = !started;
    if (started) {
      // The row before gives the inertia; the arm turns little from row to row.
      const Eigen::LLT<Coupled<kSize>> factor(elastic_part<kSize>(M_before));
      // Links whose fitted inertia is physically impossible do not ring.
      at_rest = factor.info() != Eigen::Success;
      if (!at_rest) {
        const Coupled<kSize> inverse = factor.solve(Coupled<kSize>::Identity(count, count));
        // Fastest mode: ω² is at most the trace of M⁻¹K, a decay rate at most that of M⁻¹D.
        const double rate = std::max(std::sqrt(inverse.diagonal().dot(stiffness)),
                                     inverse.diagonal().dot(damping.cwiseAbs()));
        const double phase = rate * h;
        at_rest = !(phase < kLongestRinging);
        if (!at_rest) {
          const int steps = std::max(1, static_cast<int>(std::ceil(phase / kStepPhase)));
          const Vector last = r;
          // The torque at this row needs the deflection there: first with the torque held, then along a line.
          Deflection<kSize> ahead = state;
          integrate<kSize>(inverse, springs, last, last, h, steps, ahead);
          torque = rigid(ahead.e, ahead.ed);
          integrate<kSize>(inverse, springs, last, torque, h, steps, state);
        }
      }
    }
    if (at_rest) {
      state.ed = Vector::Zero(count);
      torque = settle(state);
    }
    put_link(state.e, state.ed);
    mass = dynamics.mass_matrix(link_q);
    const Vector passed_on = springs.torque(state.e, state.ed), left = torque - passed_on;
    const Eigen::LLT<Coupled<kSize>> factor(elastic_part<kSize>(mass));
    if (!at_rest && factor.info() == Eigen::Success) second = factor.solve(left);
    // rigid(x, ẋ, ẍ) = rigid(x, ẋ, θ̈) - M_e ë; at an elastic joint it is the torque of spring and damper.
    for (Index i = 0; i < count; ++i) {
      load -= mass.col(joint(i)) * second[i];
      link_qdd[joint(i)] = motor_qdd[joint(i)] - second[i];
    }
    for (Index i = 0; i < count; ++i) load[joint(i)] = passed_on[i];
    e = state.e, ed = state.ed, r = torque;
    M_before = mass;
  }

  /// Torque of the row `motor_*` at `time`, without delay.
  /// @param at  its row in `measured`, in `temperature` and, unless a joint is elastic, in `loads`
  void row(double time, const SignWidth& sign_width, const Eigen::MatrixXd& measured,
           const Eigen::MatrixXd& temperature, const Eigen::MatrixXd& loads, Index at) {
    link_q = motor_q, link_qd = motor_qd, link_qdd = motor_qdd;
    const double h = started ? time - last_time : 0.0;
    if (K.size() == 0) {
      load = loads.row(at);
    } else if (K.size() == 1) {
      deflect<1>(h);
    } else {
      deflect<Eigen::Dynamic>(h);
    }
    tau = load;
    for (const Elasticity<double>& elasticity : robot.elasticities) {
      tau[elasticity.joint] += elasticity.motor_inertia * motor_qdd[elasticity.joint];
    }
    add_actuation(robot, motor_qd, motor_qdd, sign_width, tau);
    add_cables(robot, motor_q, tau);
    for (std::size_t k = 0; k < robot.effects.size(); ++k) {
      const JointEffect<double>& effect = robot.effects[k];
      const int j = effect.joint;
      const RobotJoint& of = robot.joints[static_cast<std::size_t>(j)];
      if (started && !memory_stays) {
        const bool as_measured = effect.displacement != Displacement::kPosition && measured.cols() > 0;
        const double step =
            as_measured ? measured(at, displacement_column(effect.displacement, j, robot.num_joints()))
                        : motor_q[j] - last_q[j];
        memory[k] = joint_effect_memory(effect, memory[k], step);
      }
      EffectPoint<double> point{
          time,    motor_q[j], motor_qd[j], motor_qdd[j], velocity_sign(motor_qd[j], sign_width.of(of.joint.type)),
          load[j], memory[k]};
      if (temperature.cols() > 0) point.temperature = temperature(at, j);
      tau[j] += joint_effect_torque(effect, point, of.actuation);
    }
    last_time = time;
    last_q = motor_q;
    started = true;
  }

  /// Every row as it was `torque_delay` before, rows of earlier calls included.
  void delay(const Eigen::VectorXd& time, Eigen::MatrixXd& torque) {
    const double late = robot.torque_delay;
    const Index before = past_time.size();
    Eigen::VectorXd known_time(before + time.size());
    known_time.head(before) = past_time, known_time.tail(time.size()) = time;
    Eigen::MatrixXd known(before + time.size(), torque.cols());
    known.topRows(before) = past_torque, known.bottomRows(time.size()) = torque;
    Index at = 0;  // the last known row that is not later than the one wanted
    for (Index k = 0; k < time.size(); ++k) {
      const double wanted = time[k] - late;
      while (at + 1 < known_time.size() && known_time[at + 1] <= wanted) ++at;
      if (wanted <= known_time[at] || at + 1 == known_time.size()) {
        torque.row(k) = known.row(at);
        continue;
      }
      const double share = (wanted - known_time[at]) / (known_time[at + 1] - known_time[at]);
      torque.row(k) = known.row(at) + share * (known.row(at + 1) - known.row(at));
    }
    // The next call reads from here on.
    const Index kept = known_time.size() - at;
    past_time = known_time.tail(kept).eval();
    past_torque = known.bottomRows(kept).eval();
  }

  /// The rigid bodies' torque of every row, where one does not depend on the rows before.
  Eigen::MatrixXd rigid_torque(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd,
                               const Eigen::MatrixXd& qdd) const {
    /// Fewer are faster one by one.
    constexpr Index kWorthLanes = 4;
    if (K.size() > 0) return {};
    if (q.rows() >= kWorthLanes) return in_lanes.inverse_dynamics(q, qd, qdd);
    Eigen::MatrixXd torque(q.rows(), q.cols());
    for (Index k = 0; k < q.rows(); ++k) {
      torque.row(k) = dynamics.inverse_dynamics(q.row(k), qd.row(k), qdd.row(k));
    }
    return torque;
  }

  Dynamics dynamics;
  BatchDynamics in_lanes;
  const Robot& robot;  // of `dynamics`
  /// Only then does a row depend on more than its own instant.
  bool along() const { return !robot.effects.empty() || !robot.elasticities.empty(); }
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1> K, D, gap;

  // State.
  bool started{false};
  bool memory_stays{false};  ///< whatever the motion
  double last_time{0.0};
  Eigen::VectorXd last_q;
  std::vector<double> memory;
  Deflections<Eigen::Dynamic> e, ed, r;
  Eigen::MatrixXd M_before;
  Eigen::VectorXd past_time;
  Eigen::MatrixXd past_torque;

  // Workspace of one row.
  Eigen::VectorXd motor_q, motor_qd, motor_qdd, link_q, link_qd, link_qdd, load, tau;
  Eigen::MatrixXd mass;

  // Of the last call.
  Eigen::MatrixXd out_q, out_qd, out_qdd;
};

bool needs_measured_displacement(const Robot& robot) {
  return std::any_of(robot.effects.begin(), robot.effects.end(), [](const JointEffect<double>& effect) {
    return effect.displacement != Displacement::kPosition;
  });
}

bool depends_on_past(const Robot& robot) {
  return robot.torque_delay > 0 || !robot.elasticities.empty() || has_memory(robot);
}

bool needs_temperature(const Robot& robot) {
  return std::any_of(robot.effects.begin(), robot.effects.end(), [](const JointEffect<double>& effect) {
    return effect.kind == joint_effect_kind<FrictionTemperature>();
  });
}

MotionTorque::MotionTorque(const Robot& robot) : impl_(std::make_unique<Impl>(robot)) {}
MotionTorque::~MotionTorque() = default;
MotionTorque::MotionTorque(MotionTorque&&) noexcept = default;
MotionTorque& MotionTorque::operator=(MotionTorque&&) noexcept = default;

Eigen::MatrixXd MotionTorque::torque(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                     const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd, const SignWidth& sign_width,
                                     const Eigen::MatrixXd& measured,
                                     const Eigen::MatrixXd& temperature) {
  Impl& s = *impl_;
  s.out_q = q, s.out_qd = qd, s.out_qdd = qdd;
  const Eigen::MatrixXd loads = s.rigid_torque(q, qd, qdd);
  Eigen::MatrixXd torque(q.rows(), q.cols());
  for (Index k = 0; k < q.rows(); ++k) {
    s.motor_q = q.row(k), s.motor_qd = qd.row(k), s.motor_qdd = qdd.row(k);
    if (!s.along()) {
      s.tau = loads.row(k);
      add_actuation(s.robot, s.motor_qd, s.motor_qdd, sign_width, s.tau);
      add_cables(s.robot, s.motor_q, s.tau);
      torque.row(k) = s.tau;
      continue;
    }
    s.row(time[k], sign_width, measured, temperature, loads, k);
    torque.row(k) = s.tau;
    if (s.robot.elasticities.empty()) continue;
    s.out_q.row(k) = s.link_q, s.out_qd.row(k) = s.link_qd, s.out_qdd.row(k) = s.link_qdd;
  }
  if (s.robot.torque_delay > 0) s.delay(time, torque);
  return torque;
}

const Eigen::MatrixXd& MotionTorque::link_q() const { return impl_->out_q; }
const Eigen::MatrixXd& MotionTorque::link_qd() const { return impl_->out_qd; }
const Eigen::MatrixXd& MotionTorque::link_qdd() const { return impl_->out_qdd; }
void MotionTorque::reset() { impl_->reset(); }

void MotionTorque::start_from(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                              const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                              const Eigen::MatrixXd& tau, const SignWidth& sign_width) {
  Impl& s = *impl_;
  s.reset();
  if (!has_memory(s.robot) || time.size() == 0) return;
  Index rows = 0;
  while (rows < time.size() && time[rows] - time[0] < kSeenAtRest) ++rows;
  // Memory that begins at 0 would wander with the noise of the position.
  s.memory_stays = true;
  const Eigen::MatrixXd left = tau.topRows(rows) - torque(time.head(rows), q.topRows(rows), qd.topRows(rows),
                                                          qdd.topRows(rows), sign_width);
  s.memory_stays = false;
  s.reset();
  // What several memories of a joint hold together, each does with its part of what they can.
  const auto most = [&](const JointEffect<double>& effect) {
    if (!joint_effect_has_memory(effect.kind)) return 0.0;
    EffectPoint<double> slid;
    slid.memory = 1.0;
    return joint_effect_torque(effect, slid,
                               s.robot.joints[static_cast<std::size_t>(effect.joint)].actuation);
  };
  Eigen::VectorXd together = Eigen::VectorXd::Zero(s.robot.num_joints());
  for (const JointEffect<double>& effect : s.robot.effects) together[effect.joint] += most(effect);
  for (std::size_t k = 0; k < s.robot.effects.size(); ++k) {
    const JointEffect<double>& effect = s.robot.effects[k];
    if (!(qd.col(effect.joint).head(rows).cwiseAbs().maxCoeff() < kRestSpeed)) continue;
    s.memory[k] = joint_effect_memory_at_rest(
        effect, left.col(effect.joint).mean() * (most(effect) / together[effect.joint]),
        s.robot.joints[static_cast<std::size_t>(effect.joint)].actuation);
  }
}

}  // namespace heft::model
