#include "support/undeclared_case.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "heft/model/dynamics.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/sim/simulator.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/case_motion.hpp"
#include "support/case_random.hpp"

namespace heft::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
// ---------------------------------------------------------------------------------------------------- arms

struct BodySpec {
  double mass;
  Vector3d com;
  Vector3d inertia;  ///< principal, about the centre, along the link axes before `turn`
  Eigen::Matrix3d turn{Eigen::Matrix3d::Identity()};
};

struct JointSpec {
  const char* type;
  Vector3d xyz, rpy, axis;
  double lower, upper, velocity, effort;
  BodySpec body;
};

struct ArmSpec {
  std::vector<JointSpec> joints;
  Vector3d tool_xyz;
  BodySpec tool;
};

ArmSpec arm_spec(const std::string& name) {
  const Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), none(0, 0, 0);
  if (name == "scara4") {
    return {{{"revolute",
              {0, 0, 0.24},
              none,
              z,
              -2.5,
              2.5,
              3.8,
              80,
              {9.6, {0.14, 0.006, 0.03}, {0.05, 0.14, 0.15}}},
             {"revolute",
              {0.31, 0, 0.06},
              none,
              z,
              -2.6,
              2.6,
              4.5,
              42,
              {5.0, {0.12, -0.008, 0.04}, {0.02, 0.055, 0.06}}},
             {"prismatic",
              {0.26, 0, 0},
              none,
              z,
              -0.24,
              0.0,
              0.5,
              150,
              {1.5, {0.002, 0.001, 0.05}, {0.02, 0.021, 0.0014}}},
             {"revolute",
              {0, 0, -0.09},
              none,
              z,
              -3.1,
              3.1,
              6.0,
              7.5,
              {0.65, {0.004, 0.002, -0.02}, {0.0006, 0.0005, 0.0007}}}},
            {0, 0, -0.05},
            {0.9, {0.035, -0.014, -0.04}, {0.0017, 0.0022, 0.0025}}};
  }
  if (name == "arm6") {
    return {{{"revolute",
              {0, 0, 0.17},
              none,
              z,
              -2.9,
              2.9,
              2.6,
              160,
              {6.5, {0.02, -0.01, 0.08}, {0.04, 0.035, 0.028}}},
             {"revolute",
              {0.06, 0, 0.21},
              none,
              y,
              -1.9,
              1.9,
              2.4,
              170,
              {9.0, {0.01, 0.03, 0.2}, {0.17, 0.165, 0.03}}},
             {"revolute",
              {0, 0, 0.43},
              none,
              y,
              -2.4,
              2.4,
              2.8,
              95,
              {4.2, {0.05, -0.02, 0.03}, {0.015, 0.03, 0.028}}},
             {"revolute",
              {0.12, 0, 0.04},
              none,
              x,
              -2.9,
              2.9,
              3.6,
              26,
              {2.6, {0.17, 0.004, 0.002}, {0.004, 0.03, 0.03}}},
             {"revolute",
              {0.33, 0, 0},
              none,
              y,
              -2.0,
              2.0,
              3.6,
              24,
              {1.1, {0.02, 0.006, 0.001}, {0.0015, 0.0017, 0.0016}}},
             {"revolute",
              {0.09, 0, 0},
              none,
              x,
              -3.1,
              3.1,
              4.0,
              14,
              {0.35, {0.015, 0.001, 0.001}, {0.0004, 0.0003, 0.0003}}}},
            {0.03, 0, 0},
            {1.3, {0.05, 0.02, -0.03}, {0.002, 0.003, 0.0028}}};
  }
  if (name == "arm7") {
    const double quarter = std::numbers::pi / 2;
    return {{{"revolute",
              {0, 0, 0.16},
              none,
              z,
              -2.8,
              2.8,
              2.0,
              110,
              {4.0, {0.0, -0.03, 0.11}, {0.03, 0.027, 0.014}}},
             {"revolute",
              {0, 0, 0.19},
              {quarter, 0, 0},
              z,
              -2.0,
              2.0,
              2.0,
              115,
              {4.1, {0.002, 0.07, 0.02}, {0.03, 0.014, 0.027}}},
             {"revolute",
              {0, 0.22, 0},
              {-quarter, 0, 0},
              z,
              -2.8,
              2.8,
              2.2,
              80,
              {3.2, {0.0, 0.03, 0.12}, {0.022, 0.02, 0.01}}},
             {"revolute",
              {0, 0, 0.2},
              {-quarter, 0, 0},
              z,
              -2.0,
              2.0,
              2.2,
              80,
              {2.9, {0.002, -0.065, 0.03}, {0.016, 0.008, 0.015}}},
             {"revolute",
              {0, -0.21, 0},
              {quarter, 0, 0},
              z,
              -2.8,
              2.8,
              2.8,
              28,
              {1.9, {0.0, 0.02, 0.08}, {0.01, 0.009, 0.005}}},
             {"revolute",
              {0, 0.06, 0.19},
              {quarter, 0, 0},
              z,
              -2.0,
              2.0,
              2.8,
              24,
              {1.7, {0.001, 0.005, 0.05}, {0.005, 0.004, 0.004}}},
             {"revolute",
              {0, 0.08, 0.06},
              {-quarter, 0, 0},
              z,
              -2.9,
              2.9,
              3.2,
              16,
              {0.4, {0.001, 0.002, 0.02}, {0.0005, 0.0005, 0.0006}}}},
            {0, 0, 0.04},
            {1.1, {0.03, 0.02, 0.06}, {0.0024, 0.0027, 0.0015}}};
  }
  if (name == "heavy6") {  // carries 80 kg
    return {{{"revolute", {0, 0, 0.4}, none, z, -2.9, 2.9, 1.6, 6000, {250, {0.2, -0.02, 0.2}, {20, 22, 18}}},
             {"revolute", {0.35, 0, 0.3}, none, y, -1.2, 1.2, 1.5, 9000, {220, {0.02, 0.05, 0.6}, {30, 29, 3}}},
             {"revolute", {0, 0, 1.2}, none, y, -1.9, 1.9, 1.6, 5000, {180, {0.2, -0.03, 0.1}, {8, 20, 19}}},
             {"revolute", {0.4, 0, 0.15}, none, x, -2.9, 2.9, 2.2, 900, {60, {0.5, 0.01, 0.01}, {1, 6, 6}}},
             {"revolute", {0.9, 0, 0}, none, y, -2.0, 2.0, 2.2, 800, {25, {0.05, 0.02, 0}, {0.3, 0.35, 0.33}}},
             {"revolute", {0.2, 0, 0}, none, x, -3.1, 3.1, 3.0, 400, {10, {0.05, 0.004, 0.003}, {0.06, 0.05, 0.05}}}},
            {0.1, 0, 0},
            {80, {0.1, 0.05, -0.06}, {1.5, 2, 1.9}}};
  }
  if (name == "desk6") {  // carries 0.2 kg
    return {{{"revolute", {0, 0, 0.06}, none, z, -2.9, 2.9, 4.0, 6, {0.6, {0.005, -0.003, 0.03}, {6e-4, 6e-4, 5e-4}}},
             {"revolute", {0.02, 0, 0.05}, none, y, -1.9, 1.9, 4.0, 7, {0.7, {0.005, 0.01, 0.09}, {3e-3, 3e-3, 4e-4}}},
             {"revolute", {0, 0, 0.18}, none, y, -2.4, 2.4, 4.5, 4, {0.5, {0.03, -0.005, 0.01}, {5e-4, 1e-3, 1e-3}}},
             {"revolute", {0.05, 0, 0.015}, none, x, -2.9, 2.9, 5.0, 1, {0.25, {0.06, 1e-3, 1e-3}, {1e-4, 5e-4, 5e-4}}},
             {"revolute", {0.13, 0, 0}, none, y, -2.0, 2.0, 5.0, 0.8, {0.12, {0.01, 2e-3, 0}, {4e-5, 5e-5, 5e-5}}},
             {"revolute", {0.04, 0, 0}, none, x, -3.1, 3.1, 6.0, 0.4, {0.04, {6e-3, 5e-4, 5e-4}, {1e-5, 1e-5, 1e-5}}}},
            {0.015, 0, 0},
            {0.15, {0.02, 0.008, -0.012}, {6e-5, 8e-5, 7e-5}}};
  }
  if (name == "gantry5") {
    return {{{"prismatic", {0, 0, 1.5}, none, x, -1.2, 1.2, 1.5, 1500, {60, {0.02, 0.1, 0.05}, {6, 2, 7}}},
             {"prismatic", {0, 0, 0.1}, none, y, -0.8, 0.8, 1.5, 800, {30, {0.03, 0.02, 0.06}, {0.9, 0.8, 0.5}}},
             {"prismatic", {0.12, 0, 0}, none, z, -0.4, 0.0, 1.0, 600, {8, {0.004, 0.003, 0.1}, {0.3, 0.3, 0.02}}},
             {"revolute", {0, 0, -0.25}, none, z, -3.0, 3.0, 5.0, 12, {1.5, {0.006, 0.004, -0.03}, {4e-3, 4e-3, 2e-3}}},
             {"revolute", {0, 0, -0.1}, none, y, -1.9, 1.9, 5.0, 10, {0.8, {0.004, 0.002, -0.02}, {1e-3, 1e-3, 8e-4}}}},
            {0, 0, -0.05},
            {1.5, {0.04, 0.02, -0.06}, {3e-3, 3.5e-3, 2e-3}}};
  }
  if (name == "polar6") {  // its arm slides out
    return {{{"revolute", {0, 0, 0.4}, none, z, -2.8, 2.8, 2.0, 220, {9, {0.01, 0.04, 0.1}, {0.1, 0.09, 0.06}}},
             {"revolute", {0, 0.15, 0.1}, none, y, -1.8, 1.8, 2.0, 240, {6, {0.01, 0.03, 0.05}, {0.06, 0.06, 0.03}}},
             {"prismatic", {0, 0, 0.2}, none, z, 0.0, 0.5, 0.8, 420, {5, {0.003, 0.004, 0.02}, {0.2, 0.2, 0.01}}},
             {"revolute", {0, 0, 0.2}, none, z, -2.9, 2.9, 4.0, 20, {1.3, {0.003, 0.01, 0.05}, {3e-3, 3e-3, 1e-3}}},
             {"revolute", {0, 0, 0.1}, none, y, -1.9, 1.9, 4.0, 18, {0.9, {0.002, 0.004, 0.03}, {1e-3, 1e-3, 8e-4}}},
             {"revolute", {0, 0, 0.08}, none, z, -3.1, 3.1, 4.5, 12, {0.35, {0.01, 0.001, 0.01}, {4e-4, 3e-4, 3e-4}}}},
            {0, 0, 0.03},
            {1.2, {0.03, 0.02, 0.05}, {0.002, 0.003, 0.0028}}};
  }
  throw std::invalid_argument(
      fmt::format("arm \"{}\": expected scara4, arm6, arm7, heavy6, desk6, gantry5 or polar6", name));
}

