#include "firmware/image_output.hpp"

#include <cstdlib>
#include <fstream>
#include <stdexcept>

namespace heft::firmware {

ImageOutput read_image_output(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  ImageOutput output;
  std::string line;
  while (std::getline(file, line)) {
    const auto space = line.find(' ');
    const std::string key = line.substr(0, space);
    const std::string value = space == std::string::npos ? "" : line.substr(space + 1);
    if (key == "done") {
      output.complete = true;
    } else if (key == "result") {
      output.results.push_back(std::strtod(value.c_str(), nullptr));  // reads hexadecimal floats
    } else if (!key.empty()) {
      output.fields[key] = value;
    }
  }
  return output;
}

}  // namespace heft::firmware
