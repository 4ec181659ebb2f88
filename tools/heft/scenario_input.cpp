#include "scenario_input.hpp"

#include <filesystem>

#include "console.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::tools {

sim::Scenario read_scenario(const std::string& path) {
  const auto load = [&](const std::string& name) {
    std::error_code ignored;
    const std::filesystem::path next_to_it = std::filesystem::path(path).parent_path() / name;
    const std::string file = std::filesystem::is_regular_file(next_to_it, ignored)
                                 ? next_to_it.string()
                                 : urdf::resolve_robot(name);
    std::vector<std::string> notes;
    const model::Robot robot = urdf::load_urdf(file, {}, &notes);
    for (const std::string& text : notes) note(text);
    return robot;
  };
  return sim::parse_scenario(host::read_file(path, "scenario"), path, load);
}

}  // namespace heft::tools
