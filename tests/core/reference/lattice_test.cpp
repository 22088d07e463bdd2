// The node order is Gmsh's.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <set>

#include "core/reference/basis.h"
#include "core/reference/nodes.h"
#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

/// FNV-1a over the lattice positions in order.
std::uint64_t fingerprint(Shape shape, int order) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const auto& position : lattice(shape, order))
    for (const std::int8_t c : position) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001b3u;
  return hash;
}

struct Pin {
  Shape shape;
  int order;
  std::uint64_t fingerprint;
};

/// From the local node coordinates that Gmsh 4.8.4 gives (gmsh.model.mesh.getElementProperties), times the order, for
/// every shape and order that it has. For prisms above order 2 that call fails.
constexpr Pin kGmsh[] = {
    {Shape::Line, 1, 0xcf3b81fa24b57292},          {Shape::Line, 2, 0x242e3ed443c49ea2},
    {Shape::Line, 3, 0x656c1ef443614b3f},          {Shape::Line, 4, 0x76bb866b9b59ba77},
    {Shape::Line, 5, 0xe9c2d15e5ebc1bc2},          {Shape::Line, 6, 0x0e2ea35b09945c52},
    {Shape::Line, 7, 0x3510d191ba5f7ae7},          {Shape::Line, 8, 0xd841942ff321a68f},
    {Shape::Line, 9, 0x00599b86e10d15da},          {Shape::Line, 10, 0xe4a24669fc1e3572},
    {Shape::Triangle, 1, 0x0971840736a146af},      {Shape::Triangle, 2, 0xd21156f286a877b9},
    {Shape::Triangle, 3, 0x16022eddca7848c3},      {Shape::Triangle, 4, 0x06b81f643a766eb1},
    {Shape::Triangle, 5, 0x7eb205d5428a2563},      {Shape::Triangle, 6, 0xd036454cdf37a5c7},
    {Shape::Triangle, 7, 0x2fd0a6f50d1e8969},      {Shape::Triangle, 8, 0x9a39f272cd2faca9},
    {Shape::Triangle, 9, 0xd566c4c1396c2eb1},      {Shape::Triangle, 10, 0x3a061cc20c02baa1},
    {Shape::Quadrilateral, 1, 0x90e84284f91aad81}, {Shape::Quadrilateral, 2, 0xde9f27ada3f68c85},
    {Shape::Quadrilateral, 3, 0xf75918345a428dd5}, {Shape::Quadrilateral, 4, 0x51e1d63f593e2b07},
    {Shape::Quadrilateral, 5, 0xf58f9768933475a9}, {Shape::Quadrilateral, 6, 0xfec918104e4978e9},
    {Shape::Quadrilateral, 7, 0x0910b764dc79e055}, {Shape::Quadrilateral, 8, 0x74064f4f5b2a120f},
    {Shape::Quadrilateral, 9, 0xb0ad783364948431}, {Shape::Quadrilateral, 10, 0xc44d0aff4f74344d},
    {Shape::Tetrahedron, 1, 0xcdac3da705c4d732},   {Shape::Tetrahedron, 2, 0x9721d38e83efda5a},
    {Shape::Tetrahedron, 3, 0x15230b640c3931da},   {Shape::Tetrahedron, 4, 0xa892e9b726298d2e},
    {Shape::Tetrahedron, 5, 0x493c26a506fe4b1f},   {Shape::Tetrahedron, 6, 0x0bf55f89dc20eaa1},
    {Shape::Tetrahedron, 7, 0x5e9a81ddb95802cd},   {Shape::Tetrahedron, 8, 0x8501c8efd84e9f89},
    {Shape::Tetrahedron, 9, 0x2e687cfe65f44db6},   {Shape::Tetrahedron, 10, 0x1440b7df8c1526aa},
    {Shape::Hexahedron, 1, 0xa040dd658f806611},    {Shape::Hexahedron, 2, 0x3d53f1b30a05872c},
    {Shape::Hexahedron, 3, 0xafcc8c15526feccd},    {Shape::Hexahedron, 4, 0xe60a0f53b5535d41},
    {Shape::Hexahedron, 5, 0xad146597c2557269},    {Shape::Hexahedron, 6, 0xf686a09ee6af2192},
    {Shape::Hexahedron, 7, 0xd63135543a4e70e5},    {Shape::Hexahedron, 8, 0x0ff96f9e494d4ddf},
    {Shape::Hexahedron, 9, 0xd944b862a4c9d339},    {Shape::Prism, 1, 0xfe093f1cff158140},
    {Shape::Prism, 2, 0x4548f3194ed8b579},         {Shape::Pyramid, 1, 0xba8b89c3705ee178},
    {Shape::Pyramid, 2, 0x1146a1dc9ad569cf},       {Shape::Pyramid, 3, 0xa1f67532732c8bd5},
    {Shape::Pyramid, 4, 0xc23e479d9ec4f81b},       {Shape::Pyramid, 5, 0x9e8af6659c6c4350},
    {Shape::Pyramid, 6, 0xbe9bbef0fabb9ba5},       {Shape::Pyramid, 7, 0x3cef1391497b3467},
    {Shape::Pyramid, 8, 0xfc24a5a74e5df82d},       {Shape::Pyramid, 9, 0x1c8a819b03bf766c},
};

