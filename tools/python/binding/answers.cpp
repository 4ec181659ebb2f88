// The questions, each one call of its facade, answered in the words of report.
#include <filesystem>

#include <fmt/format.h>

#include "answer_of.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/data/deflections.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/identify/identify.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/diagnosis.hpp"
#include "heft/report/payload.hpp"
#include "heft/report/stiffness.hpp"
#include "heft/sim/scenario.hpp"
#include "heft/sim/simulation.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "heft/validate/validate.hpp"

namespace heft::python {
namespace {

using Logs = std::vector<AnyLog>;

Answer identify_logs(const Arm& arm, const Logs& train, const Logs& judge, const std::string& method, double split,
                     const std::string& torque_at, double band, const std::vector<double>& torque_constant,
                     bool accept_torque, const Progress& progress) {
  const py::gil_scoped_release free;
  identify::Options asked;
  asked.fit.method = method_of(method);
  asked.band = band;
  asked.traces = true;
  const data::LogSet logs = open(arm, train, judge, files_of(torque_at, band, torque_constant, split));
  asked.torque = judge_torque(arm, logs, accept_torque);
  asked.progress = checked(progress);
  const auto found = std::make_shared<const identify::Identification>(identify::identify(arm.robot, logs, asked));
  Answer answer = answer_of("Identification", found);
  answer.robot = found->fit.robot;
  answer.notes = with(logs, found->notes);
  return answer;
}

Answer validate_logs(const Arm& arm, const Logs& judge, const std::optional<std::string>& torque_at, double band,
                     const std::vector<double>& torque_constant, bool accept_torque, const Progress& progress) {
  const py::gil_scoped_release free;
  const model::FitRecord* const fit = arm.file && arm.file->fit ? &*arm.file->fit : nullptr;
  const std::string at = torque_at ? *torque_at : fit != nullptr ? fit->torque_at : "motor";
  const data::LogSet logs = open(arm, {}, judge, files_of(at, band, torque_constant, 0.0));
  validate::Options asked;
  asked.band = band;
  (arm.file ? asked.model : asked.urdf) = arm.source;
  asked.traces = true;
  asked.torque = judge_torque(arm, logs, accept_torque);
  asked.progress = checked(progress);
  const auto judged = std::make_shared<const validate::Validation>(validate::validate(
      arm.robot, fit, arm.file ? arm.file->provenance.logs : std::vector<std::string>{}, logs, asked));
  Answer answer = answer_of("Validation", judged);
  answer.notes = with(logs, judged->notes);
  return answer;
}

Answer diagnose_logs(const Arm& arm, const Logs& train, const Logs& judge, double split, const std::string& torque_at,
                     double band, double cutoff, bool refit, const std::vector<double>& torque_constant, bool accept_torque,
                     const Progress& progress) {
  const py::gil_scoped_release free;
  const data::LogSet logs = open(arm, train, judge, files_of(torque_at, band, torque_constant, split));
  report::DiagnosisContext context;
  context.torque_at = torque_at;
  context.torque = judge_torque(arm, logs, accept_torque);
  for (const data::LogSource& log : logs.train()) context.train.push_back(log.path);
  for (const data::LogSource& log : logs.judge()) context.validate.push_back(log.path);
  diagnose::DiagnoseOptions asked;
  asked.band = band;
  asked.cutoff = cutoff;
  asked.refit = refit;
  asked.progress = checked(progress);
  const auto found = std::make_shared<const diagnose::Diagnosis>(diagnose::diagnose(arm.robot, logs, asked));
  Answer answer;
  answer.kind = "Diagnosis";
  answer.brief = [found] { return report::brief(*found); };
  answer.full = [found, context] { return report::full(*found, context); };
  answer.json = [found, context] { return report::json(*found, context); };
  answer.page = [found, context] { return report::page(*found, context); };
  answer.model_file = [found] { return report::model_file(*found); };
  answer.judgement = found->judgement();
  answer.notes = with(logs, found->notes);
  answer.robot = found->written();
  return answer;
}

Answer weigh(const Arm& arm, const Logs& carrying, const Logs& baseline, const Logs& zero, int first_joint,
             const std::string& torque_at, double band, const std::vector<double>& torque_constant, bool accept_torque,
             const Progress& progress) {
  const py::gil_scoped_release free;
  if (baseline.empty() == !arm.file.has_value())
    throw InputError("give either a robot of a model file of the arm without load, or a baseline to fit it to");
  Logs judge = zero;
  judge.insert(judge.end(), carrying.begin(), carrying.end());
  const data::LogSet logs = open(arm, baseline, judge, files_of(torque_at, band, torque_constant, 0.0));
  payload::Options how;
  how.first_joint = first_joint;
  how.cutoff = band;
  how.torque_at = logs.torque_at();
  for (const data::LogSource& log : logs.given())
    how.torque.push_back(judge_torque(arm, data::log_set(arm.robot.joint_specs(), {}, {data::read(log)}, logs.torque_at()),
                                      accept_torque));
  how.progress = checked(progress);
  const auto found = std::make_shared<const payload::Weighing>(
      baseline.empty() ? payload::weigh(arm.robot, *arm.file, logs, zero.size(), how)
                       : payload::weigh(arm.robot, logs, zero.size(), how));
  if (const std::string why = found->unanswered(); !why.empty()) throw NotIdentifiableError(why);
  Answer answer;
  answer.kind = "Payload";
  answer.brief = [found] { return report::brief(*found); };
  answer.full = [found] { return report::full(*found); };
  answer.json = [found] { return report::json(*found); };
  answer.page = [found] { return report::page(*found); };
  if (!baseline.empty()) answer.model_file = [found] { return found->model_file(); };
  for (const payload::Payload& load : found->loads) answer.judgement.add(load.judgement);
  answer.notes = with(logs, found->notes());
  return answer;
}

Answer excite_arm(const Arm& arm, double duration, int harmonics, std::uint64_t seed, bool rehearse, const Progress& progress) {
  const py::gil_scoped_release free;
  excite::LimitDefaults defaults;
  if (!arm.file) defaults.shapes = urdf::load_shapes(urdf::resolve_robot(arm.source), arm.robot, nullptr);
  const excite::LimitsFile limits{excite::limits_of(arm.robot, defaults), {}, {}};
  excite::Options asked;
  asked.search.duration = duration;
  asked.search.harmonics = harmonics;
  asked.search.seed = seed;
  asked.rehearse = rehearse;
  const Progress tell = checked(progress);
  asked.progress = [tell](double done) { tell("designing", done); };
  const auto motion = std::make_shared<const excite::ExcitingMotion>(excite::design(arm.robot, limits, asked));
  Answer answer = answer_of("Motion", motion);
  answer.log = std::make_shared<data::Log>(motion->log);
  return answer;
}

Answer simulate(const std::string& json, const std::string& folder) {
  const py::gil_scoped_release free;
  const auto load = [&](const std::string& name) {
    const std::filesystem::path next_to_it = std::filesystem::path(folder) / name;
    std::error_code ignored;
    return urdf::load_urdf(std::filesystem::is_regular_file(next_to_it, ignored) ? next_to_it.string()
                                                                                  : urdf::resolve_robot(name));
  };
  const sim::Scenario scenario = sim::parse_scenario(json, "scenario", load);
  const auto done = std::make_shared<const sim::Simulation>(
      sim::Simulation{scenario.settings.robot.name, "scenario", false, sim::simulate_scenario(scenario)});
  Answer answer = answer_of("Simulation", done);
  answer.log = std::make_shared<data::Log>(done->result.log);
  return answer;
}

Answer stiffness_of(const Arm& arm, const std::vector<std::string>& files) {
  const py::gil_scoped_release free;
  std::vector<data::Deflection> rows;
  std::vector<std::string> notes;
  stiffness::DeflectionOptions asked;
  for (const std::string& file : files) {
    const auto read = data::read_deflections(file, arm.robot.num_joints(), arm.robot.name, &notes);
    rows.insert(rows.end(), read.begin(), read.end());
    asked.sources.push_back(file);
  }
  const auto found = std::make_shared<const report::StiffnessReport>(
      report::StiffnessReport{stiffness::from_deflections(arm.robot, rows, asked, &notes), {}});
  Answer answer;
  answer.kind = "Stiffness";
  answer.brief = [found] { return report::brief(found->stiffness); };
  answer.full = [found] { return report::full(*found); };
  answer.json = [found] { return report::json(*found); };
  answer.page = [found] { return report::page(*found); };
  answer.model_file = [found] { return report::model_file(found->stiffness); };
  answer.notes = notes;
  return answer;
}

}  // namespace

data::LogFiles files_of(const std::string& torque_at, double band, const std::vector<double>& torque_constant, double split) {
  data::LogFiles files;
  files.torque_at = torque_at_of(torque_at);
  files.cutoff = band;
  files.torque_constant = torque_constant;
  files.split = split;
  return files;
}

std::vector<std::string> with(const data::LogSet& logs, std::vector<std::string> notes) {
  notes.insert(notes.begin(), logs.notes().begin(), logs.notes().end());
  return notes;
}

identify::Method method_of(const std::string& name) {
  for (const auto method : {identify::Method::kOls, identify::Method::kWls, identify::Method::kIrls, identify::Method::kIv,
                            identify::Method::kTls, identify::Method::kPhysical}) {
    if (name == to_string(method)) return method;
  }
  throw InputError(fmt::format("method: found '{}'; expected ols, wls, irls, iv, tls or physical", name));
}

Progress checked(const Progress& progress) {
  return [progress](const std::string& what, double done) {
    const py::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress) progress(what, done);
  };
}

