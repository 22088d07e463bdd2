// The blocks of elements that grow while a CGNS file is read. Internal to core/formats.
#pragma once

#include <cstdint>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/formats/numbering/cgns_order.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

class CgnsBlocks {
 public:
  CgnsBlocks(HighOrderMesh& mesh, FileAllowance& allowance) : mesh_(mesh), allowance_(allowance) {}

  /// What follows are `count` elements of this type, entity and groups, as far as is known. They go into the last block
  /// if they are like the elements there, otherwise into a new one.
  void begin(const CgnsType& type, int entity, const std::vector<int>& groups, std::size_t count) {
    std::vector<ElementBlock>& blocks = mesh_.blocks;
    if (blocks.empty() || blocks.back().shape != type.shape || blocks.back().order != type.order ||
        nodes_per_element(blocks.back()) != type.nodes || blocks.back().entity != entity ||
        blocks.back().physical != groups) {
      allowance_.take(1, sizeof(ElementBlock) + 2 * kAllocation);
      blocks.push_back({type.shape, type.order, entity, groups, {}, {}, {}, {}});
    }
    if (place_ == nullptr || type.shape != type_.shape || type.order != type_.order) {
      place_ = &gmsh_nodes(NodeOrder::Cgns, type.shape, type.order);
      type_ = type;
    }
    allowance_.make_room(blocks.back().numbers, count);
    type_.nodes = type.nodes;
    allowance_.make_room(blocks.back().nodes, count * type_.nodes);
  }

  /// Adds elements, as begin() has announced them.
  /// @param number of the first one
  /// @param nodes  of all of them, in CGNS's order
  /// @param shift  what is to be added to these numbers for the indices of the nodes
  void add(std::int64_t number, std::int64_t count, const std::int64_t* nodes, std::int64_t shift) {
    ElementBlock& block = mesh_.blocks.back();
    const int* const place = place_->data();
    const std::size_t each = type_.nodes, begin = block.nodes.size();
    block.nodes.resize(begin + std::size_t(count) * each);
    std::int32_t* own = block.nodes.data() + begin;
    for (std::int64_t e = 0; e < count; ++e, own += each, nodes += each) {
      block.numbers.push_back(number + e);
      for (std::size_t i = 0; i < each; ++i) own[place[i]] = std::int32_t(nodes[i] + shift);
    }
  }

 private:
  HighOrderMesh& mesh_;
  FileAllowance& allowance_;
  CgnsType type_;                            // of the elements that are added
  const std::vector<int>* place_ = nullptr;  // for each of their nodes in CGNS's order, its place in Gmsh's
};

}  // namespace varimesh::formats
