// A program with one planted race. Two threads add an event each, and the listener that they call counts without a
// lock. The thread sanitizer must find the race.
#include <atomic>
#include <cstdio>
#include <thread>

#include "server/jobs/event_log.h"

namespace {

class Careless : public varimesh::server::Listener {
 public:
  void poke() override {
    // Both threads are here before either of them counts. The order is relaxed, so that it does not synchronise them.
    inside_.fetch_add(1, std::memory_order_relaxed);
    while (inside_.load(std::memory_order_relaxed) < 2) std::this_thread::yield();
    ++pokes;
  }
  int pokes = 0;

 private:
  std::atomic<int> inside_ = 0;
};

}  // namespace

int main() {
  varimesh::server::EventLog log;
  const auto listener = std::make_shared<Careless>();
  log.subscribe(listener);
  std::thread first([&] { log.append({}); }), second([&] { log.append({}); });
  first.join();
  second.join();
  std::printf("%d pokes\n", listener->pokes);
}
