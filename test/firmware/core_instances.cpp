// Every public template of core, instantiated for float and double and 6 and 7 joints, so that the symbol and
// stack gates see header-only code too.
#include "arms.hpp"
#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/adaptive_controller.hpp"
#include "heft/core/control/arm_controllers.hpp"
#include "heft/core/control/controller_switch.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/control/terminal_link_cycle.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/lagrangian.hpp"
#include "heft/core/dynamics/lumped_regressor.hpp"
#include "heft/core/dynamics/reference_dynamics.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/estimate/covariance_recursion.hpp"
#include "heft/core/estimate/directional_least_squares.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/factored_equations.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/estimate/unscented_kalman_filter.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/kinematics/geometric_jacobian.hpp"
#include "heft/core/kinematics/joint_deflection.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/core/pack.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/status.hpp"
#include "heft/core/symmetric_eigen.hpp"

namespace heft::firmware {

template <typename Scalar, int N>
struct DynamicInstances {
  using Arm = DynamicArm<Scalar, N>;
  using Trig = JointTrigonometry<Arm>;
  using Vector = JointVector<Scalar, N>;

  static void set_model(Arm& arm, const ArmModel<Scalar, N>& model) { arm.set_model(model); }
  static void set_link(Arm& arm, int link, const InertialParameters<Scalar>& parameters) {
    arm.set_link(link, parameters);
  }
  static void trigonometry(const Vector& q, Trig& trig) { trig = joint_trigonometry<Arm>(q); }
  static void torque(const Arm& arm, const Trig& trig, const Vector& q, const Vector& qd, const Vector& qdd,
                     Vector& tau) {
    inverse_dynamics(arm, trig, q, qd, qdd, tau);
  }
  static void gravity(const Arm& arm, const Trig& trig, const Vector& q, Vector& tau) {
    gravity_torque(arm, trig, q, tau);
  }
  static void bias(const Arm& arm, const Trig& trig, const Vector& q, const Vector& qd, Vector& tau) {
    bias_torque(arm, trig, q, qd, tau);
  }
  static void mass(const Arm& arm, const Trig& trig, const Vector& q, MassMatrix<Scalar, N>& matrix) {
    mass_matrix(arm, trig, q, matrix);
  }
  static void lagrangian(const Arm& arm, const Trig& trig, const Vector& q, const Vector& qd,
                         LagrangianTerms<Scalar, N>& terms, LoadColumns<Scalar, N>& columns) {
    lagrangian_terms(arm, trig, q, qd, terms);
    load_columns(arm, trig, q, columns);
  }
  static Status acceleration(const MassMatrix<Scalar, N>& matrix, const Vector& bias, const Vector& rotor,
                             const Vector& tau, Vector& qdd) {
    return forward_dynamics<Scalar, N>(matrix, bias, rotor, tau, qdd);
  }
  static void links(const Arm& arm, const Trig& trig, const Vector& q, const Vector& qd, const Vector& qdd,
                    LinkRegressor<Scalar, N>& Y) {
    link_regressor(arm, trig, q, qd, qdd, Y);
  }
  static void full(const Arm& arm, const Vector& q, const Vector& qd, const Vector& qdd, Scalar sign_width,
                   FullRegressor<Scalar, N>& Y) {
    full_regressor(arm, q, qd, qdd, sign_width, Y);
  }
  static void lumped(const LinkRegressor<Scalar, N>& Y, const Vector& qd, Scalar sign_width,
                     LumpedRegressor<Scalar, N>& W) {
    lumped_regressor<Scalar, N>(Y, qd, sign_width, W);
  }
  static void lumps(const ArmModel<Scalar, N>& arm, LumpedParameters<Scalar, N>& x) {
    x = lumped_parameters(arm);
  }
  static Status control(const JointFeedback<Scalar, N>& feedback, const Arm& arm,
                        const FrictionFeedForward<Scalar, N>& friction,
                        const JointReference<Scalar, N>& reference, const Vector& q, const Vector& qd,
                        Vector& tau, ControlRecord& record) {
    return computed_torque<Scalar, N>(feedback, arm, friction, reference, q, qd, tau, record);
  }
  static Status position_velocity(const JointFeedback<Scalar, N>& feedback, const Arm& arm, bool with_gravity,
                                  const JointReference<Scalar, N>& reference, const Vector& q,
                                  const Vector& qd, Vector& tau, ControlRecord& record) {
    return pd_control<Scalar, N>(feedback, arm, with_gravity, reference, q, qd, tau, record);
  }
  static Scalar friction(const JointActuation<Scalar>& joint, Scalar velocity, Scalar sign_width) {
    return friction_torque(joint, velocity, sign_width);
  }
  using Effects = EffectFeedForward<Scalar, N, 8>;
  static Status set_effects(Effects& effects, const std::array<JointEffect<double>, 8>& found) {
    return effects.configure(found);
  }
  static Status effects(Effects& effects, Scalar time, const Vector& q, const Vector& qd, const Vector& qdd,
                        const Vector& load, const ArmModel<Scalar, N>& arm, Scalar sign_width, Vector& tau) {
    return effects.add_torque(time, q, qd, qdd, load, arm.actuation, sign_width, tau);
  }
};

template <typename Scalar, int N>
struct StaticsInstances {
  using Vector = JointVector<Scalar, N>;
  using Jacobian = GeometricJacobian<Scalar, N>;

