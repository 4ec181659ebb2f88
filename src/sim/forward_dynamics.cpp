#include "heft/sim/forward_dynamics.hpp"

#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "heft/host/rotation.hpp"

namespace heft::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Symmetric 3 × 3 matrix by its upper triangle. Half the work of a full one, and it stays symmetric.
struct Symmetric3 {
  double xx, xy, xz, yy, yz, zz;

  Vector3d operator*(const Vector3d& v) const {
    return {xx * v.x() + xy * v.y() + xz * v.z(), xy * v.x() + yy * v.y() + yz * v.z(),
            xz * v.x() + yz * v.y() + zz * v.z()};
  }
  void add(const Symmetric3& o) {
    xx += o.xx;
    xy += o.xy;
    xz += o.xz;
    yy += o.yy;
    yz += o.yz;
    zz += o.zz;
  }
  /// this − s · u uᵀ
  void subtract_outer(const Vector3d& u, double s) {
    const Vector3d su = s * u;
    xx -= su.x() * u.x();
    xy -= su.x() * u.y();
    xz -= su.x() * u.z();
    yy -= su.y() * u.y();
    yz -= su.y() * u.z();
    zz -= su.z() * u.z();
  }
};

/// R S Rᵀ
Symmetric3 rotate(const Matrix3d& R, const Symmetric3& S) {
  const Vector3d a = S * R.row(0).transpose();
  const Vector3d b = S * R.row(1).transpose();
  const Vector3d c = S * R.row(2).transpose();
  return {R.row(0).dot(a), R.row(0).dot(b), R.row(0).dot(c),
          R.row(1).dot(b), R.row(1).dot(c), R.row(2).dot(c)};
}

/// The constant data of a link. Every link frame is first turned so that its joint axis is z.
struct LinkConstants {
  bool prismatic{false};
  Matrix3d rotation;  ///< axes of this link at q = 0 in the parent link frame
  Vector3d position;  ///< origin at q = 0 in the parent link frame
  double mass{0.0};
  Vector3d first_moment;
  Symmetric3 inertia;  ///< about the link-frame origin
  double rotor_inertia{0.0};
};

/// Work space of one evaluation; vectors in base axes, moments about the link's own origin.
struct LinkState {
  Matrix3d R;                   ///< link axes in the base frame
  Vector3d r;                   ///< from the parent's origin to this one
  Vector3d z;                   ///< joint axis
  Vector3d w;                   ///< angular velocity
  Vector3d alpha_bias, a_bias;  ///< velocity products in the accelerations
  Vector3d mc;                  ///< first moment of the link alone
  Symmetric3 I;                 ///< inertia of the link alone
  Vector3d n, f;                ///< bias moment and force of the link alone
  Vector3d U_n, U_f;            ///< articulated inertia times the joint's motion direction
  double D, u, ratio;           ///< ratio = u / D
  double inverse_D;
};

/// A link with everything outboard of it.
struct Articulated {
  Symmetric3 I, M;  ///< inertia [[I, H], [Hᵀ, M]]
  Matrix3d H;
  Vector3d n, f;  ///< bias moment and force
};

void add_parameters(LinkConstants& link, const InertialParameters<double>& p, const Matrix3d& Q) {
  Matrix3d I;
  I << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
  const Matrix3d turned = Q.transpose() * I * Q;
  link.mass += p[kMass];
  link.first_moment += Q.transpose() * Vector3d(p[kMcx], p[kMcy], p[kMcz]);
  link.inertia.add({turned(0, 0), turned(0, 1), turned(0, 2), turned(1, 1), turned(1, 2), turned(2, 2)});
}

}  // namespace

InertialParameters<double> inertial_parameters(const Body& body) {
  const double m = body.mass;
  const Vector3d& c = body.com;
  const Matrix3d I = body.inertia + m * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
  return {m, m * c.x(), m * c.y(), m * c.z(), I(0, 0), I(0, 1), I(1, 1), I(0, 2), I(1, 2), I(2, 2)};
}

