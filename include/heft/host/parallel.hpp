/// @file
/// Work on all processors, with results that do not depend on how many there are.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace heft::host {

namespace detail {

/// 0: as many as there are processors.
inline std::atomic<std::size_t>& threads_asked_for() {
  static std::atomic<std::size_t> threads{0};
  return threads;
}

/// Whether this thread runs a part of parallel work; what it starts itself stays on it.
inline bool& within_parallel() {
  thread_local bool within = false;
  return within;
}

}  // namespace detail

/// For as long as it lives, parallel work that its thread starts stays on that thread.
class OnThisThread {
 public:
  OnThisThread() : before_(std::exchange(detail::within_parallel(), true)) {}
  ~OnThisThread() { detail::within_parallel() = before_; }
  OnThisThread(const OnThisThread&) = delete;
  OnThisThread& operator=(const OnThisThread&) = delete;

 private:
  bool before_;
};

/// Sets on how many threads all parallel work of this process runs from now on; 0: as many as there are processors.
inline void set_threads(std::size_t threads) { detail::threads_asked_for() = threads; }

/// Threads that parallel work started here would run on: what set_threads() asked for or the number of processors; 1 within a
/// part of parallel work.
inline std::size_t threads() {
  if (detail::within_parallel()) return 1;
  const std::size_t asked = detail::threads_asked_for();
  return asked > 0 ? asked : std::max(1U, std::thread::hardware_concurrency());
}

/// Calls job(0) .. job(count - 1), each once, on threads() threads; within such a job, one after the other on its thread.
/// @param progress  called from the calling thread with the share done, 0..1; may be empty
/// @throws what the first failing job threw, after all threads have ended
inline void for_each_parallel(std::size_t count, const std::function<void(std::size_t)>& job,
                              const std::function<void(double)>& progress = {}) {
  const std::size_t workers = std::min(threads(), count);
  if (workers < 2 && !progress) {
    for (std::size_t i = 0; i < count; ++i) job(i);
    return;
  }
  std::atomic<std::size_t> next{0}, done{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;
  std::mutex guard;
  const auto work = [&] {
    const OnThisThread part;
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
  std::vector<std::thread> pool;
  for (std::size_t t = 0; t < workers; ++t) pool.emplace_back(work);
  while (progress && done < count && !failed) {
    progress(static_cast<double>(done) / static_cast<double>(count));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
}

/// Takes a sequence through three steps: `next` gives the items in order, `work` makes a result of each on any thread,
/// `use` takes the results in the order of the items. Only `work` runs in parallel; of `next` and of `use` one call at a
/// time. So what `use` adds up does not depend on the number of threads, to the last bit. At most one item a thread is
/// under way.
/// @param most_threads  no more than these
/// @param next  bool(Item&): false at the end
/// @param work  Result(Item&)
/// @param use   void(Result&)
/// @throws what a step threw for the first item, in their order, for which one did
template <typename Item, typename Result, typename Next, typename Work, typename Use>
void for_each_in_order(std::size_t most_threads, const Next& next, const Work& work, const Use& use) {
  const std::size_t workers = std::min(threads(), most_threads);
  if (workers < 2) {
    for (Item item; next(item);) {
      Result result = work(item);
      use(result);
    }
    return;
  }
  std::mutex source, sink;
  std::condition_variable turn;
  std::size_t taken = 0, used = 0;  // guarded by source, sink
  bool ended = false;               // guarded by source
  std::atomic<bool> failed{false};
  std::exception_ptr failure, end_failure;  // guarded by sink, source
  const auto run = [&] {
    const OnThisThread part;
    for (;;) {
      Item item;
      std::size_t number = 0;
      {
        const std::lock_guard<std::mutex> lock(source);
        if (ended || failed) return;
        try {
          ended = !next(item);
        } catch (...) {
          end_failure = std::current_exception();
          ended = true;
        }
        if (ended) return;
        number = taken++;
      }
      std::exception_ptr own;
      Result result;
      try {
        result = work(item);
      } catch (...) {
        own = std::current_exception();
      }
      std::unique_lock<std::mutex> lock(sink);
      turn.wait(lock, [&] { return used == number; });
      if (!failed) {
        try {
          if (own) std::rethrow_exception(own);
          use(result);
        } catch (...) {
          failure = std::current_exception();
          failed = true;
        }
      }
      ++used;
      turn.notify_all();
    }
  };
  std::vector<std::thread> pool;
  for (std::size_t t = 1; t < workers; ++t) pool.emplace_back(run);
  run();
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
  if (end_failure) std::rethrow_exception(end_failure);
}

}  // namespace heft::host
