// A high-order mesh as plain data, with everything that a file contains: nodes, blocks of elements, entities, physical
// groups.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh {

/// Nodes and cells are numbered with 32 bits. Facets and vertices of all cells are numbered so too; no shape has more
/// than eight.
inline constexpr std::int64_t kMostNodes = std::numeric_limits<std::int32_t>::max();
inline constexpr std::int64_t kMostCells = std::numeric_limits<std::int32_t>::max() / 8;

/// A block: consecutive elements of one shape and order on one elementary entity, in the order of the file.
struct ElementBlock {
  Shape shape = Shape::Point;
  int order = 1;
  int entity = 0;                     ///< Tag of the elementary entity of dimension info(shape).dimension.
  std::vector<int> physical;          ///< Tags of the physical groups of these elements, in the file's order.
  std::vector<std::int64_t> numbers;  ///< Element numbers of the file, one per element.
  /// Node indices (HighOrderMesh::coordinates has three numbers for each), element after element, in Gmsh's node order.
  std::vector<std::int32_t> nodes;
  std::vector<int> partitions;  ///< Empty, or the MSH 2.2 partition list that the elements of the block share.
  /// MSH 2.2 repeats an element for each physical group after the first, under another number. These are the other
  /// numbers: physical.size() − 1 per element, element after element. Empty if the mesh comes from another format or
  /// there is at most one group.
  std::vector<std::int64_t> repeat_numbers;

  std::size_t size() const { return numbers.size(); }
};

/// An elementary entity of the geometry from which the mesh was made: a point, curve, surface or volume.
struct Entity {
  int dimension = 0;
  int tag = 0;
  std::array<double, 6> box{};  ///< Bounding box: min x, y, z, max x, y, z. For a point min = max.
  std::vector<int> physical;    ///< Tags of its physical groups.
  std::vector<int> boundary;    ///< Signed tags of the entities that bound it.
};

struct PhysicalGroup {
  int dimension = 0;
  int tag = 0;
  std::string name;  ///< May be empty.
};

/// Consecutive nodes that are classified on one entity, in the order of the file. MSH 4.1 stores nodes this way.
/// MSH 2.2 does not classify nodes, so its meshes have one block with dimension −1.
struct NodeBlock {
  int dimension = -1;
  int entity = 0;
  std::int32_t first = 0;
  std::int32_t count = 0;
  /// t of each node on a curve, or u and v of each node on a surface, as MSH 4.1 may have them. Empty: not known.
  /// core/mesh/node_parameters.h says how long they stay.
  std::vector<double> parameters{};
};

/// A periodic link of the file: nodes of one entity that are images of the nodes of another entity, the master.
struct PeriodicLink {
  int dimension = 0;
  int entity = 0;
  int master = 0;
  std::vector<double> affine;  ///< The affine map from the master: empty, or 16 numbers, row-major.
  std::vector<std::pair<std::int32_t, std::int32_t>> nodes;  ///< Pairs (node, node of the master) of node indices.
};

/// A section of the file that VariMesh does not use and writes again as it was ($Comments, $NodeData, …).
struct ForeignSection {
  std::string name;    ///< Without the dollar sign.
  std::string bytes;   ///< Everything between the first and the last line of the section.
  std::string format;  ///< Name of the format from which it was read. It is written only to this format.
};

/// A high-order mesh. The cells, which are optimised, are the elements of the highest dimension. Elements of one
/// dimension less mark boundaries and interfaces. The nodes are Gmsh's equispaced nodes.
struct HighOrderMesh {
  int dimension = 0;                       ///< Highest dimension of an element. 2 or 3 if the mesh can be optimised.
  int order = 0;                           ///< Order of the cells, the same for all.
  std::vector<double> coordinates;         ///< x y z of each node, interleaved, in the file's own unit of length.
  std::vector<std::int64_t> node_numbers;  ///< Node numbers of the file; unique and positive.
  std::vector<NodeBlock> node_blocks;      ///< Cover all nodes in order.
  std::vector<ElementBlock> blocks;        ///< All elements of all dimensions, in the file's order.
  std::vector<Entity> entities;
  std::vector<PhysicalGroup> physical_groups;
  std::vector<PeriodicLink> periodic;
  std::vector<ForeignSection> foreign;

  std::size_t node_count() const { return coordinates.size() / 3; }
  /// The number of elements of dimension d.
  std::size_t element_count(int d) const {
    std::size_t n = 0;
    for (const ElementBlock& block : blocks)
      if (reference::info(block.shape).dimension == d) n += block.size();
    return n;
  }
};

}  // namespace varimesh
