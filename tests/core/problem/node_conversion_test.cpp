// From the file's nodes to the solver's and back: by interpolation, and bit for bit if nothing moved.
#include "core/problem/node_conversion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

HighOrderMesh curved(Filling filling, int order) {
  HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  testing::shake(mesh, 0.02, 1);
  return mesh;
}

TEST(FrameOf, IsTheCentreAndTheDiagonalOfTheBoundingBox) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 2, 2}, 2, [](testing::Place at) {
    return testing::Place{2 + 3 * at[0], 4 * at[1] - 1, 12 * at[2]};
  });
  const Frame frame = frame_of(mesh);
  EXPECT_EQ(frame.centre, (std::array{3.5, 1.0, 6.0}));
  EXPECT_EQ(frame.diagonal, 13);
}

TEST(FrameOf, IgnoresNodesThatNoCellUses) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 2);
  const Frame frame = frame_of(mesh);
  mesh.coordinates.insert(mesh.coordinates.end(), {1e5, -1e5, 1e5});
  mesh.node_numbers.push_back(4711);
  // As gmsh leaves the centre of an arc: a point element, which is no cell of the highest dimension.
  ElementBlock point;
  point.shape = Shape::Point;
  point.numbers = {4711};
  point.nodes = {std::int32_t(mesh.node_count()) - 1};
  mesh.blocks.push_back(point);
  EXPECT_EQ(frame_of(mesh).centre, frame.centre);
  EXPECT_EQ(frame_of(mesh).diagonal, frame.diagonal);
}

class SolverNodes : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, SolverNodes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(SolverNodes, LieWhereTheCellsPolynomialsSay) {
  for (const int order : {1, 3, 5}) {
    const HighOrderMesh mesh = curved(GetParam(), order);
    const Frame frame = frame_of(mesh);
    const std::vector<double> positions = solver_positions(mesh, frame);
    const int d = mesh.dimension;
    const Cells cells(mesh, d);
    for (std::size_t cell = 0; cell < cells.count(); ++cell) {
      const Eigen::MatrixXd values =
          reference::basis_values(cells.shape(cell), order, reference::NodeSet::Equispaced, d,
                                  reference::nodes(cells.shape(cell), order, reference::NodeSet::Optimised, d));
      const auto nodes = cells.nodes(cell);
      for (Eigen::Index i = 0; i < values.rows(); ++i)
        for (int k = 0; k < d; ++k) {
          double x = 0;
          for (Eigen::Index j = 0; j < values.cols(); ++j)
            x += values(i, j) * mesh.coordinates[std::size_t(3 * nodes[std::size_t(j)] + k)];
          EXPECT_NEAR(positions[std::size_t(nodes[std::size_t(i)] * d + k)],
                      (x - frame.centre[std::size_t(k)]) / frame.diagonal, 1e-13);
        }
    }
  }
}

TEST_P(SolverNodes, AreTheFilesOwnUpToOrderTwo) {
  for (const int order : {1, 2}) {
    const HighOrderMesh mesh = curved(GetParam(), order);
    const Frame frame = frame_of(mesh);
    const std::vector<double> positions = solver_positions(mesh, frame);
    const auto d = std::size_t(mesh.dimension);
    for (std::size_t n = 0; n < mesh.node_count(); ++n)
      for (std::size_t k = 0; k < d; ++k)
        EXPECT_EQ(positions[n * d + k], (mesh.coordinates[3 * n + k] - frame.centre[k]) / frame.diagonal);
  }
}

TEST_P(SolverNodes, GiveTheFileBackWhatTheyWereMadeOf) {
  for (const int order : {1, 2, 4}) {
    const HighOrderMesh mesh = curved(GetParam(), order);
    HighOrderMesh moved = mesh;
    testing::shake(moved, 0.03, 2);
    const Frame frame = frame_of(mesh);
    const std::vector<double> back =
        file_coordinates(mesh, frame, solver_positions(mesh, frame), solver_positions(moved, frame));
    for (std::size_t i = 0; i < back.size(); ++i) EXPECT_NEAR(back[i], moved.coordinates[i], 1e-13);
  }
}

TEST_P(SolverNodes, LeaveTheFileBitForBitIfNoneMoved) {
  const HighOrderMesh mesh = curved(GetParam(), 4);
  const Frame frame = frame_of(mesh);
  const std::vector<double> positions = solver_positions(mesh, frame);
  EXPECT_EQ(file_coordinates(mesh, frame, positions, positions), mesh.coordinates);
}

