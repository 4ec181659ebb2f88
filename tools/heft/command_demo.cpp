/// @file
/// heft demo: an arm on a path picks up a load that nobody told it of, finds it and carries on.
#include <memory>
#include <string>

#include "command.hpp"
#include "console.hpp"
#include "demo.hpp"
#include "heft/host/output_folder.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct DemoOptions {
  std::string output{"heft-demo"};
  std::string json;
  double mass{2.0};
};

void run(const DemoOptions& options) {
  const Console console{options.json};
  const host::OutputFolder folder(options.output);
  Progress progress("simulating");
  studies::StudyReport report = studies::run_demo(options.mass, [&](double done) { progress.update(done); });
  report.json["report"] = folder.file("report.html");
  console.print("{}", report.text);
  write_each({[&] { report.page.write(folder.file("report.html")); },
              [&] { write_json(folder.file("results.json"), report.json_text()); },
              [&] { write_json(options.json, report.json_text()); }});
  console.print("Report: {}\n", folder.file("report.html"));
}

}  // namespace

Action set_up_demo(CommandLine line) {
  auto options = std::make_shared<DemoOptions>();
  line.add_option("-o,--output", options->output,
                  "folder for report.html and results.json; made if it is not there")
      .type_name("FOLDER")
      .names_file(FileUse::kOutputFolder)
      .capture_default_str();
  line.add_option("--mass", options->mass, "mass of the load that the arm picks up [kg]")
      .between(0.1, 5.0)
      .capture_default_str();
  line.add_option("--json", options->json, "write the results as JSON; - is standard output")
      .type_name("FILE")
      .names_file(FileUse::kOutput);
  line.footer("Needs no files: arm, path, sensors and load are built in. Takes a few seconds.");
  return [options] { run(*options); };
}

}  // namespace heft::tools
