#include "regressor_slope.hpp"

#include <Eigen/Geometry>

namespace heft::excite {
namespace {

struct Vec {
  Pair x, y, z;
};

inline Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(const Pair& s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
inline void operator+=(Vec& a, const Vec& b) { a = a + b; }
inline Pair dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Pair both(double v) { return Pair{v, v}; }
inline Vec both(const std::array<double, 3>& v) { return {both(v[0]), both(v[1]), both(v[2])}; }
inline Vec zero() { return {both(0.0), both(0.0), both(0.0)}; }

struct Turn {
  std::array<Pair, 9> r;  ///< row-major, link axes in the parent's

  Vec inward(const Vec& v) const {
    return {r[0] * v.x + r[1] * v.y + r[2] * v.z, r[3] * v.x + r[4] * v.y + r[5] * v.z,
            r[6] * v.x + r[7] * v.y + r[8] * v.z};
  }
  Vec outward(const Vec& v) const {
    return {r[0] * v.x + r[3] * v.y + r[6] * v.z, r[1] * v.x + r[4] * v.y + r[7] * v.z,
            r[2] * v.x + r[5] * v.y + r[8] * v.z};
  }
};

/// The ten parameters as first moment and inertia.
struct Mass {
  Pair m;
  Vec c;
  Pair xx, xy, yy, xz, yz, zz;

  explicit Mass(const std::array<Pair, kParametersPerLink>& p)
      : m(p[kMass]),
        c{p[kMcx], p[kMcy], p[kMcz]},
        xx(p[kIxx]),
        xy(p[kIxy]),
        yy(p[kIyy]),
        xz(p[kIxz]),
        yz(p[kIyz]),
        zz(p[kIzz]) {}
  Vec inertia(const Vec& v) const {
    return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z};
  }
};

/// A motion, or the derivatives by it: angular velocity, angular acceleration, acceleration of the origin.
struct Moving {
  Vec w, wd, a;
};

/// Adds to `by` and to the probe's derivatives those of one weight block: z·n + k·f with
/// n = c × a + I ω̇ + ω × I ω,  f = m a + ω̇ × c + ω × (ω × c).
inline void add_block(const Mass& H, const Moving& at, const Vec& z, const Vec& k, Moving& by, Vec& by_z,
                      Vec& by_k) {
  const Vec Iw = H.inertia(at.w), Iz = H.inertia(z);
  const Pair wc = dot(at.w, H.c), kc = dot(k, H.c), kw = dot(k, at.w), ww = dot(at.w, at.w);
  by_z += cross(H.c, at.a) + H.inertia(at.wd) + cross(at.w, Iw);
  by_k += H.m * at.a + cross(at.wd, H.c) + wc * at.w - ww * H.c;
  by.a += cross(z, H.c) + H.m * k;
  by.wd += Iz + cross(H.c, k);
  by.w += cross(Iw, z) + H.inertia(cross(z, at.w)) + wc * k + kw * H.c - (kc + kc) * at.w;
}

}  // namespace

/// A link on the way outward.
struct RegressorSlope::Link {
  Turn turn;
  Vec offset;     ///< of its origin in the parent's frame
  Moving turned;  ///< the parent's angular motion, and the acceleration of this origin, in link axes
  Moving moving;
  /// What a joint asks of a wrench: z · moment + k · force, in link axes.
  std::array<Vec, kMost> z, k;
};

RegressorSlope::RegressorSlope(const model::Robot& robot)
    : up_{-robot.gravity[0], -robot.gravity[1], -robot.gravity[2]} {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (const model::RobotJoint& robot_joint : robot.joints) {
    const Joint<double>& joint = robot_joint.joint;
    Geometry g;
    g.revolute = joint.type == JointType::kRevolute;
    const Eigen::Map<const RowMajor> placed(joint.rotation.data());
    const Eigen::Map<const Eigen::Vector3d> axis(joint.axis.data());
    Eigen::Map<RowMajor> fixed(g.fixed.data()), cosine(g.cosine.data()), sine(g.sine.data());
    if (g.revolute) {
      Eigen::Matrix3d product;
      product << 0.0, -axis.z(), axis.y(), axis.z(), 0.0, -axis.x(), -axis.y(), axis.x(), 0.0;
      fixed = placed * axis * axis.transpose();
      cosine = placed - fixed;
      sine = placed * product;
    } else {
      fixed = placed;
      cosine.setZero();
      sine.setZero();
    }
    g.position = joint.position;
    g.axis = joint.axis;
    Eigen::Map<Eigen::Vector3d>(g.slide.data()) = placed * axis;
    joints_.push_back(g);
  }
}

void RegressorSlope::go_outward(const Motion& at, std::array<Link, kMost>& links) const {
  const Moving base{zero(), zero(), both(up_)};
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Geometry& g = joints_[j];
    Link& link = links[j];
    const Moving& parent = j > 0 ? links[j - 1].moving : base;
    const Vec axis = both(g.axis);
    const Pair q = at.q[j], qd = at.qd[j], qdd = at.qdd[j];
    link.offset = both(g.position);
    if (g.revolute) {
      const Pair c{std::cos(q[0]), std::cos(q[1])}, s{std::sin(q[0]), std::sin(q[1])};
      for (std::size_t e = 0; e < 9; ++e) link.turn.r[e] = g.fixed[e] + g.cosine[e] * c + g.sine[e] * s;
    } else {
      for (std::size_t e = 0; e < 9; ++e) link.turn.r[e] = both(g.fixed[e]);
      link.offset += q * both(g.slide);
    }
    const Vec& p = link.offset;
    link.turned = {link.turn.outward(parent.w), link.turn.outward(parent.wd),
                   link.turn.outward(parent.a + cross(parent.wd, p) + cross(parent.w, cross(parent.w, p)))};
    link.moving = link.turned;
    const Vec swept = qd * cross(link.turned.w, axis);
    if (g.revolute) {
      link.moving.w += qd * axis;
      link.moving.wd += swept + qdd * axis;
    } else {
      link.moving.a += swept + swept + qdd * axis;
    }
    for (std::size_t i = 0; i < j; ++i) {
      const Link& before = links[j - 1];
      link.z[i] = link.turn.outward(before.z[i]);
      link.k[i] = link.turn.outward(before.k[i] + cross(before.z[i], p));
    }
    link.z[j] = g.revolute ? axis : zero();
    link.k[j] = g.revolute ? zero() : axis;
  }
}