TEST_P(SolverNodes, ChangeOnlyThePartsOfTheMeshThatTheyLieInOrBound) {
  const HighOrderMesh mesh = curved(GetParam(), 4);
  const Frame frame = frame_of(mesh);
  const std::vector<double> before = solver_positions(mesh, frame);
  const auto d = std::size_t(mesh.dimension);
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t node = 0; node < mesh.node_count(); node += 7) {
    std::vector<double> after = before;
    after[node * d] += 0.01;
    const std::vector<double> coordinates = file_coordinates(mesh, frame, before, after);
    // By node: whether the moved node, in a common cell, is in the part that the node lies in or on its boundary.
    std::vector<bool> may_change(mesh.node_count(), false);
    for (std::size_t cell = 0; cell < cells.count(); ++cell) {
      const auto& places = reference::node_places(cells.shape(cell), mesh.order);
      const auto nodes = cells.nodes(cell);
      for (std::size_t moved = 0; moved < nodes.size(); ++moved)
        for (std::size_t other = 0; std::size_t(nodes[moved]) == node && other < nodes.size(); ++other)
          if (in_closure(reference::info(cells.shape(cell)), places[moved], places[other]))
            may_change[std::size_t(nodes[other])] = true;
    }
    EXPECT_TRUE(may_change[node]);
    EXPECT_NE(coordinates[3 * node], mesh.coordinates[3 * node]);
    for (std::size_t n = 0; n < mesh.node_count(); ++n)
      for (std::size_t k = may_change[n] ? 1 : 0; k < 3; ++k)
        ASSERT_EQ(coordinates[3 * n + k], mesh.coordinates[3 * n + k]);
  }
}

TEST(NodeConversionOfSomeCells, GivesWhatTheConversionOfAllGives) {
  const HighOrderMesh mesh = curved(Filling::MixedSolid, 3);
  const Frame frame = frame_of(mesh);
  const std::vector<double> before = solver_positions(mesh, frame);
  const Cells cells(mesh, 3);
  // One node moves; its cells are converted again, on one thread and on three.
  const auto node = std::size_t(cells.nodes(5)[0]);
  std::vector<double> after = before;
  after[3 * node + 1] -= 0.02;
  std::vector<std::int32_t> some;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    if (std::ranges::count(cells.nodes(cell), std::int32_t(node)) > 0) some.push_back(std::int32_t(cell));
  ASSERT_LT(some.size(), cells.count());
  const NodeConversion conversion(mesh, frame, before);
  const std::vector<double> all = file_coordinates(mesh, frame, before, after);
  for (const int threads : {1, 3}) {
    std::vector<double> coordinates = mesh.coordinates;
    const Team team(threads);
    team.run([&] { conversion.update(after, some, coordinates, team); });
    EXPECT_EQ(coordinates, all);
  }
}

TEST(NodeConversionOfAPlaneMesh, KeepsTheThirdCoordinate) {
  HighOrderMesh mesh = curved(Filling::Triangles, 3);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n + 2] = 0.1 * double(n % 7);
  const Frame frame = frame_of(mesh);
  const std::vector<double> before = solver_positions(mesh, frame);
  std::vector<double> after = before;
  for (double& x : after) x += 0.01;
  const std::vector<double> coordinates = file_coordinates(mesh, frame, before, after);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) EXPECT_EQ(coordinates[3 * n + 2], mesh.coordinates[3 * n + 2]);
}

TEST(InClosure, KnowsWhatBoundsWhatInATetrahedron) {
  const reference::ShapeInfo& shape = reference::info(Shape::Tetrahedron);
  for (std::int8_t edge = 0; edge < 6; ++edge) {
    for (std::int8_t vertex = 0; vertex < 4; ++vertex) {
      const auto& ends = shape.edges[std::size_t(edge)];
      EXPECT_EQ(in_closure(shape, {0, vertex}, {1, edge}), ends[0] == vertex || ends[1] == vertex);
      EXPECT_FALSE(in_closure(shape, {1, edge}, {0, vertex})) << "a vertex does not follow its edge";
    }
    int faces = 0;
    for (std::int8_t face = 0; face < 4; ++face) faces += in_closure(shape, {1, edge}, {2, face}) ? 1 : 0;
    EXPECT_EQ(faces, 2);
    EXPECT_TRUE(in_closure(shape, {1, edge}, {3, 0})) << "the inside follows everything";
  }
  EXPECT_TRUE(in_closure(shape, {2, 1}, {2, 1}));
  EXPECT_FALSE(in_closure(shape, {2, 1}, {2, 2}));
}

}  // namespace
}  // namespace varimesh
