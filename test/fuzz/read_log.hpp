/// @file
/// A log from memory through the readers of src/data: what fuzzers call, and the short run of them in the test suite.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "heft/host/error.hpp"
#include "input_file.hpp"
#include "log_reader.hpp"

namespace heft::fuzz {

/// What became of an input.
struct Outcome {
  bool recognised{false};
  long rows{0};
  std::string message{};  ///< of the error, "" without
};

/// Reads what it can. Anything but rows, or one error of one line that begins with the file's name, ends the process.
/// @param ids  formats that are tried
inline Outcome read_log_from(std::string_view data, const std::vector<std::string_view>& ids,
                             const data::ReadAs& as) {
  constexpr long kMostRows = 5000;
  Outcome outcome;
  const InputFile file(data);
  const std::string& path = file.path();
  try {
    for (const data::LogFormat& format : data::binary_formats()) {
      if (std::find(ids.begin(), ids.end(), format.id) == ids.end()) continue;
      if (!format.recognises(data.substr(0, 65536))) continue;
      outcome.recognised = true;
      const std::unique_ptr<data::LogReader> reader = format.open(path, as);
      std::vector<double> row(reader->columns().size());
      while (outcome.rows < kMostRows && reader->next(row.data())) ++outcome.rows;
      const double part = reader->part_read();
      if (!(part >= 0.0 && part <= 1.0)) give_up("part_read is " + std::to_string(part));
      reader->notes();
      if (reader->format().empty() || reader->place().empty()) give_up("no name");
      break;
    }
  } catch (const DataError& error) {
    outcome.message = error.what();
    if (outcome.message.rfind(path + ": ", 0) != 0)
      give_up("the message does not name the file: " + outcome.message);
  }
  return outcome;
}

/// The body of a fuzzer: with the joints of a robot that the seeds have, or without, by the length of the input.
inline int fuzz_log(const std::uint8_t* data, std::size_t size, const std::vector<std::string_view>& ids) {
  data::ReadAs as;
  if (size % 2 == 1) as.joint_names = {"elbow_joint", "wrist_1_joint"};
  read_log_from({reinterpret_cast<const char*>(data), size}, ids, as);
  return 0;
}

}  // namespace heft::fuzz
