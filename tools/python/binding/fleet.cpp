// Sums of logs, which are sent and merged, and arms of one type compared.
#include "answer_of.hpp"
#include "heft/compare/fleet.hpp"
#include "heft/host/file.hpp"
#include "heft/identify/sums.hpp"

namespace heft::python {
namespace {

using identify::Sums;
using Logs = std::vector<AnyLog>;

Sums sums_of(const Arm& arm, const Logs& train, const std::string& torque_at, double band,
             const std::vector<double>& torque_constant, bool accept_torque, const Progress& progress) {
  const py::gil_scoped_release free;
  identify::Options asked;
  const data::LogSet logs = open(arm, train, {}, files_of(torque_at, band, torque_constant, 0.0));
  asked.torque = judge_torque(arm, logs, accept_torque);
  asked.progress = checked(progress);
  return identify::sums_of(arm.robot, logs, asked);
}

Answer identify_sums(const Arm& arm, const Sums& sums, const Logs& judge, const std::string& method, double band,
                     const std::vector<double>& torque_constant, bool accept_torque, const Progress& progress) {
  const py::gil_scoped_release free;
  identify::Options asked;
  asked.fit.method = method_of(method);
  asked.band = band;
  asked.traces = true;
  asked.progress = checked(progress);
  data::LogSet logs;
  if (!judge.empty()) {
    logs = open(arm, {}, judge, files_of(data::to_string(sums.torque_at), sums.observation.cutoff, torque_constant, 0.0));
    asked.torque = judge_torque(arm, logs, accept_torque);
  }
  const auto found = std::make_shared<const identify::Identification>(identify::identify(arm.robot, sums, logs, asked));
  Answer answer = answer_of("Identification", found);
  answer.robot = found->fit.robot;
  answer.notes = with(logs, found->notes);
  return answer;
}

/// A model and the name that its arm goes by.
using NamedModel = std::pair<std::string, Arm>;

Answer compare_arms(const std::vector<NamedModel>& arms) {
  const py::gil_scoped_release free;
  std::vector<model::ModelFile> files;
  for (const auto& [name, arm] : arms) {
    if (!arm.file) throw InputError(name + ": found a robot without a fit; expected what identify found, or its file");
    files.push_back(*arm.file);
    files.back().path = name;
  }
  return answer_of("Fleet", std::make_shared<const compare::FleetComparison>(compare::compare_fleet(files)));
}

py::bytes bytes_of(const Sums& sums) { return py::bytes(identify::to_bytes(sums)); }

}  // namespace

void bind_fleet(py::module_& module) {
  py::class_<Sums>(module, "Sums", "What one pass over logs leaves for a fit: to be pickled, sent, merged (+) and fitted.")
      .def("__add__", [](const Sums& a, const Sums& b) { return identify::merged(a, b); },
           py::call_guard<py::gil_scoped_release>())
      .def("__len__", [](const Sums& sums) { return sums.logs.size(); })
      .def("__bytes__", &bytes_of)
      .def_property_readonly("nbytes", [](const Sums& sums) { return identify::to_bytes(sums).size(); })
      .def_property_readonly("logs",
                             [](const Sums& sums) {
                               std::vector<std::string> paths;
                               for (const identify::LogShare& log : sums.logs) paths.push_back(log.summary.path);
                               return paths;
                             })
      .def("save", [](const Sums& sums, const std::string& path) { host::write_file_atomically(path, identify::to_bytes(sums)); },
           py::arg("path"))
      .def(py::pickle(&bytes_of, [](const py::bytes& bytes) { return identify::sums_from_bytes(std::string_view(bytes)); }))
      .def("__repr__", [](const Sums& sums) {
        return "<heft.Sums of " + std::to_string(sums.logs.size()) + " logs of '" + sums.robot + "'>";
      });
  module.def("sums", &sums_of, py::arg("robot"), py::arg("logs"), py::arg("torque_at"), py::arg("band"),
             py::arg("torque_constant"), py::arg("accept_torque"), py::arg("progress"));
  module.def(
      "read_sums",
      [](const std::string& path) { return identify::sums_from_bytes(host::read_file(path, "sums"), path); },
      py::arg("path"));
  module.def("identify_sums", &identify_sums, py::arg("robot"), py::arg("sums"), py::arg("validate"), py::arg("method"),
             py::arg("band"), py::arg("torque_constant"), py::arg("accept_torque"), py::arg("progress"));
  module.def("fleet", &compare_arms, py::arg("arms"));
}

}  // namespace heft::python
