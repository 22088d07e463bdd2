// Meshes and models as people send them: bodies that touch, one tag for everything, tags of another program, another
// size.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "core/association/association.h"
#include "core/geometry/analytic.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

geometry::Frame at_height(double z, double turn = 0) {
  geometry::Frame frame;
  frame.origin = {0, 0, z};
  frame.axes = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return frame;
}

/// A square of width 4 around the axis. Turned by quarters, it is the same.
std::shared_ptr<const geometry::SurfaceShape> square(double z, int quarters) {
  geometry::Frame frame = at_height(z, kTurn / 4 * quarters);
  frame.origin -= 2 * frame.axes.col(0) + 2 * frame.axes.col(1);
  return geometry::plane(frame, 4, 4);
}

/// Cylinders of radius 1 and height 1, one on the other. Each has its own face where they touch, and its own circle,
/// which begins elsewhere.
geometry::Geometry stacked() {
  geometry::Geometry both;
  for (int body = 0; body < 2; ++body) {
    const int s = 3 * body, c = 2 * body;
    for (const int end : {0, 1})
      both.curves.push_back(
          {c + end + 1, geometry::circle(at_height(body + end, 0.4 * body), 1), {}, {s, s + 1 + end}});
    both.surfaces.push_back({s + 1, geometry::cylinder(at_height(body), 1, 1), {c, c + 1}});
    for (const int end : {0, 1}) both.surfaces.push_back({s + 2 + end, square(body + end, body), {c + end}});
  }
  return both;
}

constexpr int kColumns = 12;

/// Walls of both cylinders and the faces at z = 0, 1 and 2, as quadrilaterals and triangles of order 1.
/// @param tag  of an element, by its wall or face: 0 and 1 the walls, 2 to 4 the faces
HighOrderMesh stacked_mesh(const std::array<int, 5>& tag) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  const auto add_node = [&](double x, double y, double z) {
    for (const double c : {x, y, z}) mesh.coordinates.push_back(c);
    mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
  };
  for (int z = 0; z < 3; ++z) {
    for (int i = 0; i < kColumns; ++i) add_node(std::cos(kTurn * i / kColumns), std::sin(kTurn * i / kColumns), z);
    add_node(0, 0, z);
  }
  const auto node = [](int i, int z) { return z * (kColumns + 1) + i % kColumns; };
  const auto add = [&](Shape shape, int of, std::vector<std::int32_t> nodes) {
    if (mesh.blocks.empty() || mesh.blocks.back().entity != of || mesh.blocks.back().shape != shape) {
      mesh.blocks.emplace_back();
      mesh.blocks.back().shape = shape;
      mesh.blocks.back().entity = of;
    }
    mesh.blocks.back().numbers.push_back(
        static_cast<std::int64_t>(mesh.blocks.size() * 1000 + mesh.blocks.back().size()));
    mesh.blocks.back().nodes.insert(mesh.blocks.back().nodes.end(), nodes.begin(), nodes.end());
  };
  for (int body = 0; body < 2; ++body)
    for (int i = 0; i < kColumns; ++i)
      add(Shape::Quadrilateral, tag[std::size_t(body)],
          {node(i, body), node(i + 1, body), node(i + 1, body + 1), node(i, body + 1)});
  for (int z = 0; z < 3; ++z)
    for (int i = 0; i < kColumns; ++i)
      add(Shape::Triangle, tag[std::size_t(z) + 2], {node(i, z), node(i + 1, z), z * (kColumns + 1) + kColumns});
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  return mesh;
}

Association associated(const HighOrderMesh& mesh, const geometry::Geometry& geometry) {
  const Team team(2);
  Expected<Association> result;
  team.run([&] { result = associate(mesh, geometry, team); });
  EXPECT_TRUE(result) << result.error().sentence;
  return result ? *result : Association();
}

/// Nodes on the circles lie on curves, the middles of the faces on surfaces, and none is held.
void expect_placed(const HighOrderMesh& mesh, const Association& association) {
  EXPECT_TRUE(association.held.empty());
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const bool is_middle = node % (kColumns + 1) == kColumns;
    EXPECT_EQ(association.nodes[node].dimension, is_middle ? 2 : 1) << node;
    EXPECT_LT(association.nodes[node].distance, 1e-12);
  }
}

