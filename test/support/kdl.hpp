/// @file
/// KDL as an independent reference for dynamics and kinematics.
///
/// Two ways to a KDL chain: from a model::Robot (checks heft's dynamics), and straight from a URDF through
/// urdfdom without heft's importer (checks the importer as well).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>
#include <Eigen/Core>
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "heft/model/robot.hpp"

namespace heft::test {

inline KDL::Rotation to_kdl_rotation(const std::array<double, 9>& r) {
  return KDL::Rotation(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]);
}

inline KDL::Vector to_kdl_vector(const std::array<double, 3>& v) { return KDL::Vector(v[0], v[1], v[2]); }

/// Ten parameters about the link origin as KDL's rigid body.
inline KDL::RigidBodyInertia to_kdl_inertia(const InertialParameters<double>& p) {
  if (p[kMass] == 0.0) return KDL::RigidBodyInertia::Zero();
  const KDL::Vector c(p[kMcx] / p[kMass], p[kMcy] / p[kMass], p[kMcz] / p[kMass]);
  const double m = p[kMass];
  // KDL takes the inertia about the centre of mass: I_c = I_o - m (|c|² E - c cᵀ).
  return KDL::RigidBodyInertia(
      m, c,
      KDL::RotationalInertia(p[kIxx] - m * (c.y() * c.y() + c.z() * c.z()),
                             p[kIyy] - m * (c.x() * c.x() + c.z() * c.z()),
                             p[kIzz] - m * (c.x() * c.x() + c.y() * c.y()), p[kIxy] + m * c.x() * c.y(),
                             p[kIxz] + m * c.x() * c.z(), p[kIyz] + m * c.y() * c.z()));
}

/// Chain of an imported robot, the tip frame as a last segment without mass.
inline KDL::Chain kdl_chain_from_robot(const model::Robot& robot) {
  KDL::Chain chain;
  for (const model::RobotJoint& joint : robot.joints) {
    const KDL::Frame frame(to_kdl_rotation(joint.joint.rotation), to_kdl_vector(joint.joint.position));
    // KDL wants the axis in the parent frame.
    const auto type = joint.joint.type == JointType::kPrismatic ? KDL::Joint::TransAxis : KDL::Joint::RotAxis;
    chain.addSegment(KDL::Segment(
        joint.link_name, KDL::Joint(joint.name, frame.p, frame.M * to_kdl_vector(joint.joint.axis), type),
        frame, to_kdl_inertia(joint.link)));
  }
  chain.addSegment(
      KDL::Segment("tip", KDL::Joint(KDL::Joint::None),
                   KDL::Frame(to_kdl_rotation(robot.tip_rotation), to_kdl_vector(robot.tip_position))));
  return chain;
}

/// Chain from the root of a URDF to `tip_link` (empty: along only children), through urdfdom alone.
inline KDL::Chain kdl_chain_from_urdf(const std::string& path, const std::string& tip_link = "") {
  const ::urdf::ModelInterfaceSharedPtr model = ::urdf::parseURDFFile(path);
  if (!model) throw std::runtime_error("urdfdom cannot read " + path);
  std::vector<::urdf::LinkConstSharedPtr> links;
  if (tip_link.empty()) {
    for (::urdf::LinkConstSharedPtr link = model->getRoot(); !link->child_links.empty();) {
      if (link->child_links.size() > 1) throw std::runtime_error(path + " branches; name a tip link");
      link = link->child_links.front();
      links.push_back(link);
    }
  } else {
    for (::urdf::LinkConstSharedPtr link = model->getLink(tip_link); link && link->parent_joint;
         link = link->getParent()) {
      links.insert(links.begin(), link);
    }
  }
  const auto to_frame = [](const ::urdf::Pose& pose) {
    double x, y, z, w;
    pose.rotation.getQuaternion(x, y, z, w);
    return KDL::Frame(KDL::Rotation::Quaternion(x, y, z, w),
                      KDL::Vector(pose.position.x, pose.position.y, pose.position.z));
  };
  KDL::Chain chain;
  for (const auto& link : links) {
    const ::urdf::Joint& joint = *link->parent_joint;
    const KDL::Frame frame = to_frame(joint.parent_to_joint_origin_transform);
    const KDL::Vector axis = frame.M * KDL::Vector(joint.axis.x, joint.axis.y, joint.axis.z);
    KDL::Joint kdl_joint(joint.name, KDL::Joint::None);
    if (joint.type == ::urdf::Joint::PRISMATIC)
      kdl_joint = KDL::Joint(joint.name, frame.p, axis, KDL::Joint::TransAxis);
    if (joint.type == ::urdf::Joint::REVOLUTE || joint.type == ::urdf::Joint::CONTINUOUS) {
      kdl_joint = KDL::Joint(joint.name, frame.p, axis, KDL::Joint::RotAxis);
    }
    KDL::RigidBodyInertia inertia = KDL::RigidBodyInertia::Zero();
    if (link->inertial) {
      const ::urdf::Inertial& i = *link->inertial;
      // About the centre of mass in the axes of the inertial frame, which KDL then turns into link axes.
      inertia = to_frame(i.origin) *
                KDL::RigidBodyInertia(i.mass, KDL::Vector::Zero(),
                                      KDL::RotationalInertia(i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz));
    }
    chain.addSegment(KDL::Segment(link->name, kdl_joint, frame, inertia));
  }
  return chain;
}

