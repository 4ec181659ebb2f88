/// @file
/// heft reproduce: rebuilds a publication's tables and figures and says what holds.
#include <memory>
#include <string>

#include "command.hpp"
#include "console.hpp"
#include "report_folder.hpp"
#include "terminal_link_report.hpp"
#include "ur5_stiffness_report.hpp"

namespace heft::tools {
namespace {

struct ReproduceOptions {
  std::string what;
  std::string output;  ///< folder
  std::string json;    ///< the results also here; empty: not, "-": standard output
  int seeds{20};
};

studies::StudyReport run_study(const ReproduceOptions& options) {
  if (options.what == "terminal-link") {
    Progress progress("running the protocol");
    return studies::reproduce_terminal_link(options.seeds, [&](double done) { progress.update(done); });
  }
  Progress progress("simulating");
  return studies::reproduce_ur5_stiffness(options.seeds, [&](double done) { progress.update(done); });
}

void run(const ReproduceOptions& options) {
  const Console console{options.json};
  const ReportFolder folder(options.output);
  const studies::StudyReport report = run_study(options);
  console.print("{}", report.text);
  report.page.write(folder.file("report.html"));
  for (const auto& [name, table] : report.tables) folder.csv(name, table);
  for (const auto& [name, plot] : report.plots) folder.figure(name, plot);
  for (const auto& [name, map] : report.maps) folder.figure(name, map);
  write_json(folder.file("results.json"), report.json_text());
  write_json(options.json, report.json_text());
  console.print("Written: {} (results.json, tables as CSV, figures as SVG)\nReport: {}\n", options.output,
                folder.file("report.html"));
}

}  // namespace

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
      "ur5-stiffness: UPC-ETSEIB, Experimental identification of the joints stiffness of the UR5 robot arm, "
      "2017, from its measured deflections: reach, dexterity, joint stiffness by both of its methods, which "
      "claims fail. Seconds.");
  return [options] { run(*options); };
}

}  // namespace heft::tools
