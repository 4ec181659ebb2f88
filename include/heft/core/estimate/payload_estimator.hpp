/// @file
/// Payload on the last link, from rows k..n: the ten inertial parameters, mass included.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/innovation_gate.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Estimates what was added to the terminal link: Δτ = R Δx + c Δm (README.md in this folder, (39')) with the
/// mass as a parameter of its own, in the ten parameters of a link, and the change of Coulomb and viscous friction of
/// the last joint, or of the last FrictionJoints joints. The friction of every joint whose row is used may change
/// (a warmer gear, a heavier load): friction without a parameter of its own goes into the load.
///
/// Runs on the residual of a model that is known to fit without payload, over rows k..n. On an arm like the UR5
/// the mass shows from k ≤ 4 on; a parameter that the motion does not determine keeps the prior, zero, and is marked.
///
/// Follows a load that changes, with its default settings: the gate widens where innovations remain large, and the past
/// is forgotten over some thousand samples. Where the moment of the change is known, restart() is faster.
///
/// @tparam N  number of joints
/// @tparam FrictionJoints  joints, counted from the last, whose friction may change
template <typename Scalar, int N, int FrictionJoints = 1>
class PayloadEstimator {
  static_assert(FrictionJoints >= 0 && FrictionJoints <= N, "no more friction joints than joints");

 public:
  /// Ten inertial parameters, then Coulomb and viscous of each friction joint, the innermost first.
  static constexpr int kParameters = 10 + 2 * FrictionJoints;
  /// First joint whose friction may change, from 0.
  static constexpr int kFirstFrictionJoint = N - FrictionJoints;
  using Vector = JointVector<Scalar, N>;
  using Estimator = RecursiveLeastSquares<Scalar, kParameters>;
  using Row = typename Estimator::Row;

  struct Config {
    int first_row{0};  ///< k − 1
    /// λ a sample that used a row, with λ^p ≥ 1e-12. The default remembers 5000 samples: 5 s at 1 kHz, and nine tenths
    /// of a change are followed within 12 s of motion. 1 for a load that does not change, or with restart().
    Scalar forgetting_factor{static_cast<Scalar>(0.9998)};
    Vector noise_std = Vector::Ones();  ///< of the torque residual of each joint [N·m, N]
    /// Neighbouring samples worth one independent sample, because the residual is correlated in time; ≥ 1.
    /// Does not move the estimate, but makes its standard deviations hold.
    Scalar correlated_samples{1};
    /// Gate in standard deviations, or in usual innovations of that joint's row; 0 never rejects.
    Scalar gate{5};
    /// How readily the gate lets in a change that lasts, see InnovationGate: with the default after 60 rows for one of
    /// 60 standard deviations. 0: a gate of fixed width, for a caller that watches rows_rejected itself.
    Scalar gate_widening{static_cast<Scalar>(0.01)};
    Scalar mass_prior{10};  ///< prior standard deviation of the mass [kg]
    /// Length [m] that scales the priors of first moment and inertia.
    Scalar length_prior{static_cast<Scalar>(0.3)};
    Scalar friction_prior{5};  ///< prior standard deviation of the friction changes [N·m], [N·m·s/rad]
    bool estimate_friction{true};
    /// Rows of slower joints are left out: at rest friction takes up any torque below its level, so such a row
    /// says nothing. 0: none.
    Scalar standstill_speed{0};
    Scalar sign_width{static_cast<Scalar>(0.01)};
  };

