// Arrays for vector loads: where they start, and how far a node is from the next.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace varimesh {

inline constexpr std::size_t kCacheLine = 64;

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

/// Floats from one node's vector to the next, where nodes are padded for vector loads. The fourth in 3-D means nothing.
constexpr int padded(int dimension) { return dimension == 2 ? 2 : 4; }

}  // namespace varimesh
