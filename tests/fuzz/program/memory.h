// Counts the memory that a call allocates, and ends the program if it is more than allowed.
#pragma once

#include <sanitizer/allocator_interface.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

namespace varimesh::fuzz {

inline std::atomic<std::int64_t> in_use{0}, peak{0};

inline void count(const volatile void* block, std::size_t size) {
  if (block == nullptr) return;
  const std::int64_t now = in_use += static_cast<std::int64_t>(size);
  if (now > peak) peak = now;
}
inline void discount(const volatile void* block) {
  if (block != nullptr) in_use -= static_cast<std::int64_t>(__sanitizer_get_allocated_size(const_cast<void*>(block)));
}

/// Must be called once, at the start.
inline void count_memory() { __sanitizer_install_malloc_and_free_hooks(count, discount); }

/// Calls read() and ends the program if it has had more than `most` bytes at a time.
template <class Read>
auto within_memory(std::int64_t most, const Read& read) {
  const std::int64_t before = in_use;
  peak = before;
  auto result = read();
  if (peak - before <= most) return result;
  std::fprintf(stderr, "ERROR: %lld bytes were allocated, more than %lld\n", static_cast<long long>(peak - before),
               static_cast<long long>(most));
  std::abort();
}

/// Ends the program unless this is true.
inline void expect(bool is_true, const char* what) {
  if (is_true) return;
  std::fprintf(stderr, "ERROR: %s\n", what);
  std::abort();
}

}  // namespace varimesh::fuzz
