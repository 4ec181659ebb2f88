#include "scenario_input.hpp"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include "console.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::tools {
namespace {

/// The log is in memory as numbers and as text before it is written.
void refuse_more_than_memory(const sim::Scenario& scenario) {
  constexpr double kBytesPerNumber = 8.0 + 19.0;
  const sim::SimulationSettings& settings = scenario.settings;
  const double rate = settings.log_rate > 0.0 ? settings.log_rate : settings.sample_rate;
  const double columns = 1.0 + (settings.log_truth ? 10.0 : 4.0) * settings.robot.num_joints();
  const double needed = settings.duration * rate * columns * kBytesPerNumber;
  double there =
      static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    there = std::min(there, static_cast<double>(limit.rlim_cur));
  if (!(there > 0.0) || needed < there) return;
  throw ModelError(
      fmt::format("{}: /duration: found {:g} s at {:g} rows a second, a log of about {:.0f} GB, more than "
                  "the {:.0f} GB of memory; "
                  "expected a log that fits; shorten it or lower log_rate",
                  scenario.file, settings.duration, rate, 1e-9 * needed, 1e-9 * there));
}

}  // namespace

sim::Scenario read_scenario(const std::string& path) {
  const auto load = [&](const std::string& name) {
    std::error_code ignored;
    const std::filesystem::path beside = std::filesystem::path(path).parent_path() / name;
    const std::string file =
        std::filesystem::is_regular_file(beside, ignored) ? beside.string() : urdf::resolve_robot(name);
    std::vector<std::string> notes;
    const model::Robot robot = urdf::load_urdf(file, {}, &notes);
    for (const std::string& text : notes) note(text);
    return robot;
  };
  sim::Scenario scenario = sim::parse_scenario(host::read_file(path, "scenario"), path, load);
  refuse_more_than_memory(scenario);
  return scenario;
}

}  // namespace heft::tools
