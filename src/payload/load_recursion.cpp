#include "load_recursion.hpp"

#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/model/sized.hpp"

namespace heft::payload {
namespace {

template <int N>
class SizedLoadRecursion final : public Recursion {
  using Estimator = PayloadEstimator<double, N, N>;

 public:
  SizedLoadRecursion(const model::Dynamics& dynamics, double cutoff, double sample_rate)
      : signals_(dynamics, cutoff, sample_rate) {}

  Status configure(const RecursionSettings& settings) override {
    typename Estimator::Config config;
    config.first_row = settings.first_row;
    config.noise_std = settings.noise_std;
    config.correlated_samples = settings.correlated_samples;
    config.gate = settings.gate;
    // One load a segment; changes are the change detector's.
    config.forgetting_factor = 1.0;
    config.gate_widening = 0.0;
    config.standstill_speed = settings.standstill_speed;
    config.estimate_friction = settings.estimate_friction;
    config.friction_prior = settings.friction_prior;
    scale_ = settings.drive_scale;
    return estimator_.configure(config);
  }
  void restart() override { estimator_.restart(); }
  Taken take(const data::Log& log, Eigen::Index k) override { return signals_.take(log, k); }
  Status update(const Eigen::VectorXd& x, Innovation& out) override {
    const auto Y = signals_.regressor();
    const JointVector<double, N> residual = signals_.tau() - Y * x;
    // What the arm itself needs was fitted to torque as measured; what the load adds is s times as large there.
    links_ = scale_.asDiagonal() * Y.template leftCols<10 * N>();
    for (int i = 0; i < N; ++i) {
      qd_[i] = signals_.velocity(i);
      sign_[i] = signals_.sign(i);
    }
    typename Estimator::Record record;
    const Status status = estimator_.update(links_, qd_, sign_, residual, record);
    out.residual = residual;
    out.value = Eigen::Map<const JointVector<double, N>>(record.innovation.data());
    out.variance = Eigen::Map<const JointVector<double, N>>(record.innovation_variance.data());
    out.used.assign(record.used.begin(), record.used.end());
    return status;
  }
  Eigen::VectorXd row(int i) const override {
    const auto row = estimator_.row(links_, qd_, sign_, i);
    return Eigen::Map<const Eigen::VectorXd>(row.data(), Estimator::kParameters);
  }
  Eigen::VectorXd arm_row(int i) const override { return signals_.regressor().row(i).transpose(); }
  double prior_variance(int i) const override { return estimator_.estimator().variance(i); }
  double mass() const override { return estimator_.payload()[0]; }
  double mass_std() const override { return estimator_.standard_deviation(0); }

 private:
  CausalSignals<N> signals_;
  Estimator estimator_;
  LinkRegressor<double, N> links_;
  JointVector<double, N> qd_, sign_, scale_;
};

}  // namespace

std::unique_ptr<Recursion> make_recursion(const model::Dynamics& dynamics, double cutoff,
                                          double sample_rate) {
  return model::with_joint_count(
      dynamics.num_joints(), dynamics.robot().name, [&](auto joints) -> std::unique_ptr<Recursion> {
        return std::make_unique<SizedLoadRecursion<decltype(joints)::value>>(dynamics, cutoff, sample_rate);
      });
}

}  // namespace heft::payload