struct ForwardDynamics::Impl {
  std::vector<LinkConstants> links;
  LinkConstants bare_last;  ///< the last link without payload
  Matrix3d last_turn;       ///< turned axes of the last link in its own link frame
  Vector3d tip_position;    ///< tip's origin in the turned last link frame
  Vector3d gravity;
  InertialParameters<double> payload{};
  std::vector<LinkState> state;
  std::vector<double> zeros;

  /// Pose of every link.
  void place(const double* q) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      const LinkConstants& link = links[i];
      LinkState& s = state[i];
      if (i == 0) {
        s.R = link.rotation;
        s.r = link.position;
      } else {
        s.R.noalias() = state[i - 1].R * link.rotation;
        s.r.noalias() = state[i - 1].R * link.position;
      }
      if (link.prismatic) {
        s.r += q[i] * s.R.col(2);
      } else {
        const double c = std::cos(q[i]);
        const double sn = std::sin(q[i]);
        const Vector3d x = s.R.col(0);
        s.R.col(0) = c * x + sn * s.R.col(1);
        s.R.col(1) = c * s.R.col(1) - sn * x;
      }
      s.z = s.R.col(2);
    }
  }

  /// Outward: velocity, velocity products, and inertia and bias force of link i alone. place() has run.
  void set_velocity(std::size_t i, double rate) {
    const LinkConstants& link = links[i];
    LinkState& s = state[i];
    if (i == 0) {
      s.w.setZero();
      s.alpha_bias.setZero();
      s.a_bias.setZero();
      if (!link.prismatic) s.w = rate * s.z;
    } else {
      const Vector3d& w = state[i - 1].w;
      const Vector3d w_cross_z_qd = w.cross(s.z) * rate;
      s.a_bias = w.cross(w.cross(s.r));
      if (link.prismatic) {
        s.w = w;
        s.alpha_bias.setZero();
        s.a_bias += 2.0 * w_cross_z_qd;
      } else {
        s.w = w + rate * s.z;
        s.alpha_bias = w_cross_z_qd;
      }
    }
    s.mc.noalias() = s.R * link.first_moment;
    s.I = rotate(s.R, link.inertia);
    s.n = s.w.cross(s.I * s.w);
    s.f = s.w.cross(s.w.cross(s.mc));
  }

  /// Adds a link alone to what its neighbour outboard handed in.
  void add_link(std::size_t i, Articulated& A) const {
    const LinkState& s = state[i];
    const double m = links[i].mass;
    A.I.add(s.I);
    A.M.xx += m;
    A.M.yy += m;
    A.M.zz += m;
    A.H(0, 1) -= s.mc.z();
    A.H(0, 2) += s.mc.y();
    A.H(1, 0) += s.mc.z();
    A.H(1, 2) -= s.mc.x();
    A.H(2, 0) -= s.mc.y();
    A.H(2, 1) += s.mc.x();
    A.n += s.n;
    A.f += s.f;
  }

  void add_at_tip(const Wrench& wrench) {
    LinkState& last = state.back();
    const Vector3d tip = last.R * tip_position;
    last.n -= wrench.moment + tip.cross(wrench.force);
    last.f -= wrench.force;
  }

  /// Inward: articulated inertia and bias of link i in the direction of its joint.
  void project_on_joint(std::size_t i, const Articulated& A, double tau) {
    const LinkConstants& link = links[i];
    LinkState& s = state[i];
    if (link.prismatic) {
      s.U_n.noalias() = A.H * s.z;
      s.U_f = A.M * s.z;
      s.D = s.z.dot(s.U_f);
      s.u = tau - s.z.dot(A.f);
    } else {
      s.U_n = A.I * s.z;
      s.U_f.noalias() = A.H.transpose() * s.z;
      s.D = s.z.dot(s.U_n);
      s.u = tau - s.z.dot(A.n);
    }
    s.D += link.rotor_inertia;
    s.inverse_D = 1.0 / s.D;
    s.ratio = s.u * s.inverse_D;
  }

  /// Inward: what link i transmits to its parent through its joint, about the parent's origin.
  void hand_inboard(std::size_t i, bool locked, Articulated& A) const {
    const LinkState& s = state[i];
    if (!locked) {
      A.I.subtract_outer(s.U_n, s.inverse_D);
      A.M.subtract_outer(s.U_f, s.inverse_D);
      A.H.noalias() -= (s.inverse_D * s.U_n) * s.U_f.transpose();
      A.n += s.ratio * s.U_n;
      A.f += s.ratio * s.U_f;
    }
    A.n += A.I * s.alpha_bias;
    A.n.noalias() += A.H * s.a_bias;
    A.f += A.M * s.a_bias;
    A.f.noalias() += A.H.transpose() * s.alpha_bias;
    shift(s.r, A);
  }

  /// The reference point moved to the parent's origin by r: with [r] the cross-product matrix of r,
  /// H' = H + [r] M,  I' = I − H' [r] + [r] Hᵀ,  M' = M.
  static void shift(const Vector3d& r, Articulated& A) {
    const double x = r.x(), y = r.y(), z = r.z();
    const Matrix3d H = A.H;
    const Symmetric3& M = A.M;
    Matrix3d& Hp = A.H;
    Hp(0, 0) = H(0, 0) + y * M.xz - z * M.xy;
    Hp(0, 1) = H(0, 1) + y * M.yz - z * M.yy;
    Hp(0, 2) = H(0, 2) + y * M.zz - z * M.yz;
    Hp(1, 0) = H(1, 0) + z * M.xx - x * M.xz;
    Hp(1, 1) = H(1, 1) + z * M.xy - x * M.yz;
    Hp(1, 2) = H(1, 2) + z * M.xz - x * M.zz;
    Hp(2, 0) = H(2, 0) + x * M.xy - y * M.xx;
    Hp(2, 1) = H(2, 1) + x * M.yy - y * M.xy;
    Hp(2, 2) = H(2, 2) + x * M.yz - y * M.xz;
    A.I.xx += -(Hp(0, 1) * z - Hp(0, 2) * y) + (y * H(0, 2) - z * H(0, 1));
    A.I.xy += -(Hp(0, 2) * x - Hp(0, 0) * z) + (y * H(1, 2) - z * H(1, 1));
    A.I.xz += -(Hp(0, 0) * y - Hp(0, 1) * x) + (y * H(2, 2) - z * H(2, 1));
    A.I.yy += -(Hp(1, 2) * x - Hp(1, 0) * z) + (z * H(1, 0) - x * H(1, 2));
    A.I.yz += -(Hp(1, 0) * y - Hp(1, 1) * x) + (z * H(2, 0) - x * H(2, 2));
    A.I.zz += -(Hp(2, 0) * y - Hp(2, 1) * x) + (x * H(2, 1) - y * H(2, 0));
    A.n += r.cross(A.f);
  }

  static bool is_locked(const bool* locked, std::size_t i) { return locked != nullptr && locked[i]; }

  /// Outward: accelerations. Gravity enters as an upward acceleration of the base.
  void accelerate(const bool* locked, double* qdd, double* excess) const {
    Vector3d alpha = Vector3d::Zero();
    Vector3d a = -gravity;
    for (std::size_t i = 0; i < links.size(); ++i) {
      const LinkState& s = state[i];
      a += alpha.cross(s.r) + s.a_bias;
      alpha += s.alpha_bias;
      const double net = s.u - s.U_n.dot(alpha) - s.U_f.dot(a);
      if (is_locked(locked, i)) {
        qdd[i] = 0.0;
        if (excess != nullptr) excess[i] = net;
        continue;
      }
      qdd[i] = net * s.inverse_D;
      if (excess != nullptr) excess[i] = 0.0;
      if (links[i].prismatic) {
        a += qdd[i] * s.z;
      } else {
        alpha += qdd[i] * s.z;
      }
    }
  }
};

