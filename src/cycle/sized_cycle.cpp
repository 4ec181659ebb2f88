#include "sized_cycle.hpp"

#include <algorithm>
#include <cstddef>

#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/host/error.hpp"
#include "heft/model/run_time_arm.hpp"
#include "heft/model/sized.hpp"
#include "heft/monitor/sized_thresholds.hpp"

namespace heft::cycle {
namespace {

/// Width of friction's sign with which thresholds of contacts are learnt [rad/s, m/s], see ContactMonitor::update.
constexpr double kSignWidthOfThresholds = 0.01;

void check(Status status, const model::Robot& robot, const char* what) {
  if (status == Status::kOk) return;
  throw ModelError("robot \"" + robot.name + "\": " + what + " refuses it: " + to_string(status) +
                   "; expected finite numbers and masses above 0");
}

template <int N>
class SizedCycle final : public Cycle::Sized {
  using Vector = JointVector<double, N>;
  using Torque = ArmTorque<model::ModelOf<N>, double>;
  using Load = LoadObserver<model::ModelOf<N>, double>;
  using Contact = ContactMonitor<double, N>;

 public:
  SizedCycle(const model::Robot& robot, const model::Robot& measured,
             const std::optional<monitor::Thresholds>& thresholds, bool follow_load)
      : watches_(thresholds.has_value()), follow_load_(follow_load) {
    check(torque_.configure(model::to_arm_model<N>(robot)), robot, "the inverse dynamics");
    model::add_parts(robot, torque_);
    typename Load::Config load;
    load.explains = true;
    if (watches_) {
      load.sign_width = kSignWidthOfThresholds;
      typename Contact::Config contact;
      contact.thresholds = monitor::sized_thresholds<N>(*thresholds);
      check(contact_.configure(contact), robot, "the contact monitor");
    }
    check(load_.configure(model::to_arm_model<N>(measured), load), measured, "the load observer");
    model::add_parts(measured, load_);
    fresh_ = load_;
  }

  int num_joints() const noexcept override { return N; }
  bool watches_contacts() const noexcept override { return watches_; }

  void reset() noexcept override {
    torque_.reset();
    static_cast<void>(torque_.set_payload({}));
    load_ = fresh_;
    contact_.reset();
    known_ = {};
  }

  Status inverse_dynamics(const double* q, const double* qd, const double* qdd, double period,
                          double* tau) noexcept override {
    Vector torque;
    const Status status = torque_.update(period, vector(q), vector(qd), vector(qdd), torque);
    if (status == Status::kOk) std::copy(torque.begin(), torque.end(), tau);
    return status;
  }

  Status update(const double* q, const double* qd, const double* tau, double period,
                Output& out) noexcept override {
    typename Load::Record seen;
    const Vector measured = vector(tau);
    if (const Status status = load_.update(vector(q), vector(qd), measured, period, seen);
        status != Status::kOk)
      return status;
    if (seen.estimated || seen.changed) known_ = load_.estimate();
    if (follow_load_) static_cast<void>(torque_.set_payload(load_.load()));  // a body that can exist
    out = Output{};
    say_load(seen, out);
    if (!load_.explained().valid) return Status::kOk;
    out.explained = true;
    Eigen::Map<Vector>(out.model_torque.data()) = load_.explained().torque;
    Eigen::Map<Vector>(out.residual.data()) = measured - load_.explained().torque;
    if (watches_) say_contact(measured, seen.changed, out);
    return Status::kOk;
  }

 private:
  static Vector vector(const double* values) noexcept { return Eigen::Map<const Vector>(values); }

  void say_load(const typename Load::Record& seen, Output& out) noexcept {
    out.load_state = seen.state;
    out.load_changed = seen.changed;
    out.mass = known_.value[kMass];
    out.mass_std = known_.std[kMass];
    out.com = known_.com;
  }

  void say_contact(const Vector& measured, bool load_changed, Output& out) noexcept {
    // What the flange carries is the observer's business. But what touches the arm may look like another load to it: a contact
    // under way lasts until the residual is quiet, which it is when a load explains it.
    if (load_changed && !contact_.contact()) contact_.reset();
    // Refused after a gap, for instance: nothing is judged then.
    if (contact_.update(load_.explained(), measured, record_) != Status::kOk) return;
    out.contact_judged = record_.judged;
    out.contact = record_.contact;
    out.contact_joint = record_.joint;
    out.contact_direction = record_.direction;
  }

  Torque torque_;
  Load load_, fresh_;
  Contact contact_;
  typename Contact::Record record_;
  LoadEstimate<double> known_;
  bool watches_, follow_load_;
};

}  // namespace

std::unique_ptr<Cycle::Sized> make_sized(const model::Robot& robot, const model::Robot& measured,
                                         const std::optional<monitor::Thresholds>& thresholds,
                                         bool follow_load) {
  return model::with_joint_count(
      robot.num_joints(), robot.name, [&](auto size) -> std::unique_ptr<Cycle::Sized> {
        return std::make_unique<SizedCycle<decltype(size)::value>>(robot, measured, thresholds, follow_load);
      });
}

}  // namespace heft::cycle
