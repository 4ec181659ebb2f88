// libFuzzer: MATLAB's files of version 5. Seeds: test/data/foreign/binary/plain.mat compressed.mat struct.mat
#include "read_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return heft::fuzz::fuzz_log(data, size, {"mat5"});
}