  struct Record {
    std::array<Scalar, static_cast<std::size_t>(N)> innovation{};  ///< of the rows used or rejected [N·m]
    /// Variance that a single innovation has; 0 where the row was left out.
    std::array<Scalar, static_cast<std::size_t>(N)> innovation_variance{};
    std::array<bool, static_cast<std::size_t>(N)> used{};
    int rows_used{0};
    int rows_rejected{0};
    int rows_at_rest{0};
    bool standstill{false};  ///< every row was left out
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    if (config.first_row < 0 || config.first_row >= N || !(config.mass_prior > Scalar(0)) ||
        !(config.length_prior > Scalar(0)) || !(config.friction_prior > Scalar(0)) ||
        !(config.correlated_samples >= Scalar(1)) || !is_usable(config.correlated_samples) ||
        !(config.standstill_speed >= Scalar(0)) || !(config.sign_width >= Scalar(0))) {
      return Status::kOutOfRange;
    }
    for (int i = 0; i < N; ++i) {
      if (!(config.noise_std[i] > Scalar(0)) ||
          !is_usable_weight(config.noise_std[i] * config.noise_std[i] * config.correlated_samples)) {
        return Status::kOutOfRange;
      }
    }
    Row prior{};
    Row variance{};
    const Scalar m = config.mass_prior;
    const Scalar h = m * config.length_prior;
    const Scalar inertia = h * config.length_prior;
    variance[0] = m * m;
    for (std::size_t i = 1; i < 4; ++i) {
      variance[i] = h * h;
    }
    for (std::size_t i = 4; i < 10; ++i) {
      variance[i] = inertia * inertia;
    }
    const Scalar friction = config.estimate_friction ? config.friction_prior : static_cast<Scalar>(1e-6);
    for (std::size_t i = 10; i < static_cast<std::size_t>(kParameters); ++i) {
      variance[i] = friction * friction;
    }
    typename Estimator::Config settings;
    settings.forgetting_factor = config.forgetting_factor;
    settings.gate = config.gate;
    settings.gate_widening = config.gate_widening;
    settings.gate_noise_share = Scalar(1) / config.correlated_samples;
    const Status status = estimator_.configure(settings, prior, variance);
    if (status == Status::kOk) {
      config_ = config;
      settings_ = settings;
      prior_variance_ = variance;
      reset_gates();
      configured_ = true;
    }
    return status;
  }

  /// Takes one sample.
  /// @param Y         inertial columns of the regressor at this sample
  /// @param qd        velocities
  /// @param residual  measured torque less the torque of the model without payload, n [N·m]
  /// @return kNonFiniteInput (also for a number beyond kLargestInput), kNotConfigured: nothing changed
  Status update(const LinkRegressor<Scalar, N>& Y, const Vector& qd, const Vector& residual,
                Record& record) noexcept {
    Vector sign;
    for (int i = 0; i < N; ++i) {
      sign[i] = velocity_sign(qd[i], config_.sign_width);
    }
    return update(Y, qd, sign, residual, record);
  }

