// Replays the log on the host with the source of the image and compares the results.
//   firmware_check_image LOG double|float TOLERANCE STACK_CEILING IMAGE_OUTPUT
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

template <typename Scalar>
std::vector<double> host_results(const std::string& log_path) {
  const auto words = read_log(log_path);
  const LogRow* const rows = rows_of(words.data());
  if (rows == nullptr) throw std::runtime_error(log_path + ": not a log table");
  const auto& header = *reinterpret_cast<const LogHeader*>(words.data());

  const auto replay = std::make_unique<Replay<Scalar>>();
  if (replay->configure() != heft::Status::kOk) throw std::runtime_error("the replay refuses its settings");
  for (std::uint32_t i = 0; i < header.samples; ++i) {
    if (replay->step(rows[i]) != heft::Status::kOk)
      throw std::runtime_error(fmt::format("the host refuses sample {}", i));
  }
  // Numbers that nobody would use prove nothing.
  if (replay->source() != heft::EstimateSource::kInstrumental) {
    throw std::runtime_error(
        fmt::format("the host's estimate is from {}", heft::to_string(replay->source())));
  }
  std::vector<double> results;
  for (int i = 0; i < Replay<Scalar>::kNumResults; ++i) {
    results.push_back(static_cast<double>(replay->result(i)));
  }
  return results;
}

int check(const std::string& log_path, const std::string& scalar, double tolerance, std::size_t stack_ceiling,
          const std::string& output_path) {
  const ImageOutput image = read_image_output(output_path);
  const auto host = scalar == "double" ? host_results<double>(log_path) : host_results<float>(log_path);
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
  const std::size_t stack = std::stoul(image.fields.at("deepest_stack_bytes"));
  fmt::print("deepest stack {} bytes, allowed {}\n", stack, stack_ceiling);
  if (image.fields.count("instructions_mean") == 0) fmt::print("QEMU's clock does not count instructions\n");
  return worst <= tolerance && stack <= stack_ceiling && image.fields.count("instructions_mean") != 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) {
    fmt::print(stderr, "usage: firmware_check_image LOG double|float TOLERANCE STACK_CEILING IMAGE_OUTPUT\n");
    return 2;
  }
  try {
    return check(argv[1], argv[2], std::atof(argv[3]), std::stoul(argv[4]), argv[5]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "firmware_check_image: {}\n", error.what());
    return 1;
  }
}
