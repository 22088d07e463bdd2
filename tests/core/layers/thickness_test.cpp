// How thick a grown row is: by cell, in parts of cells, in files. Normals of a model.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "core/association/association.h"
#include "core/formats/formats.h"
#include "core/geometry/analytic.h"
#include "core/layers/grow/grow_layer.h"
#include "core/layers/thickness_shares.h"
#include "core/mesh/changes/to_simplices.h"
#include "core/optimise/marks/marks.h"
#include "tests/core/layers/split_meshes.h"

namespace varimesh {
namespace {

const std::vector<std::string> kWalls{"7"};

HighOrderMesh triangles(const std::function<int(const Place&)>& tag_of) {
  return *change_order(*to_simplices(box(Shape::Quadrilateral, 4, 4, 1, tag_of)), 2);
}

/// Two walls that face each other, and a row that would be thicker than half of their distance.
GrownLayer grown_between_walls(const CheckedMesh& mesh) {
  auto grown = grow_layer(mesh, kWalls, 0.6, Team(1));
  EXPECT_TRUE(grown) << grown.error().sentence;
  return std::move(*grown);
}

CheckedMesh checked(HighOrderMesh mesh) { return *check_mesh(std::move(mesh), CheckFor::Optimising, Team(1)); }

int wall_at_both_ends(const Place& x) { return x[1] < 1e-9 || x[1] > 1 - 1e-9 ? 7 : 8; }

TEST(ThicknessOfCells, IsThatOfTheRowsCells) {
  const GrownLayer grown = grown_between_walls(checked(triangles(wall_at_both_ends)));
  ASSERT_EQ(grown.shares.size(), 10U);
  for (const auto& [node, share] : grown.shares) {
    EXPECT_GE(share, grown.thickness[0] / 0.6 - 1e-12);
    EXPECT_LE(share, grown.thickness[1] / 0.6 + 1e-12);
  }
  const auto shares = thickness_of_cells(checked(grown.mesh), kWalls, grown.shares);
  ASSERT_TRUE(shares);
  const Cells cells(grown.mesh, 2);
  ASSERT_EQ(shares->size(), cells.count());
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    EXPECT_EQ((*shares)[cell] > 0, cells.shape(cell) == Shape::Quadrilateral) << cell;
  EXPECT_LT(*std::ranges::max_element(*shares), 0.9);
}

/// The thinnest cell on a wall says how thick all layers in it are together.
TEST(ThicknessOfCells, GoesToThePartsOfCells) {
  const GrownLayer grown = grown_between_walls(checked(triangles(wall_at_both_ends)));
  const CheckedMesh thick = checked(grown.mesh);
  const std::vector<double> of_thick = *thickness_of_cells(thick, kWalls, grown.shares);
  LayerOptions wanted = geometric(5, 1.5);
  wanted.grow = 0.6;
  for (const bool simplices : {false, true}) {
    wanted.simplices = simplices;
    const auto made = split_layers(thick, wanted, Team(1));
    ASSERT_TRUE(made) << made.error().sentence;
    const Cells cells(made->mesh, 2);
    ASSERT_EQ(made->parents.size(), cells.count());
    EXPECT_EQ(made->certificates.size(), simplices ? 0U : cells.count());
    const std::vector<double> shares = thickness_of_parts(of_thick, made->parents);
    EXPECT_EQ(std::ranges::count_if(shares, [](double share) { return share > 0; }), 8 * 5 * (simplices ? 2 : 1));
    // A part lies in the box around its parent.
    const Cells parents(grown.mesh, 2);
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (std::size_t c = 0; c < 2; ++c) {
        const auto within = [&](const HighOrderMesh& mesh, std::span<const std::int32_t> nodes) {
          double least = 1e9, most = -1e9;
          for (const std::int32_t node : nodes) {
            least = std::min(least, mesh.coordinates[3 * at(node) + c]);
            most = std::max(most, mesh.coordinates[3 * at(node) + c]);
          }
          return std::pair(least, most);
        };
        const auto part = within(made->mesh, cells.nodes(cell));
        const auto whole = within(grown.mesh, parents.nodes(at(made->parents[cell])));
        EXPECT_GE(part.first, whole.first - 1e-9);
        EXPECT_LE(part.second, whole.second + 1e-9);
      }
  }
}

TEST(ThicknessField, IsInMshFilesForTheCellsOfTheRow) {
  const GrownLayer grown = grown_between_walls(checked(triangles(wall_at_both_ends)));
  const std::vector<double> shares = *thickness_of_cells(checked(grown.mesh), kWalls, grown.shares);
  const std::vector<formats::CellField> fields{thickness_field(shares)};
  for (const formats::Format format : {formats::Format::Msh22, formats::Format::Msh41}) {
    std::string bytes;
    const auto append = [&](std::string_view more) { return bytes.append(more), true; };
    ASSERT_TRUE(formats::write(grown.mesh, format, append, fields));
    const std::size_t section = bytes.find("$ElementData\n1\n\"layer_thickness_share\"\n1\n0\n3\n0\n1\n8\n");
    ASSERT_NE(section, std::string::npos) << bytes.substr(bytes.size() - 300);
    const auto file = formats::read(bytes);
    ASSERT_TRUE(file) << file.error().sentence;
    EXPECT_EQ(file->mesh.element_count(2), grown.mesh.element_count(2));
  }
  for (const formats::Format format : {formats::Format::Msh22Binary, formats::Format::Msh41Binary}) {
    std::string with, without;
    ASSERT_TRUE(formats::write(
        grown.mesh, format, [&](std::string_view more) { return with.append(more), true; }, fields));
    ASSERT_TRUE(formats::write(grown.mesh, format, [&](std::string_view more) { return without.append(more), true; }));
    const std::string head = "$ElementData\n1\n\"layer_thickness_share\"\n1\n0\n3\n0\n1\n8\n",
                      tail = "\n$EndElementData\n";
    EXPECT_EQ(with.size(), without.size() + head.size() + 8 * (4 + 8) + tail.size());
  }
}

/// A shell of straight tetrahedra round a sphere has the sphere's normals if it knows the sphere.
TEST(GrowLayer, TakesTheNormalsOfTheModel) {
  HighOrderMesh mesh = *to_simplices(box(Shape::Hexahedron, 3, 2, 2));
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    const Eigen::Vector3d way(0.9 * x[0] - 0.3, 1, -0.5 * x[2] + 0.2);
    Eigen::Map<Eigen::Vector3d>{x} = (1 + x[1]) * way.normalized();
  }
  geometry::Geometry sphere;
  sphere.surfaces.push_back({7, geometry::sphere({}, 1), {}});
  const Team team(1);
  const CheckedMesh shell = checked(mesh);
  Expected<Association> model;
  team.run([&] { model = associate(shell.mesh, sphere, team); });
  ASSERT_TRUE(model) << model.error().sentence;
  const auto largest_error = [&](const Association* of) {
    const auto grown = grow_layer(shell, kWalls, 0.1, team, of);
    EXPECT_TRUE(grown) << grown.error().sentence;
    double error = 0;
    // Vertices of the wall that are inside it: their columns are not held in the planes at its ends.
    for (std::size_t n = mesh.node_count(); n < grown->mesh.node_count(); ++n) {
      const Eigen::Map<const Eigen::Vector3d> top(&grown->mesh.coordinates[3 * n]);
      double nearest = 1e9;
      for (std::size_t wall = 0; wall < mesh.node_count(); ++wall) {
        const Eigen::Map<const Eigen::Vector3d> foot(&mesh.coordinates[3 * wall]);
        if (std::abs(foot.norm() - 1) < 1e-12) nearest = std::min(nearest, (top - 1.1 * foot).norm());
      }
      error = std::max(error, nearest);
    }
    return error;
  };
  EXPECT_GT(largest_error(nullptr), 1e-4);
  EXPECT_LT(largest_error(&*model), 1e-12);
}

}  // namespace
}  // namespace varimesh