  static void kinematics(const ArmModel<Scalar, N>& arm, const ToolFrame<Scalar>& tool, const Vector& q,
                         ChainKinematics<Scalar, N>& chain) {
    chain = chain_kinematics(arm, tool, q);
  }
  static void jacobian(const ChainKinematics<Scalar, N>& chain, Jacobian& J) {
    J = geometric_jacobian(chain);
  }
  static void jacobian_in_tool(const ChainKinematics<Scalar, N>& chain, Jacobian& J) {
    J = in_frame(chain.rotation, geometric_jacobian(chain));
  }
  static void torque(const Jacobian& J, const ToolWrench<Scalar>& wrench, Vector& tau) {
    tau = joint_torque(J, wrench);
  }
  static void complementary(const ChainKinematics<Scalar, N>& chain, const ToolWrench<Scalar>& wrench,
                            WrenchFrame frame, MassMatrix<Scalar, N>& K) {
    K = complementary_stiffness(chain, wrench, frame);
  }
  static void compliance(const Jacobian& J, const Vector& joints, Eigen::Matrix<Scalar, 6, 6>& C) {
    C = cartesian_compliance(J, joints);
  }
  static Status deflection(const Vector& tau, const Vector& stiffness, Vector& deflection) {
    return joint_deflection<Scalar, N>(tau, stiffness, deflection);
  }
  static Status command(const Vector& desired, const Vector& tau, const Vector& stiffness, Vector& command) {
    return compensated_command<Scalar, N>(desired, tau, stiffness, command);
  }
};

template <typename Scalar, typename Description>
struct StaticInstances {
  using Arm = StaticArm<Scalar, Description>;
  using Trig = JointTrigonometry<Arm>;
  using Vector = typename Arm::Vector;
  static constexpr int kN = Arm::kNumJoints;
  using Constant = ConstantParameters<Scalar, Description>;
  using Reduced = ReducedParameters<Scalar, Description>;

  template <typename Parameters>
  struct With {
    static void torque(const Parameters& parameters, const Trig& trig, const Vector& q, const Vector& qd,
                       const Vector& qdd, Vector& tau) {
      inverse_dynamics<Arm>(parameters, trig, q, qd, qdd, tau);
    }
    static void gravity(const Parameters& parameters, const Trig& trig, const Vector& q, Vector& tau) {
      gravity_torque<Arm>(parameters, trig, q, tau);
    }
    static void bias(const Parameters& parameters, const Trig& trig, const Vector& q, const Vector& qd,
                     Vector& tau) {
      bias_torque<Arm>(parameters, trig, q, qd, tau);
    }
    static void lagrangian(const Parameters& parameters, const Trig& trig, const Vector& q, const Vector& qd,
                           LagrangianTerms<Scalar, kN>& terms) {
      lagrangian_terms<Arm>(parameters, trig, q, qd, terms);
    }
    static Status position_velocity(const JointFeedback<Scalar, kN>& feedback, const Parameters& parameters,
                                    bool with_gravity, const JointReference<Scalar, kN>& reference,
                                    const Vector& q, const Vector& qd, Vector& tau, ControlRecord& record) {
      return pd_control<Arm>(feedback, parameters, with_gravity, reference, q, qd, tau, record);
    }
    static Status control(const JointFeedback<Scalar, kN>& feedback, const Parameters& parameters,
                          const FrictionFeedForward<Scalar, kN>& friction, const Vector& rotor,
                          const JointReference<Scalar, kN>& reference, const Vector& q, const Vector& qd,
                          Vector& tau, ControlRecord& record) {
      return computed_torque<Arm>(feedback, parameters, friction, rotor, reference, q, qd, tau, record);
    }
    static Status control_with(const JointFeedback<Scalar, kN>& feedback, const Parameters& parameters,
                               const FrictionFeedForward<Scalar, kN>& friction, const Vector& rotor,
                               const JointReference<Scalar, kN>& reference, const Trig& trig, const Vector& q,
                               const Vector& qd, Vector& tau, ControlRecord& record) {
      return computed_torque<Arm>(feedback, parameters, friction, rotor, reference, trig, q, qd, tau, record);
    }
    static Status instrument(const Parameters& parameters, const Trig& trig, const Vector& q,
                             const Vector& qd, const Vector& rotor, const Vector& tau, Vector& acceleration) {
      return predicted_acceleration<Arm>(parameters, trig, q, qd, rotor, tau, acceleration);
    }
    static void mass(const Parameters& parameters, const Trig& trig, const Vector& q,
                     MassMatrix<Scalar, kN>& matrix) {
      mass_matrix<Arm>(parameters, trig, q, matrix);
    }
  };

