/// @file
/// heft reproduce: rebuilds a publication's tables and figures and says what holds.
#include <memory>

#include "command.hpp"
#include "reproduce.hpp"

namespace heft::tools {

Action set_up_reproduce(CommandLine line) {
  auto options = std::make_shared<ReproduceOptions>();
  line.add_option("publication", options->what, "what to rebuild: terminal-link or ur5-stiffness")
      .required()
      .type_name("NAME")
      .one_of({"terminal-link", "ur5-stiffness"});
  line.add_option("-o,--output", options->output,
                  "folder for the report, tables and figures; made if it is not there")
      .type_name("FOLDER")
      .names_file(FileUse::kOutputFolder)
      .required();
  line.add_option("--seeds", options->seeds, "seeds of noise for each simulated case")
      .between(10, 1000)
      .capture_default_str();
  line.add_option("--json", options->json, "write the results as JSON also here; - is standard output")
      .type_name("FILE")
      .names_file(FileUse::kOutput);
  line.footer(
      "terminal-link: H. Kawasaki, K. Nishimura, Terminal-link parameter estimation and trajectory control "
      "of robotic manipulators, 1984. Open loop (scenarios A and B, 5 ms and 1 ms), instruments, "
      "identifiability, closed loop. About half a minute on two processors.\n"
      "ur5-stiffness: the thesis \"Experimental identification of the joints stiffness of the UR5 robot "
      "arm\" (UPC-ETSEIB, 2017) with its measured deflections: reach, dexterity, joint stiffness by both of "
      "its methods, which claims fail. Seconds.");
  return [options] {
    options->what == "terminal-link" ? reproduce_terminal_link(*options) : reproduce_ur5_stiffness(*options);
  };
}

}  // namespace heft::tools
