// How much memory may be taken while a file is read, large pages for it, and a look at whether to stop.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "core/base/stop_token.h"

// A header of glibc, which defines its macro in every header.
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace varimesh {

/// The most memory that the mesh of a file of this size takes while it is read, in bytes. A file that asks for more is
/// refused: a few bytes can announce many empty blocks, each of which takes more memory than the bytes do. The pieces
/// that threads work on take at most kPieceMemory more each, and a thread has one or two of them.
constexpr std::int64_t most_mesh_memory(std::int64_t file_bytes) { return 8 * file_bytes + (std::int64_t{32} << 20); }

/// The most memory that a piece of kPieceBytes takes, in bytes; one that takes more is not read as a piece.
inline constexpr std::int64_t kPieceMemory = std::int64_t{4} << 20;

/// What an allocation takes besides its bytes, at most.
inline constexpr std::size_t kAllocation = 32;

/// What a number in a std::set or a std::map takes, with a small value, at most.
inline constexpr std::size_t kTreeNode = 64 + kAllocation;

/// Empties a list and frees its memory. Assigning {} only empties it.
template <class T>
void free_memory(std::vector<T>& list) {
  std::vector<T>().swap(list);
}

/// Gives freed memory back to the system. Without this, lists of up to 32 MiB that a reader has freed stay with the
/// process, and longer ones do not find room in them. Takes some milliseconds.
inline void return_freed_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

/// Asks for large pages for this memory, which nobody has written yet. Does nothing if the memory is short or the
/// system has no such pages. With pages of 4 KiB, an array of 100 MB takes longer to fetch from the system than to
/// fill.
inline void prefer_large_pages([[maybe_unused]] void* begin, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_HUGEPAGE
  constexpr std::size_t kShort = std::size_t(4) << 20;  // two large pages of most processors
  if (bytes < kShort) return;
  const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto at = reinterpret_cast<std::uintptr_t>(begin);
  const std::uintptr_t first = (at + page - 1) / page * page;
  (void)::madvise(static_cast<char*>(begin) + (first - at), (at + bytes - first) / page * page, MADV_HUGEPAGE);
#endif
}

/// values.reserve(size), with large pages for a long array.
template <class Vector>
void reserve_large(Vector& values, std::size_t size) {
  const std::size_t before = values.capacity();
  values.reserve(size);
  if (values.capacity() > before)
    prefer_large_pages(values.data(), values.capacity() * sizeof(typename Vector::value_type));
}

/// What a reading may not take of its most memory until it has asked. Most files never need it.
class WithheldMemory {
 public:
  /// `get`: waits for that many bytes of it; false: the reading is to stop. Called twice at most.
  WithheldMemory(std::int64_t bytes, std::function<bool(std::int64_t bytes)> get)
      : bytes_(bytes), get_(std::move(get)) {}

  /// Gets at least as much as leaves `most` withheld. Throws Interrupted if the reading is to stop.
  void leave(std::int64_t most) {
    if (bytes_ <= most) return;
    const std::int64_t then = std::exchange(has_asked_, true) ? 0 : std::min(most, bytes_ / 2);
    if (!get_(bytes_ - then)) throw Interrupted();
    bytes_ = then;
  }

  /// For the readings of this thread that begin while it lives.
  class Scope {
   public:
    explicit Scope(WithheldMemory* memory) : before_(std::exchange(current(), memory)) {}
    ~Scope() { current() = before_; }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    WithheldMemory* const before_;
  };
  /// Null if nothing is withheld.
  static WithheldMemory*& current() {
    static thread_local WithheldMemory* memory = nullptr;
    return memory;
  }

 private:
  std::int64_t bytes_;
  bool has_asked_ = false;
  const std::function<bool(std::int64_t bytes)> get_;
};

/// Counts the memory of one mesh while it is read. One thread at a time.
class Allowance {
 public:
  /// `stop` may be null. `withheld`: what of the most has to be asked for first; may be null.
  explicit Allowance(std::int64_t most, const StopToken* stop = nullptr, WithheldMemory* withheld = nullptr)
      : left_(most), stop_(stop), withheld_(withheld) {}

  /// Returns false if this is more than is left. It counts all the same, so that give_back() is right. May wait for
  /// withheld memory. Throws Interrupted if reading is to stop meanwhile.
  bool take(std::size_t bytes) {
    left_ -= std::int64_t(bytes);
    if (withheld_ != nullptr && left_ >= 0) withheld_->leave(left_);
    return left_ >= 0;
  }
  void give_back(std::size_t bytes) { left_ += std::int64_t(bytes); }

  /// Makes room for `more` elements, and returns false if there is too little memory. Room for a single element grows
  /// by half of what is there.
  template <class T>
  bool make_room(std::vector<T>& values, std::size_t more) {
    const std::size_t size = values.size() + more, before = values.capacity();
    return size <= before || reserve(values, more > 1 ? size : size + before / 2);
  }

  /// As values.reserve(size).
  template <class T>
  bool reserve(std::vector<T>& values, std::size_t size) {
    const std::size_t before = values.capacity();
    if (size <= before) return true;
    if (!take(size * sizeof(T) + kAllocation)) return false;
    reserve_large(values, size);
    if (before > 0) give_back(before * sizeof(T) + kAllocation);
    return true;
  }

  /// Called for every record. Throws Interrupted if reading is to stop.
  void look() {
    constexpr unsigned kRecordsPerLook = 1024;
    if (++records_ % kRecordsPerLook == 0) look_now();
  }
  /// Called for every piece of many records.
  void look_now() const { varimesh::look(stop_); }

 private:
  std::int64_t left_;
  const StopToken* stop_;
  WithheldMemory* withheld_;
  unsigned records_ = 0;
};

}  // namespace varimesh
