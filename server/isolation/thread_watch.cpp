#include "server/isolation/thread_watch.h"

#include <chrono>
#include <csignal>
#include <fstream>
#include <string>

namespace varimesh::server {
namespace {

/// What a process has; nothing if it has ended.
struct Has {
  int threads = 0;
  std::int64_t shared = 0;  ///< Bytes of memory that it can share.
};

Has look_at(pid_t process) {
  Has has;
  std::ifstream file("/proc/" + std::to_string(process) + "/status");
  for (std::string word; file >> word;) {
    std::int64_t kibibytes = 0;
    if (word == "RssShmem:" && file >> kibibytes) has.shared = kibibytes << 10;
    if (word == "Threads:" && file >> has.threads) return has;
  }
  return {};
}

}  // namespace

ThreadWatch::~ThreadWatch() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ThreadWatch::add(pid_t process, int computing, std::int64_t shared) {
  const std::scoped_lock lock(mutex_);
  watched_[process] = {computing + kMore, shared};
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  changed_.notify_all();
}

void ThreadWatch::forget(pid_t process) {
  const std::scoped_lock lock(mutex_);
  watched_.erase(process);
}

const char* ThreadWatch::why_killed(pid_t process) const {
  const std::scoped_lock lock(mutex_);
  const auto found = watched_.find(process);
  return found == watched_.end() ? nullptr : found->second.why_killed;
}

void ThreadWatch::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    for (auto& [process, watched] : watched_) {
      if (watched.why_killed != nullptr) continue;
      const auto [threads, shared] = look_at(process);
      const char* const why = threads > watched.most    ? "started more threads than it may"
                              : shared > watched.shared ? "took more memory than it may"
                                                        : nullptr;
      if (why != nullptr && ::kill(process, SIGKILL) == 0) watched.why_killed = why;
    }
    if (watched_.empty())
      changed_.wait(lock, [this] { return stopping_ || !watched_.empty(); });
    else
      changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return stopping_; });
  }
}

}  // namespace varimesh::server