ForwardDynamics::ForwardDynamics(const model::Robot& robot) : impl_(std::make_unique<Impl>()) {
  if (robot.joints.empty()) {
    throw ModelError(
        fmt::format("robot \"{}\": found no moving joint, expected at least one; check the chain's "
                    "base and tip link",
                    robot.name));
  }
  impl_->gravity = Eigen::Map<const Vector3d>(robot.gravity.data());
  Matrix3d parent_turn = Matrix3d::Identity();
  for (const model::RobotJoint& joint : robot.joints) {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Vector3d axis = Eigen::Map<const Vector3d>(joint.joint.axis.data());
    // An axis that is 1e-9 too long scales the joint's inertia by 2e-9, so this is exact enough.
    if (!(std::abs(axis.norm() - 1.0) < 1e-9)) {
      throw ModelError(
          fmt::format("robot \"{}\", joint \"{}\": found an axis of length {:.12g}, expected 1; "
                      "divide the axis by its length",
                      robot.name, joint.name, axis.norm()));
    }
    for (double value : joint.link) {
      if (!std::isfinite(value) || joint.link[kMass] < 0.0) {
        throw ModelError(
            fmt::format("robot \"{}\", link \"{}\": found mass {:.6g} kg or an inertial parameter that "
                        "is not finite, expected finite values and a mass of at least 0; correct "
                        "the link's inertial parameters",
                        robot.name, joint.link_name, joint.link[kMass]));
      }
    }
    Matrix3d turn = Matrix3d::Identity();
    if ((axis - Vector3d::UnitZ()).norm() > 0.0) {
      turn = rotation_from_z(axis);
    }
    LinkConstants link;
    link.prismatic = joint.joint.type == JointType::kPrismatic;
    link.rotation = parent_turn.transpose() * Eigen::Map<const RowMajor>(joint.joint.rotation.data()) * turn;
    link.position = parent_turn.transpose() * Eigen::Map<const Vector3d>(joint.joint.position.data());
    link.first_moment.setZero();
    link.inertia = {0, 0, 0, 0, 0, 0};
    add_parameters(link, joint.link, turn);
    link.rotor_inertia = joint.actuation.rotor_inertia;
    impl_->links.push_back(link);
    parent_turn = turn;
  }
  impl_->last_turn = parent_turn;
  impl_->tip_position = parent_turn.transpose() * Eigen::Map<const Vector3d>(robot.tip_position.data());
  impl_->bare_last = impl_->links.back();
  impl_->state.resize(impl_->links.size());
  impl_->zeros.assign(impl_->links.size(), 0.0);
}