TEST(Assemblies, CountAFaceThatTwoBodiesHaveOnce) {
  const HighOrderMesh mesh = stacked_mesh({1, 4, 2, 3, 6});
  const Association association = associated(mesh, stacked());
  EXPECT_EQ(association.repeated, 1);
  EXPECT_EQ(association.geometry.surfaces.size(), 5u);
  EXPECT_EQ(association.geometry.curves.size(), 3u);
  expect_placed(mesh, association);
  // The circle where they touch bounds both walls and the face.
  const auto& curve = association.geometry.curves[std::size_t(association.nodes[kColumns + 1].entity)];
  EXPECT_EQ(curve.surfaces.size(), 3u);
}

TEST(Assemblies, GiveTheSameForOneTagAndForPermutedAndForeignTags) {
  const Association by_face = associated(stacked_mesh({1, 4, 2, 3, 6}), stacked());
  for (const std::array<int, 5>& tags :
       {std::array<int, 5>{7, 7, 7, 7, 7}, {6, 3, 4, 2, 1}, {10, 20, 30, 40, 50}, {1, 1, 2, 2, 2}}) {
    const HighOrderMesh mesh = stacked_mesh(tags);
    const Association association = associated(mesh, stacked());
    expect_placed(mesh, association);
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      EXPECT_EQ(association.nodes[node].entity, by_face.nodes[node].entity) << node;
      EXPECT_EQ(association.nodes[node].at, by_face.nodes[node].at) << node;
    }
    for (std::size_t s = 0; s < by_face.surfaces.size(); ++s) {
      EXPECT_EQ(association.surfaces[s].nodes, by_face.surfaces[s].nodes);
      EXPECT_EQ(association.surfaces[s].parameters, by_face.surfaces[s].parameters);
    }
  }
}

TEST(Assemblies, FindAFaceInsideALargerOneThatItTouches) {
  // A cylinder of radius 1 on a square of width 4, which is whole in the model. The mesh conforms.
  geometry::Geometry plate;
  plate.surfaces.push_back({1, square(0, 0), {}});
  plate.surfaces.push_back({2, geometry::cylinder({}, 1, 1), {0, 1}});
  // The end of the cylinder: the inside of the circle.
  class Disc : public geometry::SurfaceShape {
   public:
    geometry::SurfacePoint at(double u, double v) const override {
      const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
      return {{u, v, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), zero, zero, zero};
    }
    geometry::Range u_range() const override { return {-1, 1}; }
    geometry::Range v_range() const override { return {-1, 1}; }
    bool contains(double u, double v) const override { return std::hypot(u, v) < 1 + 1e-9; }
  };
  plate.surfaces.push_back({3, std::make_shared<Disc>(), {0}});
  plate.curves.push_back({1, geometry::circle({}, 1), {}, {1, 2}});
  plate.curves.push_back({2, geometry::circle(at_height(1), 1), {}, {1}});
  HighOrderMesh mesh = stacked_mesh({2, 2, 3, 8, 9});
  // Only the lower wall and the lower face stay; around the circle comes a ring of the square.
  std::erase_if(mesh.blocks, [](const ElementBlock& block) { return block.entity > 3; });
  mesh.blocks[0].numbers.resize(kColumns);
  mesh.blocks[0].nodes.resize(4 * kColumns);
  const auto first = static_cast<std::int32_t>(mesh.node_count());
  ElementBlock ring;
  ring.shape = Shape::Quadrilateral;
  ring.entity = 1;
  for (int i = 0; i < kColumns; ++i) {
    for (const double c : {1.7 * std::cos(kTurn * i / kColumns), 1.7 * std::sin(kTurn * i / kColumns), 0.0})
      mesh.coordinates.push_back(c);
    mesh.node_numbers.push_back(first + i + 1);
    const int next = (i + 1) % kColumns;
    ring.numbers.push_back(5000 + i);
    for (const int node : {i, next, first + next, first + i}) ring.nodes.push_back(node);
  }
  mesh.blocks.push_back(ring);
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  for (const int tag : {1, 2}) {  // also if the face under the cylinder has the tag of the square or of the wall
    mesh.blocks[1].entity = tag;
    const Association association = associated(mesh, plate);
    for (int i = 0; i < kColumns; ++i) {
      EXPECT_EQ(association.nodes[std::size_t(i)].dimension, 1) << i;
      EXPECT_EQ(association.nodes[std::size_t(i)].entity, 0) << i;
    }
  }
}

