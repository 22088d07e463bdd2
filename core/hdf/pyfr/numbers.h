// The numbers of nodes and cells in PyFR's mesh: nodes that cells use, and the cells of each shape. Internal to
// core/formats.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/connectivity.h"

namespace varimesh::formats {

class PyfrNumbers {
 public:
  /// The cells of a shape, in the mesh's order.
  struct OwnCells {
    struct Run {
      std::size_t index, cell;  ///< Of the first cell: among those of the shape, and among all.
    };
    std::vector<Run> runs;
    std::size_t count = 0;

    std::size_t operator[](std::size_t index) const {
      const Run& run = *std::prev(std::upper_bound(runs.begin(), runs.end(), index,
                                                   [](std::size_t i, const Run& each) { return i < each.index; }));
      return run.cell + (index - run.index);
    }
  };

  /// Refers to the cells.
  PyfrNumbers(const HighOrderMesh& mesh, const Cells& cells) : cells_(cells), valency_(mesh.node_count(), 0) {
    for (const Cells::Range& range : cells.ranges()) {
      OwnCells& own = own_[std::size_t(range.block->shape)];
      index_.push_back(own.count);
      own.runs.push_back({own.count, range.first});
      own.count += range.block->size();
      for (const std::int32_t node : range.block->nodes)
        if (std::uint16_t& count = valency_[std::size_t(node)]; count < 65535) ++count;
    }
    node_count_ = valency_.size() - std::size_t(std::count(valency_.begin(), valency_.end(), 0));
    if (node_count_ == valency_.size()) return;
    number_.assign(valency_.size(), -1);
    node_.reserve(node_count_);
    for (std::size_t node = 0; node < valency_.size(); ++node) {
      if (valency_[node] == 0) continue;
      number_[node] = std::int32_t(node_.size());
      node_.push_back(std::int32_t(node));
    }
  }

  std::size_t node_count() const { return node_count_; }
  /// How many cells have the node. 65535 stands for all larger numbers too.
  std::uint16_t valency(std::int32_t node) const { return valency_[std::size_t(node)]; }
  /// The number of a node that a cell uses.
  std::int64_t number_of(std::int32_t node) const { return number_.empty() ? node : number_[std::size_t(node)]; }
  /// The node with a number.
  std::int32_t node_of(std::size_t number) const { return node_.empty() ? std::int32_t(number) : node_[number]; }

  const OwnCells& own(Shape shape) const { return own_[std::size_t(shape)]; }
  /// The number of a cell among those of its shape.
  std::int64_t index_of(std::size_t cell) const {
    return index_of(cell, std::size_t(&cells_.range_of(cell) - cells_.ranges().data()));
  }
  /// `range`: the number of the cell's range in Cells::ranges().
  std::int64_t index_of(std::size_t cell, std::size_t range) const {
    return std::int64_t(index_[range] + cell - cells_.ranges()[range].first);
  }

 private:
  const Cells& cells_;
  std::array<OwnCells, kShapes> own_;
  std::vector<std::size_t> index_;           // of the first cell of each range among those of its shape
  std::vector<std::int32_t> number_, node_;  // empty if cells use all nodes
  std::vector<std::uint16_t> valency_;
  std::size_t node_count_ = 0;
};

}  // namespace varimesh::formats
