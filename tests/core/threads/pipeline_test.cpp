// A pipeline ends on every thread, whatever its functions throw. core/base/shared_work_test.cpp has the order.
#include "core/threads/pipeline.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace varimesh {
namespace {

enum class Where { Next, Make, Take };

TEST(Pipeline, EndsOnAllThreadsIfOneThrows) {
  for (const Where where : {Where::Next, Where::Make, Where::Take}) {
    int piece = 0;
    auto next = [&]() -> std::optional<int> {
      if (where == Where::Next && piece == 50) throw std::runtime_error("next");
      return piece++;
    };
    const auto make = [&](int number) {
      if (where == Where::Make && number == 50) throw std::runtime_error("make");
      return std::to_string(number);
    };
    const auto take = [&](const std::string& made) {
      if (where == Where::Take && made == "50") throw std::runtime_error("take");
      return true;
    };
    Pipeline pipeline(next, make, take, 6);
    std::atomic<int> thrown{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i)
      threads.emplace_back([&] {
        try {
          pipeline.work();
        } catch (const std::runtime_error&) {
          ++thrown;
        }
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_GE(thrown, 1);
  }
}

TEST(Pipeline, NeedsOneThreadOnly) {
  int piece = 0, taken = 0;
  auto next = [&] { return piece < 100 ? std::optional(piece++) : std::nullopt; };
  const auto make = [](int number) { return number; };
  const auto take = [&](int number) { return number == taken++; };
  Pipeline pipeline(next, make, take, 3);
  pipeline.work();
  EXPECT_EQ(taken, 100);
  pipeline.work();  // a thread that comes too late
  EXPECT_EQ(taken, 100);
}

}  // namespace
}  // namespace varimesh
