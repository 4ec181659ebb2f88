/// @file
/// Payload on the last link, from rows k..n: the ten inertial parameters, mass included.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Estimates what was added to the terminal link: Δτ = R Δx + c Δm, the corrected equation (39') with the mass as
/// a parameter of its own, in the contract's ten parameters, and the change of Coulomb and viscous friction of
/// the last joint.
///
/// Runs on the residual of a model that is known to fit without payload, over rows k..n. On an arm like the UR5
/// the mass shows from k ≤ 4 on; what the motion does not determine keeps the prior, zero, and is marked.
///
/// @tparam N  number of joints
template <typename Scalar, int N>
class PayloadEstimator {
 public:
  static constexpr int kParameters = 12;
  using Vector = JointVector<Scalar, N>;
  using Estimator = RecursiveLeastSquares<Scalar, kParameters>;
  using Row = typename Estimator::Row;

  struct Config {
    int first_row{0};                ///< k − 1
    Scalar forgetting_factor{1};     ///< a sample
    Vector noise_std = Vector::Ones();  ///< of the torque residual of each joint [N·m, N]
    Scalar gate{5};                  ///< standard deviations; 0 never rejects
    Scalar mass_prior{10};           ///< prior standard deviation of the mass [kg]
    Scalar length_prior{static_cast<Scalar>(0.3)};  ///< a length [m] that scales the priors of first moment and inertia
    Scalar friction_prior{5};        ///< prior standard deviation of the friction changes [N·m], [N·m·s/rad]
    bool estimate_friction{true};
    Scalar standstill_speed{0};      ///< samples with every joint slower are left out: friction hides the sign there
    Scalar sign_width{static_cast<Scalar>(0.01)};
  };

  struct Record {
    std::array<Scalar, static_cast<std::size_t>(N)> innovation{};  ///< of the rows used [N·m]
    int rows_used{0};
    int rows_rejected{0};
    bool standstill{false};
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    if (config.first_row < 0 || config.first_row >= N || !(config.mass_prior > Scalar(0)) ||
        !(config.length_prior > Scalar(0)) || !(config.friction_prior > Scalar(0))) {
      return Status::kOutOfRange;
    }
    for (int i = 0; i < N; ++i) {
      if (!(config.noise_std[i] > Scalar(0))) {
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
    variance[10] = friction * friction;
    variance[11] = friction * friction;
    typename Estimator::Config settings;
    settings.forgetting_factor = config.forgetting_factor;
    settings.gate = config.gate;
    const Status status = estimator_.configure(settings, prior, variance);
    if (status == Status::kOk) {
      config_ = config;
      prior_variance_ = variance;
    }
    return status;
  }

  /// Takes one sample.
  /// @param Y         inertial columns of the regressor at this sample
  /// @param qd        velocities
  /// @param residual  measured torque less the torque of the model without payload, n [N·m]
  /// @return kNonFiniteInput, kNotConfigured: nothing changed
  Status update(const LinkRegressor<Scalar, N>& Y, const Vector& qd, const Vector& residual, Record& record) noexcept {
    record = Record{};
    bool finite = true;
    bool moving = !(config_.standstill_speed > Scalar(0));
    for (int i = 0; i < N; ++i) {
      finite = finite && residual[i] - residual[i] == Scalar(0) && qd[i] - qd[i] == Scalar(0);
      moving = moving || qd[i] > config_.standstill_speed || qd[i] < -config_.standstill_speed;
      for (int c = kParametersPerLink * (N - 1); c < kParametersPerLink * N; ++c) {
        finite = finite && Y(i, c) - Y(i, c) == Scalar(0);
      }
    }
    if (!finite) {
      return Status::kNonFiniteInput;
    }
    if (!moving) {
      record.standstill = true;
      return Status::kOk;
    }
    for (int i = config_.first_row; i < N; ++i) {
      const Row w = row(Y, qd, i);
      typename Estimator::Record taken;
      const Status status =
          estimator_.update(w, residual[i], config_.noise_std[i] * config_.noise_std[i], taken);
      if (status != Status::kOk) {
        return status;
      }
      record.innovation[static_cast<std::size_t>(i)] = taken.innovation;
      ++(taken.used ? record.rows_used : record.rows_rejected);
    }
    return Status::kOk;
  }

  /// Row i of the problem: ten columns of the last link, then Coulomb and viscous of the last joint.
  Row row(const LinkRegressor<Scalar, N>& Y, const Vector& qd, int i) const noexcept {
    Row w{};
    for (int c = 0; c < kParametersPerLink; ++c) {
      w[static_cast<std::size_t>(c)] = Y(i, kParametersPerLink * (N - 1) + c);
    }
    if (i == N - 1) {
      w[10] = velocity_sign(qd[i], config_.sign_width);
      w[11] = qd[i];
    }
    return w;
  }

  /// What was added: ten inertial parameters about the last link frame.
  InertialParameters<Scalar> payload() const noexcept {
    InertialParameters<Scalar> p{};
    for (std::size_t i = 0; i < 10; ++i) {
      p[i] = estimator_.solution()[i];
    }
    return p;
  }
  Scalar coulomb_change() const noexcept { return estimator_.solution()[10]; }
  Scalar viscous_change() const noexcept { return estimator_.solution()[11]; }

  /// Standard deviation of parameter i (0..11) for white residuals of the configured size.
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
  Config config_{};
  Row prior_variance_{};
  Estimator estimator_;
};

}  // namespace heft
