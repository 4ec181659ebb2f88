// libFuzzer: MATLAB's files of version 7.3. Seeds: test/data/foreign/binary/v73*.mat
#include "read_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return heft::fuzz::fuzz_log(data, size, {"hdf5"});
}