std::string inertial_text(const BodySpec& body) {
  const Eigen::Matrix3d I = body.turn * body.inertia.asDiagonal() * body.turn.transpose();
  return fmt::format(
      "    <inertial>\n      <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n"
      "      <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>\n",
      body.com.x(), body.com.y(), body.com.z(), body.mass, I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2),
      I(2, 2));
}

std::string urdf_text(const std::string& name, const ArmSpec& arm) {
  std::string text =
      fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"base_link\"/>\n", name);
  std::string parent = "base_link";
  for (std::size_t i = 0; i < arm.joints.size(); ++i) {
    const JointSpec& j = arm.joints[i];
    const std::string link = fmt::format("link{}", i + 1);
    text += fmt::format(
        "  <joint name=\"joint{}\" type=\"{}\">\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n"
        "    <origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/>\n    <axis xyz=\"{} {} {}\"/>\n"
        "    <limit lower=\"{}\" upper=\"{}\" velocity=\"{}\" effort=\"{}\"/>\n  </joint>\n",
        i + 1, j.type, parent, link, j.xyz.x(), j.xyz.y(), j.xyz.z(), j.rpy.x(), j.rpy.y(), j.rpy.z(),
        j.axis.x(), j.axis.y(), j.axis.z(), j.lower, j.upper, j.velocity, j.effort);
    text += fmt::format("  <link name=\"{}\">\n{}  </link>\n", link, inertial_text(j.body));
    parent = link;
  }
  text += fmt::format(
      "  <joint name=\"tool_mount\" type=\"fixed\">\n    <parent link=\"{}\"/>\n    <child link=\"tool\"/>\n"
      "    <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n  </joint>\n  <link name=\"tool\">\n{}  "
      "</link>\n</robot>\n",
      parent, arm.tool_xyz.x(), arm.tool_xyz.y(), arm.tool_xyz.z(), inertial_text(arm.tool));
  return text;
}

/// A body 10 to 25 % away from another one.
BodySpec true_body(const BodySpec& nominal, Random& random) {
  const auto off = [&] { return 1.0 + either(random) * uniform(random, 0.10, 0.25); };
  BodySpec body;
  body.mass = nominal.mass * off();
  for (int k = 0; k < 3; ++k) body.com[k] = nominal.com[k] * off() + uniform(random, -0.005, 0.005);
  // The second moments ∫x² dm of a body scale one by one, and it stays a body.
  const Vector3d second = Vector3d::Constant(0.5 * nominal.inertia.sum()) - nominal.inertia;
  Vector3d scaled;
  const double common = off();
  for (int k = 0; k < 3; ++k) scaled[k] = std::max(1e-6, second[k]) * common * uniform(random, 0.92, 1.08);
  body.inertia = Vector3d::Constant(scaled.sum()) - scaled;
  Vector3d axis(normal(random), normal(random), normal(random));
  body.turn = Eigen::AngleAxisd(uniform(random, 0.0, 0.15), axis.normalized()).toRotationMatrix();
  return body;
}

// -------------------------------------------------------------------------------------------------- motion

/// A motion, a row per sample.
struct Motion {
  VectorXd time;
  MatrixXd q, qd, qdd;
};

Motion sample(const Path& path, double duration, double rate) {
  const auto rows = static_cast<Eigen::Index>(duration * rate);
  Motion m;
  m.time = VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate);
  m.q.resize(rows, path.num_joints());
  m.qd = m.qdd = m.q;
  VectorXd q(path.num_joints()), qd(q), qdd(q);
  for (Eigen::Index k = 0; k < rows; ++k) {
    path.evaluate(m.time[k], q, qd, qdd);
    m.q.row(k) = q;
    m.qd.row(k) = qd;
    m.qdd.row(k) = qdd;
  }
  return m;
}

/// A path whose torque stays within the limits.
std::shared_ptr<Path> make_path(CaseMotion kind, const model::Robot& robot, double duration, bool brisk, Random& random) {
  const std::shared_ptr<Path> path = kind == CaseMotion::kWork ? work_path(robot, random)
                                                               : exciting_path(robot, duration, brisk, random);
  const model::Dynamics dynamics(robot);
  for (int pass = 0; pass < 12; ++pass) {
    const Motion m = sample(*path, duration, 50.0);
    double worst = 0.0;
    for (Eigen::Index k = 0; k < m.time.size(); ++k) {
      const VectorXd tau = dynamics.joint_torque(m.q.row(k).transpose(), m.qd.row(k).transpose(),
                                                 m.qdd.row(k).transpose(), 1e-3);
      for (int i = 0; i < robot.num_joints(); ++i) {
        worst = std::max(worst, std::abs(tau[i]) / robot.joints[static_cast<std::size_t>(i)].effort_limit);
      }
    }
    if (worst < 0.75) break;
    path->slow_down(0.88);
  }
  return path;
}

