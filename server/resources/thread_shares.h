// How many of the machine's threads each running job may use.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace varimesh::server {

/// A job's view of its threads.
struct LentThreads {
  std::function<int()> now;                            ///< How many threads the job may use now, at least 1.
  std::function<void(bool rests)> rest = [](bool) {};  ///< The job begins or ends to wait for something else.
};

/// Shares a number of threads among the running jobs: one per job, then one more per job in the order of their arrival,
/// as long as threads are left and the job wants more. A job asks between its iterations how many it has, so a large
/// job lends threads to small jobs that arrive and gets them back when those are done. Thread-safe.
class ThreadShares {
 public:
  /// The share of one job. Its threads return when it is destroyed.
  class Share {
   public:
    ~Share() { shares_.leave(this); }
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;
    /// How many threads the job may use now, at least 1.
    int threads() const { return threads_; }
    /// A job that rests, because it waits for something else, has no share, and the other jobs have its threads.
    void rest(bool rests) { shares_.rest(this, rests); }

   private:
    friend class ThreadShares;
    Share(ThreadShares& shares, int wanted) : shares_(shares), wanted_(wanted) { shares_.join(this); }

    ThreadShares& shares_;
    const int wanted_;
    bool rests_ = false;  ///< Guarded by the mutex of the shares.
    std::atomic<int> threads_ = 1;
  };

  explicit ThreadShares(int threads) : threads_(threads) {}

  /// Adds a job that wants at most `wanted` threads.
  std::unique_ptr<Share> take(int wanted) { return std::unique_ptr<Share>(new Share(*this, wanted)); }

 private:
  void join(Share* share) {
    std::lock_guard lock(mutex_);
    running_.push_back(share);
    share_out();
  }
  void leave(Share* share) {
    std::lock_guard lock(mutex_);
    std::erase(running_, share);
    share_out();
  }
  void rest(Share* share, bool rests) {
    std::lock_guard lock(mutex_);
    share->rests_ = rests;
    share_out();
  }
  void share_out() {
    std::vector<Share*> at_work;
    for (Share* share : running_)
      if (!share->rests_) at_work.push_back(share);
    std::vector<int> parts(at_work.size(), 1);
    int left = threads_ - static_cast<int>(parts.size());
    for (bool given = true; given && left > 0;) {
      given = false;
      for (std::size_t i = 0; i < parts.size() && left > 0; ++i) {
        if (parts[i] >= at_work[i]->wanted_) continue;
        ++parts[i];
        --left;
        given = true;
      }
    }
    for (std::size_t i = 0; i < parts.size(); ++i) at_work[i]->threads_ = parts[i];
  }

  const int threads_;
  std::mutex mutex_;
  std::vector<Share*> running_;  ///< In the order of arrival.
};

}  // namespace varimesh::server