/// Adds three faces and three edges of a cube of width 1, those at the corner that is nearest to `corner`.
void add_corner(geometry::Geometry& model, const Eigen::Vector3d& corner, const Eigen::Vector3d& along) {
  const int v = int(model.vertices.size()), c = int(model.curves.size()), s = int(model.surfaces.size());
  model.vertices.push_back({v + 1, corner});
  for (int k = 0; k < 3; ++k) {
    geometry::Frame frame;
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    frame.axes.setZero();
    frame.axes(i, 0) = along[i];
    frame.axes(j, 1) = along[j];
    frame.axes.col(2) = frame.axes.col(0).cross(frame.axes.col(1));
    frame.origin = corner;
    model.surfaces.push_back({s + k + 1, geometry::plane(frame, 1, 1), {c + i, c + j}});
    const Eigen::Vector3d end = corner + along[k] * Eigen::Vector3d::Unit(k);
    model.curves.push_back({c + k + 1, geometry::line(corner, end), {v}, {s + i, s + j}});
  }
}

TEST(Assemblies, HaveAVertexWhereBodiesTouchInACorner) {
  // Two cubes that have no edge and no face in common.
  geometry::Geometry model;
  add_corner(model, Eigen::Vector3d::Zero(), {1, 1, 1});
  add_corner(model, Eigen::Vector3d::Zero(), {-1, -1, -1});
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  mesh.coordinates = {0, 0, 0};
  for (const double side : {1, -1})
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) mesh.coordinates.push_back(k == l ? side : 0);
  for (std::int64_t number = 1; number <= 7; ++number) mesh.node_numbers.push_back(number);
  for (int k = 0; k < 6; ++k) {
    mesh.blocks.emplace_back();
    mesh.blocks.back().shape = Shape::Triangle;
    mesh.blocks.back().entity = k + 1;
    mesh.blocks.back().numbers = {k + 1};
    const int first = 1 + 3 * (k / 3);
    mesh.blocks.back().nodes = {0, first + (k + 1) % 3, first + (k + 2) % 3};
  }
  const Association association = associated(mesh, model);
  EXPECT_EQ(association.nodes[0].dimension, 0);
  EXPECT_TRUE(association.held.empty());
}