// ------------------------------------------------------------------------------------------------- control

/// Damping of the loop over the inertia that a motor feels [1/s].
constexpr double kDampingRate = 220.0;

/// Torque of a nearly true model along the reference, and a stiff PD loop around it.
class ReferenceController : public sim::Controller {
 public:
  ReferenceController(const model::Robot& robot, VectorXd kp, VectorXd kd)
      : dynamics_(robot), kp_(std::move(kp)), kd_(std::move(kd)) {}
  void control(double, const sim::Measurement& m, Eigen::Ref<VectorXd> torque) override {
    torque = dynamics_.joint_torque(m.q_ref, m.qd_ref, m.qdd_ref, 0.02) + kp_.cwiseProduct(m.q_ref - m.q) +
             kd_.cwiseProduct(m.qd_ref - m.qd);
  }

 private:
  model::Dynamics dynamics_;
  VectorXd kp_, kd_;
};

// ------------------------------------------------------------------------------------------------- effects

/// A joint effect as a function, for what is on no list.
class FunctionEffect : public sim::JointEffect {
 public:
  explicit FunctionEffect(std::function<double(const sim::JointPoint&)> f) : f_(std::move(f)) {}
  double torque(const sim::JointPoint& point, const double*) const override { return f_(point); }

 private:
  std::function<double(const sim::JointPoint&)> f_;
};

/// A burst after each reversal: the rate of an oscillator that the sign of the velocity drives.
class KickEffect : public sim::JointEffect {
 public:
  KickEffect(double size, double frequency) : size_(size), w_(kTwoPi * frequency) {}
  double torque(const sim::JointPoint&, const double* z) const override { return size_ * z[1]; }
  int num_states() const override { return 2; }
  void initial_state(const sim::JointPoint&, double* z) const override { z[0] = z[1] = 0.0; }
  void rate(const sim::JointPoint& point, const double* z, double* zd) const override {
    // y'' + 2 D w y' + w² y = w² direction; z = (y, y' / w)
    zd[0] = w_ * z[1];
    zd[1] = w_ * (point.direction - z[0] - 2.0 * 0.25 * z[1]);
  }

 private:
  double size_, w_;
};

/// Smooth random walk: a spline through values of a random walk every second.
struct Walk {
  std::vector<double> value;
  double operator()(double t) const {
    const double u = std::clamp(t, 0.0, static_cast<double>(value.size()) - 2.001);
    const auto k = static_cast<std::size_t>(u);
    return value[k] + (value[k + 1] - value[k]) * smooth_step(u - static_cast<double>(k));
  }
};

double contact_share(const ContactEvent& event, double t) {
  constexpr double kFlank = 0.06;
  return smooth_step((t - event.start) / kFlank) * smooth_step((event.start + event.duration - t) / kFlank);
}

/// Values at the knots of a friction that rises to a hump at medium speed, as no formula does.
constexpr double kCurve[] = {2.0, -2.4, 0.8};

bool belongs_to_joint(const std::string& kind) {
  for (const char* name :
       {"stribeck", "offset", "viscous_nonlinear", "load_friction", "rotor_inertia", "elasticity", "spring",
        "ripple", "hysteresis", "friction_drift", "torque_scale", "friction_curve", "outside:time_sine",
        "outside:neighbour", "outside:random_walk", "outside:backlash_kick"}) {
    if (kind == name) return true;
  }
  return false;
}

/// What the settings of one simulation are made from.
struct Plan {
  model::Robot truth;  ///< with effects, couplings, elasticity, delay
  sim::SimulationSettings settings;
};

/// Everything about a case before it is simulated.
class CaseMaker {
 public:
  CaseMaker(const std::string& kinds, const std::string& arm, std::uint64_t seed, CaseMotion motion,
            const std::array<double, 3>& gravity) {
    std::uint64_t hash = seed * 1000003ULL + 17;
    for (char c : kinds + "/" + arm) hash = hash * 131 + static_cast<unsigned char>(c);
    random_.seed(hash);
    case_.arm = arm;
    std::string name = kinds;
    std::replace(name.begin(), name.end(), ':', '-');
    std::replace(name.begin(), name.end(), '+', '-');
    case_.name = fmt::format("{}-{}-{}{}", name, arm, seed, motion == CaseMotion::kWork ? "-work" : "");
    const ArmSpec nominal = arm_spec(arm);
    ArmSpec real = nominal;
    for (JointSpec& joint : real.joints) joint.body = true_body(joint.body, random_);
    real.tool = true_body(real.tool, random_);
    case_.urdf = urdf_text(arm, nominal);
    case_.robot = urdf::load_urdf_string(case_.urdf, arm);
    case_.truth = urdf::load_urdf_string(urdf_text(arm, real), arm);
    case_.robot.gravity = case_.truth.gravity = gravity;
    n_ = case_.truth.num_joints();
    case_.noise.resize(n_);
    const double share = uniform(random_, 0.0035, 0.0085);
    for (int i = 0; i < n_; ++i) {
      model::RobotJoint& joint = case_.truth.joints[static_cast<std::size_t>(i)];
      joint.actuation.coulomb_friction = joint.effort_limit * uniform(random_, 0.025, 0.06);
      joint.actuation.viscous_friction =
          joint.actuation.coulomb_friction * uniform(random_, 0.6, 1.6) / (0.6 * joint.velocity_limit);
      case_.noise[i] = joint.effort_limit * share * uniform(random_, 0.87, 1.15);
    }
    case_.rate = chance(random_, 0.6) ? 500.0 : 1000.0;
    case_.has_qd = chance(random_, 0.5);
    train_seconds_ = std::round(uniform(random_, 30.0, 40.0));
    // What only quick motion shows has it more often.
    const bool quick =
        kinds.find("elasticity") != std::string::npos || kinds.find("delay") != std::string::npos;
    const bool brisk = chance(random_, quick ? 0.75 : 1.0 / 3.0);
    train_path_ = make_path(motion, case_.truth, train_seconds_, brisk, random_);
    validate_path_ = make_path(motion, case_.truth, kValidateSeconds, brisk, random_);
    motion_ = sample(*train_path_, train_seconds_, 100.0);

    std::string rest = kinds;
    while (!rest.empty()) {
      const std::size_t plus = rest.find('+');
      const std::string kind = rest.substr(0, plus);
      rest = plus == std::string::npos ? "" : rest.substr(plus + 1);
      if (kind != "none") add_effect(kind);
    }
    case_.kind = kinds.rfind("outside", 0) == 0 ? "outside" : kinds.substr(0, kinds.find('+'));
  }

  UndeclaredCase make() {
    MatrixXd exact_train, exact_validate;
    Motion train_motion, validate_motion;
    case_.train = record(true, train_motion, exact_train);
    case_.validate = record(false, validate_motion, exact_validate);
    case_.noise_floor = ((case_.validate.tau - exact_validate).colwise().squaredNorm() /
                         static_cast<double>(exact_validate.rows()))
                            .cwiseSqrt()
                            .transpose();
    judge(train_motion, validate_motion);
    const sim::SimulationSettings simulated = settings(false);
    case_.complete = simulated.robot;
    case_.complete.torque_delay = modelled_.torque_delay;
    if (simulated.gravity)
      case_.complete.gravity = {simulated.gravity->x(), simulated.gravity->y(), simulated.gravity->z()};
    return std::move(case_);
  }

