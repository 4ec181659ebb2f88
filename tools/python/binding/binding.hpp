/// @file
/// What the parts of the Python module share. Facades only: nothing is computed here.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/page/page.hpp"

namespace heft::python {

namespace py = pybind11;

/// A robot as the command has it: of a URDF, or of a model file with the record of its fit.
struct Arm {
  model::Robot robot;
  std::optional<model::ModelFile> file;
  std::string source;  ///< path or name
};

/// A path, or a log in memory.
using AnyLog = std::variant<std::string, std::shared_ptr<data::Log>>;

/// Called with what is being done and its share; None: nobody is told. Ctrl-C ends the work from here.
using Progress = std::function<void(const std::string& what, double done)>;

/// What a facade found, in the words of report.
struct Answer {
  std::string kind;                              ///< "Identification"
  std::function<std::string()> brief, full, json;
  std::function<page::Page()> page;
  host::Judgement judgement;
  std::vector<std::string> notes;
  std::function<model::ModelFile()> model_file;  ///< empty: it is no model
  std::optional<model::Robot> robot;             ///< with what was found
  std::shared_ptr<data::Log> log;                ///< of a motion or a simulation
};

/// What was asked of logs, as the facade takes it.
data::LogFiles files_of(const std::string& torque_at, double band, const std::vector<double>& torque_constant, double split);
/// Notes with those of the logs in front.
std::vector<std::string> with(const data::LogSet& logs, std::vector<std::string> notes);
identify::Method method_of(const std::string& name);

/// Logs to fit to and to judge on: files piece by piece, or all in memory as soon as one of them is.
data::LogSet open(const Arm& arm, const std::vector<AnyLog>& train, const std::vector<AnyLog>& judge,
                  data::LogFiles files);
/// What speaks against the torque of the logs; a contradiction is refused unless it is accepted.
host::Judgement judge_torque(const Arm& arm, const data::LogSet& logs, bool accept);
data::TorqueAt torque_at_of(const std::string& where);
/// Progress that looks for Ctrl-C. Call it with the interpreter's lock released.
Progress checked(const Progress& progress);

void bind_logs(py::module_& module);
void bind_answers(py::module_& module);
void bind_live(py::module_& module);
void bind_fleet(py::module_& module);

}  // namespace heft::python
