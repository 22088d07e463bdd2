// A crew calls every index once, on no more threads than it has, also for loops inside loops.
#include "core/threads/crew.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace varimesh {
namespace {

template <class Body>
void share(std::size_t count, std::size_t grain, const Body& body) {
  Crew::current()->share(count, grain, LoopBody(body));
}

TEST(Crew, IsOfTheThreadThatOpenedItUntilItCloses) {
  EXPECT_EQ(Crew::current(), nullptr);
  {
    const Crew::Opened outer(2);
    Crew* const first = Crew::current();
    EXPECT_NE(first, nullptr);
    {
      const Crew::Opened inner(3);
      EXPECT_NE(Crew::current(), first);
    }
    EXPECT_EQ(Crew::current(), first);
  }
  EXPECT_EQ(Crew::current(), nullptr);
}

TEST(Crew, CallsEveryIndexOnceForLoopsInsideLoops) {
  for (const int threads : {1, 2, 3, 8}) {
    const Crew::Opened opened(threads);
    std::vector<std::atomic<int>> calls(20 * 300);
    for (int round = 0; round < 50; ++round)
      share(20, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
          share(300, 7, [&](std::size_t first, std::size_t last) {
            for (std::size_t k = first; k < last; ++k) ++calls[300 * i + k];
          });
      });
    for (const auto& number : calls) EXPECT_EQ(number, 50) << threads << " threads";
  }
}

TEST(Crew, RunsOnNoMoreThreadsThanItHas) {
  const Crew::Opened opened(3);
  std::atomic<int> inside{0}, most{0};
  share(30, 1, [&](std::size_t, std::size_t) {
    share(10, 1, [&](std::size_t, std::size_t) {
      const int now = ++inside;
      for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
      }
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      --inside;
    });
  });
  EXPECT_LE(most, 3);
}

TEST(Crew, DoesTheLoopsInsideALongPieceTogether) {
  const Crew::Opened opened(2);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  share(2, 1, [&](std::size_t begin, std::size_t) {
    if (begin == 0) return;  // one thread is done at once, and helps with the loop of the other
    for (int i = 0; i < 20; ++i)
      share(20, 1, [&](std::size_t, std::size_t) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const std::scoped_lock lock(mutex);
        threads.insert(std::this_thread::get_id());
      });
  });
  EXPECT_EQ(threads.size(), 2U);
}

TEST(Crew, RethrowsOnceAndCanGoOn) {
  for (const int threads : {1, 2, 8}) {
    const Crew::Opened opened(threads);
    for (int round = 0; round < 100; ++round)
      EXPECT_THROW(share(64, 1, [](std::size_t, std::size_t) { throw std::runtime_error("broken"); }),
                   std::runtime_error);
    std::atomic<int> sum{0};
    share(64, 1, [&](std::size_t begin, std::size_t end) { sum += static_cast<int>(end - begin); });
    EXPECT_EQ(sum, 64);
  }
}

TEST(Crew, WorksBesideOthers) {
  std::vector<std::thread> runs;
  std::atomic<int> sum{0};
  for (int run = 0; run < 6; ++run)
    runs.emplace_back([&] {
      for (int round = 0; round < 50; ++round) {
        const Crew::Opened opened(3);
        share(100, 3, [&](std::size_t begin, std::size_t end) { sum += static_cast<int>(end - begin); });
      }
    });
  for (std::thread& run : runs) run.join();
  EXPECT_EQ(sum, 6 * 50 * 100);
}

std::ptrdiff_t threads_of_this_process() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/task"), {});
}

TEST(Crew, TakesTheHelpersOfTheCrewBefore) {
  const std::ptrdiff_t before = threads_of_this_process();
  for (int round = 0; round < 300; ++round) {
    const Crew::Opened opened(3);
    share(100, 3, [](std::size_t, std::size_t) {});
  }
  EXPECT_LE(threads_of_this_process(), before + 2);
}

TEST(Crew, TheMachineHasAThread) { EXPECT_GE(machine_threads(), 1); }

}  // namespace
}  // namespace varimesh
