// What the readers of the two Gmsh versions share: node numbers, blocks, sections. Internal to core/formats.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/formats.h"
#include "core/formats/gmsh_types.h"
#include "core/formats/scanner.h"

namespace varimesh::formats {

/// From node numbers to indices. Takes no memory where the numbers are 1, 2, 3, …, a dense table where they are
/// compact, and sorted pairs otherwise.
class NodeIndex {
 public:
  /// Takes the numbers of all nodes; fails on the scanner where one is not positive or comes twice.
  void build(const std::vector<std::int64_t>& numbers, const Scanner& scanner);

  /// The index of that number, or −1.
  std::int32_t find(std::int64_t number) const {
    if (std::uint64_t(number - 1) >= std::uint64_t(largest_)) return -1;
    if (identity_) return std::int32_t(number - 1);
    return dense_.empty() ? find_sorted(number) : dense_[std::size_t(number)];
  }

 private:
  std::int32_t find_sorted(std::int64_t number) const;

  bool identity_ = false;
  std::int64_t largest_ = 0;
  std::vector<std::int32_t> dense_;
  std::vector<std::pair<std::int64_t, std::int32_t>> sorted_;
};

/// Physical groups by entity (dimension, tag).
using EntityGroups = std::map<std::pair<int, int>, std::vector<int>>;

/// A file being read.
struct GmshReading {
  Scanner scanner;
  HighOrderMesh mesh;
  Format format = Format::Auto;
  NodeIndex index;
  EntityGroups entity_groups;
  bool has_nodes = false;
  bool has_elements = false;

  /// The index of the node of that number, which an element or a link refers to.
  std::int32_t node(std::int64_t number, const char* by, std::int64_t by_number) const {
    const std::int32_t i = index.find(number);
    if (i < 0)
      scanner.fail(std::string(by) + " " + std::to_string(by_number) + " refers to node " + std::to_string(number) +
                   ", which the file does not have");
    return i;
  }
};

/// The type of an element type number that is read; fails where it cannot be.
GmshType accepted_type(const Scanner& scanner, int number);

/// Reads the sections' contents, from after the line with the section's name.
void read_nodes_22(GmshReading& reading);
void read_elements_22(GmshReading& reading);
void read_periodic_22(GmshReading& reading);

void read_entities_41(GmshReading& reading);
void read_partitioned_entities_41(GmshReading& reading);
void read_nodes_41(GmshReading& reading);
void read_elements_41(GmshReading& reading);
void read_periodic_41(GmshReading& reading);

/// Reads a whole MSH file; throws ReadFailure.
MeshFile read_gmsh(std::string_view bytes);

}  // namespace varimesh::formats
