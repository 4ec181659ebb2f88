#include "heft/host/words.hpp"

#include <cstddef>

#include <fmt/format.h>

namespace heft::host {

std::string joints_in_words(const std::vector<int>& joints) {
  std::string text = joints.size() == 1 ? "joint " : "joints ";
  for (std::size_t k = 0; k < joints.size(); ++k) {
    text += fmt::format("{}{}", k == 0 ? "" : k + 1 == joints.size() ? " and " : ", ", joints[k] + 1);
  }
  return text;
}

}  // namespace heft::host
