// What estimators of drifting friction and of a whole arm cost a sample.
#include <memory>
#include <vector>

#include "heft/core/control/arm_controllers.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/estimate/directional_least_squares.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/unscented_kalman_filter.hpp"
#include "heft/host/error.hpp"
#include "operation_count.hpp"

namespace heft::bench {

namespace {

/// Samples that are counted: a second of the log, after which every sample costs what those before it did.
constexpr std::size_t kCounted = 200;

template <typename Scalar>
ArmModel<Scalar, kN> arm_with_rotors() {
  ArmModel<Scalar, kN> model = converted<Scalar>(Description::kModel);
  for (auto& joint : model.actuation) joint.rotor_inertia = Scalar(0.3);
  return model;
}

/// @tparam Filter  of a scalar
template <template <typename> class Filter>
Result filter_sample(const char* name) {
  Result result{name, false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    const auto filter = std::make_unique<Filter<Scalar>>();
    typename Filter<Scalar>::Config config;
    config.period = Scalar(0.005);
    if (filter->configure(config, arm_with_rotors<Scalar>()) != Status::kOk) {
      throw Error("operation count: a Kalman filter refused its settings");
    }
    for (std::size_t k = 0; k < kCounted; ++k) {
      const Sample& s = samples()[k];
      typename Filter<Scalar>::Record record;
      Status status = Status::kOk;
      const OperationCount sample = counted([&] {
        status = filter->update(vector_of<Scalar>(s.q), vector_of<Scalar>(s.qd), vector_of<Scalar>(s.tau),
                                Scalar(0.005), record);
      });
      if (status != Status::kOk) throw Error("operation count: a sample of a Kalman filter was refused");
      if constexpr (std::is_same_v<Scalar, Counted>) note_sample(result, sample);
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(filter->coulomb(i)));
  };
  static_cast<void>(run_in_both(result, drive));
  return result;
}

template <typename Scalar>
using Extended = ExtendedKalmanFilter<Scalar, kN>;
template <typename Scalar>
using Unscented = UnscentedKalmanFilter<Scalar, kN>;

}  // namespace

Result extended_sample() { return filter_sample<Extended>("extended Kalman filter"); }
Result unscented_sample() { return filter_sample<Unscented>("unscented Kalman filter"); }

Result directional_sample() {
  Result result{"directional least squares", false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    using Estimator = DirectionalLeastSquares<Scalar, 12, kN>;
    const auto estimator = std::make_unique<Estimator>();
    typename Estimator::Row prior{}, variance;
    variance.fill(Scalar(1));
    if (estimator->configure({}, prior, variance) != Status::kOk) {
      throw Error("operation count: directional least squares refused its settings");
    }
    for (std::size_t k = 0; k < kCounted; ++k) {
      // Each row of a motion of its own: rows in the span of the others would cost less.
      typename Estimator::Sample rows{};
      typename Estimator::Values torque{};
      for (std::size_t i = 0; i < kN; ++i) {
        const Sample& s = samples()[(k + 37 * i) % kCounted];
        for (std::size_t p = 0; p < 12; ++p)
          rows[i][p] = Scalar(p < 6 ? s.measured[p] * s.q[i] : s.qd[p - 6] + s.q[i]);
        torque[i] = Scalar(s.tau[i]);
      }
      typename Estimator::Record record;
      Status status = Status::kOk;
      const OperationCount sample = counted([&] { status = estimator->update(rows, torque, record); });
      if (status != Status::kOk) throw Error("operation count: a sample of least squares was refused");
      if constexpr (std::is_same_v<Scalar, Counted>) note_sample(result, sample);
    }
    for (const Scalar& value : estimator->solution()) last.push_back(number(value));
  };
  static_cast<void>(run_in_both(result, drive));
  return result;
}

Result arm_estimating_sample() {
  Result result{"controller that estimates the arm", false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    using Controller = ArmEstimatingController<RunTimeArm<kN, 2, 1>, Scalar>;
    const auto controller = std::make_unique<Controller>();
    if (controller->configure(arm_with_rotors<Scalar>()) != Status::kOk) {
      throw Error("operation count: the controller refused its settings");
    }
    typename Controller::Vector torque = Controller::Vector::Zero();
    for (std::size_t k = 0; k < kCounted; ++k) {
      const Sample& s = samples()[k];
      typename Controller::Reference reference{vector_of<Scalar>(s.q), vector_of<Scalar>(s.qd),
                                               vector_of<Scalar>(s.instrument)};
      typename Controller::Measurement measured;
      measured.q = reference.q;
      measured.qd = reference.qd;
      measured.tau = vector_of<Scalar>(s.tau);
      measured.dt = Scalar(0.005);
      Status status = Status::kOk;
      const OperationCount sample = counted([&] {
        const auto step = controller->step(reference, measured);
        status = step.status;
        torque = step.torque;
      });
      if (status != Status::kOk) throw Error("operation count: a cycle of the controller was refused");
      if constexpr (std::is_same_v<Scalar, Counted>) note_sample(result, sample);
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(torque[i]));
  };
  static_cast<void>(run_in_both(result, drive));
  return result;
}

}  // namespace heft::bench