  static void payload(const Reduced& parameters, const InertialParameters<Scalar>& load, Reduced& corrected) {
    corrected = corrected_for_payload(parameters, load);
  }
  static void trigonometry(const Vector& q, Trig& trig) { trig = joint_trigonometry<Arm>(q); }
  static void links(const Trig& trig, const Vector& q, const Vector& qd, const Vector& qdd,
                    LinkRegressor<Scalar, kN>& Y) {
    link_regressor<Arm>(trig, q, qd, qdd, Y);
  }
  static void load(const Trig& trig, const Vector& q, LoadColumns<Scalar, kN>& columns) {
    load_columns<Arm>(trig, q, columns);
  }
  static void full(const Vector& q, const Vector& qd, const Vector& qdd, Scalar sign_width,
                   FullRegressor<Scalar, kN>& Y) {
    full_regressor<Arm>(q, qd, qdd, sign_width, Y);
  }
};

/// The terminal-link problem from joint First (counted from 0) on.
template <typename Scalar, typename Description, int First>
struct TerminalInstances {
  using Arm = StaticArm<Scalar, Description>;
  using Vector = typename Arm::Vector;
  using Layout = TerminalLayout<Arm, First>;
  using Trig = TerminalTrigonometry<Arm, First>;
  using Rows = TerminalRows<Scalar, Layout>;

  static void trigonometry(const Vector& q, Trig& trig) { trig = terminal_trigonometry<Arm, First>(q); }
  static void sums(const JointTrigonometry<Arm>& own, Trig& trig) {
    trig = terminal_trigonometry<Arm, First>(own);
  }
  static void rows(const Trig& trig, const Vector& q, const Vector& qd, const std::array<Vector, 1>& qdd,
                   Scalar sign_width, std::array<Rows, 1>& rows) {
    terminal_rows<Arm, First, 1>(trig, q, qd, qdd, sign_width, rows);
  }
  static void rows_and_instruments(const Trig& trig, const Vector& q, const Vector& qd,
                                   const std::array<Vector, 2>& qdd, Scalar sign_width,
                                   std::array<Rows, 2>& rows) {
    terminal_rows<Arm, First, 2>(trig, q, qd, qdd, sign_width, rows);
  }
  static void cycle(const ReducedParameters<Scalar, Description>& parameters,
                    const JointTrigonometry<Arm>& joint_trig, const Vector& q, const Vector& qd,
                    const Vector& commanded, const Vector& measured, Scalar sign_width, Vector& tau,
                    std::array<Rows, 2>& rows) {
    inverse_dynamics_with_rows<Arm, First>(parameters, joint_trig, q, qd, commanded, measured, sign_width,
                                           tau, rows);
  }
};

template struct DynamicInstances<float, 6>;
template struct DynamicInstances<double, 7>;

template struct StaticsInstances<float, 6>;
template struct StaticsInstances<double, 7>;

template struct StaticInstances<float, PaperArm>;
template struct StaticInstances<double, SevenJointArm>;

template struct StaticInstances<float, PaperArm>::With<ConstantParameters<float, PaperArm>>;
template struct StaticInstances<float, PaperArm>::With<ReducedParameters<float, PaperArm>>;
template struct StaticInstances<double, SevenJointArm>::With<ConstantParameters<double, SevenJointArm>>;
template struct StaticInstances<double, SevenJointArm>::With<ReducedParameters<double, SevenJointArm>>;

template struct TerminalInstances<double, PaperArm, 0>;
template struct TerminalInstances<float, PaperArm, 4>;
template struct TerminalInstances<double, SevenJointArm, 5>;

#ifdef HEFT_WHOLE_GRID
template struct DynamicInstances<float, 7>;
template struct DynamicInstances<double, 6>;

template struct StaticsInstances<float, 7>;
template struct StaticsInstances<double, 6>;

template struct StaticInstances<float, SevenJointArm>;
template struct StaticInstances<double, PaperArm>;

template struct StaticInstances<float, SevenJointArm>::With<ConstantParameters<float, SevenJointArm>>;
template struct StaticInstances<float, SevenJointArm>::With<ReducedParameters<float, SevenJointArm>>;
template struct StaticInstances<double, PaperArm>::With<ConstantParameters<double, PaperArm>>;
template struct StaticInstances<double, PaperArm>::With<ReducedParameters<double, PaperArm>>;

template struct TerminalInstances<float, PaperArm, 0>;
template struct TerminalInstances<double, PaperArm, 4>;
template struct TerminalInstances<float, PaperArm, 5>;
template struct TerminalInstances<double, PaperArm, 5>;
template struct TerminalInstances<float, SevenJointArm, 5>;
#endif

}  // namespace heft::firmware

