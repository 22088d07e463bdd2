// The memory that all running jobs may use together.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace varimesh::server {

/// Gives memory to jobs, so that no owner waits for another's large jobs. Thread-safe.
///
/// Jobs that hold memory and need more are served first. Then it is the turn of the owner who holds least, and among
/// equals of the job that has waited longest. Smaller jobs pass one that does not fit, until that has waited for
/// `patience`; then what becomes free is kept for it. A part of the memory, the reserve, is for first jobs: a job that
/// fits into it, of an owner who holds nothing, has to wait for other such jobs only.
class MemoryBudget {
 public:
  /// The part of a job.
  struct Share {
    std::string owner;  ///< Empty: nobody's. Such a job may have all memory, and has no use of the reserve.
    std::int64_t bytes = 0;
    bool in_reserve = false;
  };

  /// `limit` in bytes. 0: no limit.
  explicit MemoryBudget(std::int64_t limit, std::chrono::milliseconds patience = std::chrono::seconds(30));

  std::int64_t limit() const { return limit_; }
  /// The most bytes that one job of this owner may have; 0: no limit.
  std::int64_t most_of(const std::string& owner) const { return owner.empty() ? limit_ : limit_ - reserve_; }
  bool can_ever_fit(std::int64_t bytes, const std::string& owner = {}) const {
    return limit_ == 0 || bytes <= most_of(owner);
  }

  /// Waits until the job can have `bytes` in place of what it has, and takes them. It keeps what it has while it waits,
  /// and also if it gives up: `given_up` is called ten times per second, and exchange() returns false if that returns
  /// true first. Once all jobs that have memory wait for more, none of them could ever go on: then the first gets what
  /// it needs, although the others keep what they have.
  bool exchange(Share& share, std::int64_t bytes, const std::function<bool()>& given_up);
  /// Adds as much of this as is free to the share, at once, and returns how much that is. None if a job waits for
  /// memory.
  std::int64_t take_spare(Share& share, std::int64_t bytes);
  /// Gives back a part of the share.
  void give_back(Share& share, std::int64_t bytes);

 private:
  struct Waiting {
    const Share* share;
    std::int64_t bytes;
    std::chrono::steady_clock::time_point since;
  };
  /// Where a job that waits finds its memory.
  enum class Place { Nowhere, Common, Reserve };

  std::int64_t held_by(const std::string& owner) const;
  Place place_for(const Waiting& waiting, bool all_wait, bool is_kept) const;
  /// Where this job may take its memory now, if it is its turn.
  Place turn_of(const Share& share) const;
  void count(const Share& share, std::int64_t bytes);

  const std::int64_t limit_, reserve_;
  const std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;  ///< In the order in which they have asked.
  std::map<std::string, std::int64_t> held_;
  std::int64_t taken_ = 0, in_reserve_ = 0;  ///< By all, those that wait included, and what of it is in the reserve.
};

}  // namespace varimesh::server
