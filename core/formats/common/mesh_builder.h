// Makes a mesh of nodes and elements that come one after another, with numbers, and are put into groups later, as
// Abaqus, GMF and Exodus have them. Internal to core/formats and core/hdf.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Throws ReadFailure: its sentence begins with what cannot be read.
class MeshBuilder {
 public:
  explicit MeshBuilder(FileAllowance& allowance) : allowance_(allowance) {}

  /// A node with a number from 1 on. Refuses coordinates that are not finite.
  void add_node(std::int64_t number, const std::array<double, 3>& at);

  /// An element, whose nodes are numbers of nodes in Gmsh's order: all nodes of the complete element, or the first ones
  /// of them, those of the serendipity element. Returns its index. `number`: from 1 on.
  std::size_t add_element(Shape shape, int order, std::span<const std::int64_t> nodes, std::int64_t number);

  /// The element of one dimension less on a facet, which is counted as in ShapeInfo::facets. It is made once, also if
  /// it is asked for from both sides. Returns its index.
  std::size_t add_side(std::size_t element, int facet);

  /// Puts an element into a physical group with this tag.
  void put_into_group(std::size_t element, int tag);
  /// Names the group. Groups without elements of this dimension are left out.
  void name_group(int dimension, int tag, std::string name);

  std::size_t element_count() const { return elements_.size(); }
  Shape shape(std::size_t element) const { return elements_[element].shape; }
  int dimension(std::size_t element) const { return reference::info(shape(element)).dimension; }

  /// The mesh. Elements of one shape, order and list of groups become one block, and sides get the numbers above all
  /// others. Refuses elements with a node that the file does not have, and numbers that occur twice.
  HighOrderMesh take();

 private:
  struct Element {
    Shape shape;
    std::uint8_t order;
    std::int32_t count;   ///< Of its nodes.
    std::int32_t groups;  ///< Index in lists_.
    std::int64_t number;  ///< 0: not chosen yet.
    std::size_t first;    ///< Of its nodes in nodes_.
  };

  std::span<const std::int64_t> nodes_of(std::size_t element) const {
    return {nodes_.data() + elements_[element].first, std::size_t(elements_[element].count)};
  }
  void number_elements();
  void check_node_numbers();
  std::int32_t index_of(std::int64_t number, const Element& element) const;
  void add_to_block(const Element& element);

  FileAllowance& allowance_;
  HighOrderMesh mesh_;
  std::vector<Element> elements_;
  std::vector<std::int64_t> nodes_;
  std::map<std::array<std::int64_t, 4>, std::size_t> sides_;  ///< By their sorted vertices.
  std::vector<std::vector<int>> lists_{{}};                   ///< Lists of groups of elements.
  std::map<std::pair<std::int32_t, int>, std::int32_t> longer_lists_;
  std::map<std::array<int, 3>, std::size_t> blocks_;  ///< By shape, number of nodes and list of groups.
  std::vector<PhysicalGroup> names_;
  bool ascending_ = true;                                         ///< The numbers of the nodes are 1, 2, 3 …
  std::vector<std::pair<std::int64_t, std::int32_t>> by_number_;  ///< Of the nodes, unless they ascend.
};

}  // namespace varimesh::formats
