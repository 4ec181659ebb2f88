// Replays the log on the host with the source of the image and compares the results.
//   firmware_check_image LOG LOOP_SCALAR TOLERANCE STACK_CEILING INSTRUCTION_CEILING RAM_CEILING IMAGE_OUTPUT
// LOOP_SCALAR: image_double, image_float, online_double or online_float; a ceiling of 0: none.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "firmware/image_output.hpp"
#include "firmware/log_table.hpp"
#include "firmware/online_replay.hpp"
#include "firmware/replay.hpp"

namespace {

using namespace heft::firmware;

// Whole words, so that the rows are aligned.
std::vector<std::uint32_t> read_log(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::uint32_t> words(bytes.size() / sizeof(std::uint32_t));
  if (bytes.size() < sizeof(LogHeader)) throw std::runtime_error(path + ": not a log table");
  std::memcpy(words.data(), bytes.data(), words.size() * sizeof(std::uint32_t));
  return words;
}

template <typename Loop, typename Scalar>
std::vector<double> host_results(const std::string& log_path) {
  const auto words = read_log(log_path);
  const LogRow* const rows = rows_of(words.data());
  if (rows == nullptr) throw std::runtime_error(log_path + ": not a log table");
  const auto& header = *reinterpret_cast<const LogHeader*>(words.data());

  const auto replay = std::make_unique<Loop>();
  if (replay->configure() != heft::Status::kOk) throw std::runtime_error("the replay refuses its settings");
  // As the image has it.
  const auto period = static_cast<Scalar>(1e-6F * static_cast<float>(header.period_us));
  for (std::uint32_t i = 0; i < header.samples; ++i) {
    if (replay->step(rows[i], period) != heft::Status::kOk)
      throw std::runtime_error(fmt::format("the host refuses sample {}", i));
  }
  if (!replay->determined()) {
    throw std::runtime_error(fmt::format("the host's estimate: {}", replay->rests_on()));
  }
  std::vector<double> results;
  for (int i = 0; i < Loop::kNumResults; ++i) {
    results.push_back(static_cast<double>(replay->result(i)));
  }
  return results;
}

std::vector<double> host_results(const std::string& loop, const std::string& log_path) {
  if (loop == "image_double") return host_results<Replay<double>, double>(log_path);
  if (loop == "image_float") return host_results<Replay<float>, float>(log_path);
  if (loop == "online_double") return host_results<OnlineReplay<double>, double>(log_path);
  if (loop == "online_float") return host_results<OnlineReplay<float>, float>(log_path);
  throw std::runtime_error(loop + ": no such loop");
}

/// Prints a figure against its ceiling.
bool within(const ImageOutput& image, const std::string& field, std::size_t ceiling) {
  const auto found = image.fields.find(field);
  if (found == image.fields.end()) return false;
  if (ceiling == 0) return true;
  fmt::print("{} {}, allowed {}\n", field, found->second, ceiling);
  return std::stoul(found->second) <= ceiling;
}

struct Ceilings {
  std::size_t stack, instructions, ram;
};

int check(const std::string& log_path, const std::string& loop, double tolerance, const Ceilings& ceilings,
          const std::string& output_path) {
  const ImageOutput image = read_image_output(output_path);
  const auto host = host_results(loop, log_path);
  if (!image.complete || image.results.size() != host.size()) {
    fmt::print("{}: {} results, {} expected{}\n", output_path, image.results.size(), host.size(),
               image.complete ? "" : "; the image did not finish");
    return 1;
  }

  double worst = 0.0;
  for (std::size_t i = 0; i < host.size(); ++i) {
    const double difference = std::abs(image.results[i] - host[i]) / std::abs(host[i]);
    fmt::print("result {:2}: image {:24.17g}  host {:24.17g}  relative difference {:.1e}\n", i,
               image.results[i], host[i], difference);
    // Written so that a NaN fails.
    if (!(difference <= worst)) worst = difference;
  }
  fmt::print("largest relative difference {:.2e}, allowed {:.0e}\n", worst, tolerance);
  if (image.fields.count("instructions_mean") == 0) fmt::print("QEMU's clock does not count instructions\n");
  const bool stack = within(image, "deepest_stack_bytes", ceilings.stack);
  const bool instructions = within(image, "instructions_worst", ceilings.instructions);
  const bool ram = within(image, "loop_bytes", ceilings.ram);
  return worst <= tolerance && stack && instructions && ram ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 8) {
    fmt::print(
        stderr,
        "usage: firmware_check_image LOG LOOP_SCALAR TOLERANCE STACK_CEILING INSTRUCTION_CEILING RAM_CEILING "
        "IMAGE_OUTPUT\n");
    return 2;
  }
  try {
    return check(argv[1], argv[2], std::atof(argv[3]),
                 {std::stoul(argv[4]), std::stoul(argv[5]), std::stoul(argv[6])}, argv[7]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "firmware_check_image: {}\n", error.what());
    return 1;
  }
}
