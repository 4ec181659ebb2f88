// libFuzzer: arrays of NumPy. Seeds: test/data/foreign/binary/*.npz *.npy
#include "read_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return heft::fuzz::fuzz_log(data, size, {"npz", "npy"});
}
