#include "streaming_median.hpp"

#include <algorithm>
#include <bit>
#include <optional>

namespace heft::data {

void StreamingMedian::add(double value) {
  if (first_pass_) ++total_;
  if (counts_.empty()) {
    if (known_bits_ > 0 && (std::bit_cast<std::uint64_t>(value) >> (64 - known_bits_)) != known_) return;
    values_.push_back(value);
    if (values_.size() <= kMost) return;
    // Too many to keep (only in the first pass): count them instead.
    counts_.assign(std::size_t{1} << kBits, 0);
    for (const double kept : values_) count(kept);
    values_ = {};
    return;
  }
  count(value);
}

void StreamingMedian::count(double value) {
  // Positive numbers are in the order of their binary form.
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
  if (known_bits_ > 0 && (bits >> (64 - known_bits_)) != known_) return;
  ++counts_[(bits >> (64 - kBits - known_bits_)) & ((std::uint64_t{1} << kBits) - 1)];
}

bool StreamingMedian::finish_pass() {
  if (first_pass_) rank_ = total_ / 2;
  first_pass_ = false;
  if (counts_.empty()) {
    if (values_.empty()) return true;
    const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(rank_);
    std::nth_element(values_.begin(), middle, values_.end());
    value_ = *middle;
    return true;
  }
  std::uint64_t digit = 0;
  while (rank_ >= counts_[digit]) rank_ -= counts_[digit++];
  const std::uint64_t in_range = counts_[digit];
  known_ = (known_ << kBits) | digit;
  known_bits_ += kBits;
  if (known_bits_ == 64) {
    value_ = std::bit_cast<double>(known_);
    return true;
  }
  if (in_range <= kMost) {
    counts_ = {};
  } else {
    std::fill(counts_.begin(), counts_.end(), 0);
  }
  return false;
}

double median_of_steps(StreamingMedian steps,
                       const std::function<void(const std::function<void(double)>&)>& each_value) {
  while (!steps.finish_pass()) {
    std::optional<double> last;
    each_value([&](double value) {
      if (last) steps.add(value - *last);
      last = value;
    });
  }
  return steps.value();
}

}  // namespace heft::data
