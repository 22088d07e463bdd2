// Waiting for memory.
#include "server/resources/memory_budget.h"

#include <algorithm>
#include <tuple>
#include <vector>

namespace varimesh::server {
namespace {

/// An eighth of the memory, or what a small mesh needs to be read, but never more than a quarter.
std::int64_t reserve_of(std::int64_t limit) {
  constexpr std::int64_t kForSmallJob = std::int64_t{128} << 20;
  return std::min(std::max(limit / 8, kForSmallJob), limit / 4);
}

}  // namespace

MemoryBudget::MemoryBudget(std::int64_t limit, std::chrono::milliseconds patience)
    : limit_(limit), reserve_(reserve_of(limit)), patience_(patience) {}

bool MemoryBudget::exchange(Share& share, std::int64_t bytes, const std::function<bool()>& given_up) {
  std::unique_lock lock(mutex_);
  waiting_.push_back({&share, bytes, std::chrono::steady_clock::now()});
  changed_.notify_all();  // perhaps now all that hold memory wait
  Place place = Place::Nowhere;
  const auto is_turn = [&] { return (place = turn_of(share)) != Place::Nowhere; };
  bool gave_up = false;
  while (!gave_up && !changed_.wait_for(lock, std::chrono::milliseconds(100), is_turn)) {
    lock.unlock();
    gave_up = given_up();
    lock.lock();
  }
  std::erase_if(waiting_, [&](const Waiting& one) { return one.share == &share; });
  if (!gave_up) {
    count(share, -share.bytes);
    share.bytes = bytes;
    share.in_reserve = place == Place::Reserve;
    count(share, bytes);
  }
  changed_.notify_all();
  return !gave_up;
}

std::int64_t MemoryBudget::take_spare(Share& share, std::int64_t bytes) {
  std::lock_guard lock(mutex_);
  if (!waiting_.empty()) return 0;
  const std::int64_t of_all = limit_ == 0 ? bytes : limit_ - taken_;
  const std::int64_t of_its = share.in_reserve                     ? reserve_ - in_reserve_
                              : limit_ == 0 || share.owner.empty() ? bytes
                                                                   : limit_ - reserve_ - (taken_ - in_reserve_);
  const std::int64_t lent = std::clamp<std::int64_t>(std::min(of_all, of_its), 0, bytes);
  share.bytes += lent;
  count(share, lent);
  return lent;
}

void MemoryBudget::give_back(Share& share, std::int64_t bytes) {
  std::lock_guard lock(mutex_);
  share.bytes -= bytes;
  count(share, -bytes);
  changed_.notify_all();
}

std::int64_t MemoryBudget::held_by(const std::string& owner) const {
  const auto found = held_.find(owner);
  return found == held_.end() ? 0 : found->second;
}

MemoryBudget::Place MemoryBudget::place_for(const Waiting& waiting, bool all_wait, bool is_kept) const {
  if (limit_ == 0) return Place::Common;
  const auto& [owner, held, in_reserve] = *waiting.share;
  const bool fits = taken_ - held + waiting.bytes <= limit_;
  const std::int64_t common = taken_ - in_reserve_ - (in_reserve ? 0 : held);
  const bool fits_beside = owner.empty() || common + waiting.bytes <= limit_ - reserve_;
  if (!is_kept && fits && fits_beside) return Place::Common;
  if (!is_kept && held > 0 && all_wait) return Place::Common;
  // Jobs of nobody may have more than leaves the reserve free.
  const bool is_first = !owner.empty() && held_by(owner) == (in_reserve ? held : 0);
  const std::int64_t reserved = in_reserve_ - (in_reserve ? held : 0);
  return is_first && fits && reserved + waiting.bytes <= reserve_ ? Place::Reserve : Place::Nowhere;
}

MemoryBudget::Place MemoryBudget::turn_of(const Share& share) const {
  std::int64_t held_and_waiting = 0;
  std::vector<const Waiting*> order;
  for (const Waiting& one : waiting_) {
    held_and_waiting += one.share->bytes;
    order.push_back(&one);
  }
  std::stable_sort(order.begin(), order.end(), [&](const Waiting* a, const Waiting* b) {
    const auto rank = [&](const Waiting& one) {
      const bool holds = one.share->bytes > 0;
      return std::tuple(!holds, holds || one.share->owner.empty() ? 0 : held_by(one.share->owner));
    };
    return rank(*a) < rank(*b);
  });
  const auto now = std::chrono::steady_clock::now();
  bool is_kept = false;  // whether what is free is kept for a job before
  for (const Waiting* one : order) {
    const Place place = place_for(*one, held_and_waiting == taken_, is_kept);
    if (one->share == &share) return place;
    if (place != Place::Nowhere) return Place::Nowhere;  // it is another's turn
    is_kept = is_kept || now - one->since >= patience_;
  }
  return Place::Nowhere;
}

void MemoryBudget::count(const Share& share, std::int64_t bytes) {
  taken_ += bytes;
  if (share.in_reserve) in_reserve_ += bytes;
  if (!share.owner.empty() && (held_[share.owner] += bytes) == 0) held_.erase(share.owner);
}

}  // namespace varimesh::server
