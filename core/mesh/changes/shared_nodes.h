// The nodes on the edges and faces of cells, by the vertices of these edges and faces, so that cells which share an
// edge or face find the same nodes. Internal to the library.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::detail {

/// Vertices of an edge or face; unused entries are −1.
using Vertices = std::array<std::int32_t, 4>;

/// A node inside an edge or face: its local number and its position (i, j) on the lattice of this edge or face.
struct PlacedNode {
  int local;
  int i;
  int j;
};

/// The nodes of one shape and order besides its vertices, by edge, face and interior.
struct CellNodes {
  std::vector<std::vector<PlacedNode>> edges;
  std::vector<std::vector<PlacedNode>> faces;
  std::vector<int> interior;
};

CellNodes cell_nodes(Shape shape, int order, int ambient);

/// A position inside a face that does not depend on the order of the face's vertices.
struct FacePlace {
  Vertices sorted;
  std::int32_t rank;   ///< Its number among the positions inside the face, counted from the smallest vertex.
  std::int32_t count;  ///< The number of positions inside the face.
};

/// The place at (i, j) of the face's lattice.
FacePlace face_place(const Vertices& v, int i, int j, int order);

/// The vertices of one face of an element, in the order of the face.
Vertices face_vertices(const reference::Facet& face, const std::int32_t* element);

inline constexpr std::int32_t kNoNode = -1;

struct HashVertices {
  std::size_t operator()(const Vertices& v) const {
    std::uint64_t hash = 0;
    for (const std::int32_t x : v) hash = (hash ^ std::uint32_t(x)) * 0x9e3779b97f4a7c15u, hash ^= hash >> 29;
    return hash;
  }
};

/// Numbers the nodes inside edges and faces from 0, in the order in which they are first used. An edge or face is known
/// by its sorted vertices, and a position on it is counted from the smallest vertex. If `make` is false, nodes are only
/// looked up, and −1 stands for a node that does not exist.
class SharedNodes {
 public:
  explicit SharedNodes(int order) : order_(order) {}

  /// How many there are.
  std::int32_t count() const { return count_; }
  /// A node that is on no edge or face.
  std::int32_t add() { return count_++; }

  /// Node i of the edge, counted from vertex `a`.
  std::int32_t edge_node(std::int32_t a, std::int32_t b, int i, bool make = true) {
    const std::int32_t first = first_of({std::min(a, b), std::max(a, b), kNoNode, kNoNode}, order_ - 1, make);
    return first == kNoNode ? kNoNode : first + (a < b ? i : order_ - i) - 1;
  }

  /// The node at (i, j) of the face's lattice.
  std::int32_t face_node(const Vertices& v, int i, int j, bool make = true) {
    const FacePlace place = face_place(v, i, j, order_);
    const std::int32_t first = first_of(place.sorted, place.count, make);
    return first == kNoNode ? kNoNode : first + place.rank;
  }

 private:
  /// The number of the first node inside an edge or face.
  std::int32_t first_of(const Vertices& sorted, std::int32_t nodes, bool make) {
    const auto found = first_.find(sorted);
    if (found != first_.end()) return found->second;
    if (!make) return kNoNode;
    first_.emplace(sorted, count_);
    count_ += nodes;
    return count_ - nodes;
  }

  int order_;
  std::int32_t count_ = 0;
  std::unordered_map<Vertices, std::int32_t, HashVertices> first_;
};

}  // namespace varimesh::detail