TEST(Lattice, NumbersNodesAsGmshDoes) {
  for (const Pin& pin : kGmsh)
    EXPECT_EQ(fingerprint(pin.shape, pin.order), pin.fingerprint) << at(pin.shape, pin.order);
}

TEST(Lattice, HoldsEveryPositionOnce) {
  for (const Shape shape : kCells) {
    for (int order = 1; order <= kMaxOrder; ++order) {
      const auto& all = lattice(shape, order);
      EXPECT_EQ(static_cast<int>(all.size()), node_count(shape, order)) << at(shape, order);
      const std::set<std::array<std::int8_t, 3>> distinct(all.begin(), all.end());
      EXPECT_EQ(distinct.size(), all.size()) << at(shape, order);
    }
  }
}

TEST(Lattice, PrismsGoAlongTheThirdDirectionInside) {
  const auto& all = lattice(Shape::Prism, 4);
  // Three inner positions of the triangle. For each, the ends of the inner line come first and its middle last.
  const std::vector<std::array<std::int8_t, 3>> inside(all.end() - 9, all.end());
  const std::vector<std::array<std::int8_t, 3>> expected{{1, 1, 1}, {1, 1, 3}, {1, 1, 2}, {2, 1, 1}, {2, 1, 3},
                                                         {2, 1, 2}, {1, 2, 1}, {1, 2, 3}, {1, 2, 2}};
  EXPECT_EQ(inside, expected);
}

TEST(Lattice, PrismFacesComeWithTheTrianglesFirst) {
  // Order 3 has 6 vertices, 18 edge nodes, one node in each triangle, and four in each quadrilateral from its first
  // vertex.
  const auto& all = lattice(Shape::Prism, 3);
  const std::vector<std::array<std::int8_t, 3>> faces(all.begin() + 24, all.begin() + 30);
  const std::vector<std::array<std::int8_t, 3>> expected{{1, 1, 0}, {1, 1, 3}, {1, 0, 1},
                                                         {2, 0, 1}, {2, 0, 2}, {1, 0, 2}};
  EXPECT_EQ(faces, expected);
}

/// Distance of a point from the affine hull of some vertices.
double distance(const ShapeInfo& cell, const std::vector<int>& vertices, const Eigen::RowVectorXd& point) {
  std::vector<Eigen::RowVectorXd> directions;
  const auto corner = [&](int v) {
    return Eigen::RowVectorXd(Eigen::Map<const Eigen::RowVectorXd>(cell.vertex[v].data(), cell.dimension));
  };
  Eigen::RowVectorXd rest = point - corner(vertices[0]);
  for (std::size_t v = 1; v < vertices.size(); ++v) {
    Eigen::RowVectorXd direction = corner(vertices[v]) - corner(vertices[0]);
    for (const auto& d : directions) direction -= direction.dot(d) * d;
    if (direction.norm() > 1e-9) directions.push_back(direction.normalized());
  }
  for (const auto& d : directions) rest -= rest.dot(d) * d;
  return rest.norm();
}

