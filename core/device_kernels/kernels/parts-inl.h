// The threads of a device that share a cell. On a device each part is a thread, and parts exchange numbers by shuffles;
// on the processor one thread has all parts, in arrays, and the same sums are taken in the same order. Code for both
// keeps what a part has in an array of kHere<parts> entries and loops over them.
#if defined(VARIMESH_DEVICE_PARTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_PARTS_INL_H
#undef VARIMESH_DEVICE_PARTS_INL_H
#else
#define VARIMESH_DEVICE_PARTS_INL_H
#endif

#include <bit>
#include <cstdint>
#include <utility>

#include "core/device_kernels/kernels/splits.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/number-inl.h"
#include "core/kernels/hessian/batch.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

#ifdef __CUDA_ARCH__
inline constexpr bool kOnDevice = true;
#else
inline constexpr bool kOnDevice = false;
#endif

/// What was loaded before is loaded again after this call. Else the compiler keeps a row of the table in registers from
/// one use to the next, and there are not enough.
HWY_INLINE void forget_loads() {
#ifdef __CUDA_ARCH__
  asm volatile("" ::: "memory");
#endif
}

template <int parts>
inline constexpr int kHere = kOnDevice ? 1 : parts;

/// As device::turns_of().
template <int parts>
inline constexpr int kTurns = device::turns_of(parts);

#ifdef __CUDA_ARCH__
template <class T>
HWY_INLINE T other(T value, int mask) {
  if constexpr (sizeof(T) == 4) {
    return std::bit_cast<T>(__nvvm_shfl_sync_bfly_i32(-1, std::bit_cast<int>(value), mask, 31));
  } else {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    const auto low = static_cast<std::uint32_t>(__nvvm_shfl_sync_bfly_i32(-1, static_cast<int>(bits), mask, 31));
    const auto high = static_cast<std::uint32_t>(__nvvm_shfl_sync_bfly_i32(-1, static_cast<int>(bits >> 32), mask, 31));
    return std::bit_cast<T>(static_cast<std::uint64_t>(high) << 32 | low);
  }
}
/// The value of thread `source` of each `width` neighbours.
template <int width, class T>
HWY_INLINE T of_part(T value, int source) {
  constexpr int segment = (32 - width) << 8 | 31;
  if constexpr (sizeof(T) == 4) {
    return std::bit_cast<T>(__nvvm_shfl_sync_idx_i32(-1, std::bit_cast<int>(value), source, segment));
  } else {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    const auto low = static_cast<std::uint32_t>(__nvvm_shfl_sync_idx_i32(-1, static_cast<int>(bits), source, segment));
    const auto high =
        static_cast<std::uint32_t>(__nvvm_shfl_sync_idx_i32(-1, static_cast<int>(bits >> 32), source, segment));
    return std::bit_cast<T>(static_cast<std::uint64_t>(high) << 32 | low);
  }
}
#endif

/// A cell, and the parts of it that this thread has.
template <int parts>
struct Place {
  std::int32_t batch;
  int lane;
  int first;  ///< The first part; kHere<parts> of them are here.

  /// @param thread  the thread's number on a device; on the processor, the cell's
  static HWY_INLINE Place of(std::int64_t thread) {
    const std::int64_t cell = kOnDevice ? thread / parts : thread;
    return {static_cast<std::int32_t>(cell / kBatch), static_cast<int>(cell % kBatch),
            kOnDevice ? static_cast<int>(thread % parts) : 0};
  }
};

/// The sum over all parts, for each of them: a tree, so that all parts get the same bits.
template <int parts, class T, class Add>
HWY_INLINE void over_parts(T (&values)[kHere<parts>], const Add& add) {
  for (int mask = parts / 2; mask > 0; mask /= 2) {
#ifdef __CUDA_ARCH__
    values[0] = add(values[0], other(values[0], mask));
#else
    T before[kHere<parts>];
    for (int p = 0; p < parts; ++p) before[p] = values[p];
    for (int p = 0; p < parts; ++p) values[p] = add(before[p], before[p ^ mask]);
#endif
  }
}

/// Adds up what all parts have for each of kTurns<parts> points, and gives each part the sums of point part %
/// kTurns<parts>. In each step of the tree after the first ones a part gives away half of the points it still has.
template <int parts, int count, class T>
HWY_INLINE void take_turns(T (&sums)[kHere<parts>][kTurns<parts>][count], int part, T (&own)[kHere<parts>][count]) {
  constexpr int kPoints = kTurns<parts>;
#ifdef __CUDA_ARCH__
  VARIMESH_UNROLLED for (int mask = parts / 2; mask >= kPoints; mask /= 2) {
    VARIMESH_UNROLLED for (int point = 0; point < kPoints; ++point) {
      VARIMESH_UNROLLED for (int i = 0; i < count; ++i) {
        sums[0][point][i] = sums[0][point][i] + other(sums[0][point][i], mask);
      }
    }
  }
  if constexpr (kPoints == 4) VARIMESH_UNROLLED for (int point = 0; point < 2; ++point) {
      VARIMESH_UNROLLED for (int i = 0; i < count; ++i) {
        const bool upper = (part & 2) != 0;
        const T kept = upper ? sums[0][point + 2][i] : sums[0][point][i];
        const T given = upper ? sums[0][point][i] : sums[0][point + 2][i];
        sums[0][point][i] = kept + other(given, 2);
      }
    }
  VARIMESH_UNROLLED for (int i = 0; i < count; ++i) {
    if constexpr (kPoints == 1) {
      own[0][i] = sums[0][0][i];
    } else {
      const bool upper = (part & 1) != 0;
      const T kept = upper ? sums[0][1][i] : sums[0][0][i];
      const T given = upper ? sums[0][0][i] : sums[0][1][i];
      own[0][i] = kept + other(given, 1);
    }
  }
#else
  static_cast<void>(part);
  for (int point = 0; point < kPoints; ++point)
    for (int i = 0; i < count; ++i) {
      T now[parts];
      for (int p = 0; p < parts; ++p) now[p] = sums[p][point][i];
      for (int mask = parts / 2; mask > 0; mask /= 2) {
        T before[parts];
        for (int p = 0; p < parts; ++p) before[p] = now[p];
        for (int p = 0; p < parts; ++p) now[p] = before[p] + before[p ^ mask];
      }
      for (int p = point; p < parts; p += kPoints) own[p][i] = now[p];
    }
#endif
}

/// What the part that has point `point` has, for every part.
template <int parts, int count, class T>
HWY_INLINE void share(const T (&own)[kHere<parts>][count], int point, T (&shared)[count]) {
#ifdef __CUDA_ARCH__
  VARIMESH_UNROLLED for (int i = 0; i < count; ++i) {
    if constexpr (parts == 1)
      shared[i] = own[0][i];
    else
      shared[i] = of_part<parts>(own[0][i], point);
  }
#else
  for (int i = 0; i < count; ++i) shared[i] = own[point][i];
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
