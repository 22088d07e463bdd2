// The registry of open streams, used by many threads at the same time.
#include "server/streams/calls.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace varimesh::server {
namespace {

/// A call that leaves the registry when it ends, as streams do.
class FakeCall : public Call, public std::enable_shared_from_this<FakeCall> {
 public:
  explicit FakeCall(CallRegistry* calls) : calls_(calls) {}
  void end(const grpc::Status&) override {
    if (!ended_.exchange(true)) calls_->remove(shared_from_this());
  }
  void tick(std::chrono::steady_clock::time_point) override { ++ticks; }
  std::atomic<int> ticks = 0;

 private:
  CallRegistry* const calls_;
  std::atomic<bool> ended_ = false;
};

TEST(CallRegistryConcurrency, EndsEveryCallThatComesBeforeOrAfter) {
  CallRegistry calls;
  std::atomic<bool> stopping = false;
  std::atomic<int> refused = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&] {
      for (int call = 0; call < 500; ++call) {
        const auto made = std::make_shared<FakeCall>(&calls);
        if (!calls.add(made)) {
          ++refused;
          made->end({});
        } else if (call % 2 == 0) {
          made->end({});
        }
      }
    });
  threads.emplace_back([&] {
    while (!stopping) calls.tick(std::chrono::steady_clock::now());
  });
  calls.end_all({});
  for (std::size_t i = 0; i < 4; ++i) threads[i].join();
  stopping = true;
  threads.back().join();
  EXPECT_TRUE(calls.wait_empty(std::chrono::steady_clock::now() + std::chrono::seconds(10)));
  EXPECT_EQ(calls.size(), 0u);
}

}  // namespace
}  // namespace varimesh::server
