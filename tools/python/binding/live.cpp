// The load sample by sample, as a controller follows it.
#include "binding.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/payload.hpp"

namespace heft::python {
namespace {

/// A live load with the logs that its arm was fitted to.
class LiveLoad {
 public:
  LiveLoad(const Arm& arm, const std::vector<AnyLog>& baseline, const std::string& torque_at, int first_joint) {
    payload::Options how;
    how.first_joint = first_joint;
    how.torque_at = torque_at_of(torque_at);
    data::LogFiles files;
    files.torque_at = how.torque_at;
    files.split = 0.0;
    const data::LogSet logs = open(arm, baseline, {}, files);
    load_ = std::make_unique<payload::LiveLoad>(baseline.empty() && arm.file
                                                    ? payload::arm_from_file(arm.robot, *arm.file, logs, 0, how)
                                                    : payload::fit_unloaded(arm.robot, logs, 0, how),
                                                how);
  }
  /// @return fields of the event as JSON; empty: none
  std::string push(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& tau, const Eigen::VectorXd& qd) {
    const auto event = load_->push({time, q, qd, tau});
    return event ? report::json(*event) : "";
  }
  std::string end() { return report::json(load_->end()); }

 private:
  std::unique_ptr<payload::LiveLoad> load_;
};

}  // namespace

void bind_live(py::module_& module) {
  py::class_<LiveLoad>(module, "LiveLoad")
      .def(py::init<const Arm&, const std::vector<AnyLog>&, const std::string&, int>(), py::arg("robot"), py::arg("baseline"),
           py::arg("torque_at"), py::arg("first_joint"))
      .def("push", &LiveLoad::push, py::arg("time"), py::arg("q"), py::arg("tau"), py::arg("qd"))
      .def("end", &LiveLoad::end);
}

}  // namespace heft::python
