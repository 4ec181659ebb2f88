#include "causal_sample.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "core_settings.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/host/error.hpp"
#include "heft/model/sized.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// Poles of the low-pass that gives velocity where the log has none [Hz]; delay 16 ms. Half of it leaves twice the delay,
/// twice of it eight times the noise of a coarse encoder.
constexpr double kVelocityPole = 30.0;
/// Width of friction's sign [rad/s, m/s]: a joint that rests while others move rattles by some mrad/s, and friction that
/// turned round with that would hide a touch (10 N·m on the first joint of a UR10e).
constexpr double kSignWidth = 0.01;

/// Rigid, and with its torque on time.
model::Robot stiff(const model::Robot& robot) {
  model::Robot arm = robot;
  arm.elasticities.clear();
  arm.torque_delay = 0.0;
  return arm;
}

}  // namespace

class SampleFilter::Sized {
 public:
  virtual ~Sized() = default;
  virtual void update(Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& tau, double period) = 0;
};

namespace {

template <int N>
class FilterOf : public SampleFilter::Sized {
 public:
  FilterOf() {
    if (position_.configure(kVelocityPole) != Status::kOk || torque_.configure(kVelocityPole) != Status::kOk)
      throw Error("monitor: the low-pass of the velocity refuses its pole");
  }

  void update(Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& tau, double period) override {
    const JointVector<double, N> q_now = q, tau_now = tau;
    // Refused is what the checks of a log refuse before: numbers that are not finite, time that stands.
    if (position_.update(q_now, period) == Status::kOk && torque_.update(tau_now, period) == Status::kOk) {
      q_ = position_.value();
      qd_ = position_.derivative();
      tau_ = torque_.value();
    }
    q = q_;
    qd = qd_;
    tau = tau_;
  }

 private:
  StateVariableFilter<double, N> position_, torque_;
  JointVector<double, N> q_ = JointVector<double, N>::Zero(), qd_ = q_, tau_ = q_;
};

}  // namespace

SampleFilter::SampleFilter(const model::Robot& robot) {
  model::with_joint_count(robot.num_joints(), robot.name, [&](auto size) {
    sized_ = std::make_unique<FilterOf<decltype(size)::value>>();
    return 0;
  });
}
SampleFilter::~SampleFilter() = default;

void SampleFilter::update(Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& tau, double period) {
  sized_->update(q, qd, tau, period);
}

SampleFriction::SampleFriction(const model::Robot& robot, double begin)
    : dynamics_(stiff(robot)), predictor_(stiff(robot), begin, {.sign_width = kSignWidth}) {}

Eigen::MatrixXd SampleFriction::rows(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                     const Eigen::MatrixXd& qd) {
  const Eigen::MatrixXd rest = Eigen::MatrixXd::Zero(q.rows(), q.cols());
  Eigen::MatrixXd torque = predictor_.rows(validate::MotionRows{time, q, qd, rest, {}, {}});
  for (Index k = 0; k < torque.rows(); ++k)
    torque.row(k) -= dynamics_.inverse_dynamics(q.row(k), qd.row(k), rest.row(k)).transpose();
  return torque;
}

class SampleMonitor::Sized {
 public:
  virtual ~Sized() = default;
  virtual Status update(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& tau,
                        const Eigen::VectorXd& friction, double period, SampleRecord& record) = 0;
};

namespace {

template <int N>
class MonitorOf : public SampleMonitor::Sized {
 public:
  MonitorOf(const model::Robot& robot, const Thresholds& thresholds, double period)
      : arm_(model::to_arm_model<N>(robot)) {
    typename ContactMonitor<double, N>::Config config;
    config.thresholds = sized_thresholds<N>(thresholds);
    config.motor_inertia = motor_inertia_of(robot);
    config.longest_period = longest_period(period);
    if (const Status status = core_.configure(config); status != Status::kOk) {
      throw ModelError(fmt::format(
          "robot \"{}\": thresholds of contacts: {}; expected those that heft monitor --learn writes",
          robot.name, to_string(status)));
    }
  }

  Status update(const Eigen::VectorXd& q_now, const Eigen::VectorXd& qd_now, const Eigen::VectorXd& tau,
                const Eigen::VectorXd& friction, double period, SampleRecord& record) override {
    const JointVector<double, N> q = q_now, qd = qd_now;
    const auto trig = joint_trigonometry<DynamicArm<double, N>>(q);
    lagrangian_terms(arm_, trig, q, qd, terms_);
    if (core_.wants_load_columns()) load_columns(arm_, trig, q, columns_);
    const Status status = core_.update(terms_, columns_, qd, tau, friction, period, record_);
    record.deviation = record_.deviation;
    record.threshold = record_.threshold;
    record.residual = record_.residual;
    record.level_threshold = record_.level_threshold;
    record.change = record_.change;
    record.change_threshold = record_.change_threshold;
    record.judged = record_.judged;
    record.contact = record_.contact;
    record.joint = record_.joint;
    record.direction = record_.direction;
    record.event = record_.event;
    record.load = record_.load;
    return status;
  }

 private:
  DynamicArm<double, N> arm_;
  ContactMonitor<double, N> core_;
  typename ContactMonitor<double, N>::Record record_;
  LagrangianTerms<double, N> terms_;
  LoadColumns<double, N> columns_ = LoadColumns<double, N>::Zero();
};

}  // namespace

SampleMonitor::SampleMonitor(const model::Robot& robot, const Thresholds& thresholds, double period) {
  model::with_joint_count(robot.num_joints(), robot.name, [&](auto size) {
    sized_ = std::make_unique<MonitorOf<decltype(size)::value>>(robot, thresholds, period);
    return 0;
  });
}
SampleMonitor::~SampleMonitor() = default;

Status SampleMonitor::update(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& tau,
                             const Eigen::VectorXd& friction, double period, SampleRecord& record) {
  return sized_->update(q, qd, tau, friction, period, record);
}

void check_joints(const Thresholds& thresholds, const model::Robot& robot) {
  if (thresholds.joints.size() == robot.joints.size()) return;
  throw ModelError(fmt::format("thresholds of contacts: found {} joints; expected {}, as robot \"{}\" has",
                               thresholds.joints.size(), robot.joints.size(), robot.name));
}

OpenContact::OpenContact(double time, const Eigen::VectorXd& deviation, const Eigen::VectorXd& threshold)
    : above_(static_cast<std::size_t>(deviation.size()), 0) {
  contact_.begin = time;
  double most = 0.0;
  for (Index j = 0; j < deviation.size(); ++j) {
    const double share = std::abs(deviation[j]) / threshold[j];
    if (share > most) {
      most = share;
      contact_.joint = static_cast<int>(j);
      contact_.direction = deviation[j] < 0 ? -1 : 1;
    }
  }
  add(time, deviation, threshold);
}

void OpenContact::add(double time, const Eigen::VectorXd& deviation, const Eigen::VectorXd& threshold) {
  contact_.end = time;
  contact_.peak = std::max(contact_.peak, std::abs(deviation[contact_.joint]));
  for (Index j = 0; j < deviation.size(); ++j) {
    char& above = above_[static_cast<std::size_t>(j)];
    above = static_cast<char>(above != 0 || std::abs(deviation[j]) > threshold[j]);
  }
}

Contact OpenContact::contact() const {
  Contact contact = contact_;
  for (std::size_t j = 0; j < above_.size(); ++j) {
    if (above_[j] != 0) contact.joints.push_back(static_cast<int>(j));
  }
  return contact;
}

}  // namespace heft::monitor