ForwardDynamics::~ForwardDynamics() = default;
ForwardDynamics::ForwardDynamics(ForwardDynamics&&) noexcept = default;
ForwardDynamics& ForwardDynamics::operator=(ForwardDynamics&&) noexcept = default;

int ForwardDynamics::num_joints() const { return static_cast<int>(impl_->links.size()); }

void ForwardDynamics::set_gravity(const Vector3d& gravity) { impl_->gravity = gravity; }

Vector3d ForwardDynamics::gravity() const { return impl_->gravity; }

void ForwardDynamics::set_rotor_inertia(int joint, double inertia) {
  impl_->links[static_cast<std::size_t>(joint)].rotor_inertia = inertia;
  if (joint + 1 == num_joints()) impl_->bare_last.rotor_inertia = inertia;
}

double ForwardDynamics::rotor_inertia(int joint) const {
  return impl_->links[static_cast<std::size_t>(joint)].rotor_inertia;
}

void ForwardDynamics::attach(const Body& body) {
  impl_->payload = inertial_parameters(body);
  impl_->links.back() = impl_->bare_last;
  add_parameters(impl_->links.back(), impl_->payload, impl_->last_turn);
}

void ForwardDynamics::detach() {
  impl_->payload = {};
  impl_->links.back() = impl_->bare_last;
}

