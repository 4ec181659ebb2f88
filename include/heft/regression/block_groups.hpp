/// @file
/// Neighbouring blocks of time joined, so that what is left out together is nearly independent of the rest.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "heft/regression/triangular_factor.hpp"

namespace heft::regression {

/// Numbers of the blocks in each group; a group is at least `length` long [s] and spans two logs only if a block does.
inline std::vector<std::vector<int>> groups_of(const BlockFactors& blocks, double length) {
  const double least = std::max(length, blocks.block_length());
  std::map<BlockPartition::Key, std::vector<int>> groups;
  for (int k = 0; k < blocks.num_blocks(); ++k) {
    // A begin that is a multiple of the length must not fall below it by rounding.
    const BlockPartition::Key& key = blocks.key(k);
    const auto index = static_cast<long>(std::floor((blocks.partition().begin_of(key) + 1e-9) / least));
    groups[{key.log, index}].push_back(k);
  }
  std::vector<std::vector<int>> out;
  for (auto& [key, members] : groups) out.push_back(std::move(members));
  return out;
}

}  // namespace heft::regression
