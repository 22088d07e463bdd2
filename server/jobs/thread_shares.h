// Who may use how many of the machine's threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

namespace varimesh::server {

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

   private:
    friend class ThreadShares;
    Share(ThreadShares& shares, int wanted) : shares_(shares), wanted_(wanted) { shares_.join(this); }

    ThreadShares& shares_;
    const int wanted_;
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
  void share_out() {
    std::vector<int> parts(running_.size(), 1);
    int left = threads_ - static_cast<int>(parts.size());
    for (bool given = true; given && left > 0;) {
      given = false;
      for (std::size_t i = 0; i < parts.size() && left > 0; ++i) {
        if (parts[i] >= running_[i]->wanted_) continue;
        ++parts[i];
        --left;
        given = true;
      }
    }
    for (std::size_t i = 0; i < parts.size(); ++i) running_[i]->threads_ = parts[i];
  }

  const int threads_;
  std::mutex mutex_;
  std::vector<Share*> running_;  ///< In the order in which they came.
};

}  // namespace varimesh::server