/// KDL's answers with Eigen's vectors. Not for several threads.
class KdlArm {
 public:
  explicit KdlArm(const KDL::Chain& chain, const std::array<double, 3>& gravity = {0.0, 0.0, -9.81})
      : chain_(chain),
        inverse_dynamics_(chain_, to_kdl_vector(gravity)),
        parameters_(chain_, to_kdl_vector(gravity)),
        kinematics_(chain_),
        jacobians_(chain_) {}

  KdlArm(const KdlArm&) = delete;
  KdlArm& operator=(const KdlArm&) = delete;

  int num_joints() const { return static_cast<int>(chain_.getNrOfJoints()); }

  /// Rigid-body torque with gravity.
  Eigen::VectorXd inverse_dynamics(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                   const Eigen::VectorXd& qdd) {
    KDL::JntArray torque(chain_.getNrOfJoints());
    const KDL::Wrenches none(chain_.getNrOfSegments(), KDL::Wrench::Zero());
    check(inverse_dynamics_.CartToJnt(to_array(q), to_array(qd), to_array(qdd), none, torque));
    return torque.data;
  }

  Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q) {
    KDL::JntArray torque(chain_.getNrOfJoints());
    check(parameters_.JntToGravity(to_array(q), torque));
    return torque.data;
  }

  Eigen::MatrixXd mass_matrix(const Eigen::VectorXd& q) {
    KDL::JntSpaceInertiaMatrix mass(chain_.getNrOfJoints());
    check(parameters_.JntToMass(to_array(q), mass));
    return mass.data;
  }

  /// Placement of the chain's end in the base: 4 × 4 homogeneous matrix.
  Eigen::Matrix4d forward_kinematics(const Eigen::VectorXd& q) {
    KDL::Frame frame;
    check(kinematics_.JntToCart(to_array(q), frame));
    Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) result(row, column) = frame.M(row, column);
      result(row, 3) = frame.p(row);
    }
    return result;
  }

  /// Geometric Jacobian of the chain's end in the base: linear rows, then angular, 6 × n.
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& q) {
    KDL::Jacobian J(chain_.getNrOfJoints());
    check(jacobians_.JntToJac(to_array(q), J));
    return J.data;
  }

 private:
  static KDL::JntArray to_array(const Eigen::VectorXd& values) {
    KDL::JntArray array(static_cast<unsigned int>(values.size()));
    array.data = values;
    return array;
  }

  static void check(int error) {
    if (error < 0) throw std::runtime_error("KDL returned error " + std::to_string(error));
  }

  KDL::Chain chain_;
  KDL::ChainIdSolver_RNE inverse_dynamics_;
  KDL::ChainDynParam parameters_;
  KDL::ChainFkSolverPos_recursive kinematics_;
  KDL::ChainJntToJacSolver jacobians_;
};

}  // namespace heft::test
