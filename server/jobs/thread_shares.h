// Who may use how many of the machine's threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace varimesh::server {

/// What a job can ask about its threads, and say.
struct LentThreads {
  std::function<int()> now;                            ///< How many it has at the moment, at least 1.
  std::function<void(bool rests)> rest = [](bool) {};  ///< It waits for something else, or does so no more.
};

/// Shares a number of threads among the jobs that run: one each, and then one more each, in the order in which they
/// came, as long as there are some and the job wants more. A job asks between its iterations how many it has now, so
/// that a large one lends threads to small ones that come, and has them back when they are done.
class ThreadShares {
 public:
  /// One job's part. Its threads come back when it goes.
  class Share {
   public:
    ~Share() { shares_.leave(this); }
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;
    /// How many it may use now, at least 1.
    int threads() const { return threads_; }
    /// As long as the job waits for something else it has no part, and the others have its threads.
    void rest(bool rests) { shares_.rest(this, rests); }

   private:
    friend class ThreadShares;
    Share(ThreadShares& shares, int wanted) : shares_(shares), wanted_(wanted) { shares_.join(this); }

    ThreadShares& shares_;
    const int wanted_;
    bool rests_ = false;  ///< With the lock of the shares held.
    std::atomic<int> threads_ = 1;
  };

  explicit ThreadShares(int threads) : threads_(threads) {}

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
  std::vector<Share*> running_;  ///< In the order in which they came.
};

}  // namespace varimesh::server
