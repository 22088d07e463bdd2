// Blocks of elements that grow while a file is read, and whose memory the scanner counts. Internal to core/formats.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

/// Frees memory that a vector does not need, unless it is little: a copy of the vector takes time, and for a while
/// twice the memory. Pages that were never used cost nothing.
template <class T>
void shrink(std::vector<T>& values, const Scanner& scan) {
  const std::size_t before = values.capacity();
  if (before - values.size() <= values.size() / 8) return;
  scan.take_memory(values.size() * sizeof(T) + kAllocation);
  values.shrink_to_fit();
  if (scan.allowance != nullptr) scan.allowance->give_back(before * sizeof(T) + kAllocation);
}

/// Frees memory that a block does not need now that another one follows.
inline void close(ElementBlock& block, const Scanner& scan) {
  if (block.size() == block.numbers.capacity()) return;
  shrink(block.numbers, scan);
  shrink(block.nodes, scan);
  shrink(block.repeat_numbers, scan);
}

/// Adds an empty block.
inline void add_block(std::vector<ElementBlock>& blocks, ElementBlock block, const Scanner& scan) {
  scan.take_memory((block.physical.size() + block.partitions.size()) * sizeof(int) + 2 * kAllocation);
  scan.add(blocks, std::move(block));
}

/// Appends values to a vector.
template <class T>
void add_values(std::vector<T>& to, const std::vector<T>& more, const Scanner& scan) {
  if (to.capacity() - to.size() < more.size()) scan.reserve(to, std::max(to.size() + more.size(), to.size() * 3 / 2));
  to.insert(to.end(), more.begin(), more.end());
}

/// Puts the elements of one piece after another into the blocks of the mesh.
class Joiner {
 public:
  // `scan` stands at the first element.
  Joiner(std::vector<ElementBlock>& blocks, std::int64_t total, const Scanner& scan)
      : blocks_(blocks), left_(total), scan_(scan), bytes_left_(scan.left()) {}

  std::int64_t left() const { return left_; }  ///< Elements of the file that no piece has had.

  // Refuses a piece that begins with the nodes of the last element: it may begin with a repetition. `lines`: elements
  // of the file in the piece, repetitions included. `bytes`: bytes of the piece.
  bool take(std::vector<ElementBlock>& piece, std::int64_t lines, std::size_t bytes) {
    if (lines > left_ || begins_like_last(piece)) return false;
    left_ -= lines;
    bytes_left_ -= bytes;
    for (ElementBlock& block : piece) append(block);
    return true;
  }

 private:
  bool begins_like_last(const std::vector<ElementBlock>& piece) const {
    if (blocks_.empty() || piece.empty()) return false;
    const ElementBlock &last = blocks_.back(), &first = piece.front();
    if (last.shape != first.shape || nodes_per_element(last) != nodes_per_element(first)) return false;
    const auto nodes = std::ptrdiff_t(nodes_per_element(last));
    return std::equal(last.nodes.end() - nodes, last.nodes.end(), first.nodes.begin());
  }

  void append(ElementBlock& more) {
    if (blocks_.empty() || !fits(blocks_.back(), more)) {
      if (!blocks_.empty()) close(blocks_.back(), scan_);
      scan_.take_memory(more.numbers.capacity() * sizeof more.numbers[0] +
                        more.nodes.capacity() * sizeof more.nodes[0] +
                        more.repeat_numbers.capacity() * sizeof more.repeat_numbers[0] + 3 * kAllocation);
      add_block(blocks_, std::move(more), scan_);
      return;
    }
    ElementBlock& block = blocks_.back();
    grow(block, more.size());
    add_values(block.numbers, more.numbers, scan_);
    add_values(block.nodes, more.nodes, scan_);
    add_values(block.repeat_numbers, more.repeat_numbers, scan_);
  }

  static bool fits(const ElementBlock& a, const ElementBlock& b) {
    return a.shape == b.shape && a.order == b.order && nodes_per_element(a) == nodes_per_element(b) &&
           a.entity == b.entity && a.physical == b.physical && a.partitions == b.partitions;
  }

  // Doubling the capacity would temporarily need up to three times the block's size. A block that is larger than a
  // piece therefore reserves memory for all elements that may follow. Pages that are never used cost nothing, and the
  // rest is freed at the end of the block.
  void grow(ElementBlock& block, std::size_t more) const {
    if (block.size() + more <= block.numbers.capacity()) return;
    // The number of elements is what the file announces, which its bytes may be too few for.
    const std::size_t per_element = nodes_per_element(block),
                      least = scan_.binary ? 4 * (1 + per_element) : 2 * (3 + per_element),
                      all = block.size() + more + std::min(std::size_t(left_), bytes_left_ / least);
    scan_.reserve(block.numbers, all);
    scan_.reserve(block.nodes, all * per_element);
  }

  std::vector<ElementBlock>& blocks_;
  std::int64_t left_;
  const Scanner& scan_;
  std::size_t bytes_left_;
};

}  // namespace varimesh::formats
