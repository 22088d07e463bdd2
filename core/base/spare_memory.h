// Memory that a run can use if nobody else needs it.
#pragma once

#include <cstdint>
#include <functional>

namespace varimesh {

/// The most that one run borrows at a time, in bytes.
inline constexpr std::int64_t kMostSpareMemory = std::int64_t{2} << 30;

/// Lends memory beyond what a run was admitted with. Both functions return at once. Both may be empty: then nothing is
/// lent. They are called by one thread at a time.
struct SpareMemory {
  /// Asks for so many bytes and returns how many are lent: from none to all.
  std::function<std::int64_t(std::int64_t bytes)> take;
  /// Gives back bytes that take() has lent.
  std::function<void(std::int64_t bytes)> give_back;
};

}  // namespace varimesh
