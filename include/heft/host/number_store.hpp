/// @file
/// Numbers kept beside memory: written once from front to back, read as often as needed.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "heft/host/file.hpp"

namespace heft::host {

/// A sequence of numbers, in memory while there are few, in an unnamed temporary file beyond. Memory does not grow with their
/// number: what all stores of the process hold together has a bound.
class NumberStore {
 public:
  NumberStore() = default;
  ~NumberStore();
  NumberStore(const NumberStore&) = delete;
  NumberStore& operator=(const NumberStore&) = delete;

  /// Adds numbers at the end. @return false, now and from then on, where there is no place for them on the disk
  bool append(std::span<const double> numbers);
  /// Copies numbers from place `at` on. From several threads at once, but not while numbers are added.
  /// @return false when they cannot be read
  bool read(std::size_t at, std::span<double> numbers) const;
  std::size_t size() const { return size_; }
  bool is_usable() const { return usable_; }

 private:
  bool to_file();
  bool write(std::span<const double> numbers);

  std::vector<double> memory_;
  InputFile file_;
  std::size_t size_{0};
  bool usable_{true};
};

}  // namespace heft::host
