// Collects the figures of the images: a table on standard output and a JSON file.
//   firmware_figures OUTPUT.json IMAGE_OUTPUT...
#include <array>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "firmware/image_output.hpp"

namespace {

using heft::firmware::ImageOutput;

constexpr std::array kFields = {
    "samples",           "period_us",         "flash_bytes",          "log_bytes",
    "ram_bytes",         "loop_bytes",        "stack_reserved_bytes", "deepest_stack_bytes",
    "instructions_mean", "instructions_worst"};

void collect(int count, char** paths, const std::string& json_path) {
  nlohmann::ordered_json images = nlohmann::ordered_json::array();
  fmt::print("{:<24} {:>8} {:>8} {:>8} {:>14} {:>18} {:>18}\n", "image", "flash B", "RAM B", "loop B",
             "deepest stack B", "instr/sample mean", "instr/sample worst");
  for (int i = 0; i < count; ++i) {
    const ImageOutput output = heft::firmware::read_image_output(paths[i]);
    if (!output.complete) throw std::runtime_error(std::string(paths[i]) + ": the image did not finish");
    nlohmann::ordered_json image{{"image", output.fields.at("image")}};
    for (const char* field : kFields) image[field] = std::stoll(output.fields.at(field));
    fmt::print("{:<24} {:>8} {:>8} {:>8} {:>14} {:>18} {:>18}\n", output.fields.at("image"),
               image["flash_bytes"].get<long>(), image["ram_bytes"].get<long>(),
               image["loop_bytes"].get<long>(), image["deepest_stack_bytes"].get<long>(),
               image["instructions_mean"].get<long>(), image["instructions_worst"].get<long>());
    images.push_back(std::move(image));
  }
  std::ofstream file(json_path);
  file << nlohmann::ordered_json{{"images", std::move(images)}}.dump(2) << '\n';
  file.close();
  if (!file) throw std::runtime_error(json_path + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: firmware_figures OUTPUT.json IMAGE_OUTPUT...\n");
    return 2;
  }
  try {
    collect(argc - 2, argv + 2, argv[1]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "firmware_figures: {}\n", error.what());
    return 1;
  }
  return 0;
}
