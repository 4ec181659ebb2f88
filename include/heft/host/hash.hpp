/// @file
/// Numbers that tell contents apart; not for secrets.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

namespace heft::host {

/// A hash with one more number in it. The finaliser of splitmix64 (G. Steele, D. Lea, C. Flood, 2014): every bit of the
/// input moves every bit of the result.
constexpr std::uint64_t combine(std::uint64_t hash, std::uint64_t next) {
  std::uint64_t x = hash * 0x9e3779b97f4a7c15U + next + 1U;
  x ^= x >> 30U;
  x *= 0xbf58476d1ce4e5b9U;
  x ^= x >> 27U;
  x *= 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

/// Zero has two signs and one meaning.
constexpr std::uint64_t bits_of(double value) {
  return std::bit_cast<std::uint64_t>(value == 0.0 ? 0.0 : value);
}

/// With all numbers of a range.
template <typename Numbers>
std::uint64_t combine_all(std::uint64_t hash, const Numbers& numbers) {
  for (const double number : numbers) hash = combine(hash, bits_of(number));
  return hash;
}

/// Of a string of bytes.
inline std::uint64_t hash_of(std::string_view bytes) {
  std::uint64_t hash = bytes.size();
  for (const char byte : bytes) hash = combine(hash, static_cast<unsigned char>(byte));
  return hash;
}

}  // namespace heft::host