 private:
  static constexpr double kValidateSeconds = 20.0;

  // ---- what baseline leaves of a torque, per joint, in units of the noise

  MatrixXd baseline_columns(const Motion& m, Eigen::Index step) const {
    const model::Dynamics dynamics(case_.robot);
    const Eigen::Index rows = (m.time.size() + step - 1) / step;
    MatrixXd W = MatrixXd::Zero(rows * n_, 12 * n_);
    for (Eigen::Index k = 0; k < rows; ++k) {
      const Eigen::Index r = k * step;
      const MatrixXd Y =
          dynamics.regressor(m.q.row(r).transpose(), m.qd.row(r).transpose(), m.qdd.row(r).transpose());
      for (int i = 0; i < n_; ++i) {
        W.row(k * n_ + i).head(10 * n_) = Y.row(i).head(10 * n_) / case_.noise[i];
        W(k * n_ + i, 10 * n_ + i) = std::tanh(m.qd(r, i) / smooth_speed(i)) / case_.noise[i];
        W(k * n_ + i, 11 * n_ + i) = m.qd(r, i) / case_.noise[i];
      }
    }
    return W;
  }

  VectorXd stack(const MatrixXd& tau, Eigen::Index step) const {
    const Eigen::Index rows = (tau.rows() + step - 1) / step;
    VectorXd b(rows * n_);
    for (Eigen::Index k = 0; k < rows; ++k) {
      for (int i = 0; i < n_; ++i) b[k * n_ + i] = tau(k * step, i) / case_.noise[i];
    }
    return b;
  }

  VectorXd rms_per_joint(const VectorXd& stacked) const {
    VectorXd sum = VectorXd::Zero(n_);
    for (Eigen::Index k = 0; k < stacked.size(); ++k) sum[k % n_] += stacked[k] * stacked[k];
    return (sum * (static_cast<double>(n_) / static_cast<double>(stacked.size()))).cwiseSqrt();
  }

  VectorXd left_over(const MatrixXd& tau) {
    if (baseline_.cols() == 0) {
      MatrixXd W = baseline_columns(motion_, 2);
      const Eigen::ColPivHouseholderQR<MatrixXd> qr(W);
      // Orthonormal basis of what the baseline can say.
      Eigen::Index rank = 0;
      const auto diagonal = qr.matrixR().diagonal().cwiseAbs();
      while (rank < diagonal.size() && diagonal[rank] > 1e-9 * diagonal[0]) ++rank;
      baseline_ = qr.householderQ() * MatrixXd::Identity(W.rows(), rank);
    }
    VectorXd b = stack(tau, 2);
    b -= baseline_ * (baseline_.transpose() * b).eval();
    return rms_per_joint(b);
  }

  // ---- effects

  double smooth_speed(int i) const {
    return case_.truth.joints[static_cast<std::size_t>(i)].joint.type == JointType::kPrismatic ? 5e-4 : 1e-3;
  }
  double direction(Eigen::Index row, int joint) const {
    return std::tanh(motion_.qd(row, joint) / smooth_speed(joint));
  }
  JointActuation<double>& actuation(int joint) {
    return case_.truth.joints[static_cast<std::size_t>(joint)].actuation;
  }

  VectorXd rigid_torque(Eigen::Index k, const model::Dynamics& dynamics) const {
    return dynamics.inverse_dynamics(motion_.q.row(k).transpose(), motion_.qd.row(k).transpose(),
                                     motion_.qdd.row(k).transpose());
  }

  MatrixXd along_motion(const std::function<VectorXd(Eigen::Index)>& torque) const {
    MatrixXd tau(motion_.time.size(), n_);
    for (Eigen::Index k = 0; k < tau.rows(); ++k) tau.row(k) = torque(k).transpose();
    return tau;
  }
  MatrixXd on_joint(int joint, const std::function<double(Eigen::Index)>& torque) const {
    MatrixXd tau = MatrixXd::Zero(motion_.time.size(), n_);
    for (Eigen::Index k = 0; k < tau.rows(); ++k) tau(k, joint) = torque(k);
    return tau;
  }

  model::Robot with_body(const Vector3d& com, double mass) const {
    model::Robot robot = case_.truth;
    const InertialParameters<double> p = sim::inertial_parameters(payload_body(com, mass));
    for (std::size_t k = 0; k < p.size(); ++k) robot.joints.back().link[k] += p[k];
    return robot;
  }
  static sim::Body payload_body(const Vector3d& com, double mass) {
    return {mass, com, mass * 0.0008 * Eigen::Matrix3d::Identity()};
  }