void bind_answers(py::module_& module) {
  py::class_<Answer>(module, "Answer", "What was found, in the words and fields of the command.")
      .def_readonly("kind", &Answer::kind)
      .def("brief", [](const Answer& a) { return a.brief(); }, "One sentence.")
      .def("full", [](const Answer& a) { return a.full(); }, "What the command prints.")
      .def("json", [](const Answer& a) { return a.json(); }, "Fields as in tools/README.md.")
      .def("html", [](const Answer& a) { return a.page().html(); }, py::call_guard<py::gil_scoped_release>(), "The page.")
      .def_property_readonly("verdict", [](const Answer& a) { return std::string(host::to_string(a.judgement.verdict)); })
      .def_property_readonly("reasons", [](const Answer& a) { return a.judgement.reasons; })
      .def_property_readonly("usable", [](const Answer& a) { return a.judgement.usable(); })
      .def_readonly("notes", &Answer::notes)
      .def_property_readonly("log", [](const Answer& a) { return a.log; })
      .def_property_readonly("robot",
                             [](const Answer& a) -> std::optional<Arm> {
                               if (!a.robot || !a.model_file) return std::nullopt;
                               return Arm{*a.robot, a.model_file(), a.kind};
                             })
      .def("save",
           [](const Answer& a, const std::string& path) {
             if (!a.model_file) throw InputError(fmt::format("{} holds no model; expected one to save", a.kind));
             model::write_model(path, a.model_file());
           },
           py::arg("path"), "Writes the model file.")
      .def("report", [](const Answer& a, const std::string& path) { a.page().write(path); }, py::arg("path"),
           "Writes the page (HTML).");
  const std::vector<double> none;
  module.def("identify", &identify_logs, py::arg("robot"), py::arg("logs"), py::arg("validate"), py::arg("method"),
             py::arg("split"), py::arg("torque_at"), py::arg("band"), py::arg("torque_constant"), py::arg("accept_torque"),
             py::arg("progress"));
  module.def("validate", &validate_logs, py::arg("robot"), py::arg("logs"), py::arg("torque_at"), py::arg("band"),
             py::arg("torque_constant"), py::arg("accept_torque"), py::arg("progress"));
  module.def("diagnose", &diagnose_logs, py::arg("robot"), py::arg("logs"), py::arg("validate"), py::arg("split"),
             py::arg("torque_at"), py::arg("band"), py::arg("cutoff"), py::arg("refit"), py::arg("torque_constant"),
             py::arg("accept_torque"), py::arg("progress"));
  module.def("payload", &weigh, py::arg("robot"), py::arg("logs"), py::arg("baseline"), py::arg("zero"), py::arg("first_joint"),
             py::arg("torque_at"), py::arg("band"), py::arg("torque_constant"), py::arg("accept_torque"), py::arg("progress"));
  module.def("excite", &excite_arm, py::arg("robot"), py::arg("duration"), py::arg("harmonics"), py::arg("seed"),
             py::arg("rehearse"), py::arg("progress"));
  module.def("simulate", &simulate, py::arg("scenario"), py::arg("folder"));
  module.def("stiffness", &stiffness_of, py::arg("robot"), py::arg("measurements"));
}

}  // namespace heft::python
