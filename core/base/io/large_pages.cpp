// Memory for the programs: long arrays in large pages.
//
// This replaces the operators new of a program that links it; the library does not contain it, and asks for large pages
// for its longest arrays only (large_arrays.h). A run takes and frees some hundred arrays that grow with the mesh. On
// 124,883 quartic tetrahedra it fetched 4.0 pages of 4 KiB per tetrahedron from the system. With large pages it makes
// 1.2 such fetches.
#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <new>

#include "core/base/io/allowance.h"

// The sanitizers have operators of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VARIMESH_KEEPS_OPERATORS
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define VARIMESH_KEEPS_OPERATORS
#endif
#endif

#if defined(MADV_HUGEPAGE) && !defined(VARIMESH_KEEPS_OPERATORS)

namespace {

constexpr std::size_t kLargePage = std::size_t(2) << 20;  // of most processors
/// Memory that is at least this long begins at a large page. That costs addresses before it, at most a quarter of its
/// length, and no memory. The limit of a worker process on addresses is twice the estimate of its memory and more.
constexpr std::size_t kLong = 4 * kLargePage;

void* try_to_allocate(std::size_t bytes, std::size_t alignment) {
  if (bytes >= kLong && bytes <= static_cast<std::size_t>(-1) - kLargePage) alignment = std::max(alignment, kLargePage);
  void* memory = nullptr;
  if (alignment <= alignof(std::max_align_t))
    memory = std::malloc(std::max<std::size_t>(bytes, 1));
  else if (::posix_memalign(&memory, alignment, std::max<std::size_t>(bytes, 1)) != 0)
    return nullptr;
  if (memory == nullptr) return nullptr;
  const int error = errno;  // a system without large pages sets it
  varimesh::prefer_large_pages(memory, bytes);
  errno = error;
  return memory;
}

void* allocate(std::size_t bytes, std::size_t alignment) {
  for (;;) {
    if (void* const memory = try_to_allocate(bytes, alignment); memory != nullptr) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}

}  // namespace

// The other forms of new call these two.
void* operator new(std::size_t bytes) { return allocate(bytes, 1); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return allocate(bytes, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*bytes*/) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*bytes*/, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}

#endif
