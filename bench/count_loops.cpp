// What the loops of a controller cost a sample: facades of core in their steady state.
#include <vector>

#include "heft/core/control/adaptive_controller.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/host/error.hpp"
#include "operation_count.hpp"

namespace heft::bench {

namespace {

/// Thresholds that any motion exceeds: the load of a contact is looked into where the monitor does that.
template <typename Scalar>
typename ContactMonitor<Scalar, kN>::Config watched_closely() {
  typename ContactMonitor<Scalar, kN>::Config config;
  config.thresholds.joints.fill(JointThreshold<Scalar>::uniform(Scalar(1e-3), Scalar(0)));
  return config;
}

}  // namespace

OperationCount computed_torque_cost() {
  using Arm = ArmOf<Counted>;
  const Sample& s = samples()[100];
  const auto q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd), a = vector_of<Counted>(s.instrument);
  const auto parameters = nominal<Counted>();
  typename Arm::Vector tau;
  return counted([&] { inverse_dynamics<Arm>(parameters, joint_trigonometry<Arm>(q), q, qd, a, tau); });
}

OperationCount monitor_cost() {
  using Arm = ArmOf<Counted>;
  using Vector = typename Arm::Vector;
  ContactMonitor<Counted, kN> monitor;
  const auto parameters = nominal<Counted>();
  OperationCount worst;
  if (monitor.configure(watched_closely<Counted>()) != Status::kOk) return worst;
  for (const Sample& s : samples()) {
    const Vector q = vector_of<Counted>(s.q), qd = vector_of<Counted>(s.qd), tau = vector_of<Counted>(s.tau);
    const OperationCount now = counted([&] {
      const auto trig = joint_trigonometry<Arm>(q);
      LagrangianTerms<Counted, kN> terms;
      LoadColumns<Counted, kN> columns = LoadColumns<Counted, kN>::Zero();
      typename ContactMonitor<Counted, kN>::Record record;
      lagrangian_terms<Arm>(parameters, trig, q, qd, terms);
      if (monitor.wants_load_columns()) load_columns<Arm>(trig, q, columns);
      if (monitor.update(terms, columns, qd, tau, Vector::Zero(), Counted(0.005), record) != Status::kOk) {
        throw Error("operation count: a sample of the monitor was refused");
      }
    });
    if (now.mul + now.add > worst.mul + worst.add) worst = now;
  }
  return worst;
}

Result control_sample(bool watched) {
  Result result{"control sample", false, false, {}, 0, {}, {}, true, 0};
  OperationCount observing, watching, torque_cost;
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    LoadObserver<Description, Scalar> observer;
    ArmTorque<Description, Scalar> arm;
    JointFeedback<Scalar, kN> feedback;
    typename LoadObserver<Description, Scalar>::Config config;
    config.rows_per_sample = 1;
    config.update_rate = Scalar(20.0);  // of 200 Hz
    config.explains = watched;
    ContactMonitor<Scalar, kN> monitor;
    typename ContactMonitor<Scalar, kN>::Record contact;
    if (watched && monitor.configure(watched_closely<Scalar>()) != Status::kOk) {
      throw Error("operation count: the monitor refused its settings");
    }
    if (observer.configure(config) != Status::kOk || arm.configure() != Status::kOk ||
        feedback.configure({vector_of<Scalar>({400, 400, 400, 400, 400, 400}),
                            vector_of<Scalar>({40, 40, 40, 40, 40, 40})}) != Status::kOk) {
      throw Error("operation count: the loop refused its settings");
    }
    JointVector<Scalar, kN> tau;
    bool new_load = false;
    for (const Sample& s : samples()) {
      typename LoadObserver<Description, Scalar>::Record record;
      const auto q = vector_of<Scalar>(s.q), qd = vector_of<Scalar>(s.qd);
      Status status = Status::kOk;
      const OperationCount observer_cost =
          counted([&] { status = observer.update(q, qd, vector_of<Scalar>(s.tau), Scalar(0.005), record); });
      const OperationCount monitor_cost = counted([&] {
        if (status == Status::kOk && observer.explained().valid) {
          status = monitor.update(observer.explained(), vector_of<Scalar>(s.tau), contact);
        }
      });
      const OperationCount own = counted([&] {
        if (new_load) {
          status = status == Status::kOk ? arm.set_payload(observer.load()) : status;
        }
        new_load = record.estimated;
        const JointReference<Scalar, kN> reference{q, qd, vector_of<Scalar>(s.instrument)};
        status = status == Status::kOk
                     ? arm.update(Scalar(0.005), q, qd,
                                  commanded_acceleration<Scalar, kN>(feedback, reference, q, qd), tau)
                     : status;
      });
      if (status != Status::kOk) {
        throw Error("operation count: a sample of the loop was refused");
      }
      if constexpr (std::is_same_v<Scalar, Counted>) {
        OperationCount sample = observer_cost;
        sample += monitor_cost;
        sample += own;
        watching += monitor_cost;
        note_sample(result, sample);
        observing += observer_cost;
        torque_cost += own;
      }
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(tau[i]));
    last.push_back(number(observer.load()[kMass]));
    last.push_back(number(contact.residual[kN - 1]));
  };
  static_cast<void>(run_in_both(result, drive));
  result.stages = {{"load_observer", observing}, {"contact_monitor", watching}, {"arm_torque", torque_cost}};
  return result;
}

