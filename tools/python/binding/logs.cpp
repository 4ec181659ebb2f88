// Robots and logs.
#include <cmath>

#include <fmt/format.h>

#include "binding.hpp"
#include "heft/data/log_part.hpp"
#include "heft/data/read_map.hpp"
#include "heft/exchange/robot_formats.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::python {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Arm load_arm(const std::string& source) {
  Arm arm{{}, std::nullopt, source};
  if (source.ends_with(".json")) {
    arm.file = model::read_model(source);
    arm.robot = model::make_robot(*arm.file);
  } else {
    arm.robot = urdf::load_urdf(urdf::resolve_robot(source));
  }
  return arm;
}

data::Log make_log(const VectorXd& time, const MatrixXd& q, const std::optional<MatrixXd>& tau,
                   const std::optional<MatrixXd>& qd, const std::optional<MatrixXd>& qdd,
                   const std::optional<MatrixXd>& current, const std::map<std::string, VectorXd>& extra,
                   const std::string& name) {
  data::Log log;
  log.path = name;
  log.time = time;
  const auto put = [&](MatrixXd& place, const std::optional<MatrixXd>& values, const char* what) {
    if (!values) return;
    if (values->rows() != time.size() || values->cols() != q.cols())
      throw DataError(fmt::format("{}: {} is {} × {}; expected {} × {}, a row a sample and a column a joint", name, what,
                                  values->rows(), values->cols(), time.size(), q.cols()));
    place = *values;
  };
  put(log.q, q, "q");
  put(log.tau, tau, "tau");
  put(log.qd, qd, "qd");
  put(log.qdd, qdd, "qdd");
  put(log.current, current, "current");
  for (const auto& [column, values] : extra) {
    if (values.size() != time.size())
      throw DataError(fmt::format("{}: {} has {} rows, time has {}; expected the same number", name, column,
                                  values.size(), time.size()));
    log.extra.emplace_back(column, values);
  }
  return log;
}

/// A row of answers for each row of states.
template <typename Of>
MatrixXd rows_of(const Arm& arm, const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd, Of&& of) {
  const int n = arm.robot.num_joints();
  for (const MatrixXd* part : {&q, &qd, &qdd}) {
    if (part->cols() != n || part->rows() != q.rows())
      throw InputError(fmt::format("states are {} × {}; expected a column for each of {} joints and the same rows in each",
                                   part->rows(), part->cols(), n));
  }
  const model::Dynamics dynamics(arm.robot);
  MatrixXd result(q.rows(), n);
  for (Eigen::Index k = 0; k < q.rows(); ++k)
    result.row(k) = of(dynamics, q.row(k).transpose(), qd.row(k).transpose(), qdd.row(k).transpose()).transpose();
  return result;
}

}  // namespace

data::TorqueAt torque_at_of(const std::string& where) {
  if (where == "motor") return data::TorqueAt::kMotor;
  if (where == "joint") return data::TorqueAt::kJoint;
  throw InputError(fmt::format("torque_at: found '{}'; expected 'motor' or 'joint'", where));
}

data::LogSet open(const Arm& arm, const std::vector<AnyLog>& train, const std::vector<AnyLog>& judge, data::LogFiles files) {
  const auto specs = arm.robot.joint_specs();
  files.robot = arm.robot.name;
  bool in_memory = false;
  for (const auto* logs : {&train, &judge})
    for (const AnyLog& log : *logs) in_memory |= std::holds_alternative<std::shared_ptr<data::Log>>(log);
  if (!in_memory) {
    for (const AnyLog& log : train) files.train.push_back(std::get<std::string>(log));
    for (const AnyLog& log : judge) files.judge.push_back(std::get<std::string>(log));
    return data::open_logs(specs, files);
  }
  data::LogRequirements needs;
  needs.num_joints = arm.robot.num_joints();
  needs.robot_name = arm.robot.name;
  needs.torque = files.torque;
  needs.torque_constant = files.torque_constant;
  const auto read = [&](const std::vector<AnyLog>& from) {
    std::vector<data::Log> logs;
    for (const AnyLog& log : from) {
      const auto* path = std::get_if<std::string>(&log);
      logs.push_back(path != nullptr ? data::read_log(*path, needs) : *std::get<std::shared_ptr<data::Log>>(log));
    }
    return logs;
  };
  std::vector<data::Log> fitted = read(train), judged = read(judge);
  if (judged.empty() && fitted.size() == 1 && files.split > 0.0 && fitted.front().time.size() > 1) {
    const data::Log whole = fitted.front();
    const double begin = whole.time[0], end = whole.time[whole.time.size() - 1], cut = begin + files.split * (end - begin);
    fitted = {data::part_of(whole, begin, cut)};
    judged = {data::part_of(whole, cut, std::nextafter(end, INFINITY))};
  }
  return data::log_set(specs, std::move(fitted), std::move(judged), files.torque_at);
}

host::Judgement judge_torque(const Arm& arm, const data::LogSet& logs, bool accept) {
  host::Judgement judgement;
  for (const data::LogSource& log : logs.given()) {
    const plausibility::TorqueCheck check = plausibility::check_torque(
        arm.robot, data::stream(log), {logs.torque_at() == data::TorqueAt::kMotor, {}});
    if (!accept) plausibility::refuse_contradictions(check);
    judgement.add(check.judgement());
  }
  return judgement;
}

