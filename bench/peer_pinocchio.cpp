// Pinocchio's dynamics, model made at run time.
#include <memory>

#ifdef HEFT_WITH_PINOCCHIO
#include <pinocchio/fwd.hpp>  // first

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#endif

#include "dynamics_contest.hpp"

namespace heft::bench {

#ifdef HEFT_WITH_PINOCCHIO

namespace {

using Eigen::Index;

/// Joints about coordinate axes are of the types that Pinocchio has for them, as its URDF reader chooses.
pinocchio::Model model_of(const model::Robot& robot) {
  pinocchio::Model model;
  model.gravity.linear() = Eigen::Map<const Eigen::Vector3d>(robot.gravity.data());
  pinocchio::JointIndex parent = 0;
  for (const model::RobotJoint& joint : robot.joints) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(joint.joint.rotation.data());
    const pinocchio::SE3 placement(R, Eigen::Map<const Eigen::Vector3d>(joint.joint.position.data()));
    const Eigen::Vector3d axis = Eigen::Map<const Eigen::Vector3d>(joint.joint.axis.data());
    pinocchio::JointModel type = pinocchio::JointModelRevoluteUnaligned(axis);
    if (axis == Eigen::Vector3d::UnitX()) type = pinocchio::JointModelRX();
    if (axis == Eigen::Vector3d::UnitY()) type = pinocchio::JointModelRY();
    if (axis == Eigen::Vector3d::UnitZ()) type = pinocchio::JointModelRZ();
    parent = model.addJoint(parent, type, placement, joint.name);
    model.appendBodyToJoint(parent, pinocchio::Inertia::FromDynamicParameters(
                                        Eigen::Map<const Eigen::Matrix<double, 10, 1>>(joint.link.data())));
  }
  return model;
}

}  // namespace

std::vector<Contestant> pinocchio_contestants(const model::Robot& robot) {
  struct Pinocchio {
    explicit Pinocchio(const model::Robot& robot) : model(model_of(robot)), data(model) {
      model.armature.setZero();
    }
    pinocchio::Model model;
    pinocchio::Data data;
    Eigen::VectorXd q, v, a;
  };
  const auto p = std::make_shared<Pinocchio>(robot);
  const Eigen::VectorXd x = link_parameters_of(robot);
  return {{"Pinocchio", Quantity::kTorque,
           [p](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               p->q = s.q.row(k), p->v = s.qd.row(k), p->a = s.qdd.row(k);
               out.values.row(k) = pinocchio::rnea(p->model, p->data, p->q, p->v, p->a);
             }
           }},
          {"Pinocchio", Quantity::kRegressor,
           [p, x](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               p->q = s.q.row(k), p->v = s.qd.row(k), p->a = s.qdd.row(k);
               const auto& Y = pinocchio::computeJointTorqueRegressor(p->model, p->data, p->q, p->v, p->a);
               if (out.checked) out.values.row(k) = Y * x;
             }
           }},
          {"Pinocchio", Quantity::kMassMatrix,
           [p](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               p->q = s.q.row(k);
               pinocchio::crba(p->model, p->data, p->q);
               p->data.M.triangularView<Eigen::StrictlyLower>() =
                   p->data.M.transpose().triangularView<Eigen::StrictlyLower>();
               out.values.row(k) = p->data.M.reshaped();
             }
           }},
          {"Pinocchio", Quantity::kAcceleration, [p](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               p->q = s.q.row(k), p->v = s.qd.row(k), p->a = s.tau.row(k);
               out.values.row(k) = pinocchio::aba(p->model, p->data, p->q, p->v, p->a);
             }
           }}};
}

#else

std::vector<Contestant> pinocchio_contestants(const model::Robot&) { return {}; }

#endif

}  // namespace heft::bench
