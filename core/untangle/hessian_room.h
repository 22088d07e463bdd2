// The memory that patches have for the Hessians of their cells.
#pragma once

#include <atomic>
#include <cstdint>

namespace varimesh {

/// Bytes that patches take and give back while they work at the same time. Thread-safe.
class HessianRoom {
 public:
  explicit HessianRoom(std::int64_t bytes) : left_(bytes) {}

  /// Takes these bytes and returns true, or returns false if there are not as many.
  bool take(std::int64_t bytes) {
    if (left_.fetch_sub(bytes) >= bytes) return true;
    left_.fetch_add(bytes);
    return false;
  }
  void give_back(std::int64_t bytes) { left_.fetch_add(bytes); }
  std::int64_t left() const { return left_; }

 private:
  std::atomic<std::int64_t> left_;
};

}  // namespace varimesh
