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
#include <system_error>
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

class Crew;

/// What this thread is busy with.
struct Part {
  bool of_parallel_work = false;
  Crew* crew = nullptr;  ///< threads that may take up what this one starts; none where all of it stays here
};

inline Part& part() {
  thread_local Part part;
  return part;
}

/// The thread is busy with a part of parallel work for as long as this lives.
class WithinPart {
 public:
  explicit WithinPart(Crew* crew) : before_(std::exchange(part(), Part{true, crew})) {}
  ~WithinPart() { part() = before_; }
  WithinPart(const WithinPart&) = delete;
  WithinPart& operator=(const WithinPart&) = delete;

 private:
  Part before_;
};

/// Jobs 0 .. count - 1, each for whichever thread takes it up first.
class Jobs {
 public:
  Jobs(std::size_t count, const std::function<void(std::size_t)>& job) : count_(count), job_(job) {}

  std::size_t count() const { return count_; }
  bool left() const { return next_ < count_ && !failed_; }
  bool failed() const { return failed_; }
  /// Share of the jobs that is done, 0..1.
  double share_done() const { return static_cast<double>(done_) / static_cast<double>(count_); }

  /// Takes up one after the other until none is left or one has failed.
  void take_up() {
    for (std::size_t i = next_++; i < count_ && !failed_; i = next_++) {
      try {
        job_(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(guard_);
        if (!failed_.exchange(true)) failure_ = std::current_exception();
      }
      ++done_;
    }
  }

  /// Once no thread is at a job.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::size_t count_;
  const std::function<void(std::size_t)>& job_;
  std::atomic<std::size_t> next_{0}, done_{0};
  std::atomic<bool> failed_{false};
  std::exception_ptr failure_;  // guarded by guard_ until no thread is at a job
  std::mutex guard_;
};

/// The threads of one call from outside. A thread that finds no job left helps with jobs that another one has started from
/// within its own, so that it is not idle while that one is busy; if there were fewer jobs than threads allowed, more threads
/// start then. A thread that waits for jobs it has started takes up no others meanwhile, so that it may hold a lock that those
/// need.
class Crew {
 public:
  /// @param jobs    what each thread begins with
  /// @param most    threads, the calling one among them where it joins in
  Crew(Jobs& jobs, std::size_t most) : jobs_(jobs), most_(most) {}

  /// @return whether one at least is at work: the system may have none left
  bool start(std::size_t threads) {
    const std::lock_guard<std::mutex> lock(guard_);
    for (std::size_t t = 0; t < threads && start_one(); ++t) {
    }
    return !pool_.empty();
  }

  /// The calling thread is one of them until all have no job left.
  void join_in() {
    {
      const std::lock_guard<std::mutex> lock(guard_);
      ++threads_;
    }
    work();
  }

  /// Waits for the others.
  void end() {
    for (;;) {
      std::thread one;
      {
        const std::lock_guard<std::mutex> lock(guard_);
        if (pool_.empty()) return;  // only their jobs start more
        one = std::move(pool_.back());
        pool_.pop_back();
      }
      one.join();
    }
  }

  /// Jobs that a job starts.
  void share(Jobs& jobs) {
    Started started{jobs};
    {
      const std::lock_guard<std::mutex> lock(guard_);
      started_.push_back(&started);
      if (idle_ > 0) change_.notify_all();
      for (std::size_t helpers = idle_ + 1; helpers < jobs.count() && threads_ < most_ && start_one(); ++helpers) {
      }
    }
    jobs.take_up();
    std::unique_lock<std::mutex> lock(guard_);
    started_.erase(std::find(started_.begin(), started_.end(), &started));
    change_.wait(lock, [&] { return started.helpers == 0; });
  }

 private:
  struct Started {
    Jobs& jobs;
    std::size_t helpers = 0;
  };

  /// @pre guard_ is held
  /// @return whether the system has another thread
  bool start_one() {
    try {
      pool_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      return false;
    }
    ++threads_;
    return true;
  }

  /// Jobs as long as there are any, then help until all threads have none.
  void work() {
    const WithinPart part(this);
    jobs_.take_up();
    std::unique_lock<std::mutex> lock(guard_);
    ++idle_;
    while (idle_ < threads_) {
      const auto open = std::find_if(started_.begin(), started_.end(), [](const Started* s) { return s->jobs.left(); });
      if (open == started_.end()) {
        change_.wait(lock);
        continue;
      }
      Started& started = **open;
      ++started.helpers;
      --idle_;
      lock.unlock();
      started.jobs.take_up();
      lock.lock();
      ++idle_;
      --started.helpers;
      change_.notify_all();
    }
    change_.notify_all();
  }

  Jobs& jobs_;
  std::size_t most_;
  std::mutex guard_;
  std::condition_variable change_;
  std::vector<std::thread> pool_;  // guarded by guard_, as are the following
  std::vector<Started*> started_;
  std::size_t threads_ = 0, idle_ = 0;
};

}  // namespace detail

/// For as long as it lives, parallel work that its thread starts stays on that thread.
class OnThisThread {
  detail::WithinPart alone_{nullptr};
};

/// Sets on how many threads all parallel work of this process runs from now on; 0: as many as there are processors.
inline void set_threads(std::size_t threads) { detail::threads_asked_for() = threads; }

/// Threads that parallel work started here would run on: what set_threads() asked for or the number of processors; 1 within a
/// part of parallel work.
inline std::size_t threads() {
  if (detail::part().of_parallel_work) return 1;
  const std::size_t asked = detail::threads_asked_for();
  return asked > 0 ? asked : std::max(1U, std::thread::hardware_concurrency());
}

/// Calls job(0) .. job(count - 1), each once, on threads() threads; when called from within a job, on its thread and on those
/// that have no job left.
/// @param progress      called from the calling thread with the share done, 0..1; may be empty. Not called within a job
/// @param most_threads  in place of threads(); 0: threads(). Within a job it does not count
/// @throws what the first failing job threw, after all threads have ended
inline void for_each_parallel(std::size_t count, const std::function<void(std::size_t)>& job,
                              const std::function<void(double)>& progress = {}, std::size_t most_threads = 0) {
  const bool asked = most_threads > 0 && !detail::part().of_parallel_work;
  const std::size_t most = asked ? most_threads : threads(), first = std::min(most, count);
  detail::Crew* const within = count > 1 ? detail::part().crew : nullptr;
  if (first < 2 && within == nullptr && !progress) {
    for (std::size_t i = 0; i < count; ++i) job(i);
    return;
  }
  detail::Jobs jobs(count, job);
  if (within != nullptr) {
    within->share(jobs);
    jobs.rethrow();
    return;
  }
  detail::Crew crew(jobs, most);
  if (progress && crew.start(first)) {
    while (jobs.share_done() < 1.0 && !jobs.failed()) {
      progress(jobs.share_done());
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  } else {
    crew.start(progress ? 0 : first - 1);
    crew.join_in();
  }
  crew.end();
  jobs.rethrow();
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
    const OnThisThread alone;
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