void RegressorSlope::gradient(const Motion& at, const Weights& weights, Motion& by) const {
  std::array<Link, kMost> links;
  go_outward(at, links);
  const Moving base{zero(), zero(), both(up_)};
  // Back: derivatives by a link's motion and probes, and what of them its parent and its joint bring about.
  Moving by_moving{zero(), zero(), zero()};
  std::array<Vec, kMost> by_z, by_k;
  by_z.fill(zero());
  by_k.fill(zero());
  for (std::size_t j = joints_.size(); j-- > 0;) {
    const Geometry& g = joints_[j];
    const Link& link = links[j];
    for (std::size_t i = 0; i <= j; ++i)
      add_block(Mass(weights[i][j]), link.moving, link.z[i], link.k[i], by_moving, by_z[i], by_k[i]);
    const Vec axis = both(g.axis);
    const Vec along = at.qd[j] * axis;
    Moving by_turned = by_moving;
    if (g.revolute) {
      by_turned.w += cross(along, by_moving.wd);
      by.qd[j] = dot(axis, by_moving.w) + dot(by_moving.wd, cross(link.turned.w, axis));
      by.qdd[j] = dot(axis, by_moving.wd);
    } else {
      const Vec twice = along + along;
      by_turned.w += cross(twice, by_moving.a);
      const Pair coriolis = dot(by_moving.a, cross(link.turned.w, axis));
      by.qd[j] = coriolis + coriolis;
      by.qdd[j] = dot(axis, by_moving.a);
    }
    // Every vector v that was turned outward changes by v × axis with q.
    Vec moment = cross(by_turned.w, link.turned.w) + cross(by_turned.wd, link.turned.wd) +
                 cross(by_turned.a, link.turned.a);
    const Moving& parent = j > 0 ? links[j - 1].moving : base;
    const Vec& p = link.offset;
    const Vec w = link.turn.inward(by_turned.w), wd = link.turn.inward(by_turned.wd),
              a = link.turn.inward(by_turned.a);
    const Pair aw = dot(a, parent.w), wp = dot(parent.w, p), ap = dot(a, p), ww = dot(parent.w, parent.w);
    Vec by_offset = cross(a, parent.wd) + aw * parent.w - ww * a;
    by_moving.w = w + wp * a + aw * p - (ap + ap) * parent.w;
    by_moving.wd = wd + cross(p, a);
    by_moving.a = a;
    for (std::size_t i = 0; i < j; ++i) {
      moment += cross(by_z[i], link.z[i]) + cross(by_k[i], link.k[i]);
      const Vec k = link.turn.inward(by_k[i]);
      by_offset += cross(k, links[j - 1].z[i]);
      by_z[i] = link.turn.inward(by_z[i]) + cross(p, k);
      by_k[i] = k;
    }
    by.q[j] = g.revolute ? dot(axis, moment) : dot(both(g.slide), by_offset);
  }
}

}  // namespace heft::excite
