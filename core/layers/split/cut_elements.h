// The parts of elements that are cut: their nodes, and where these lie. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/layers/split/cut_pattern.h"
#include "core/layers/split/layer_cuts.h"
#include "core/mesh/changes/shared_nodes.h"
#include "core/mesh/high_order_mesh.h"
#include "core/mesh/topology.h"

namespace varimesh::detail {

/// An element, and how its edges are cut.
struct CutElement {
  const CutPattern* pattern = nullptr;  ///< Null: it is not cut.
  /// By axis and by edge of the axis.
  std::array<std::array<DirectedEdge, 4>, kMostAxes> edges{};
};

/// New nodes, numbered from 0 as they are met. Elements that share an edge or a face find the same nodes there.
class NewNodes {
 public:
  std::int32_t count() const { return count_; }
  std::int32_t add(std::int32_t nodes) { return std::exchange(count_, count_ + nodes); }

  /// The new node at a point of an element with these vertices. The point lies on an edge or a face.
  /// @param make whether an edge or face that was not met yet gets nodes; otherwise −1 is returned
  std::int32_t find(const CutPattern& pattern, const CutPoint& point, const std::int32_t* vertices, bool make = true);

 private:
  std::int32_t first_of(const Vertices& sorted, std::int32_t nodes, bool make);

  std::int32_t count_ = 0;
  std::unordered_map<Vertices, std::int32_t, HashVertices> first_;
};

/// Finds how elements are cut. Patterns are made once.
class ElementCutter {
 public:
  ElementCutter(const HighOrderMesh& mesh, const Topology& topology, const LayerCuts& cuts)
      : mesh_(mesh), topology_(topology), cuts_(cuts) {}

  /// Errors: BadInput if an element of this shape cannot be cut so.
  Expected<CutElement> cut(const ElementBlock& block, std::size_t element);

  /// Where the points of the pattern lie in the element: 3 per point, interleaved.
  std::vector<double> places(const CutElement& cut, std::span<const std::int32_t> nodes) const;
  /// The same, by the basis of the whole element. It takes longer, and is a check on the other.
  std::vector<double> places_by_basis(const CutElement& cut, std::span<const std::int32_t> nodes) const;

 private:
  /// The parameter of a point along an axis.
  double parameter(const CutElement& cut, const CutPoint& point, std::size_t axis) const;
  std::vector<double> places_on_lines(const CutElement& cut, std::span<const std::int32_t> nodes) const;

  using Name = std::pair<Shape, std::vector<std::pair<std::ptrdiff_t, int>>>;
  const HighOrderMesh& mesh_;
  const Topology& topology_;
  const LayerCuts& cuts_;
  std::map<Name, std::unique_ptr<CutPattern>> patterns_;
};

}  // namespace varimesh::detail
