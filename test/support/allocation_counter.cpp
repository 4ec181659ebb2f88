#include "support/allocation_counter.hpp"

#include <cerrno>
#include <cstdlib>
#include <new>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HEFT_COUNTS_ALLOCATIONS 1
#else
#define HEFT_COUNTS_ALLOCATIONS 0
#endif

namespace {

// Initial-exec: a thread's first use must not itself allocate.
[[gnu::tls_model("initial-exec")]] constinit thread_local heft::test::AllocationCount count{};

}  // namespace

namespace heft::test {

bool allocations_are_counted() noexcept { return HEFT_COUNTS_ALLOCATIONS != 0; }

AllocationCount allocation_count() noexcept { return count; }

}  // namespace heft::test

#if HEFT_COUNTS_ALLOCATIONS

// glibc's own entry points, beneath the names replaced here.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  ++count.malloc;
  return __libc_malloc(size);
}

void* calloc(std::size_t number, std::size_t size) {
  ++count.malloc;
  return __libc_calloc(number, size);
}

void* realloc(void* block, std::size_t size) {
  ++count.malloc;
  return __libc_realloc(block, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++count.malloc;
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  ++count.malloc;
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
}

// The array and nothrow forms of the standard library end in these two.
void* operator new(std::size_t size) {
  ++count.operator_new;
  void* block = std::malloc(size == 0 ? 1 : size);
  if (block == nullptr) throw std::bad_alloc();
  return block;
}

void* operator new(std::size_t size, std::align_val_t alignment) {
  ++count.operator_new;
  void* block = nullptr;
  if (posix_memalign(&block, static_cast<std::size_t>(alignment), size) != 0) throw std::bad_alloc();
  return block;
}

void operator delete(void* block) noexcept { std::free(block); }
void operator delete(void* block, std::size_t) noexcept { std::free(block); }
void operator delete(void* block, std::align_val_t) noexcept { std::free(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { std::free(block); }

#endif
