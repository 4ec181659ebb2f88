#include "heft/model/acceleration.hpp"

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/model/sized.hpp"
#include "heft/model/sized_dynamics.hpp"

namespace heft::model {

struct Acceleration::Impl {
  virtual ~Impl() = default;
  virtual bool solve(const Acceleration::Vector& q, const Acceleration::Vector& qd,
                     const Acceleration::Vector& torque, Acceleration::Vector& qdd) const = 0;
};

namespace {

template <int N, typename Base>
struct SizedSolver final : Base {
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;

  SizedSolver(const Robot& robot, const Eigen::MatrixXd& added) : arm(to_arm_model<N>(robot)), drives(added) {}

  bool solve(const Acceleration::Vector& q, const Acceleration::Vector& qd, const Acceleration::Vector& torque,
             Acceleration::Vector& qdd) const override {
    const Vector position = q, velocity = qd;
    const auto trig = joint_trigonometry<Arm>(position);
    MassMatrix<double, N> mass;
    mass_matrix(arm, trig, position, mass);
    mass += drives;
    Vector bias, result;
    bias_torque(arm, trig, position, velocity, bias);
    if (forward_dynamics<double, N>(mass, bias, Vector::Zero(), torque, result) != Status::kOk) return false;
    qdd = result;
    return true;
  }

  Arm arm;
  MassMatrix<double, N> drives;
};

}  // namespace

Acceleration::Acceleration(const Robot& robot, const Eigen::MatrixXd& drives)
    : impl_(with_joint_count(robot.num_joints(), robot.name, [&](auto n) -> std::unique_ptr<Impl> {
        return std::make_unique<SizedSolver<n, Impl>>(robot, drives);
      })) {}
Acceleration::~Acceleration() = default;
Acceleration::Acceleration(Acceleration&&) noexcept = default;
Acceleration& Acceleration::operator=(Acceleration&&) noexcept = default;

bool Acceleration::solve(const Vector& q, const Vector& qd, const Vector& torque, Vector& qdd) const {
  return impl_->solve(q, qd, torque, qdd);
}

}  // namespace heft::model