/// Two squares of width 4 at z = 0, the faces of two bodies. Neither is a part of the other. A wall stands on the left
/// side of the second one, and a wall hangs from the far side of the first one. These sides are the model's curves.
geometry::Geometry overlapping() {
  const auto frame = [](const Eigen::Vector3d& origin, const Eigen::Vector3d& x, const Eigen::Vector3d& y) {
    geometry::Frame result;
    result.origin = origin;
    result.axes << x, y, x.cross(y);
    return result;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  geometry::Geometry model;
  model.curves.push_back({1, geometry::line({-1, -1, 0}, {-1, 3, 0}), {}, {1, 2}});
  model.curves.push_back({2, geometry::line({-2, 2, 0}, {2, 2, 0}), {}, {0, 3}});
  model.surfaces.push_back({1, geometry::plane(frame({-2, -2, 0}, x, y), 4, 4), {1}});
  model.surfaces.push_back({2, geometry::plane(frame({-1, -1, 0}, x, y), 4, 4), {0}});
  model.surfaces.push_back({3, geometry::plane(frame({-1, -1, 0}, y, z), 4, 1), {0}});
  model.surfaces.push_back({4, geometry::plane(frame({-2, 2, -1}, x, z), 4, 1), {1}});
  return model;
}

TEST(Assemblies, HaveCurvesAndVerticesWhereFacesOverlap) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  std::map<std::array<double, 3>, std::int32_t> node_at;
  const auto node = [&](double x, double y, double z) {
    const auto [found, is_new] = node_at.try_emplace({x, y, z}, static_cast<std::int32_t>(mesh.node_count()));
    if (is_new) {
      mesh.coordinates.insert(mesh.coordinates.end(), {x, y, z});
      mesh.node_numbers.push_back(found->second + 1);
    }
    return found->second;
  };
  std::array<ElementBlock, 5> blocks;  // the first square alone, both, the second alone, and the walls
  const auto add = [&](std::size_t tag, const std::array<std::int32_t, 4>& nodes) {
    blocks[tag].numbers.push_back(static_cast<std::int64_t>(100 * tag + blocks[tag].size()) + 1);
    blocks[tag].nodes.insert(blocks[tag].nodes.end(), nodes.begin(), nodes.end());
  };
  const std::array<double, 5> at{-2, -1, 0.5, 2, 3};
  for (std::size_t i = 0; i < 4; ++i) {
    const double a = at[i], b = at[i + 1];
    for (std::size_t j = 0; j < 4; ++j) {
      const bool in_first = i < 3 && j<3, in_second = i> 0 && j > 0;
      if (!in_first && !in_second) continue;
      add(in_first && in_second ? 1
          : in_first            ? 0
                                : 2,
          {node(a, at[j], 0), node(b, at[j], 0), node(b, at[j + 1], 0), node(a, at[j + 1], 0)});
    }
    if (i > 0) add(3, {node(-1, a, 0), node(-1, b, 0), node(-1, b, 1), node(-1, a, 1)});
    if (i < 3) add(4, {node(a, 2, -1), node(b, 2, -1), node(b, 2, 0), node(a, 2, 0)});
  }
  for (std::size_t tag = 0; tag < blocks.size(); ++tag) {
    blocks[tag].shape = Shape::Quadrilateral;
    blocks[tag].entity = static_cast<int>(tag) + 11;
    mesh.blocks.push_back(blocks[tag]);
  }
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  const Association association = associated(mesh, overlapping());
  const auto entity = [&](double x, double y) { return association.nodes[std::size_t(node(x, y, 0))]; };
  for (const double y : {0.5, 3.0}) {
    EXPECT_EQ(entity(-1, y).dimension, 1) << y;
    EXPECT_EQ(entity(-1, y).entity, 0) << y;
  }
  for (const double x : {-2.0, 0.5, 2.0}) {
    EXPECT_EQ(entity(x, 2).dimension, 1) << x;
    EXPECT_EQ(entity(x, 2).entity, 1) << x;
  }
  EXPECT_EQ(entity(-1, 2).dimension, 0);  // where the sides cross
  EXPECT_EQ(entity(0.5, 0.5).dimension, 2);
}

TEST(Assemblies, KeepTheUnitIfAFarFieldIsTenTimesTheBody) {
  geometry::Geometry body;
  body.curves = {};
  body.surfaces.push_back({1, geometry::sphere({}, 1), {}});
  // A sphere of elements, in a box of ten times the size.
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  ElementBlock ball, box;
  ball.shape = box.shape = Shape::Quadrilateral;
  ball.entity = 1;
  box.entity = 2;
  const int faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const double half : {1 / std::sqrt(3.0), 10.0})
    for (int n = 0; n < 8; ++n) {
      for (const int bit : {1, 2, 4}) mesh.coordinates.push_back((n & bit) != 0 ? half : -half);
      mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
    }
  for (int f = 0; f < 6; ++f) {
    ball.numbers.push_back(f + 1);
    box.numbers.push_back(f + 7);
    for (const int node : faces[f]) {
      ball.nodes.push_back(node);
      box.nodes.push_back(node + 8);
    }
  }
  mesh.blocks = {ball, box};
  mesh.node_blocks = {{-1, 0, 0, 16}};
  const Association association = associated(mesh, body);
  EXPECT_EQ(association.factor, 1);
  EXPECT_EQ(association.matches[0].on_none, 0);
  EXPECT_EQ(association.matches[1].on_none, 6);
  EXPECT_EQ(association.held.size(), 8u);
}

}  // namespace
}  // namespace varimesh