  /// Torque of an effect of size 1 along the training path. `effect` has the shape parameters.
  MatrixXd unit_torque(const UndeclaredEffect& effect) {
    const std::string& kind = effect.kind;
    const int j = effect.joint;
    const auto p = [&](const char* name) { return effect.parameters.at(name); };
    const model::Dynamics dynamics(case_.truth);
    const Motion& m = motion_;
    if (kind == "stribeck") {
      return on_joint(j, [&](Eigen::Index k) {
        const double u = m.qd(k, j) / p("vs");
        return std::exp(-u * u) * direction(k, j);
      });
    }
    if (kind == "offset") {
      return on_joint(
          j, [&](Eigen::Index k) { return effect.variant == "bias" ? 1.0 : std::abs(direction(k, j)); });
    }
    if (kind == "viscous_nonlinear") {
      return on_joint(
          j, [&](Eigen::Index k) { return std::pow(std::abs(m.qd(k, j)), p("p")) * direction(k, j); });
    }
    if (kind == "load_friction") {
      return on_joint(
          j, [&](Eigen::Index k) { return std::abs(rigid_torque(k, dynamics)[j]) * direction(k, j); });
    }
    if (kind == "torque_scale") {
      return on_joint(j, [&](Eigen::Index k) { return rigid_torque(k, dynamics)[j]; });
    }
    if (kind == "friction_curve") {
      return on_joint(j, [&](Eigen::Index k) {
        const double u = std::abs(m.qd(k, j)) / p("V");
        double sum = 0.0;
        for (int i = 0; i < 3; ++i) sum += kCurve[i] * std::max(0.0, 1.0 - std::pow(3.0, i) * u);
        return sum * direction(k, j);
      });
    }
    if (kind == "rotor_inertia") {
      return on_joint(j, [&](Eigen::Index k) { return m.qdd(k, j); });
    }
    if (kind == "spring") {
      return on_joint(j, [&](Eigen::Index k) { return m.q(k, j) - p("q0"); });
    }
    if (kind == "ripple") {
      return on_joint(j, [&](Eigen::Index k) { return std::sin(p("n") * m.q(k, j) + p("phase")); });
    }
    if (kind == "friction_drift") {
      return on_joint(j, [&](Eigen::Index k) {
        return std::exp(-m.time[k] / p("T")) * (actuation(j).coulomb_friction * direction(k, j) +
                                                p("ratio") * actuation(j).viscous_friction * m.qd(k, j));
      });
    }
    if (kind == "payload_change") {
      const model::Dynamics loaded(with_body(Vector3d(effect.com[0], effect.com[1], effect.com[2]), 1.0));
      const bool picked_up = effect.variant == "picked_up";
      return along_motion([&](Eigen::Index k) -> VectorXd {
        if ((m.time[k] >= p("time")) != picked_up) return VectorXd::Zero(n_);
        return rigid_torque(k, loaded) - rigid_torque(k, dynamics);
      });
    }
    if (kind == "delay") {
      MatrixXd tau = along_motion([&](Eigen::Index k) {
        return dynamics.joint_torque(m.q.row(k).transpose(), m.qd.row(k).transpose(),
                                     m.qdd.row(k).transpose(), 0.01);
      });
      MatrixXd rate = MatrixXd::Zero(tau.rows(), n_);
      const Eigen::Index inner = tau.rows() - 2;
      rate.middleRows(1, inner) = (tau.topRows(inner) - tau.bottomRows(inner)) * 50.0;
      return rate;
    }
    if (kind == "contact") {
      // A torque that the arm's motors bring up against a force at the tool: −Jᵀ F, by a force on a still
      // arm.
      sim::ForwardDynamics arm(case_.truth);
      return along_motion([&](Eigen::Index k) -> VectorXd {
        Vector3d force = Vector3d::Zero();
        for (const ContactEvent& e : effect.events) force += e.force * contact_share(e, m.time[k]);
        if (force.norm() == 0.0) return VectorXd::Zero(n_);
        const VectorXd q = m.q.row(k), still = VectorXd::Zero(n_);
        VectorXd excess(n_), with(n_), qdd(n_);
        const auto locked = std::make_unique<bool[]>(static_cast<std::size_t>(n_));
        std::fill(locked.get(), locked.get() + n_, true);
        const sim::Wrench wrench{force, Vector3d::Zero()};
        arm.acceleration(q.data(), still.data(), still.data(), locked.get(), nullptr, qdd.data(),
                         excess.data());
        arm.acceleration(q.data(), still.data(), still.data(), locked.get(), &wrench, qdd.data(),
                         with.data());
        return excess - with;
      });
    }
    if (kind == "wrist_coupling") {
      MatrixXd tau = MatrixXd::Zero(m.time.size(), n_);
      for (Eigen::Index k = 0; k < tau.rows(); ++k) {
        const double v = m.qd(k, 4) + m.qd(k, 5);
        tau(k, 4) = tau(k, 5) = std::tanh(v / 1e-3) + p("ratio") * v;
      }
      return tau;
    }
    if (kind == "base_tilt" || kind == "outside:vibrating_base") {
      const double azimuth = p("azimuth_deg") * std::numbers::pi / 180.0;
      const bool tilt = kind == "base_tilt";
      model::Robot sideways = case_.truth;
      const double size = tilt ? 9.81 * std::numbers::pi / 180.0 : 1.0;
      sideways.gravity = {size * std::cos(azimuth), size * std::sin(azimuth), -9.81};
      const model::Dynamics other(sideways);
      return along_motion([&](Eigen::Index k) -> VectorXd {
        const double share = tilt ? 1.0 : std::sin(kTwoPi * p("frequency_hz") * m.time[k]);
        return share * (rigid_torque(k, other) - rigid_torque(k, dynamics));
      });
    }
    if (kind == "outside:time_sine") {
      return on_joint(j, [&](Eigen::Index k) { return std::sin(kTwoPi * p("frequency_hz") * m.time[k]); });
    }
    if (kind == "outside:neighbour") {
      const int other = static_cast<int>(p("neighbour")) - 1;
      return on_joint(j, [&](Eigen::Index k) { return m.qd(k, other); });
    }
    if (kind == "outside:random_walk") {
      return on_joint(j, [&](Eigen::Index k) { return walk_train_(m.time[k]); });
    }
    if (kind == "outside:backlash_kick") {
      const KickEffect kick(1.0, p("frequency_hz"));
      std::array<double, 2> z{}, zd{};
      return on_joint(j, [&](Eigen::Index k) {
        for (int s = 0; s < 20; ++s) {
          kick.rate({0.0, 0.0, 0.0, direction(k, j)}, z.data(), zd.data());
          for (std::size_t i = 0; i < 2; ++i) z[i] += 0.0005 * zd[i];
        }
        return z[1];
      });
    }
    throw std::invalid_argument(fmt::format("kind \"{}\" is not known", kind));
  }

  /// Shape parameters at random; the joint is given.
  UndeclaredEffect draw(const std::string& kind, int joint) {
    UndeclaredEffect e;
    e.kind = kind;
    e.joint = joint;
    auto& p = e.parameters;
    const auto j = static_cast<Eigen::Index>(std::max(0, joint));
    const double top = train_path_->top_speed()[j];
    const double low = motion_.q.col(j).minCoeff(), high = motion_.q.col(j).maxCoeff();
    const bool prismatic =
        case_.truth.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
    if (kind == "stribeck") p["vs"] = top * log_uniform(random_, 0.03, 0.15);
    if (kind == "friction_curve") p["V"] = top * uniform(random_, 0.4, 0.8);
    if (kind == "offset") e.variant = chance(random_, 0.5) ? "bias" : "asymmetric";
    if (kind == "viscous_nonlinear") p["p"] = chance(random_, 0.5) ? 0.6 : 3.0;
    if (kind == "spring") p["q0"] = uniform(random_, low, high);
    if (kind == "ripple") {
      // On a rail at least one period within the travel.
      const double lowest = std::max(2.0, std::ceil(kTwoPi / (high - low)));
      p["n"] = std::min(100.0, std::round(log_uniform(random_, lowest, prismatic ? 100.0 : 60.0)));
      p["phase"] = uniform(random_, -std::numbers::pi, std::numbers::pi);
    }
    if (kind == "friction_drift") {
      p["T"] = uniform(random_, 6.0, 18.0);
      p["ratio"] = uniform(random_, 0.5, 1.2);
    }
    if (kind == "payload_change") {
      e.variant = chance(random_, 0.5) ? "picked_up" : "dropped";
      p["time"] = uniform(random_, 0.35, 0.6) * train_seconds_;
      const ArmSpec spec = arm_spec(case_.arm);
      for (int k = 0; k < 3; ++k) {
        e.com.push_back(spec.tool_xyz[k] * 1.5 + spec.tool.com[k] + uniform(random_, -0.03, 0.03));
      }
    }
    if (kind == "contact") {
      const int count = 1 + pick(random_, 3);
      for (int k = 0; k < count; ++k) {
        Vector3d way(normal(random_), normal(random_), normal(random_));
        const double slot = (train_seconds_ - 4.0) / count;
        e.events.push_back({2.0 + slot * (k + uniform(random_, 0.0, 0.7)), uniform(random_, 0.3, 1.0),
                            way.normalized() * uniform(random_, 0.7, 1.3)});
      }
    }
    if (kind == "wrist_coupling") p["ratio"] = uniform(random_, 0.3, 1.2);
    if (kind == "base_tilt" || kind == "outside:vibrating_base")
      p["azimuth_deg"] = uniform(random_, -180.0, 180.0);
    if (kind == "outside:vibrating_base") p["frequency_hz"] = uniform(random_, 6.0, 15.0);
    if (kind == "outside:time_sine") p["frequency_hz"] = uniform(random_, 0.8, 8.0);
    if (kind == "outside:neighbour") {
      int other = pick(random_, n_ - 1);
      if (other >= joint) ++other;
      p["neighbour"] = other + 1;
    }
    if (kind == "outside:random_walk") {
      for (Walk* walk : {&walk_train_, &walk_validate_}) {
        walk->value.assign(1, 0.0);
        for (int k = 0; k < 50; ++k) walk->value.push_back(walk->value.back() + normal(random_));
      }
    }
    if (kind == "outside:backlash_kick") p["frequency_hz"] = uniform(random_, 5.0, 12.0);
    return e;
  }

  /// Smallest inertia that each motor feels along the motion, n.
  VectorXd least_inertia() const {
    const model::Dynamics dynamics(case_.truth);
    VectorXd inertia = VectorXd::Constant(n_, 1e9);
    for (Eigen::Index k = 0; k < motion_.time.size(); k += 50) {
      const MatrixXd inverse = dynamics.mass_matrix(motion_.q.row(k).transpose()).inverse();
      inertia = inertia.cwiseMin(inverse.diagonal().cwiseInverse());
    }
    return inertia;
  }