  /// The same with the sign of the velocities given: where torque and motion come through a low-pass, the sign
  /// must come through it too.
  Status update(const LinkRegressor<Scalar, N>& Y, const Vector& qd, const Vector& sign,
                const Vector& residual, Record& record) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    bool usable = all_usable(residual) && all_usable(qd) && all_usable(sign);
    for (int i = 0; i < N; ++i) {
      for (int c = kParametersPerLink * (N - 1); c < kParametersPerLink * N; ++c) {
        usable = usable && is_usable(Y(i, c));
      }
    }
    if (!usable) {
      return Status::kNonFiniteInput;
    }
    for (int i = config_.first_row; i < N; ++i) {
      const std::size_t at = static_cast<std::size_t>(i);
      if (qd[i] < config_.standstill_speed && qd[i] > -config_.standstill_speed) {
        ++record.rows_at_rest;
        continue;
      }
      typename Estimator::Record taken;
      const Scalar noise = config_.noise_std[i] * config_.noise_std[i] * config_.correlated_samples;
      const Status status = estimator_.add(row(Y, qd, sign, i), residual[i], noise, gates_[at], taken);
      if (status != Status::kOk) {
        return status;
      }
      record.innovation[at] = taken.innovation;
      record.innovation_variance[at] = taken.innovation_variance;
      record.used[at] = taken.used;
      ++(taken.used ? record.rows_used : record.rows_rejected);
    }
    estimator_.forget();
    record.standstill = record.rows_at_rest == N - config_.first_row;
    return Status::kOk;
  }

  /// Row i of the problem: ten columns of the last link, then Coulomb and viscous of the friction joints.
  Row row(const LinkRegressor<Scalar, N>& Y, const Vector& qd, int i) const noexcept {
    Vector sign = Vector::Zero();
    sign[i] = velocity_sign(qd[i], config_.sign_width);
    return row(Y, qd, sign, i);
  }

  /// The same with the sign of the velocities given.
  Row row(const LinkRegressor<Scalar, N>& Y, const Vector& qd, const Vector& sign, int i) const noexcept {
    return row_of(Y, kParametersPerLink * (N - 1), sign[i], qd[i], i);
  }

  /// The same from the columns of the last link alone.
  Row load_row(const Eigen::Matrix<Scalar, N, kParametersPerLink>& columns, const Vector& qd,
               int i) const noexcept {
    return row_of(columns, 0, velocity_sign(qd[i], config_.sign_width), qd[i], i);
  }

  /// The added body: ten inertial parameters about the last link frame.
  InertialParameters<Scalar> payload() const noexcept {
    InertialParameters<Scalar> p{};
    for (std::size_t i = 0; i < 10; ++i) {
      p[i] = estimator_.solution()[i];
    }
    return p;
  }
  /// Change of the friction of joint i; 0 for a joint that is no friction joint.
  Scalar coulomb_change(int i = N - 1) const noexcept { return friction_change(i, 0); }
  Scalar viscous_change(int i = N - 1) const noexcept { return friction_change(i, 1); }

  /// Takes up the prior's variances again and keeps the estimate: after a change of load.
  void restart() noexcept {
    if (prior_variance_[0] > Scalar(0)) {
      static_cast<void>(estimator_.configure(settings_, estimator_.solution(), prior_variance_));
      reset_gates();
    }
  }

  /// Standard deviation of parameter i for residuals of the configured size and correlation.
  Scalar standard_deviation(int i) const noexcept {
    using std::sqrt;
    return sqrt(estimator_.variance(i));
  }

  /// True when the data have reduced the prior standard deviation of parameter i to less than a tenth.
  bool identifiable(int i) const noexcept {
    return estimator_.variance(i) < static_cast<Scalar>(0.01) * prior_variance_[static_cast<std::size_t>(i)];
  }

  /// The underlying recursion, for variances of combinations.
  const Estimator& estimator() const noexcept { return estimator_; }
  Estimator& estimator() noexcept { return estimator_; }

 private:
  /// @param first  column of the last link's mass
  template <typename Matrix>
  static Row row_of(const Matrix& Y, int first, const Scalar& sign, const Scalar& qd, int i) noexcept {
    Row w{};
    for (int c = 0; c < kParametersPerLink; ++c) {
      w[static_cast<std::size_t>(c)] = Y(i, first + c);
    }
    if (i >= kFirstFrictionJoint) {
      const std::size_t friction = static_cast<std::size_t>(10 + 2 * (i - kFirstFrictionJoint));
      w[friction] = sign;
      w[friction + 1] = qd;
    }
    return w;
  }

  Scalar friction_change(int i, int which) const noexcept {
    return i < kFirstFrictionJoint || i >= N
               ? Scalar(0)
               : estimator_.solution()[static_cast<std::size_t>(10 + 2 * (i - kFirstFrictionJoint) + which)];
  }

  void reset_gates() noexcept {
    for (InnovationGate<Scalar>& gate : gates_) {
      gate.reset();
    }
  }

  Config config_{};
  typename Estimator::Config settings_{};
  Row prior_variance_{};
  std::array<InnovationGate<Scalar>, static_cast<std::size_t>(N)> gates_{};  ///< one a joint's row
  Estimator estimator_;
  bool configured_{false};
};

}  // namespace heft
