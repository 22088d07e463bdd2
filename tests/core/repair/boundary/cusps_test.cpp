// Where two surfaces of a model meet at nearly 0°, or two curves in the corner of a surface, a sentence names them.
#include "core/repair/boundary/cusps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/curve/curve.h"
#include "tests/core/support/split_pipe.h"
#include "tests/core/support/wedge.h"

namespace varimesh {
namespace {

using testing::in_wedge;
using testing::wedge;
constexpr double kPi = std::numbers::pi;

/// Two cones point to point at 0, with their axes along z, of this half angle in radians. The first ends at a disc. Its
/// seam is curve 1, and its parameters have no period.
geometry::Geometry cones(double half_angle) {
  const double radius = std::sin(half_angle), height = std::cos(half_angle);
  geometry::Geometry model;
  geometry::Frame round, floor, other;
  round.origin = {0, 0, height};
  floor.origin = {-1, -1, height};
  other.axes.col(1) *= -1;
  other.axes.col(2) *= -1;
  model.vertices = {{1, {0, 0, 0}}, {2, {radius, 0, height}}, {3, {radius, 0, -height}}};
  model.curves.push_back({1, geometry::line({0, 0, 0}, {radius, 0, height}), {0, 1}, {0, 0}});
  model.curves.push_back({2, geometry::circle(round, radius), {1, 1}, {0, 1}});
  model.curves.push_back({3, geometry::line({0, 0, 0}, {radius, 0, -height}), {0, 2}, {2, 2}});
  model.surfaces.push_back(
      {1, std::make_shared<testing::PartOfSurface>(geometry::cone({}, 0, half_angle, 1), 0, 2 * kPi, false), {0, 1}});
  model.surfaces.push_back({2, geometry::plane(floor, 2, 2), {1}});
  model.surfaces.push_back({3, geometry::cone(other, 0, half_angle, 1), {2}});
  return model;
}

/// Six tetrahedra of order 2, numbers 1 to 6, around the axis of the first cone, and a triangle on the other. Node 0 is
/// at the point, node 1 in the middle of the disc.
HighOrderMesh between_cones(double half_angle) {
  constexpr std::int32_t kAround = 6;
  const double radius = std::sin(half_angle), height = std::cos(half_angle);
  const auto on_circle = [=](double step, double side) {
    const double turn = 2 * kPi * step / kAround;
    return Eigen::Vector3d(radius * std::cos(turn), radius * std::sin(turn), side * height);
  };
  std::vector<Eigen::Vector3d> x{{0, 0, 0}, {0, 0, height}};
  for (int i = 0; i < kAround; ++i) x.push_back(on_circle(i, 1));
  for (int i = 0; i < 2; ++i) x.push_back(on_circle(i, -1));
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
  const auto middle = [&](std::int32_t a, std::int32_t b) {
    const auto [place, is_new] = middles.try_emplace(std::minmax({a, b}), static_cast<std::int32_t>(x.size()));
    if (!is_new) return place->second;
    Eigen::Vector3d at = (x[static_cast<std::size_t>(a)] + x[static_cast<std::size_t>(b)]) / 2;
    if (a > 1 && b > 1) at.head<2>() *= radius / at.head<2>().norm();
    x.push_back(at);
    return place->second;
  };
  const auto block = [](Shape shape, int entity) {
    ElementBlock result;
    result.shape = shape;
    result.order = 2;
    result.entity = entity;
    return result;
  };
  ElementBlock side = block(Shape::Triangle, 1), disc = block(Shape::Triangle, 2), other = block(Shape::Triangle, 3),
               cells = block(Shape::Tetrahedron, 1);
  const auto add = [&](ElementBlock& to, std::int32_t a, std::int32_t b, std::int32_t c) {
    to.nodes.insert(to.nodes.end(), {a, b, c, middle(a, b), middle(b, c), middle(c, a)});
    to.numbers.push_back(100 * to.entity + static_cast<std::int64_t>(to.size()));
  };
  for (std::int32_t i = 0; i < kAround; ++i) {
    const std::int32_t from = 2 + i, to = 2 + (i + 1) % kAround;
    add(side, 0, from, to);
    add(disc, 1, from, to);
    cells.nodes.insert(cells.nodes.end(), {0, from, to, 1, middle(0, from), middle(from, to), middle(to, 0),
                                           middle(1, 0), middle(1, to), middle(1, from)});
    cells.numbers.push_back(1 + i);
  }
  add(other, 0, 2 + kAround, 3 + kAround);
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 2;
  mesh.blocks = {side, disc, other, cells};
  for (const Eigen::Vector3d& at : x) {
    mesh.coordinates.insert(mesh.coordinates.end(), {at[0], at[1], at[2]});
    mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
  }
  NodeBlock nodes;
  nodes.count = static_cast<std::int32_t>(x.size());
  mesh.node_blocks.push_back(nodes);
  return mesh;
}

std::vector<Cusp> cusps_at(double angle, const std::vector<std::int64_t>& wanted) {
  const geometry::Geometry model = wedge(angle);
  const Team team(1);
  std::vector<Cusp> found;
  team.run([&] {
    auto association = associate(in_wedge(model), model, team);
    ASSERT_TRUE(association) << association.error().sentence;
    auto curved = curve(in_wedge(model), std::move(*association), 3, team);
    ASSERT_TRUE(curved) << curved.error().sentence;
    found = cusps(curved->mesh, curved->association, wanted);
  });
  return found;
}

TEST(Cusps, AreNamedWithTheirAngle) {
  for (const double degrees : {0.0, 3.0}) {
    const std::vector<Cusp> found = cusps_at(degrees * kPi / 180, {7});
    ASSERT_EQ(found.size(), 2u) << degrees;
    EXPECT_EQ(found[0].sides, "curves 2 and 3 of surface 3");
    EXPECT_EQ(found[1].sides, "surfaces 1 and 2 'Hole'");
    for (const Cusp& cusp : found) {
      EXPECT_NEAR(cusp.angle, degrees, 1e-6);
      EXPECT_LT(cusp.x.head<2>().norm(), 1e-12);
      EXPECT_EQ(cusp.cells, std::set<std::int64_t>{7});
    }
    const std::string sentence = cusps_sentence(found);
    EXPECT_NE(sentence.find("surfaces 1 and 2 'Hole' meet at " + std::string(degrees > 0 ? "3.0" : "0.0") + "°"),
              sentence.npos)
        << sentence;
    EXPECT_NE(sentence.find("at 2 cusps: "), sentence.npos) << sentence;
    EXPECT_NE(sentence.find("1 element touches them."), sentence.npos) << sentence;
    EXPECT_EQ(sentence.starts_with("The model leaves hardly any room"), degrees > 0) << sentence;
    EXPECT_NE(sentence.find(degrees > 0 ? " Smaller elements hardly help." : " Smaller elements do not help."),
              sentence.npos)
        << sentence;
  }
}

TEST(Cusps, NeedASmallAngleAndElementsThatAreWanted) {
  EXPECT_TRUE(cusps_at(10 * kPi / 180, {7}).empty());
  EXPECT_TRUE(cusps_at(0, {}).empty());
  EXPECT_EQ(cusps_sentence({}), "");
}

TEST(Cusps, AreNotAtTheSeamOfASlenderCone) {
  const double half_angle = 10 * kPi / 180;
  const geometry::Geometry model = cones(half_angle);
  const HighOrderMesh mesh = between_cones(half_angle);
  const Team team(1);
  team.run([&] {
    auto association = associate(mesh, model, team);
    ASSERT_TRUE(association) << association.error().sentence;
    ASSERT_EQ(association->nodes[0].dimension, 0);
    ASSERT_EQ(association->nodes[static_cast<std::size_t>(mesh.blocks[0].nodes[3])].dimension, 1);
    const std::vector<Cusp> found = cusps(mesh, *association, std::vector<std::int64_t>{1, 2, 3, 4, 5, 6});
    EXPECT_TRUE(found.empty()) << cusps_sentence(found);
  });
}

TEST(Cusps, OneIsNamedInTheSingular) {
  const Cusp cusp{0, {1, 2, 3}, "surfaces 1 and 2", {7, 9}};
  EXPECT_EQ(
      cusps_sentence({cusp}),
      "The model leaves no room for valid elements at a cusp: surfaces 1 and 2 meet at 0.0° near (1, 2, 3); 2 "
      "elements touch it. Smaller elements do not help. Change the model there, for example leave a wall or a flat "
      "of some width, and export it again.");
}

}  // namespace
}  // namespace varimesh
