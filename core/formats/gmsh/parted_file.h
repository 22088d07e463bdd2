// A binary MSH 4.1 file that is read in parts, so that none needs the memory for the whole mesh.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/formats/common/format.h"
#include "core/formats/gmsh/types.h"

namespace varimesh::formats {

/// Consecutive elements of one dimension, by their places among all elements of this dimension in the file.
struct ElementRange {
  std::int64_t first = 0, count = 0;
};

/// Elements to read. Both lists ascend.
struct Wanted {
  std::vector<ElementRange> cells, borders;
};

/// Knows where in the file the blocks of nodes and elements are. A part is read by copying the bytes of its elements
/// and of their nodes into a small file, which the reader of MSH files reads.
class PartedFile {
 public:
  /// Reads the sections' heads. Errors: BadInput, with the path: no such file, another format, a damaged head.
  static Expected<PartedFile> open(const std::string& path);
  PartedFile(PartedFile&& other) noexcept;
  PartedFile(const PartedFile&) = delete;
  PartedFile& operator=(const PartedFile&) = delete;
  PartedFile& operator=(PartedFile&&) = delete;
  ~PartedFile();

  int dimension() const { return dimension_; }                       ///< The highest of an element.
  std::int64_t cells() const { return elements(dimension_); }        ///< Elements of this dimension.
  std::int64_t borders() const { return elements(dimension_ - 1); }  ///< Elements of one dimension less.
  std::int64_t elements(int dimension) const;
  std::int64_t nodes() const { return nodes_; }
  int order() const;  ///< Of the first cells.
  /// The last place at or before `place` that is a multiple of `multiple` cells behind the begin of its block.
  std::int64_t aligned(std::int64_t place, std::int64_t multiple) const;
  /// The first element of each block of cells and of borders.
  Wanted one_of_each_block() const;

  /// The mesh of these elements and of their nodes, in the order of the file, with the file's numbers but without
  /// groups, entities and periodic links. Errors: BadInput, with the place in the file. The calling thread reads.
  /// Reading takes twice the memory of the part.
  /// @param places if not null, receives the place of each node among all nodes of the file
  Expected<HighOrderMesh> read(const Wanted& wanted, int threads, std::vector<std::int64_t>* places) const;

  /// The number of the node at this place among all nodes. Errors: BadInput.
  Expected<std::int64_t> node_number(std::int64_t place) const;

 private:
  struct NodeRecords {
    std::int32_t dimension = 0, entity = 0;
    std::int64_t first = 0, count = 0;          // places among all nodes
    std::int64_t numbers = 0, coordinates = 0;  // bytes of the file
    std::size_t stride = 0;                     // bytes of a node's coordinates and parameters
  };
  struct ElementRecords {
    std::int32_t dimension = 0, entity = 0, type = 0;
    std::int64_t first = 0, count = 0;  // places among all elements of this dimension
    std::int64_t at = 0;                // byte of the file
    std::size_t stride = 0;             // bytes of an element: its number and those of its nodes
  };
  class Heads;
  class Cut;

  PartedFile(const std::string& path, int descriptor, std::int64_t size)
      : path_(path), descriptor_(descriptor), size_(size) {}
  void find_records();
  void read_bytes(std::int64_t at, void* to, std::size_t count) const;

  std::string path_;
  int descriptor_ = -1;
  std::int64_t size_ = 0, nodes_ = 0;
  int dimension_ = 0;
  std::vector<NodeRecords> node_records_;
  std::vector<ElementRecords> element_records_;
};

}  // namespace varimesh::formats
