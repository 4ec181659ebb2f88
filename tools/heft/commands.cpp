#include "command.hpp"

namespace heft::tools {

const std::vector<Command>& commands() {
  static const std::vector<Command> all{
      {"dynamics", "torque, gravity torque or regressor for each row of a log", set_up_dynamics},
      {"simulate", "run a scenario on the simulated arm, write a log", set_up_simulate},
      {"excite", "design a motion that makes the parameters visible", set_up_excite},
      {"identify", "fit a model to one or more logs", set_up_identify},
      {"validate", "judge a model on logs it has not seen", set_up_validate},
      {"diagnose", "find the effects that a fit's residual shows", set_up_diagnose},
      {"payload", "estimate the load at the flange sample by sample, as the controller would",
       set_up_payload},
      {"track", "closed-loop tracking in the simulator, several controllers side by side", set_up_track},
      {"stiffness", "joint stiffness from load and deflection measurements", set_up_stiffness},
      {"export", "write a robot and a model as a constexpr C++ header for firmware", set_up_export},
      {"reproduce", "rebuild a publication's tables and figures", set_up_reproduce},
      {"demo", "the whole loop end to end, ends with a report", set_up_demo},
  };
  return all;
}

}  // namespace heft::tools
