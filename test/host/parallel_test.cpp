#include "heft/host/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "heft/host/number_store.hpp"

namespace heft::host {
namespace {

constexpr int kItems = 500;

/// Sets the number of threads as long as it lives.
class Threads {
 public:
  explicit Threads(std::size_t count) { set_threads(count); }
  ~Threads() { set_threads(0); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;
};

/// Work of unequal length.
double slow_root(int item) {
  double x = item;
  for (int k = 0; k < (item * 7919) % 2000; ++k) x = 0.5 * (x + item / std::max(x, 1e-9));
  return x;
}

void be_busy(int item = 1999) { [[maybe_unused]] const volatile double root = slow_root(item); }

template <typename Use>
void take_through(int items, const Use& use) {
  int next = 0;
  for_each_in_order<int, double>(
      16, [&](int& item) { return (item = next++) < items; }, [](int& item) { return slow_root(item); }, use);
}

TEST(InOrder, UsesResultsInTheOrderOfTheItemsOnAnyNumberOfThreads) {
  for (const std::size_t threads : {1, 2, 3, 8}) {
    const Threads set(threads);
    std::vector<double> used;
    take_through(kItems, [&](double& result) { used.push_back(result); });
    ASSERT_EQ(used.size(), static_cast<std::size_t>(kItems));
    for (int item = 0; item < kItems; ++item) EXPECT_EQ(used[static_cast<std::size_t>(item)], slow_root(item));
  }
}

TEST(InOrder, ThrowsWhatTheFirstItemThrowsWhicheverFailsSooner) {
  for (const std::size_t threads : {1, 2, 3, 8}) {
    const Threads set(threads);
    for (int repetition = 0; repetition < 20; ++repetition) {
      int next = 0, used = 0;
      const auto run = [&] {
        for_each_in_order<int, int>(
            16,
            [&](int& item) {
              item = next++;
              if (item == 60) throw std::runtime_error("reading 60");
              return true;
            },
            [](int& item) {
              if (item < 50) be_busy();
              if (item >= 50) throw std::runtime_error("working on " + std::to_string(item));
              return item;
            },
            [&](int&) { ++used; });
      };
      std::string message;
      try {
        run();
      } catch (const std::runtime_error& error) {
        message = error.what();
      }
      EXPECT_EQ(message, "working on 50");
      EXPECT_EQ(used, 50);
    }
  }
}

TEST(InOrder, ThrowsWhatReadingThrowsOnceEverythingBeforeWasUsed) {
  for (const std::size_t threads : {1, 2, 8}) {
    const Threads set(threads);
    int next = 0, used = 0;
    EXPECT_THROW((for_each_in_order<int, int>(
                     16,
                     [&](int& item) {
                       item = next++;
                       if (item == 30) throw std::runtime_error("the end is missing");
                       return true;
                     },
                     [](int& item) { return item; }, [&](int&) { ++used; })),
                 std::runtime_error);
    EXPECT_EQ(used, 30);
  }
}

TEST(InOrder, RunsOnAsManyThreadsAsAskedForAndNestedWorkOnItsOwn) {
  const Threads set(3);
  EXPECT_EQ(threads(), 3U);
  std::mutex guard;
  std::set<std::thread::id> ids;
  std::atomic<int> nested{0};
  take_through(kItems, [&](double&) {
    if (threads() == 1) ++nested;
    const std::lock_guard<std::mutex> lock(guard);
    ids.insert(std::this_thread::get_id());
  });
  EXPECT_LE(ids.size(), 3U);
  EXPECT_EQ(nested, kItems);
  EXPECT_EQ(threads(), 3U) << "of the calling thread, once the work is done";
}

TEST(Parallel, CallsEveryJobOnceAlsoThoseThatJobsStart) {
  constexpr std::size_t kJobs = 6, kParts = 40;
  for (const std::size_t threads : {1, 2, 3, 8}) {
    const Threads set(threads);
    std::vector<std::atomic<int>> calls(kJobs * kParts * 2);
    for_each_parallel(kJobs, [&](std::size_t job) {
      for_each_parallel(job % 2 == 0 ? 1 : kParts, [&](std::size_t part) {
        be_busy(static_cast<int>(part) * 31);
        for_each_parallel(2, [&](std::size_t half) { ++calls[(job * kParts + part) * 2 + half]; });
      });
    });
    for (std::size_t k = 0; k < calls.size(); ++k) {
      const bool called = k / (kParts * 2) % 2 == 1 || k / 2 % kParts == 0;
      ASSERT_EQ(calls[k], called ? 1 : 0) << threads << " threads, part " << k;
    }
  }
}

TEST(Parallel, ThreadsWithoutAJobHelpWithWhatAnotherJobStarts) {
  // Of 2 jobs one ends at once, the other starts as many parts as threads are allowed. Each of them waits until all have begun:
  // fewer threads would wait in vain.
  for (const int threads : {2, 5}) {
    const Threads set(static_cast<std::size_t>(threads));
    std::atomic<int> begun{0}, met{0};
    int met_by_the_end = 0;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    for_each_parallel(2, [&](std::size_t job) {
      if (job == 0) return;
      const std::thread::id own = std::this_thread::get_id();
      for_each_parallel(static_cast<std::size_t>(threads), [&](std::size_t) {
        ++begun;
        while (begun < threads && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
        if (std::this_thread::get_id() != own) std::this_thread::sleep_for(std::chrono::milliseconds(20));
        if (begun == threads) ++met;
      });
      met_by_the_end = met;
    });
    EXPECT_EQ(met, threads);
    EXPECT_EQ(met_by_the_end, threads) << "the job goes on before its parts have ended";
  }
}

TEST(Parallel, AJobMayHoldALockThatOthersWaitForWhileItsPartsRun) {
  const Threads set(3);
  std::mutex guard;
  int sum = 0;
  for_each_parallel(30, [&](std::size_t) {
    const std::lock_guard<std::mutex> lock(guard);
    std::atomic<int> parts{0};
    for_each_parallel(8, [&](std::size_t part) { be_busy(), parts += static_cast<int>(part) + 1; });
    sum += parts;
  });
  EXPECT_EQ(sum, 30 * 36);
}

TEST(Parallel, WhatAPartThrowsReachesTheCallerOnceNoThreadIsAtAJob) {
  for (const std::size_t threads : {1, 2, 8}) {
    const Threads set(threads);
    for (int repetition = 0; repetition < 20; ++repetition) {
      std::atomic<int> busy{0};
      std::string message;
      try {
        for_each_parallel(4, [&](std::size_t job) {
          ++busy;
          try {
            for_each_parallel(10, [&](std::size_t part) {
              ++busy;
              be_busy();
              --busy;
              if (job == 2 && part == 7) throw std::runtime_error("part 7");
            });
          } catch (...) {
            --busy;
            throw;
          }
          --busy;
        });
      } catch (const std::runtime_error& error) {
        message = error.what();
      }
      EXPECT_EQ(message, "part 7");
      EXPECT_EQ(busy, 0);
    }
  }
}

TEST(Parallel, RunsOnAsManyThreadsAsACallAsksForButNotWithinAJob) {
  const Threads set(1);
  // Jobs wait until all have begun, as many as there are threads.
  const auto meet = [](std::size_t count, std::chrono::milliseconds patience, std::size_t most_threads) {
    std::atomic<std::size_t> begun{0}, met{0};
    const auto deadline = std::chrono::steady_clock::now() + patience;
    const auto job = [&](std::size_t) {
      ++begun;
      while (begun < count && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
      if (begun == count) ++met;
    };
    for_each_parallel(count, job, {}, most_threads);
    return met == count;
  };
  EXPECT_TRUE(meet(3, std::chrono::seconds(20), 3));
  EXPECT_FALSE(meet(2, std::chrono::milliseconds(50), 0));
  const OnThisThread alone;
  EXPECT_FALSE(meet(2, std::chrono::milliseconds(50), 2));
}

TEST(Parallel, OnThisThreadKeepsPartsOfAJobThere) {
  const Threads set(4);
  std::atomic<int> elsewhere{0};
  for_each_parallel(4, [&](std::size_t job) {
    if (job > 0) return;
    const OnThisThread alone;
    const std::thread::id own = std::this_thread::get_id();
    for_each_parallel(kItems, [&](std::size_t) {
      for (int k = 0; k < 30; ++k) be_busy();
      if (std::this_thread::get_id() != own) ++elsewhere;
    });
  });
  EXPECT_EQ(elsewhere, 0);
}

TEST(NumberStore, GivesBackWhatItTookFromMemoryAndFromTheDisk) {
  NumberStore store;
  constexpr std::size_t kBlock = 50'000, kBlocks = 60;  // 24 MB: more than stays in memory
  std::vector<double> block(kBlock), read(kBlock);
  for (std::size_t b = 0; b < kBlocks; ++b) {
    for (std::size_t k = 0; k < kBlock; ++k) block[k] = static_cast<double>(b * kBlock + k);
    ASSERT_TRUE(store.append(block));
    for (const std::size_t from : {std::size_t{0}, b}) {
      ASSERT_TRUE(store.read(from * kBlock, read));
      EXPECT_EQ(read.front(), static_cast<double>(from * kBlock));
      EXPECT_EQ(read.back(), static_cast<double>(from * kBlock + kBlock - 1));
    }
  }
  EXPECT_EQ(store.size(), kBlock * kBlocks);
  EXPECT_FALSE(store.read(store.size() - kBlock + 1, read)) << "beyond the end there is nothing";
}

}  // namespace
}  // namespace heft::host
