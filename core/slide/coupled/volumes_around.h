// The volumes of the cells at the elements of a mesh's boundary. Internal to core/slide.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/mesh/high_order_mesh.h"
#include "core/slide/entity_elements.h"

namespace varimesh::detail {

/// Sums of the volumes of the cells at each facet and at each edge that is asked for.
class VolumesAround {
 public:
  void ask(const std::vector<std::vector<EntityElement>>& entities) {
    for (const auto& elements : entities)
      for (const EntityElement& element : elements) sums_[key_of(element.nodes, vertices(element.shape))] = 0;
  }
  /// @param volumes  by cell of the mesh
  void add(const HighOrderMesh& mesh, std::span<const double> volumes) {
    std::size_t cell = 0;
    for (const ElementBlock& block : mesh.blocks) {
      const reference::ShapeInfo& shape = reference::info(block.shape);
      if (shape.dimension != mesh.dimension) continue;
      const auto stride = at(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e, ++cell) {
        const std::int32_t* nodes = block.nodes.data() + e * stride;
        for (const reference::Facet& facet : shape.facets) {
          std::array<std::int32_t, 4> own{};
          for (std::size_t k = 0; k < own.size(); ++k) own[k] = facet.vertices[k] < 0 ? -1 : nodes[facet.vertices[k]];
          add(key_of(own, 4), volumes[cell]);
        }
        for (const auto& edge : shape.edges) add(key_of(std::array{nodes[edge[0]], nodes[edge[1]]}, 2), volumes[cell]);
      }
    }
  }
  double of(const EntityElement& element) const { return sums_.at(key_of(element.nodes, vertices(element.shape))); }

 private:
  /// The vertices of an element, sorted: what elements of a boundary and facets or edges of cells have in common.
  using Key = std::array<std::int32_t, 4>;

  template <class Nodes>
  static Key key_of(const Nodes& nodes, int vertices) {
    Key key{-1, -1, -1, -1};
    for (int k = 0; k < vertices; ++k) key[at(k)] = nodes[at(k)];
    std::ranges::sort(key);
    return key;
  }
  static int vertices(Shape shape) { return reference::info(shape).vertices; }
  void add(const Key& key, double volume) {
    if (const auto found = sums_.find(key); found != sums_.end()) found->second += volume;
  }

  std::map<Key, double> sums_;
};

}  // namespace varimesh::detail