// Class templates, with all their members.
namespace heft {

#define HEFT_INSTANTIATE_TERMINAL(Arm, First)                                       \
  template class NormalEquations<Arm::Scalar, TerminalLayout<Arm, First>>;          \
  template class StagedSolver<Arm::Scalar, TerminalLayout<Arm, First>>;             \
  template class CovarianceRecursion<Arm::Scalar, TerminalLayout<Arm, First>>;      \
  template class FactoredEquations<Arm::Scalar, TerminalLayout<Arm, First>, true>;  \
  template class FactoredEquations<Arm::Scalar, TerminalLayout<Arm, First>, false>; \
  template class TerminalLinkEstimator<Arm, First, EstimatorForm::kInformation>;    \
  template class TerminalLinkEstimator<Arm, First, EstimatorForm::kFactored>

#define HEFT_INSTANTIATE_JOINTS(Scalar, N)                                                            \
  template class PayloadEstimator<Scalar, N>;                                                         \
  template class JointAccelerationModel<Scalar, N>;                                                   \
  template class DelayedMean<Scalar, N, 8>;                                                           \
  template class StateVariableFilter<Scalar, N>;                                                      \
  template class MomentumObserver<Scalar, N>;                                                         \
  template class LoadChangeTest<Scalar, N>;                                                           \
  template class ContactDeviation<Scalar, N>;                                                         \
  template class ContactMonitor<Scalar, N>;                                                           \
  template Status ContactMonitor<Scalar, N>::update(const ExplainedTorque<Scalar, N>&,                \
                                                    const JointVector<Scalar, N>&, Record&) noexcept; \
  template class ReferenceDynamics<Scalar, N>;                                                        \
  template class AdaptiveController<Scalar, N>;                                                       \
  template class JointFeedback<Scalar, N>

using SixFloat = StaticArm<float, firmware::PaperArm>;
using SixDouble = StaticArm<double, firmware::PaperArm>;
using SevenFloat = StaticArm<float, firmware::SevenJointArm>;
using SevenDouble = StaticArm<double, firmware::SevenJointArm>;

// k = 1 (the whole arm), k = 5, k = 6.
HEFT_INSTANTIATE_TERMINAL(SixDouble, 0);
HEFT_INSTANTIATE_TERMINAL(SixFloat, 4);
HEFT_INSTANTIATE_TERMINAL(SevenDouble, 5);
#ifdef HEFT_WHOLE_GRID
HEFT_INSTANTIATE_TERMINAL(SixFloat, 0);
HEFT_INSTANTIATE_TERMINAL(SixDouble, 4);
HEFT_INSTANTIATE_TERMINAL(SixFloat, 5);
HEFT_INSTANTIATE_TERMINAL(SixDouble, 5);
HEFT_INSTANTIATE_TERMINAL(SevenFloat, 5);
#endif

/// The facades of the loop.
#define HEFT_INSTANTIATE_FACADES(Scalar, Arm, First)  \
  template class ArmTorque<firmware::Arm, Scalar>;    \
  template class LoadObserver<firmware::Arm, Scalar>; \
  template class TerminalLinkController<firmware::Arm, Scalar, First>

/// The same for an arm known at run time, which takes more in by a template of its own.
#define HEFT_INSTANTIATE_RUN_TIME_FACADES(Scalar)                                                    \
  template class ArmTorque<RunTimeArm<6, 8, 1>, Scalar>;                                             \
  template Status ArmTorque<RunTimeArm<6, 8, 1>, Scalar>::add(const JointEffect<Scalar>&) noexcept;  \
  template Status ArmTorque<RunTimeArm<6, 8, 1>, Scalar>::add(const GearCoupling<Scalar>&) noexcept; \
  template class LoadObserver<RunTimeArm<6, 8, 1>, Scalar, 6>;                                       \
  template Status symmetric_eigen(const Matrix3<Scalar>&, SymmetricEigen<Scalar>&) noexcept;         \
  template Status check_physical(const InertialParameters<Scalar>&) noexcept;                        \
  template Status make_physical(InertialParameters<Scalar>&, Scalar) noexcept

/// The controllers of one interface, and their exchange.
#define HEFT_INSTANTIATE_CONTROLLERS(Scalar, ...)                    \
  template class PdController<__VA_ARGS__, Scalar>;                  \
  template class ComputedTorqueController<__VA_ARGS__, Scalar>;      \
  template class LoadEstimatingController<__VA_ARGS__, Scalar>;      \
  template class AdaptiveArmController<__VA_ARGS__, Scalar>;         \
  template class ControllerSwitch<PdController<__VA_ARGS__, Scalar>, \
                                  ComputedTorqueController<__VA_ARGS__, Scalar>>

#define HEFT_INSTANTIATE_RUN_TIME_CONTROLLERS(Scalar, ...)                                     \
  HEFT_INSTANTIATE_CONTROLLERS(Scalar, __VA_ARGS__);                                           \
  template class ArmEstimatingController<__VA_ARGS__, Scalar>;                                 \
  template Status ArmEstimator<__VA_ARGS__, Scalar>::add(const JointEffect<Scalar>&) noexcept; \
  template Status ReferenceDrive<__VA_ARGS__, Scalar>::add(const Elasticity<Scalar>&) noexcept

HEFT_INSTANTIATE_CONTROLLERS(float, firmware::EffectsArm);
HEFT_INSTANTIATE_RUN_TIME_CONTROLLERS(double, RunTimeArm<7, 8, 1>);
HEFT_INSTANTIATE_FACADES(float, EffectsArm, 4);
HEFT_INSTANTIATE_FACADES(double, SevenJointArm, 5);
HEFT_INSTANTIATE_RUN_TIME_FACADES(float);
HEFT_INSTANTIATE_JOINTS(float, 6);
HEFT_INSTANTIATE_JOINTS(double, 7);
template float spring_torque(const Elasticity<float>&, const float&, const float&) noexcept;
template double spring_torque(const Elasticity<double>&, const double&, const double&) noexcept;
template class RecursiveLeastSquares<float, 12>;
template class DirectionalLeastSquares<float, 12, 6>;
// Two states at a time, which a microcontroller computes one after the other.
template class Pack<float, 2>;
template DynamicArm<Pack<float, 2>, 6>::DynamicArm(const DynamicArm<float, 6>&) noexcept;
template void inverse_dynamics(const DynamicArm<Pack<float, 2>, 6>&,
                               const JointTrigonometry<DynamicArm<Pack<float, 2>, 6>>&,
                               const JointVector<Pack<float, 2>, 6>&, const JointVector<Pack<float, 2>, 6>&,
                               const JointVector<Pack<float, 2>, 6>&,
                               JointVector<Pack<float, 2>, 6>&) noexcept;
#ifdef HEFT_WHOLE_GRID
HEFT_INSTANTIATE_CONTROLLERS(double, firmware::EffectsArm);
HEFT_INSTANTIATE_RUN_TIME_CONTROLLERS(float, RunTimeArm<7, 8, 1>);
HEFT_INSTANTIATE_FACADES(double, EffectsArm, 4);
HEFT_INSTANTIATE_FACADES(float, SevenJointArm, 5);
HEFT_INSTANTIATE_RUN_TIME_FACADES(double);
HEFT_INSTANTIATE_JOINTS(float, 7);
HEFT_INSTANTIATE_JOINTS(double, 6);
template class RecursiveLeastSquares<double, 12>;
template class DirectionalLeastSquares<double, 12, 6>;
#endif

/// The Kalman filters, which are aliases of this; the largest frames are those of the second.
#define HEFT_INSTANTIATE_FILTERS(Scalar, N, Load)                                               \
  template class detail::DriftFilter<Scalar, N, Load, detail::LinearisedStep<Scalar, N, Load>>; \
  template class detail::DriftFilter<Scalar, N, Load, detail::SigmaPointStep<Scalar, N, Load>>

HEFT_INSTANTIATE_FILTERS(float, 6, 0);
HEFT_INSTANTIATE_FILTERS(double, 7, 10);

}  // namespace heft
