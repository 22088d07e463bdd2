// Stands in for malloc() and its relatives, counts, and passes on to those of glibc.
#include "tests/core/memory/counted_heap.h"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VARIMESH_COUNTS_HEAP 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define VARIMESH_COUNTS_HEAP 0
#endif
#endif
#if !defined(VARIMESH_COUNTS_HEAP) && defined(__GLIBC__)
#define VARIMESH_COUNTS_HEAP 1
#include <malloc.h>
#endif

namespace {

std::atomic<std::int64_t> in_use{0}, peak{0};

}  // namespace

#if VARIMESH_COUNTS_HEAP
extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

namespace {

constexpr std::int64_t kHeader = 8;

std::int64_t size_of(void* block) { return static_cast<std::int64_t>(::malloc_usable_size(block)) + kHeader; }

void* counted(void* block) {
  if (block == nullptr) return block;
  const std::int64_t now = in_use.fetch_add(size_of(block)) + size_of(block);
  std::int64_t most = peak.load();
  while (now > most && !peak.compare_exchange_weak(most, now)) {
  }
  return block;
}

}  // namespace

void* malloc(std::size_t size) { return counted(__libc_malloc(size)); }
void* calloc(std::size_t count, std::size_t size) { return counted(__libc_calloc(count, size)); }
void* memalign(std::size_t alignment, std::size_t size) { return counted(__libc_memalign(alignment, size)); }
void* aligned_alloc(std::size_t alignment, std::size_t size) { return counted(__libc_memalign(alignment, size)); }
int posix_memalign(void** to, std::size_t alignment, std::size_t size) {
  *to = counted(__libc_memalign(alignment, size));
  return *to == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  if (block != nullptr) in_use.fetch_sub(size_of(block));
  __libc_free(block);
}
void* realloc(void* block, std::size_t size) {
  const std::int64_t before = block != nullptr ? size_of(block) : 0;
  void* moved = __libc_realloc(block, size);
  if (moved == nullptr && size > 0) return moved;
  in_use.fetch_sub(before);
  return counted(moved);
}
}
#endif

namespace varimesh::testing {

std::int64_t bytes_in_use() { return in_use; }
std::int64_t peak_bytes() { return peak; }
void forget_peak() { peak = in_use.load(); }

}  // namespace varimesh::testing
