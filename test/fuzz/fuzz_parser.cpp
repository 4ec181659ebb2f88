// libFuzzer: one of the parsers of parsers.hpp, the one that HEFT_FUZZ_PARSER names. Its seeds are named there.
#include <algorithm>
#include <cstdint>

#include "parsers.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const heft::fuzz::Parser& parser =
      *std::ranges::find(heft::fuzz::parsers(), HEFT_FUZZ_PARSER, &heft::fuzz::Parser::name);
  heft::fuzz::try_to_read(parser, {reinterpret_cast<const char*>(data), size});
  return 0;
}
