// MuJoCo's dynamics, without contacts, limits, friction and actuators.
#include <memory>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#ifdef HEFT_WITH_MUJOCO
#include <mujoco/mujoco.h>
#endif

#include "dynamics_contest.hpp"

namespace heft::bench {

#ifdef HEFT_WITH_MUJOCO

namespace {

using Eigen::Index;

/// The robot as a file of MuJoCo's.
std::string xml_of(const model::Robot& robot) {
  std::string xml = fmt::format(
      "<mujoco><compiler angle=\"radian\" balanceinertia=\"false\" boundmass=\"0\"/><option gravity=\"{} {} {}\"><flag "
      "contact=\"disable\" constraint=\"disable\"/></option><worldbody>",
      robot.gravity[0], robot.gravity[1], robot.gravity[2]);
  for (const model::RobotJoint& joint : robot.joints) {
    const auto& p = joint.joint.position;
    const auto& R = joint.joint.rotation;
    const auto& a = joint.joint.axis;
    const auto& l = joint.link;
    const double m = l[kMass], x = l[kMcx] / m, y = l[kMcy] / m, z = l[kMcz] / m;
    xml += fmt::format(
        "<body pos=\"{} {} {}\" xyaxes=\"{} {} {} {} {} {}\"><inertial pos=\"{} {} {}\" mass=\"{}\" fullinertia=\"{} {} {} "
        "{} {} {}\"/><joint type=\"hinge\" axis=\"{} {} {}\"/>",
        p[0], p[1], p[2], R[0], R[3], R[6], R[1], R[4], R[7], x, y, z, m, l[kIxx] - m * (y * y + z * z),
        l[kIyy] - m * (x * x + z * z), l[kIzz] - m * (x * x + y * y), l[kIxy] + m * x * y, l[kIxz] + m * x * z,
        l[kIyz] + m * y * z, a[0], a[1], a[2]);
  }
  for (int j = 0; j < robot.num_joints(); ++j) xml += "</body>";
  return xml + "</worldbody></mujoco>";
}

struct Mujoco {
  explicit Mujoco(const model::Robot& robot) {
    const std::string xml = xml_of(robot);
    char error[1000] = "";
    mjSpec* spec = mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error);
    if (spec != nullptr) model = mj_compile(spec, nullptr);
    if (model == nullptr) throw std::runtime_error(fmt::format("MuJoCo refuses the robot: {}", error));
    mj_deleteSpec(spec);
    data = mj_makeData(model);
  }
  Mujoco(const Mujoco&) = delete;
  Mujoco& operator=(const Mujoco&) = delete;
  ~Mujoco() { mj_deleteData(data), mj_deleteModel(model); }

  void set(const StateSet& s, Index k) const {
    for (Index j = 0; j < s.q.cols(); ++j) data->qpos[j] = s.q(k, j), data->qvel[j] = s.qd(k, j);
  }

  mjModel* model{nullptr};
  mjData* data{nullptr};
};

}  // namespace

std::vector<Contestant> mujoco_contestants(const model::Robot& robot) {
  const auto mj = std::make_shared<Mujoco>(robot);
  return {{"MuJoCo", Quantity::kTorque,
           [mj](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               mj->set(s, k);
               for (Index j = 0; j < s.q.cols(); ++j) mj->data->qacc[j] = s.qdd(k, j);
               mj_inverse(mj->model, mj->data);
               for (Index j = 0; j < s.q.cols(); ++j) out.values(k, j) = mj->data->qfrc_inverse[j];
             }
           }},
          {"MuJoCo", Quantity::kAcceleration, [mj](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k) {
               mj->set(s, k);
               for (Index j = 0; j < s.q.cols(); ++j) mj->data->qfrc_applied[j] = s.tau(k, j);
               mj_forward(mj->model, mj->data);
               for (Index j = 0; j < s.q.cols(); ++j) out.values(k, j) = mj->data->qacc[j];
             }
           }}};
}

#else

std::vector<Contestant> mujoco_contestants(const model::Robot&) { return {}; }

#endif

}  // namespace heft::bench
