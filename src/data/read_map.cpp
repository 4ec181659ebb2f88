#include "heft/data/read_map.hpp"

#include <fmt/format.h>

#include "column_words.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/settings_reader.hpp"

namespace heft::data {
namespace {

using Map = std::vector<std::pair<std::string, std::string>>;

/// More joints than any arm has: keys that a file may have.
constexpr int kMostJoints = 32;

void read_map_file(const std::string& path, Map& map) {
  const host::SettingsReader file = host::SettingsReader::parse(host::read_file(path, "map"), path);
  for (const ColumnGroup& group : column_groups()) {
    const std::string name(group.name);
    if (file.has(name)) map.emplace_back(name, file.text(name));
    for (int joint = 1; joint <= kMostJoints && group.quantity != Quantity::kTime; ++joint) {
      const std::string key = fmt::format("{}{}", name, joint);
      if (file.has(key)) map.emplace_back(key, file.text(key));
    }
  }
  file.finish();
}

}  // namespace

Map read_map(const std::vector<std::string>& words) {
  Map map;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals == std::string::npos && word.ends_with(".json")) {
      read_map_file(word, map);
    } else if (equals == std::string::npos || equals == 0 || equals + 1 == word.size()) {
      throw InputError(fmt::format(
          "--map {0}: found '{0}'; expected heft's name, an equals sign and the log's, as in tau=effort,q=position, or a JSON "
          "file of them; write it so",
          word));
    } else {
      map.emplace_back(word.substr(0, equals), word.substr(equals + 1));
    }
  }
  return map;
}

}  // namespace heft::data