  /// Gives the effect its size.
  static void scale(UndeclaredEffect& e, double size) {
    auto& p = e.parameters;
    const std::string& kind = e.kind;
    if (kind == "stribeck") p["Fs"] = size;
    if (kind == "offset") p["tau0"] = size;
    if (kind == "viscous_nonlinear") p["c"] = size;
    if (kind == "load_friction") p["mu"] = std::min(0.4, size);
    if (kind == "torque_scale") p["s"] = std::min(0.3, size);
    if (kind == "friction_curve") {
      for (int i = 0; i < 3; ++i) p[fmt::format("F{}", i + 1)] = size * kCurve[i];
    }
    if (kind == "rotor_inertia") p["Ia"] = size;
    if (kind == "spring") p["k"] = size;
    if (kind == "ripple") p["A"] = size;
    if (kind == "friction_drift") {
      p["alpha_c"] = size;
      p["alpha_v"] = size * p["ratio"];
      p.erase("ratio");
    }
    if (kind == "payload_change") p["mass"] = std::min(3.5, size);
    if (kind == "delay") p["delay"] = std::clamp(size, 0.0015, 0.014);
    if (kind == "contact") {
      for (ContactEvent& event : e.events) event.force *= size;
    }
    if (kind == "wrist_coupling") {
      p["Fc"] = size;
      p["Fv"] = size * p["ratio"];
      p.erase("ratio");
    }
    if (kind == "base_tilt") p["tilt_deg"] = std::clamp(size, 0.5, 8.0);
    if (kind.rfind("outside", 0) == 0) p["size"] = size;
  }

  void add_effect(const std::string& kind) {
    if (kind == "wrist_coupling" && n_ < 6) {
      throw std::invalid_argument("wrist_coupling needs an arm with joints 5 and 6");
    }
    const double target = log_uniform(random_, 1.2, 4.5);
    if (kind == "elasticity") return add_elasticity(target);
    if (kind == "outside:backlash") return add_backlash(target);
    if (kind == "hysteresis") return add_hysteresis(target, 0.0);
    if (kind == "hysteresis_in_part") return add_hysteresis(target, 0.4);
    for (int attempt = 0; attempt < 90; ++attempt) {
      const int joint = belongs_to_joint(kind) ? pick(random_, n_) : -1;
      if (joint >= 0 && taken(joint)) continue;
      UndeclaredEffect e = draw(kind, joint);
      const MatrixXd unit = unit_torque(e);
      const VectorXd left = left_over(unit);
      VectorXd raw =
          (unit.colwise().squaredNorm() / static_cast<double>(unit.rows())).cwiseSqrt().transpose();
      raw = raw.cwiseQuotient(case_.noise);
      Eigen::Index main = joint;
      if (joint < 0) left.maxCoeff(&main);
      double size = target / left[main];
      // What the baseline takes up nearly whole would have to be of no likely size, and so would what is
      // far larger than the joint's friction. At last the effect stays as small as is likely.
      const bool levels_off = kind == "viscous_nonlinear" && e.parameters["p"] < 1.0;
      const model::RobotJoint& there = case_.truth.joints[static_cast<std::size_t>(main)];
      double largest = (levels_off ? 0.15 : 0.1) * there.effort_limit / (raw[main] * case_.noise[main]);
      if (kind == "viscous_nonlinear") {
        largest = std::min(
            largest, 0.2 * there.effort_limit / std::pow(0.8 * there.velocity_limit, e.parameters["p"]));
      }
      // Holding takes less than twice the force of sliding, and the loop's damping exceeds the steepest fall
      // of friction with speed, 0.86 Fs / vs: else the arm sticks and slips, and no log resolves the jumps.
      if (kind == "stribeck") {
        const double steepest = 0.8 * kDampingRate * least_inertia()[main];
        largest =
            std::min({largest, 0.9 * there.actuation.coulomb_friction, steepest * e.parameters["vs"] / 0.86});
      }
      const bool last = attempt >= 60;
      if (left[main] < (levels_off ? 0.04 : 0.12) * raw[main] && !last) continue;
      if (joint >= 0 && size > largest) {
        if (!last && !levels_off) continue;
        if (kind == "stribeck" && largest < 0.4 * size && attempt < 85)
          continue;  // another joint shows it better
        size = largest;
      }
      if (kind == "load_friction" && size > 0.35 && !last) continue;
      // A contact is seen while it lasts, not over the log.
      if (kind == "contact")
        size = uniform(random_, 6.0, 20.0) /
               (unit.cwiseAbs().colwise().maxCoeff().transpose().cwiseQuotient(case_.noise)).maxCoeff();
      if (kind == "offset") size *= either(random_);
      if (kind == "viscous_nonlinear") {
        // Taken out of the linear part, so that the friction stays of its size.
        const double v = 0.6 * train_path_->top_speed()[main];
        double& linear = actuation(joint).viscous_friction;
        linear = std::max(0.25 * linear, linear - 0.7 * size * std::pow(v, e.parameters["p"] - 1.0));
      }
      scale(e, size);
      e.main_joint = static_cast<int>(main);
      apply(e);
      case_.effects.push_back(e);
      return;
    }
    throw std::invalid_argument(fmt::format("no joint of {} shows \"{}\"", case_.arm, kind));
  }

  bool taken(int joint) const {
    for (const UndeclaredEffect& e : case_.effects) {
      if (e.joint == joint) return true;
    }
    return false;
  }

  /// How many of the first joints have an effect.
  int taken_of(int joints) const {
    int count = 0;
    for (int j = 0; j < joints; ++j) count += taken(j) ? 1 : 0;
    return count;
  }

  /// Inertia about a joint, mean along the motion.
  double mean_inertia(int joint, const model::Dynamics& dynamics) const {
    double mean = 0.0;
    constexpr Eigen::Index kPoses = 20;
    for (Eigen::Index k = 0; k < kPoses; ++k) {
      const Eigen::Index row = k * motion_.time.size() / kPoses;
      mean += dynamics.mass_matrix(motion_.q.row(row).transpose())(joint, joint) / kPoses;
    }
    return mean;
  }

  /// @param e  with its kind and what only that kind has
  void add_gear(UndeclaredEffect e, const Elasticity<double>& gear) {
    e.parameters["stiffness"] = gear.stiffness;
    e.parameters["damping"] = gear.damping;
    e.parameters["motor_inertia"] = gear.motor_inertia;
    e.main_joint = gear.joint;
    case_.effects.push_back(std::move(e));
    modelled_.elasticities.push_back(gear);
  }

  void add_elasticity(double target) {
    UndeclaredEffect e;
    e.kind = "elasticity";
    const int carrying = n_ == 4 ? 2 : 3;  // joints that carry something
    if (taken_of(carrying) == carrying)
      throw std::invalid_argument("every joint that could be elastic has another effect");
    do {
      e.joint = pick(random_, carrying);
    } while (taken(e.joint));
    const model::Dynamics dynamics(case_.truth);
    const double load = mean_inertia(e.joint, dynamics);
    const double motor = load * uniform(random_, 0.05, 0.15);
    // To first order the deflection is τ/K, and its acceleration takes torque.
    const MatrixXd rigid =
        on_joint(e.joint, [&](Eigen::Index k) { return rigid_torque(k, dynamics)[e.joint]; });
    double best = 1e9, w = 0.0;
    for (double hz = 4.5; hz < 13.0; hz *= 1.1) {
      const double stiffness = load * (kTwoPi * hz) * (kTwoPi * hz);
      const MatrixXd tau = on_joint(e.joint, [&](Eigen::Index k) {
        if (k == 0 || k + 1 == rigid.rows()) return 0.0;
        const double bend = (rigid(k + 1, e.joint) - 2.0 * rigid(k, e.joint) + rigid(k - 1, e.joint)) * 1e4;
        return motor * motion_.qdd(k, e.joint) - load * bend / stiffness;
      });
      const double off = std::abs(std::log(left_over(tau)[e.joint] / target));
      if (off < best) {
        best = off;
        w = kTwoPi * hz;
      }
    }
    add_gear(e, {e.joint, load * w * w, 2.0 * uniform(random_, 0.01, 0.04) * load * w, motor});
  }