TEST(NodePlaces, AreWhereTheNodesLie) {
  for (const Shape shape : kCells) {
    const ShapeInfo& cell = info(shape);
    for (int order = 1; order <= kMaxOrder; ++order) {
      const auto& places = node_places(shape, order);
      ASSERT_EQ(static_cast<int>(places.size()), node_count(shape, order));
      for (const NodeSet set : {NodeSet::Equispaced, NodeSet::Optimised}) {
        const Points& points = nodes(shape, order, set, 3);
        for (int n = 0; n < points.rows(); ++n) {
          std::vector<int> vertices;
          if (places[n].dimension == 0) vertices = {places[n].index};
          if (places[n].dimension == 1) vertices = {cell.edges[places[n].index][0], cell.edges[places[n].index][1]};
          if (places[n].dimension == 2)
            for (const std::int8_t v : cell.faces[places[n].index].vertices)
              if (v >= 0) vertices.push_back(v);
          if (places[n].dimension < 3) {
            EXPECT_LT(distance(cell, vertices, points.row(n)), 1e-14) << at(shape, order) << ", node " << n;
          }
        }
      }
    }
  }
}

TEST(NodePlaces, CountTheInteriorNodesOfATetrahedron) {
  int interior = 0;
  for (const NodePlace& place : node_places(Shape::Tetrahedron, 5)) interior += place.dimension == 3;
  EXPECT_EQ(interior, 4);
}

TEST(FacetNodes, AreTheNodesThatLieOnTheFacet) {
  for (const Shape shape : kCells) {
    if (shape == Shape::Line) continue;
    const ShapeInfo& cell = info(shape);
    for (const int order : {1, 2, 3, 5, 10}) {
      const Points& points = nodes(shape, order, NodeSet::Equispaced, 3);
      for (std::size_t f = 0; f < cell.facets.size(); ++f) {
        std::vector<int> vertices;
        for (const std::int8_t v : cell.facets[f].vertices)
          if (v >= 0) vertices.push_back(v);
        const auto& found = facet_nodes(shape, order, static_cast<int>(f));
        for (std::size_t v = 0; v < vertices.size(); ++v) EXPECT_EQ(found[v], vertices[v]);
        const std::set<int> listed(found.begin(), found.end());
        for (int n = 0; n < points.rows(); ++n)
          EXPECT_EQ(listed.contains(n), distance(cell, vertices, points.row(n)) < 1e-12) << at(shape, order);
      }
    }
  }
}

TEST(FacetNodes, OfALineAreItsEnds) {
  EXPECT_EQ(facet_nodes(Shape::Line, 4, 0), std::vector<int>{0});
  EXPECT_EQ(facet_nodes(Shape::Line, 4, 1), std::vector<int>{1});
}

TEST(TurnedNodes, AreThoseOfTheMirrorImageOnTheSameNodes) {
  for (const Shape shape :
       {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= kMaxOrder; ++order) {
      const int d = info(shape).dimension;
      const std::vector<int>& turned = turned_nodes(shape, order);
      const Points& at = nodes(shape, order, NodeSet::Equispaced, d);
      ASSERT_EQ(static_cast<int>(turned.size()), node_count(shape, order));
      Points vertices(info(shape).vertices, d), places(at.rows(), d);
      for (Eigen::Index n = 0; n < at.rows(); ++n) places.row(n) = at.row(turned[static_cast<std::size_t>(n)]);
      for (Eigen::Index v = 0; v < vertices.rows(); ++v) vertices.row(v) = places.row(v);
      // The vertices of the turned cell place all its nodes.
      const Eigen::MatrixXd placed = basis_values(shape, 1, NodeSet::Equispaced, d, at) * vertices;
      EXPECT_LT((placed - places).cwiseAbs().maxCoeff(), 1e-13) << info(shape).name << " of order " << order;
      const Points inside = at.colwise().mean();
      const auto gradients = basis_gradients(shape, 1, NodeSet::Equispaced, d, inside);
      Eigen::MatrixXd jacobian(d, d);
      for (int k = 0; k < d; ++k) jacobian.row(k) = gradients[static_cast<std::size_t>(k)] * vertices;
      EXPECT_NEAR(jacobian.determinant(), -1, 1e-13);
      for (std::size_t n = 0; n < turned.size(); ++n)
        EXPECT_EQ(turned[static_cast<std::size_t>(turned[n])], static_cast<int>(n)) << "turned twice";
    }
}

}  // namespace
}  // namespace varimesh::reference
