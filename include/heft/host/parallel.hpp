/// @file
/// Independent pieces of work on all processors.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace heft::host {

/// Calls job(0) .. job(count - 1), each once, on as many threads as there are processors; within such a job, one after the
/// other on its thread.
/// @param progress  called from the calling thread with the share done, 0..1; may be empty
/// @throws what the first failing job threw, after all threads have ended
inline void for_each_parallel(std::size_t count, const std::function<void(std::size_t)>& job,
                              const std::function<void(double)>& progress = {}) {
  thread_local bool within = false;
  const std::size_t processors = within ? 1 : std::max(1U, std::thread::hardware_concurrency());
  if (std::min(processors, count) < 2 && !progress) {
    for (std::size_t i = 0; i < count; ++i) job(i);
    return;
  }
  std::atomic<std::size_t> next{0}, done{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;
  std::mutex guard;
  const auto work = [&] {
    within = true;  // of the thread that ends with this work
    for (std::size_t i = next++; i < count && !failed; i = next++) {
      try {
        job(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(guard);
        if (!failed.exchange(true)) failure = std::current_exception();
      }
      ++done;
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < std::min(processors, count); ++t) threads.emplace_back(work);
  while (progress && done < count && !failed) {
    progress(static_cast<double>(done) / static_cast<double>(count));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace heft::host
