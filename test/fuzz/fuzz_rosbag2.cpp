// libFuzzer: recordings in rosbag2's SQLite. Seeds: test/data/foreign/binary/*.db3 *.zstd
#include "read_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return heft::fuzz::fuzz_log(data, size, {"rosbag2", "rosbag2.zstd"});
}