  /// Play in a stiff gear, on a joint whose load changes sides often.
  void add_backlash(double target) {
    UndeclaredEffect e;
    e.kind = "outside:backlash";
    const model::Dynamics dynamics(case_.truth);
    const MatrixXd rigid = along_motion([&](Eigen::Index k) { return rigid_torque(k, dynamics); });
    int changes = 0;
    do {
      e.joint = pick(random_, n_);
      const VectorXd load = rigid.col(e.joint);
      changes = 0;
      for (Eigen::Index k = 1; k < load.size(); ++k) changes += load[k] * load[k - 1] < 0.0;
    } while (taken(e.joint) || changes < 20);
    const double inertia = mean_inertia(e.joint, dynamics);
    const double w = kTwoPi * uniform(random_, 18.0, 28.0);
    Elasticity<double> gear{e.joint, inertia * w * w, 2.0 * uniform(random_, 0.25, 0.5) * inertia * w,
                            inertia * uniform(random_, 0.3, 1.0)};
    const auto torque = [&](double gap) {
      model::Robot robot = case_.truth;
      robot.elasticities = {gear};
      robot.elasticities[0].gap = gap;
      return model::MotionTorque(robot).torque(motion_.time, motion_.q, motion_.qd, motion_.qdd, 1e-3);
    };
    const MatrixXd without = torque(0.0);
    const double travel = motion_.q.col(e.joint).maxCoeff() - motion_.q.col(e.joint).minCoeff();
    double best = 1e9;
    for (double part = 2e-4; part < 1.5e-2; part *= 1.25) {
      const double off = std::abs(std::log(left_over(torque(part * travel) - without)[e.joint] / target));
      if (off < best) {
        best = off;
        gear.gap = part * travel;
      }
    }
    e.parameters["gap"] = gear.gap;
    add_gear(e, gear);
  }

  /// @param sharp  part of the friction that turns over at once
  void add_hysteresis(double target, double sharp) {
    UndeclaredEffect e;
    e.kind = "hysteresis";
    e.parameters["sharp"] = sharp;
    double best = 1e9;
    for (int attempt = 0; attempt < 12; ++attempt) {
      const int joint = pick(random_, n_);
      if (taken(joint)) continue;
      const double travel = motion_.q.col(joint).maxCoeff() - motion_.q.col(joint).minCoeff();
      for (double share : {0.002, 0.004, 0.008, 0.016, 0.03}) {
        const double x0 = share * travel * uniform(random_, 0.8, 1.25);
        double z = 0.0;
        const MatrixXd tau = on_joint(joint, [&](Eigen::Index k) {
          if (k > 0) {
            const double step = motion_.q(k, joint) - motion_.q(k - 1, joint);
            z = Hysteresis::memory<double>({x0}, z, step);
          }
          return actuation(joint).coulomb_friction * (1.0 - sharp) * (z - direction(k, joint));
        });
        const double here = left_over(tau)[joint];
        if (std::abs(std::log(here / target)) < best) {
          best = std::abs(std::log(here / target));
          e.joint = e.main_joint = joint;
          e.parameters["x0"] = x0;
        }
      }
    }
    apply(e);
    case_.effects.push_back(e);
  }

  /// Puts an effect into the robot that is simulated.
  void apply(const UndeclaredEffect& e) {
    const int kind = joint_effect_kind(std::string_view(e.kind));
    if (kind >= 0 && !(e.kind == "offset" && e.variant == "asymmetric")) {
      heft::JointEffect<double> effect;
      effect.kind = kind;
      effect.joint = e.joint;
      visit_joint_effect(kind, [&](auto type) {
        for (std::size_t k = 0; k < decltype(type)::kParameters.size(); ++k) {
          effect.parameters[k] = e.parameters.at(std::string(decltype(type)::kParameters[k].name));
        }
      });
      modelled_.effects.push_back(effect);
    }
    if (e.kind == "wrist_coupling") {
      GearCoupling<double> coupling;
      coupling.driving = 4;
      coupling.driven = 5;
      coupling.coulomb_friction = e.parameters.at("Fc");
      coupling.viscous_friction = e.parameters.at("Fv");
      modelled_.couplings.push_back(coupling);
    }
    if (e.kind == "delay") modelled_.torque_delay = e.parameters.at("delay");
  }

  // ---- simulation

  sim::SimulationSettings settings(bool train) {
    sim::SimulationSettings s;
    s.robot = case_.truth;
    s.robot.effects = modelled_.effects;
    s.robot.couplings = modelled_.couplings;
    s.robot.elasticities = modelled_.elasticities;
    s.sample_rate = 1000.0;
    // A drive reports the mean torque around the sampling instant, not the one that sets in there.
    s.robot.torque_delay = modelled_.torque_delay + 0.5 / s.sample_rate;
    s.duration = train ? train_seconds_ : kValidateSeconds;
    s.log_rate = case_.rate;
    const std::shared_ptr<Path> path = train ? train_path_ : validate_path_;
    s.reference = path;
    s.initial_position.resize(n_);
    s.initial_velocity.resize(n_);
    VectorXd qdd(n_);
    path->evaluate(0.0, s.initial_position, s.initial_velocity, qdd);
    s.loads = sim::friction_of(s.robot, sim::SignModel::kSmooth);
    s.solver.method = sim::SolverMethod::kBdf;
    s.solver.relative_tolerance = 1e-6;
    s.solver.absolute_tolerance = 1e-8;

    for (const UndeclaredEffect& e : case_.effects) {
      const auto p = [&](const char* name) { return e.parameters.at(name); };
      auto add = [&](std::shared_ptr<const sim::JointEffect> effect) {
        s.loads[static_cast<std::size_t>(e.joint)].effects.push_back(std::move(effect));
      };
      if (e.kind == "offset" && e.variant == "asymmetric")
        add(std::make_shared<sim::AsymmetricFriction>(p("tau0")));
      if (e.kind == "payload_change") {
        const sim::Body body = payload_body(Vector3d(e.com[0], e.com[1], e.com[2]), p("mass"));
        const bool picked_up = e.variant == "picked_up";
        if (train && picked_up) s.payload_events = {{true, body, p("time"), {}, 0.0}};
        if (train && !picked_up)
          s.payload_events = {{true, body, 0.0, {}, 0.0}, {false, {}, p("time"), {}, 0.0}};
        if (!train && picked_up) s.payload_events = {{true, body, 0.0, {}, 0.0}};
      }
      if (e.kind == "contact" && train) {
        s.tool_wrench = [events = e.events](double t) {
          sim::Wrench wrench;
          for (const ContactEvent& event : events) wrench.force += event.force * contact_share(event, t);
          return wrench;
        };
      }
      if (e.kind == "base_tilt") {
        s.gravity = sim::tilted_gravity(Vector3d(0, 0, -9.81), p("tilt_deg") * std::numbers::pi / 180.0,
                                        p("azimuth_deg") * std::numbers::pi / 180.0);
      }
      if (e.kind == "outside:vibrating_base") {
        const double azimuth = p("azimuth_deg") * std::numbers::pi / 180.0, w = kTwoPi * p("frequency_hz");
        s.gravity_of_time = [=, size = p("size")](double t) {
          const double a = size * std::sin(w * t);
          return Vector3d(a * std::cos(azimuth), a * std::sin(azimuth), -9.81);
        };
      }
      if (e.kind == "outside:time_sine") {
        const double size = p("size"), w = kTwoPi * p("frequency_hz");
        add(std::make_shared<FunctionEffect>(
            [=](const sim::JointPoint& at) { return size * std::sin(w * at.time); }));
      }
      if (e.kind == "outside:random_walk") {
        const double size = p("size");
        add(std::make_shared<FunctionEffect>(
            [size, walk = train ? walk_train_ : walk_validate_](const sim::JointPoint& at) {
              return size * walk(at.time);
            }));
      }
      if (e.kind == "outside:neighbour") {
        s.disturbance = [joint = e.joint, other = static_cast<int>(p("neighbour")) - 1, size = p("size")](
                            double, const Eigen::Ref<const VectorXd>&, const Eigen::Ref<const VectorXd>& qd,
                            Eigen::Ref<VectorXd> torque) { torque[joint] += size * qd[other]; };
      }
      if (e.kind == "outside:backlash_kick") add(std::make_shared<KickEffect>(p("size"), p("frequency_hz")));
    }

    // Gains from the smallest inertia that each motor feels, so that the sampled loop is stable.
    VectorXd inertia = least_inertia();
    for (const Elasticity<double>& e : s.robot.elasticities) inertia[e.joint] = e.motor_inertia;
    const VectorXd kd = kDampingRate * inertia;
    VectorXd kp = 12000.0 * inertia;
    model::Robot known = case_.truth;
    for (model::RobotJoint& joint : known.joints) {
      for (double& value : joint.link) value *= 0.98;
    }
    for (const Elasticity<double>& e : s.robot.elasticities) {
      known.joints[static_cast<std::size_t>(e.joint)].actuation.rotor_inertia = e.motor_inertia;
    }
    s.controller = std::make_shared<ReferenceController>(known, kp, kd);
    return s;
  }

