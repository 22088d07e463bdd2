// The memory that patches have for the Hessians of their cells.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <utility>

#include "core/base/spare_memory.h"

namespace varimesh {

/// Bytes that patches take and give back while they work at the same time. take(), give_back() and left() are
/// thread-safe.
class HessianRoom {
 public:
  /// `bytes`: its own. It may borrow more, and gives that back at its end.
  explicit HessianRoom(std::int64_t bytes, SpareMemory spare = {})
      : own_(bytes), left_(bytes), spare_(std::move(spare)) {}
  HessianRoom(const HessianRoom&) = delete;
  HessianRoom& operator=(const HessianRoom&) = delete;
  ~HessianRoom() {
    if (lent_ > 0 && spare_.give_back) spare_.give_back(lent_);
  }

  /// Borrows what it needs to have room for so many bytes, or as much of it as is lent. Call it while nothing is taken.
  void grow_to(std::int64_t bytes) {
    const std::int64_t wanted = std::min(bytes - own_, kMostSpareMemory) - lent_;
    if (wanted <= 0 || !spare_.take) return;
    const std::int64_t lent = spare_.take(wanted);
    lent_ += lent;
    left_ += lent;
  }

  /// Takes these bytes and returns true, or returns false if there are not as many.
  bool take(std::int64_t bytes) {
    if (left_.fetch_sub(bytes) >= bytes) return true;
    left_.fetch_add(bytes);
    return false;
  }
  void give_back(std::int64_t bytes) { left_.fetch_add(bytes); }
  std::int64_t left() const { return left_; }

 private:
  const std::int64_t own_;
  std::int64_t lent_ = 0;
  std::atomic<std::int64_t> left_;
  const SpareMemory spare_;
};

}  // namespace varimesh