const InertialParameters<double>& ForwardDynamics::payload() const { return impl_->payload; }

void ForwardDynamics::acceleration(const double* q, const double* qd, const double* tau, const bool* locked,
                                   const Wrench* wrench, double* qdd, double* excess) const {
  Impl& impl = *impl_;
  impl.place(q);
  const std::size_t n = impl.links.size();
  for (std::size_t i = 0; i < n; ++i) impl.set_velocity(i, qd[i]);
  if (wrench != nullptr) impl.add_at_tip(*wrench);
  Articulated A{{}, {}, Matrix3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
  for (std::size_t i = n; i-- > 0;) {
    impl.add_link(i, A);
    impl.project_on_joint(i, A, tau[i]);
    if (i > 0) impl.hand_inboard(i, impl.is_locked(locked, i), A);
  }
  impl.accelerate(locked, qdd, excess);
}

Eigen::VectorXd ForwardDynamics::acceleration(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                              const Eigen::VectorXd& tau) const {
  Eigen::VectorXd qdd(num_joints());
  acceleration(q.data(), qd.data(), tau.data(), nullptr, nullptr, qdd.data(), nullptr);
  return qdd;
}

Eigen::VectorXd ForwardDynamics::gravity_torque(const Eigen::VectorXd& q) const {
  Impl& impl = *impl_;
  impl.place(q.data());
  const std::size_t n = impl.links.size();
  Eigen::VectorXd torque(static_cast<Eigen::Index>(n));
  // Weight of everything from link i outwards, as mass and first moment about link i's origin.
  double mass = 0.0;
  Vector3d first_moment = Vector3d::Zero();
  for (std::size_t i = n; i-- > 0;) {
    const LinkState& s = impl.state[i];
    if (i + 1 < n) first_moment += mass * impl.state[i + 1].r;
    mass += impl.links[i].mass;
    first_moment += s.R * impl.links[i].first_moment;
    torque[static_cast<Eigen::Index>(i)] =
        impl.links[i].prismatic ? -mass * s.z.dot(impl.gravity) : -s.z.dot(first_moment.cross(impl.gravity));
  }
  return torque;
}

double ForwardDynamics::kinetic_energy(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const {
  Impl& impl = *impl_;
  impl.place(q.data());
  Vector3d w = Vector3d::Zero();
  Vector3d v = Vector3d::Zero();
  double energy = 0.0;
  for (std::size_t i = 0; i < impl.links.size(); ++i) {
    const LinkConstants& link = impl.links[i];
    const LinkState& s = impl.state[i];
    const double rate = qd[static_cast<Eigen::Index>(i)];
    v += w.cross(s.r);
    if (link.prismatic) {
      v += rate * s.z;
    } else {
      w += rate * s.z;
    }
    // In link axes, where the inertia is constant.
    const Vector3d w_link = s.R.transpose() * w;
    const Vector3d v_link = s.R.transpose() * v;
    energy += 0.5 * link.mass * v_link.squaredNorm() + v_link.dot(w_link.cross(link.first_moment)) +
              0.5 * w_link.dot(link.inertia * w_link) + 0.5 * link.rotor_inertia * rate * rate;
  }
  return energy;
}

double ForwardDynamics::potential_energy(const Eigen::VectorXd& q) const {
  Impl& impl = *impl_;
  impl.place(q.data());
  Vector3d origin = Vector3d::Zero();
  double energy = 0.0;
  for (std::size_t i = 0; i < impl.links.size(); ++i) {
    origin += impl.state[i].r;
    energy -= impl.gravity.dot(impl.links[i].mass * origin + impl.state[i].R * impl.links[i].first_moment);
  }
  return energy;
}

}  // namespace heft::sim
