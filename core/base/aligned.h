// Arrays that start on a cache line, and the padding of node coordinates, both for vector loads.
#pragma once

#include <cstddef>
#include <new>
#include <utility>
#include <vector>

namespace varimesh {

inline constexpr std::size_t kCacheLine = 64;

/// Allocates arrays that start on a cache line.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  CacheLineAllocator() = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(kCacheLine))); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, std::align_val_t(kCacheLine)); }
  template <class U>
  bool operator==(const CacheLineAllocator<U>&) const {
    return true;
  }
};

template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

/// The same, but the numbers that resize() adds have no value. A loop that the threads share writes them first, so the
/// threads also share the work of fetching new memory from the system, and nothing is written twice.
template <class T>
struct UntouchedAllocator : CacheLineAllocator<T> {
  using value_type = T;
  UntouchedAllocator() = default;
  template <class U>
  UntouchedAllocator(const UntouchedAllocator<U>&) {}
  template <class U>
  void construct(U* p) {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Arguments>
  void construct(U* p, Arguments&&... arguments) {
    ::new (static_cast<void*>(p)) U(std::forward<Arguments>(arguments)...);
  }
};

template <class T>
using UntouchedVector = std::vector<T, UntouchedAllocator<T>>;

/// Numbers per node in arrays that are padded for vector loads. In 3-D the fourth number has no meaning.
constexpr int padded(int dimension) { return dimension == 2 ? 2 : 4; }

}  // namespace varimesh
