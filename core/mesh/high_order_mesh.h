// A high-order mesh as a file holds it: nodes, elements in blocks, entities, physical groups. Plain data.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh {

/// Consecutive elements of one shape and order on one elementary entity, in the order of the file.
struct ElementBlock {
  Shape shape = Shape::Point;
  int order = 1;
  int entity = 0;                     ///< Tag of the elementary entity of dimension info(shape).dimension.
  std::vector<int> physical;          ///< Tags of the physical groups these elements are in, in the file's order.
  std::vector<std::int64_t> numbers;  ///< Element numbers as the file has them, one an element.
  std::vector<std::int32_t> nodes;  ///< Indices into HighOrderMesh::coordinates / 3, element-major, Gmsh's node order.
  std::vector<int> partitions;      ///< Empty, or the MSH 2.2 partition list shared by the block's elements.
  /// MSH 2.2 repeats an element, under another number, for each further physical group: those numbers,
  /// physical.size() − 1 an element, element-major. Empty: from another format, or no more than one group.
  std::vector<std::int64_t> repeat_numbers;

  std::size_t size() const { return numbers.size(); }
};

/// An elementary entity (point, curve, surface, volume) of the geometry that the mesh was made from.
struct Entity {
  int dimension = 0;
  int tag = 0;
  std::array<double, 6> box{};  ///< min x, y, z, max x, y, z; for a point min = max.
  std::vector<int> physical;    ///< Tags of its physical groups.
  std::vector<int> boundary;    ///< Signed tags of the entities that bound it.
};

struct PhysicalGroup {
  int dimension = 0;
  int tag = 0;
  std::string name;  ///< May be empty.
};

/// Consecutive nodes classified on one entity, in the order of the file (MSH 4.1 has them so; from MSH 2.2 there is one
/// block with dimension −1, "not said").
struct NodeBlock {
  int dimension = -1;
  int entity = 0;
  std::int32_t first = 0;
  std::int32_t count = 0;
};

/// Nodes of one entity that are images of another entity's, as the file declares them.
struct PeriodicLink {
  int dimension = 0;
  int entity = 0;
  int master = 0;
  std::vector<double> affine;                                ///< Empty, or 16 numbers, row-major.
  std::vector<std::pair<std::int32_t, std::int32_t>> nodes;  ///< (node, master's node), indices.
};

/// A section of the file that VariMesh does not use and hands back as it was ($Comments, $NodeData, …).
struct ForeignSection {
  std::string name;    ///< Without the dollar sign.
  std::string bytes;   ///< Everything between the first and the last line of the section.
  std::string format;  ///< Name of the format it was read from; it is handed back to that format alone.
};

/// A high-order mesh. The cells that are optimised are the elements of the highest dimension; those one dimension lower
/// mark boundaries and interfaces. Nodes are Gmsh's equispaced ones.
struct HighOrderMesh {
  int dimension = 0;                       ///< Highest dimension of an element: 2 or 3 where it can be optimised.
  int order = 0;                           ///< Order of the cells of that dimension; all the same.
  std::vector<double> coordinates;         ///< x y z of each node, interleaved, in the file's own unit of length.
  std::vector<std::int64_t> node_numbers;  ///< Node numbers as the file has them; unique and positive.
  std::vector<NodeBlock> node_blocks;      ///< Cover all nodes in order.
  std::vector<ElementBlock> blocks;        ///< All elements of all dimensions, in the file's order.
  std::vector<Entity> entities;
  std::vector<PhysicalGroup> physical_groups;
  std::vector<PeriodicLink> periodic;
  std::vector<ForeignSection> foreign;

  std::size_t node_count() const { return coordinates.size() / 3; }
  /// Number of elements of dimension d.
  std::size_t element_count(int d) const {
    std::size_t n = 0;
    for (const ElementBlock& block : blocks)
      if (reference::info(block.shape).dimension == d) n += block.size();
    return n;
  }
};

}  // namespace varimesh
