// Faces that are narrower than the elements on them: edges across such a face leave it, and still lie on it.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "core/association/association.h"
#include "core/geometry/analytic.h"

namespace varimesh {
namespace {

constexpr int kColumns = 6;
constexpr double kTurn = 2 * std::numbers::pi, kInner = 2.2, kOuter = 2.5;

/// The part of the plane z = 0 between two circles around the origin.
class Ring final : public geometry::SurfaceShape {
 public:
  Ring(double inner, double outer) : inner_(inner), outer_(outer) {}
  geometry::SurfacePoint at(double u, double v) const override {
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    return {{u, v, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), zero, zero, zero};
  }
  geometry::Range u_range() const override { return {-outer_, outer_}; }
  geometry::Range v_range() const override { return {-outer_, outer_}; }
  bool contains(double u, double v) const override {
    const double r = std::hypot(u, v);
    return r >= inner_ - 1e-9 && r <= outer_ + 1e-9;
  }

 private:
  double inner_, outer_;
};

enum Face { kRing, kOuterWall, kInnerWall, kDisc, kFaces };

/// A ring, walls of height 1 on both of its circles, and the disc in its hole.
geometry::Geometry model() {
  geometry::Geometry model;
  geometry::Frame top;
  top.origin = {0, 0, 1};
  model.curves = {{1, geometry::circle({}, kOuter), {}, {kRing, kOuterWall}},
                  {2, geometry::circle({}, kInner), {}, {kRing, kInnerWall, kDisc}},
                  {3, geometry::circle(top, kOuter), {}, {kOuterWall}},
                  {4, geometry::circle(top, kInner), {}, {kInnerWall}}};
  model.surfaces = {{1, std::make_shared<Ring>(kInner, kOuter), {0, 1}},
                    {2, geometry::cylinder({}, kOuter, 1), {0, 2}},
                    {3, geometry::cylinder({}, kInner, 1), {1, 3}},
                    {4, std::make_shared<Ring>(0, kInner), {1}}};
  return model;
}

/// The mesh of these faces: triangles of order 2, six in a round. Nodes on edges of the walls lie on the model, those
/// across the ring and the disc in the middle of their edges.
class Mesh {
 public:
  explicit Mesh(const std::array<int, kFaces>& tags) : tags_(tags) {
    mesh.dimension = 2;
    mesh.order = 2;
    for (int i = 0; i < kColumns; ++i)
      for (const double z : {0., 1.})
        for (const double r : {kInner, kOuter})
          add_node(r * std::cos(kTurn * i / kColumns), r * std::sin(kTurn * i / kColumns), z);
    const int centre = add_node(0, 0, 0);
    const auto node = [](int i, int z, int outer) { return 4 * (i % kColumns) + 2 * z + outer; };
    for (int i = 0; i < kColumns; ++i) {
      add(kRing, node(i, 0, 0), node(i, 0, 1), node(i + 1, 0, 1));
      add(kRing, node(i, 0, 0), node(i + 1, 0, 1), node(i + 1, 0, 0));
      add(kDisc, centre, node(i, 0, 0), node(i + 1, 0, 0));
      for (const int outer : {0, 1}) {
        const Face wall = outer == 0 ? kInnerWall : kOuterWall;
        add(wall, node(i, 0, outer), node(i + 1, 0, outer), node(i, 1, outer));
        add(wall, node(i + 1, 0, outer), node(i + 1, 1, outer), node(i, 1, outer));
      }
    }
    mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  }

  HighOrderMesh mesh;
  std::vector<int> face_of_element;

 private:
  int add_node(double x, double y, double z) {
    for (const double c : {x, y, z}) mesh.coordinates.push_back(c);
    mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
    return static_cast<int>(mesh.node_numbers.size()) - 1;
  }

  int middle(int a, int b) {
    const auto [place, is_new] = middles_.emplace(std::minmax(a, b), 0);
    if (!is_new) return place->second;
    const auto x = [&](int n) { return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * std::size_t(n)]); };
    Eigen::Vector3d half = (x(a) + x(b)) / 2;
    const double ra = x(a).head<2>().norm(), rb = x(b).head<2>().norm();
    if (std::abs(ra - rb) < 1e-12) half.head<2>() *= ra / half.head<2>().norm();
    return place->second = add_node(half[0], half[1], half[2]);
  }

  void add(Face face, int a, int b, int c) {
    const int tag = tags_[face];
    if (mesh.blocks.empty() || mesh.blocks.back().entity != tag) {
      mesh.blocks.emplace_back();
      mesh.blocks.back().shape = Shape::Triangle;
      mesh.blocks.back().order = 2;
      mesh.blocks.back().entity = tag;
    }
    ElementBlock& block = mesh.blocks.back();
    block.numbers.push_back(static_cast<std::int64_t>(face_of_element.size()) + 1);
    for (const int n : {a, b, c, middle(a, b), middle(b, c), middle(c, a)}) block.nodes.push_back(n);
    face_of_element.push_back(face);
  }

  const std::array<int, kFaces> tags_;
  std::map<std::pair<int, int>, int> middles_;
};

/// By element, in their order: the surface on which it lies.
std::vector<int> surfaces_of(const Mesh& mesh) {
  const Team team(2);
  Expected<Association> made;
  team.run([&] { made = associate(mesh.mesh, model(), team); });
  EXPECT_TRUE(made) << made.error().sentence;
  if (!made) return {};
  EXPECT_TRUE(made->held.empty()) << made->held.size();
  std::vector<int> result;
  for (const std::vector<int>& block : made->surface_of_element)
    result.insert(result.end(), block.begin(), block.end());
  return result;
}

TEST(CoarseFaces, AreMatchedThoughEdgesAcrossThemLeaveThem) {
  const Mesh mesh({1, 2, 3, 4});
  EXPECT_EQ(surfaces_of(mesh), mesh.face_of_element);
}

TEST(CoarseFaces, AreMatchedByTheirBordersIfTheirTagsAreForeignOrPermuted) {
  // Ring and disc lie in one plane, and each has the other's tag.
  for (const std::array<int, kFaces>& tags : {std::array<int, kFaces>{4, 2, 3, 1}, {30, 20, 10, 40}}) {
    const Mesh mesh(tags);
    EXPECT_EQ(surfaces_of(mesh), mesh.face_of_element);
  }
}

TEST(CoarseFaces, AreMatchedElementByElementIfAllHaveOneTag) {
  // The middle of each element of the ring lies in the hole, on the disc.
  const Mesh mesh({9, 9, 9, 9});
  EXPECT_EQ(surfaces_of(mesh), mesh.face_of_element);
}

}  // namespace
}  // namespace varimesh
