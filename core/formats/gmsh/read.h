// Reads Gmsh's MSH files, and what the readers of its versions share. Internal to core/formats.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/base/team.h"
#include "core/formats/common/format.h"
#include "core/formats/gmsh/types.h"

namespace varimesh::formats {

/// Converts node numbers to indices. Needs no memory if the numbers are 1, 2, 3, …; uses a dense table if they are
/// compact, and sorted pairs otherwise.
class NodeIndex {
 public:
  /// Takes the numbers of all nodes. Calls scanner.fail() if one is not positive or appears twice.
  void build(const std::vector<std::int64_t>& numbers, const Scanner& scanner);

  /// The index of the node with this number, or −1.
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

/// Tags of physical groups by entity (dimension, tag).
using EntityGroups = std::map<std::pair<int, int>, std::vector<int>>;

/// The state of reading one file.
struct GmshReading {
  const Team& team;
  Allowance& allowance;
  Scanner scanner;
  HighOrderMesh mesh;
  Format format = Format::Auto;  ///< Files of versions 2.0 and 2.1 count as 2.2, and those of 4.0 as 4.1.
  int version = 0;               ///< Ten times the version: 20, 21, 22, 40 or 41.
  NodeIndex index;
  EntityGroups entity_groups;
  bool has_nodes = false;
  bool has_elements = false;

  /// The index of the node with this number. Fails if there is none; the sentence names the element or link, `by`
  /// `by_number`, that refers to it.
  std::int32_t node(std::int64_t number, const char* by, std::int64_t by_number) const {
    return node(scanner, number, by, by_number);
  }
  /// The same for a number that another scanner has read.
  std::int32_t node(const Scanner& scan, std::int64_t number, const char* by, std::int64_t by_number) const {
    const std::int32_t i = index.find(number);
    if (i < 0)
      scan.fail(std::string(by) + " " + std::to_string(by_number) + " refers to node " + std::to_string(number) +
                ", which the file does not have");
    return i;
  }
};

/// The shape and order for a number of an element type. Fails if VariMesh cannot read such elements.
GmshType accepted_type(const Scanner& scanner, int number);

/// Reads the type of an element block of this dimension, and gives the block its shape and order. Fails if the type is
/// of another dimension.
GmshType type_of_block(Scanner& scan, int dimension, ElementBlock& block);

/// The number of an element. Fails if it is negative.
inline std::int64_t element_number(const Scanner& scan, std::int64_t number) {
  if (number < 0) scan.fail("element number " + std::to_string(number) + " is negative; renumber the mesh");
  return number;
}

/// Gives a block the physical groups of its entity.
void take_groups(GmshReading& reading, int dimension, ElementBlock& block);

/// Each reads the contents of one section. The scanner has read the line with the section's name.
void read_nodes_22(GmshReading& reading);
void read_elements_22(GmshReading& reading);
void read_periodic_22(GmshReading& reading);

void read_entities_41(GmshReading& reading);
void read_partitioned_entities_41(GmshReading& reading);
void read_nodes_41(GmshReading& reading);
void read_elements_41(GmshReading& reading);
void read_periodic_41(GmshReading& reading);

/// Version 4.0 has other headers of blocks, numbers of type int, and nodes with their numbers.
void read_nodes_40(GmshReading& reading);
void read_elements_40(GmshReading& reading);

/// Whether the bytes begin like an MSH file: with a dollar sign.
bool begins_like_gmsh(std::string_view bytes);

/// Reads a whole MSH file of version 2.0, 2.1, 2.2, 4.0 or 4.1, ASCII or binary. Throws ReadFailure.
Expected<MeshFile> read_gmsh(std::string_view bytes, const Team& team);

}  // namespace varimesh::formats
