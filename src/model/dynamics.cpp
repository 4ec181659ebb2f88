#include "heft/model/dynamics.hpp"

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/model/sized.hpp"

#include "drive_torque.hpp"

// With ten sizes in one file the compiler leaves calls that it inlines where there is one. (With every access checked, that
// takes minutes to compile.)
#if defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__)
#define HEFT_INLINE_ALL [[gnu::flatten]]
#else
#define HEFT_INLINE_ALL
#endif

namespace heft::model {

/// Core behind a virtual call, one instantiation a number of joints.
struct Dynamics::Impl {
  explicit Impl(Robot r) : robot(std::move(r)) {}
  virtual ~Impl() = default;
  virtual Eigen::VectorXd inverse(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                  const Eigen::VectorXd& qdd) const = 0;
  virtual Eigen::VectorXd gravity(const Eigen::VectorXd& q) const = 0;
  virtual Eigen::MatrixXd mass(const Eigen::VectorXd& q) const = 0;
  virtual Eigen::MatrixXd regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                    const Eigen::VectorXd& qdd) const = 0;
  Robot robot;
};

namespace {

template <int N, typename Base>
struct Sized final : Base {
  using Vector = JointVector<double, N>;
  using Arm = DynamicArm<double, N>;

  explicit Sized(const Robot& r) : Base(r), arm(to_arm_model<N>(r)) {}

  HEFT_INLINE_ALL Eigen::VectorXd inverse(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                           const Eigen::VectorXd& qdd) const override {
    return inverse_dynamics(arm, Vector(q), Vector(qd), Vector(qdd));
  }
  Eigen::VectorXd gravity(const Eigen::VectorXd& q) const override {
    Vector tau;
    const Vector position = q;
    gravity_torque(arm, joint_trigonometry<Arm>(position), position, tau);
    return tau;
  }
  HEFT_INLINE_ALL Eigen::MatrixXd mass(const Eigen::VectorXd& q) const override {
    MassMatrix<double, N> m;
    const Vector position = q;
    mass_matrix(arm, joint_trigonometry<Arm>(position), position, m);
    return m;
  }
  HEFT_INLINE_ALL Eigen::MatrixXd regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                             const Eigen::VectorXd& qdd) const override {
    FullRegressor<double, N> Y;
    full_regressor<double, N>(arm, Vector(q), Vector(qd), Vector(qdd), 0.0, Y);
    return Y;
  }

  Arm arm;
};

}  // namespace

Dynamics::Dynamics(const Robot& robot)
    : impl_(with_joint_count(robot.num_joints(), robot.name, [&](auto n) -> std::unique_ptr<Impl> {
        return std::make_unique<Sized<n, Impl>>(robot);
      })) {
  check_effects(robot);
}
Dynamics::~Dynamics() = default;
Dynamics::Dynamics(Dynamics&&) noexcept = default;
Dynamics& Dynamics::operator=(Dynamics&&) noexcept = default;

int Dynamics::num_joints() const { return impl_->robot.num_joints(); }
const Robot& Dynamics::robot() const { return impl_->robot; }

Eigen::VectorXd Dynamics::inverse_dynamics(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                           const Eigen::VectorXd& qdd) const {
  return impl_->inverse(q, qd, qdd);
}

Eigen::VectorXd Dynamics::joint_torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                       const Eigen::VectorXd& qdd, const SignWidth& sign_width) const {
  Eigen::VectorXd tau = impl_->inverse(q, qd, qdd);
  const Robot& robot = impl_->robot;
  // Before anything is added tau is the load of the gears.
  const Eigen::VectorXd load = robot.effects.empty() ? Eigen::VectorXd{} : tau;
  add_actuation(robot, qd, qdd, sign_width, tau);
  add_cables(robot, q, tau);
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    tau[elasticity.joint] += elasticity.motor_inertia * qdd[elasticity.joint];
  }
  for (const JointEffect<double>& effect : robot.effects) {
    const int j = effect.joint;
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double direction = velocity_sign(qd[j], sign_width.of(joint.joint.type));
    const EffectPoint<double> point{0.0, q[j], qd[j], qdd[j], direction, load[j], direction};
    tau[j] += joint_effect_torque(effect, point, joint.actuation);
  }
  return tau;
}

Eigen::VectorXd Dynamics::gravity_torque(const Eigen::VectorXd& q) const { return impl_->gravity(q); }
Eigen::MatrixXd Dynamics::mass_matrix(const Eigen::VectorXd& q) const { return impl_->mass(q); }
Eigen::MatrixXd Dynamics::regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                    const Eigen::VectorXd& qdd) const {
  return impl_->regressor(q, qd, qdd);
}

Eigen::VectorXd Dynamics::parameters() const {
  const Eigen::Index n = num_joints();
  Eigen::VectorXd x(14 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& joint = impl_->robot.joints[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < kParametersPerLink; ++k) {
      x[kParametersPerLink * i + k] = joint.link[static_cast<std::size_t>(k)];
    }
    x[10 * n + i] = joint.actuation.rotor_inertia;
    x[11 * n + i] = joint.actuation.coulomb_friction;
    x[12 * n + i] = joint.actuation.viscous_friction;
    x[13 * n + i] = joint.actuation.friction_offset;
  }
  return x;
}

}  // namespace heft::model