  data::Log record(bool train, Motion& exact, MatrixXd& exact_torque) {
    data::Log log = sim::simulate(settings(train)).log;
    const Eigen::Index rows = log.time.size() - 1;  // one at the end less: whole seconds
    data::Log out;
    out.path = fmt::format("{}/{}.csv", case_.name, train ? "train" : "validate");
    out.time = log.time.head(rows);
    out.q.resize(rows, n_);
    out.tau.resize(rows, n_);
    exact_torque = log.tau.topRows(rows);
    exact.time = out.time;
    exact.q = log.q.topRows(rows);
    exact.qd.setZero(rows, n_);
    exact.qdd.setZero(rows, n_);
    const double dt = 1.0 / case_.rate;
    for (Eigen::Index k = 1; k + 1 < rows; ++k) {
      exact.qd.row(k) = (exact.q.row(k + 1) - exact.q.row(k - 1)) / (2.0 * dt);
      exact.qdd.row(k) = (exact.q.row(k + 1) - 2.0 * exact.q.row(k) + exact.q.row(k - 1)) / (dt * dt);
    }
    for (int i = 0; i < n_; ++i) {
      const model::RobotJoint& joint = case_.truth.joints[static_cast<std::size_t>(i)];
      const double quantum = joint.joint.type == JointType::kPrismatic ? 5e-6 : 2e-5;
      const double step = joint.effort_limit >= 60.0 ? 0.1 : joint.effort_limit >= 10.0 ? 0.01 : 0.001;
      for (Eigen::Index k = 0; k < rows; ++k) {
        out.q(k, i) = std::round((log.q(k, i) + 0.3 * quantum * normal(random_)) / quantum) * quantum;
        out.tau(k, i) = std::round((log.tau(k, i) + case_.noise[i] * normal(random_)) / step) * step;
      }
    }
    if (case_.has_qd) {
      // Differences, twice through a first-order low-pass of 40 Hz.
      const double share = 1.0 - std::exp(-kTwoPi * 40.0 * dt);
      out.qd.setZero(rows, n_);
      VectorXd first = VectorXd::Zero(n_), second = first;
      for (Eigen::Index k = 1; k < rows; ++k) {
        first += share * ((out.q.row(k) - out.q.row(k - 1)).transpose() / dt - first);
        second += share * (first - second);
        out.qd.row(k) = second.transpose();
      }
    }
    return out;
  }

  /// Fits the baseline to the training log and takes its errors.
  void judge(const Motion& train, const Motion& validate) {
    const auto step = static_cast<Eigen::Index>(case_.rate / 100.0);
    const auto edge = static_cast<Eigen::Index>(0.5 * case_.rate);
    const auto inner = [&](const Motion& m) {
      const Eigen::Index rows = m.time.size() - 2 * edge;
      return Motion{m.time.segment(edge, rows), m.q.middleRows(edge, rows), m.qd.middleRows(edge, rows),
                    m.qdd.middleRows(edge, rows)};
    };
    const MatrixXd tau_train = case_.train.tau.middleRows(edge, case_.train.tau.rows() - 2 * edge);
    const MatrixXd tau_validate = case_.validate.tau.middleRows(edge, case_.validate.tau.rows() - 2 * edge);
    const MatrixXd W = baseline_columns(inner(train), step);
    const VectorXd b = stack(tau_train, step);
    Eigen::ColPivHouseholderQR<MatrixXd> qr;
    qr.setThreshold(1e-7);
    qr.compute(W);
    const VectorXd parameters = qr.solve(b);
    case_.baseline_train = rms_per_joint(b - W * parameters).cwiseProduct(case_.noise);
    const VectorXd b_validate = stack(tau_validate, step);
    case_.baseline_validate = rms_per_joint(b_validate - baseline_columns(inner(validate), step) * parameters)
                                  .cwiseProduct(case_.noise);
    const auto excess = [&](const VectorXd& rmse) -> VectorXd {
      return (rmse.array().square() - case_.noise_floor.array().square()).max(0.0).sqrt() /
             case_.noise_floor.array();
    };
    case_.excess = excess(case_.baseline_validate);
    case_.excess_train = excess(case_.baseline_train);
  }

  UndeclaredCase case_;
  Random random_;
  int n_{0};
  double train_seconds_{35.0};
  std::shared_ptr<Path> train_path_, validate_path_;
  Motion motion_;          ///< of the training path at 100 Hz
  MatrixXd baseline_;      ///< orthonormal
  model::Robot modelled_;  ///< effects, couplings, elasticities and delay
  Walk walk_train_, walk_validate_;
};

}  // namespace

const std::vector<std::string>& undeclared_kinds() {
  static const std::vector<std::string> kinds{
      "base_tilt",     "contact",       "delay",    "elasticity",        "friction_drift",
      "hysteresis",    "load_friction", "offset",   "payload_change",    "ripple",
      "rotor_inertia", "spring",        "stribeck", "viscous_nonlinear", "wrist_coupling"};
  return kinds;
}

const std::vector<std::string>& outside_kinds() {
  static const std::vector<std::string> kinds{"outside:vibrating_base", "outside:time_sine",
                                              "outside:neighbour", "outside:random_walk",
                                              "outside:backlash_kick", "outside:backlash"};
  return kinds;
}

const std::vector<std::string>& undeclared_arms() {
  static const std::vector<std::string> arms{"scara4", "arm6", "arm7"};
  return arms;
}

UndeclaredCase make_undeclared_case(const std::string& kind, const std::string& arm, std::uint64_t seed,
                                    CaseMotion motion, const std::array<double, 3>& gravity) {
  const bool base_moves = kind.find("base") != std::string::npos;
  if (base_moves && gravity != model::Robot{}.gravity)
    throw std::invalid_argument(fmt::format("\"{}\": expected an arm on the floor, whose gravity is (0, 0, -9.81)", kind));
  return CaseMaker(kind, arm, seed, motion, gravity).make();
}

}  // namespace heft::test
