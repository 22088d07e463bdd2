// Pieces of work that are begun and received in order, and done by several threads at the same time.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

namespace varimesh {

/// next() returns the next piece, or nothing after the last one; make(piece) does the work; take(result) receives the
/// results in the order of the pieces and returns whether it wants more. next() and take() are each called by one
/// thread at a time, and at most `most` pieces are in memory.
///
/// Every thread that is to work calls work(), which returns when nothing is left to do for it. One thread is enough.
/// What next(), make() or take() throws leaves work() on that thread, and ends it on the others.
template <class Next, class Make, class Take>
class Pipeline {
 public:
  Pipeline(Next& next, const Make& make, const Take& take, std::size_t most)
      : next_(next), make_(make), take_(take), most_(most) {}

  void work() {
    std::unique_lock lock(mutex_);
    try {
      while (!is_done())
        if (!take_one(lock) && !make_one(lock) && !is_done()) changed_.wait(lock);
    } catch (...) {
      if (!lock) lock.lock();
      ended_ = stopped_ = true;
      changed_.notify_all();
      throw;
    }
  }

 private:
  using Piece = typename decltype(std::declval<Next&>()())::value_type;
  using Result = decltype(std::declval<const Make&>()(std::declval<Piece&>()));

  /// A piece that was begun is received, unless take() wants no more.
  bool is_done() const { return stopped_ || (ended_ && taken_ == begun_); }

  bool take_one(std::unique_lock<std::mutex>& lock) {
    const auto result = results_.find(taken_);
    if (taking_ || result == results_.end()) return false;
    taking_ = true;
    Result received = std::move(result->second);
    results_.erase(result);
    lock.unlock();
    const bool more = take_(std::move(received));
    lock.lock();
    taking_ = false;
    ++taken_;
    if (!more) ended_ = stopped_ = true;
    changed_.notify_all();
    return true;
  }

  bool make_one(std::unique_lock<std::mutex>& lock) {
    if (beginning_ || ended_ || begun_ - taken_ >= most_) return false;
    beginning_ = true;
    lock.unlock();
    std::optional<Piece> piece = next_();
    lock.lock();
    beginning_ = false;
    if (!piece) ended_ = true;
    changed_.notify_all();
    if (!piece) return true;
    const std::size_t number = begun_++;
    lock.unlock();
    Result result = make_(*piece);
    lock.lock();
    results_.emplace(number, std::move(result));
    changed_.notify_all();
    return true;
  }

  Next& next_;
  const Make& make_;
  const Take& take_;
  const std::size_t most_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::size_t, Result> results_;    ///< Of pieces that wait to be received.
  std::size_t begun_ = 0, taken_ = 0;        ///< How many pieces.
  bool beginning_ = false, taking_ = false;  ///< Whether a thread is in next() or take().
  bool ended_ = false, stopped_ = false;     ///< Whether there is no next piece; whether no more results are wanted.
};

}  // namespace varimesh
