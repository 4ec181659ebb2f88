#include "command.hpp"

namespace heft::tools {

const std::vector<Command>& commands() {
  static const std::vector<Command> all{
      {"log", "what a log of any format holds and how it is understood; any log as heft's CSV", set_up_log},
      {"dynamics", "torque, gravity torque or regressor for each row of a log", set_up_dynamics},
      {"simulate", "run a scenario on the simulated arm, write a log", set_up_simulate, false},
      {"excite", "design an exciting motion inside the limits of the arm", set_up_excite},
      {"identify", "fit a model to one or more logs", set_up_identify},
      {"validate", "judge a model on logs that it was not fitted to", set_up_validate},
      {"diagnose", "find the effects that a model lacks", set_up_diagnose},
      {"compare", "what changed between two models of one robot", set_up_compare, false},
      {"payload", "estimate the load at the flange sample by sample, as a controller would", set_up_payload},
      {"torque-constants", "the torque an ampere gives, from target torque and current or a known load",
       set_up_torque_constants},
      {"monitor", "find contacts in a log, as a controller would", set_up_monitor},
      {"track", "closed-loop tracking in the simulator, several controllers side by side", set_up_track},
      {"retime", "the fastest motion along a path under limits of torque, velocity and acceleration",
       set_up_retime, false},
      {"stiffness", "joint stiffness from loads and deflections, or from encoders", set_up_stiffness},
      {"export", "write a robot and a model as a C++ header for firmware, or for a simulator", set_up_export, false},
      {"reproduce", "rebuild a publication's tables and figures", set_up_reproduce},
      {"demo", "an arm picks up an unknown load; one page of plots", set_up_demo},
  };
  return all;
}

}  // namespace heft::tools
