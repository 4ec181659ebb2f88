// The Python module heft._heft.
#include "binding.hpp"
#include "heft/host/error.hpp"
#include "heft/host/reproducible.hpp"

PYBIND11_MODULE(_heft, module) {
  namespace py = pybind11;
  heft::host::multiply_alike_everywhere();
  module.doc() = "heft's facades; see the package heft";
  // InputError: bad input, exit code 3 of the command. NotIdentifiableError: the data cannot answer, exit code 4.
  const auto error = py::register_exception<heft::Error>(module, "Error", PyExc_RuntimeError);
  const auto input = py::register_exception<heft::InputError>(module, "InputError", error);
  py::register_exception<heft::DataError>(module, "DataError", input);
  py::register_exception<heft::UrdfError>(module, "UrdfError", input);
  py::register_exception<heft::ModelError>(module, "ModelError", input);
  py::register_exception<heft::NotIdentifiableError>(module, "NotIdentifiableError", error);
  heft::python::bind_logs(module);
  heft::python::bind_answers(module);
  heft::python::bind_live(module);
  heft::python::bind_fleet(module);
}