namespace {

/// @param map  as of the command's --map
std::shared_ptr<data::Log> read_log_as(const std::string& path, const std::string& topic, const std::vector<std::string>& joints,
                                       const std::vector<std::string>& map) {
  data::LogRequirements needs;
  needs.as = {topic, joints, data::read_map(map)};
  return std::make_shared<data::Log>(data::read_log(path, needs));
}

}  // namespace

void bind_logs(py::module_& module) {
  py::class_<Arm>(module, "Robot", "A serial arm: of a URDF, of heft's own robots by name, or of a model file (.json).")
      .def(py::init(&load_arm), py::arg("source"))
      .def_property_readonly("name", [](const Arm& arm) { return arm.robot.name; })
      .def_property_readonly("num_joints", [](const Arm& arm) { return arm.robot.num_joints(); })
      .def_property_readonly("joint_names",
                             [](const Arm& arm) {
                               std::vector<std::string> names;
                               for (const model::RobotJoint& joint : arm.robot.joints) names.push_back(joint.name);
                               return names;
                             })
      .def("torque",
           [](const Arm& arm, const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd) {
             return rows_of(arm, q, qd, qdd, [](const auto& d, const auto& a, const auto& b, const auto& c) {
               return d.joint_torque(a, b, c);
             });
           },
           py::arg("q"), py::arg("qd"), py::arg("qdd"), py::call_guard<py::gil_scoped_release>(),
           "Torque of each row with friction and all that one instant determines, m × n [N·m, N].")
      .def("inverse_dynamics",
           [](const Arm& arm, const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd) {
             return rows_of(arm, q, qd, qdd, [](const auto& d, const auto& a, const auto& b, const auto& c) {
               return d.inverse_dynamics(a, b, c);
             });
           },
           py::arg("q"), py::arg("qd"), py::arg("qdd"), py::call_guard<py::gil_scoped_release>(),
           "Torque of the rigid bodies alone, m × n [N·m, N].")
      .def("gravity",
           [](const Arm& arm, const MatrixXd& q) {
             return rows_of(arm, q, q, q, [](const auto& d, const auto& a, const auto&, const auto&) {
               return d.gravity_torque(a);
             });
           },
           py::arg("q"), "Gravity torque of each row, m × n [N·m, N].")
      .def("mass_matrix", [](const Arm& arm, const VectorXd& q) { return model::Dynamics(arm.robot).mass_matrix(q); },
           py::arg("q"), "Joint-space mass matrix of the rigid bodies, n × n.")
      .def("regressor",
           [](const Arm& arm, const VectorXd& q, const VectorXd& qd, const VectorXd& qdd) {
             return model::Dynamics(arm.robot).regressor(q, qd, qdd);
           },
           py::arg("q"), py::arg("qd"), py::arg("qdd"),
           "Full regressor, n × 14 n: ten columns a link, then rotor inertia, Coulomb, viscous, offset.")
      .def("export",
           [](const Arm& arm, const std::string& format) { return exchange::to_text(arm.robot, format).text; },
           py::arg("format"), "Text of a model file: 'urdf', 'mjcf' or 'sdf'.")
      .def("__repr__", [](const Arm& arm) {
        return fmt::format("<heft.Robot '{}', {} joints>", arm.robot.name, arm.robot.num_joints());
      });

  // Views of the log's own columns: no copy, and the log lives as long as they do.
  const auto view = py::return_value_policy::reference_internal;
  py::class_<data::Log, std::shared_ptr<data::Log>>(module, "Log",
                                                    "A log in memory. SI units; a row a sample, a column a joint.")
      .def(py::init(&make_log), py::arg("time"), py::arg("q"), py::arg("tau") = std::nullopt, py::arg("qd") = std::nullopt,
           py::arg("qdd") = std::nullopt, py::arg("current") = std::nullopt,
           py::arg("extra") = std::map<std::string, VectorXd>{}, py::arg("name") = "log in memory")
      .def_property_readonly("time", [](const data::Log& log) -> const VectorXd& { return log.time; }, view)
      .def_property_readonly("q", [](const data::Log& log) -> const MatrixXd& { return log.q; }, view)
      .def_property_readonly("qd", [](const data::Log& log) -> const MatrixXd& { return log.qd; }, view)
      .def_property_readonly("qdd", [](const data::Log& log) -> const MatrixXd& { return log.qdd; }, view)
      .def_property_readonly("tau", [](const data::Log& log) -> const MatrixXd& { return log.tau; }, view)
      .def_property_readonly("current", [](const data::Log& log) -> const MatrixXd& { return log.current; }, view)
      .def_property_readonly("extra",
                             [](const data::Log& log) {
                               py::dict columns;
                               for (const auto& [name, values] : log.extra) columns[py::str(name)] = values;
                               return columns;
                             })
      .def_readwrite("name", &data::Log::path)
      .def("write", [](const data::Log& log, const std::string& path) { data::write_log(path, log); }, py::arg("path"))
      .def("__len__", &data::Log::num_samples)
      .def("__repr__", [](const data::Log& log) {
        return fmt::format("<heft.Log '{}', {} samples, {} joints>", log.path, log.num_samples(), log.num_joints());
      });
  module.def("read_log", read_log_as, py::arg("path"), py::arg("topic"), py::arg("joints"), py::arg("map"),
             py::call_guard<py::gil_scoped_release>());
  module.def("robot_names", &urdf::robot_names);
}

}  // namespace heft::python