Result controller_sample() {
  Result result{"controller", false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    TerminalLinkController<Description, Scalar, 4> controller;
    typename TerminalLinkController<Description, Scalar, 4>::Config config;
    config.update_rate = Scalar(40.0);  // of 200 Hz
    if (controller.configure(config) != Status::kOk) {
      throw Error("operation count: the controller refused its settings");
    }
    JointVector<Scalar, kN> tau;
    for (const Sample& s : samples()) {
      typename TerminalLinkController<Description, Scalar, 4>::Record record;
      const auto q = vector_of<Scalar>(s.q);
      const JointReference<Scalar, kN> reference{q, vector_of<Scalar>(s.qd), vector_of<Scalar>(s.instrument)};
      Status status = Status::kOk;
      const OperationCount sample = counted([&] {
        status = controller.update(reference, q, vector_of<Scalar>(s.tau), Scalar(0.005), tau, record);
      });
      if (status != Status::kOk) {
        throw Error("operation count: a cycle of the controller was refused");
      }
      if constexpr (std::is_same_v<Scalar, Counted>) {
        note_sample(result, sample);
      }
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(tau[i]));
  };
  static_cast<void>(run_in_both(result, drive));
  return result;
}

Result adaptive_sample() {
  Result result{"adaptive controller", false, false, {}, 0, {}, {}, true, 0};
  const auto drive = [&]<typename Scalar>(Scalar, std::vector<double>& last) {
    AdaptiveController<Scalar, kN> controller;
    if (controller.configure({}, converted<Scalar>(Description::kModel)) != Status::kOk) {
      throw Error("operation count: the adaptive controller refused its settings");
    }
    JointVector<Scalar, kN> tau;
    for (const Sample& s : samples()) {
      typename AdaptiveController<Scalar, kN>::Record record;
      const auto q = vector_of<Scalar>(s.q), qd = vector_of<Scalar>(s.qd);
      // A little behind its reference, so that it adapts.
      JointReference<Scalar, kN> reference{q, qd, vector_of<Scalar>(s.instrument)};
      reference.q += JointVector<Scalar, kN>::Constant(Scalar(0.01));
      Status status = Status::kOk;
      const OperationCount sample = counted([&] {
        status =
            controller.update(reference, q, qd, JointVector<Scalar, kN>::Zero(), Scalar(0.005), tau, record);
      });
      if (status != Status::kOk) {
        throw Error("operation count: a cycle of the adaptive controller was refused");
      }
      if constexpr (std::is_same_v<Scalar, Counted>) {
        note_sample(result, sample);
      }
    }
    for (int i = 0; i < kN; ++i) last.push_back(number(tau[i]));
    last.push_back(number(controller.load()[kMass]));
  };
  static_cast<void>(run_in_both(result, drive));
  return result;
}

}  // namespace heft::bench
