// Orocos KDL's dynamics.
#include <memory>

#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfdsolver_recursive_newton_euler.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "dynamics_contest.hpp"

namespace heft::bench {
namespace {

using Eigen::Index;

/// The robot without rotors, from the same numbers.
KDL::Chain chain_of(const model::Robot& robot) {
  KDL::Chain chain;
  for (const model::RobotJoint& joint : robot.joints) {
    const auto& R = joint.joint.rotation;
    const auto& p = joint.joint.position;
    const auto& a = joint.joint.axis;
    const KDL::Frame frame(KDL::Rotation(R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]),
                           KDL::Vector(p[0], p[1], p[2]));
    const auto& l = joint.link;
    const double m = l[kMass];
    const KDL::Vector c(l[kMcx] / m, l[kMcy] / m, l[kMcz] / m);
    // KDL takes the inertia about the centre of mass, and the axis in the parent's frame.
    const KDL::RotationalInertia about_centre(
        l[kIxx] - m * (c.y() * c.y() + c.z() * c.z()), l[kIyy] - m * (c.x() * c.x() + c.z() * c.z()),
        l[kIzz] - m * (c.x() * c.x() + c.y() * c.y()), l[kIxy] + m * c.x() * c.y(), l[kIxz] + m * c.x() * c.z(),
        l[kIyz] + m * c.y() * c.z());
    chain.addSegment(KDL::Segment(
        KDL::Joint(frame.p, frame.M * KDL::Vector(a[0], a[1], a[2]), KDL::Joint::RotAxis), frame,
        KDL::RigidBodyInertia(m, c, about_centre)));
  }
  return chain;
}

}  // namespace

std::vector<Contestant> kdl_contestants(const model::Robot& robot) {
  struct Kdl {
    explicit Kdl(const model::Robot& robot)
        : chain(chain_of(robot)),
          gravity(robot.gravity[0], robot.gravity[1], robot.gravity[2]),
          inverse(chain, gravity),
          forward(chain, gravity),
          parameters(chain, gravity),
          none(chain.getNrOfSegments()),
          q(chain.getNrOfJoints()), qd(q), qdd(q), tau(q), mass(chain.getNrOfJoints()) {}
    KDL::Chain chain;
    KDL::Vector gravity;
    KDL::ChainIdSolver_RNE inverse;
    KDL::ChainFdSolver_RNE forward;
    KDL::ChainDynParam parameters;
    KDL::Wrenches none;
    KDL::JntArray q, qd, qdd, tau;
    KDL::JntSpaceInertiaMatrix mass;
  };
  const auto kdl = std::make_shared<Kdl>(robot);
  return {{"KDL", Quantity::kTorque,
           [kdl](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               kdl->q.data = s.q.row(k), kdl->qd.data = s.qd.row(k), kdl->qdd.data = s.qdd.row(k);
               kdl->inverse.CartToJnt(kdl->q, kdl->qd, kdl->qdd, kdl->none, kdl->tau);
               out.values.row(k) = kdl->tau.data;
             }
           }},
          {"KDL", Quantity::kMassMatrix,
           [kdl](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               kdl->q.data = s.q.row(k);
               kdl->parameters.JntToMass(kdl->q, kdl->mass);
               out.values.row(k) = kdl->mass.data.reshaped();
             }
           }},
          {"KDL", Quantity::kAcceleration, [kdl](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               kdl->q.data = s.q.row(k), kdl->qd.data = s.qd.row(k), kdl->tau.data = s.tau.row(k);
               kdl->forward.CartToJnt(kdl->q, kdl->qd, kdl->tau, kdl->none, kdl->qdd);
               out.values.row(k) = kdl->qdd.data;
             }
           }}};
}

}  // namespace heft::bench
