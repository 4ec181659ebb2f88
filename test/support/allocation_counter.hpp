/// @file
/// Counts what a stretch of code takes from the heap, in any build type.
///
/// Link allocation_counter.cpp into the test: it replaces malloc and its family and operator new. It is a
/// translation unit of its own because in the test the compiler may assume that malloc does not change a
/// variable.
#pragma once

#include <cstdint>

namespace heft::test {

/// Allocations of this thread since its start. An operator new that calls malloc counts in both.
struct AllocationCount {
  std::uint64_t operator_new{0};  ///< calls of any operator new
  std::uint64_t malloc{0};        ///< calls of malloc, calloc, realloc, aligned_alloc and posix_memalign

  friend bool operator==(const AllocationCount&, const AllocationCount&) = default;
  friend AllocationCount operator-(const AllocationCount& a, const AllocationCount& b) {
    return {a.operator_new - b.operator_new, a.malloc - b.malloc};
  }
};

/// False where the functions are not replaced (a sanitizer has its own, or the C library is not glibc).
bool allocations_are_counted() noexcept;

/// Count so far.
AllocationCount allocation_count() noexcept;

}  // namespace heft::test
