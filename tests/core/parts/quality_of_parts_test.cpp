// A mesh in parts is judged as a whole one is, for any number of ranks: threads are the ranks here.
#include "core/parts/quality_of_parts.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/base/team.h"
#include "core/mesh/check.h"
#include "core/mesh/loose_parts.h"
#include "core/optimise/optimiser.h"
#include "core/ranks/thread_ranks.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/turned.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr int kCounts[] = {1, 2, 3, 5};

/// A mesh file of the test that runs.
class InParts : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }

  void write(const HighOrderMesh& mesh) {
    const auto written = formats::write_file(mesh, formats::Format::Msh41Binary, path_);
    ASSERT_TRUE(written) << written.error().sentence;
  }

  /// What each number of ranks finds; `see` gets the first rank's result, all ranks must agree on success.
  void for_each_count(const std::function<void(int, const Expected<WholeQuality>&)>& see) {
    for (const int count : kCounts)
      run_as_ranks(count, [&](const Ranks& ranks) {
        const auto found = quality_of_parts({path_, 0, 1, true}, ranks);
        const auto bad = ranks.sum(std::int64_t{found ? 0 : 1});
        EXPECT_EQ(bad, found ? 0 : count);
        if (ranks.is_first()) see(count, found);
      });
  }

  void expect_the_same_as_whole() {
    const auto file = formats::read_file(path_);
    ASSERT_TRUE(file) << file.error().sentence;
    const HighOrderMesh& mesh = file->mesh;
    const auto sizes = summarise(mesh);
    ASSERT_TRUE(sizes) << sizes.error().sentence;
    const QualityReport report = quality(mesh, 0, 1);
    const auto numbers = uncertified_numbers(report);
    const auto groups = with_any_of(diagnose(mesh, 1), numbers);
    const WhatIsLeft left = what_is_left(mesh, numbers, groups, {});
    const Team team(1);
    const auto loose = loose_parts(mesh, facets(mesh), team);
    for_each_count([&](int count, const Expected<WholeQuality>& found) {
      SCOPED_TRACE("ranks: " + std::to_string(count));
      ASSERT_TRUE(found) << found.error().sentence;
      expect_equal(found->mesh, *sizes);
      expect_equal(found->quality, report);
      EXPECT_EQ(found->loose, loose);
      EXPECT_EQ(found->left.sentence, left.sentence);
      EXPECT_EQ(found->left.remedies.size(), left.remedies.size());
      ASSERT_EQ(found->unrepairable.size(), groups.size());
      for (std::size_t i = 0; i < groups.size(); ++i) EXPECT_EQ(found->unrepairable[i].sentence, groups[i].sentence);
    });
  }

  std::string path_ =
      (std::filesystem::temp_directory_path() / ("varimesh-parts-" + std::to_string(::getpid()) + ".msh")).string();

 private:
  static void expect_equal(const MeshSummary& a, const MeshSummary& b) {
    EXPECT_EQ(a.dimension, b.dimension);
    EXPECT_EQ(a.order, b.order);
    EXPECT_EQ(a.elements, b.elements);
    EXPECT_EQ(a.nodes, b.nodes);
    EXPECT_EQ(a.free_nodes, b.free_nodes);
  }

  static void expect_equal(const QualityReport& a, const QualityReport& b) {
    EXPECT_EQ(a.min_scaled_jacobian, b.min_scaled_jacobian);
    EXPECT_EQ(a.mean_scaled_jacobian, b.mean_scaled_jacobian);
    EXPECT_EQ(a.min_distortion_jacobian, b.min_distortion_jacobian);
    EXPECT_EQ(a.invalid_elements, b.invalid_elements);
    EXPECT_EQ(a.histogram, b.histogram);
    EXPECT_EQ(a.lattice_intervals, b.lattice_intervals);
    EXPECT_EQ(a.certified.valid, b.certified.valid);
    EXPECT_EQ(a.certified.invalid, b.certified.invalid);
    EXPECT_EQ(a.certified.undecided, b.certified.undecided);
    EXPECT_EQ(a.certified.min_scaled_jacobian_lower_bound, b.certified.min_scaled_jacobian_lower_bound);
    EXPECT_EQ(a.accuracy.value().loss, b.accuracy.value().loss);
    EXPECT_EQ(a.accuracy.value().modal_parts, b.accuracy.value().modal_parts);
    EXPECT_EQ(a.clockwise, b.clockwise);
    ASSERT_EQ(a.invalid.size(), b.invalid.size());
    for (std::size_t i = 0; i < a.invalid.size(); ++i) {
      EXPECT_EQ(a.invalid[i].number, b.invalid[i].number);
      EXPECT_EQ(a.invalid[i].scaled_jacobian, b.invalid[i].scaled_jacobian);
      EXPECT_EQ(a.invalid[i].place, b.invalid[i].place);
    }
    ASSERT_EQ(a.uncertified.size(), b.uncertified.size());
    for (std::size_t i = 0; i < a.uncertified.size(); ++i) {
      EXPECT_EQ(a.uncertified[i].number, b.uncertified[i].number);
      EXPECT_EQ(a.uncertified[i].answer, b.uncertified[i].answer);
      EXPECT_EQ(a.uncertified[i].place, b.uncertified[i].place);
    }
  }
};

class GridInParts : public InParts, public ::testing::WithParamInterface<Filling> {
 protected:
  static HighOrderMesh bent_grid(int order) {
    const bool plane = testing::is_plane(GetParam());
    return testing::grid(GetParam(), plane ? std::array{6, 5, 1} : std::array{4, 3, 3}, order,
                         testing::bent(plane ? 2 : 3));
  }
};

INSTANTIATE_TEST_SUITE_P(Shapes, GridInParts, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return testing::name(filling.param); });

TEST_P(GridInParts, IsJudgedAsAWhole) {
  for (int order = 1; order <= 5; ++order) {
    SCOPED_TRACE("order " + std::to_string(order));
    write(bent_grid(order));
    expect_the_same_as_whole();
  }
}

TEST_P(GridInParts, IsJudgedAsAWholeIfItIsTangled) {
  for (const int order : {2, 3}) {
    SCOPED_TRACE("order " + std::to_string(order));
    HighOrderMesh mesh = bent_grid(order);
    testing::shake(mesh, 0.12, 1, testing::Shaken::AllInterior);
    ASSERT_GT(quality(mesh).certified.invalid, 0);
    write(mesh);
    expect_the_same_as_whole();
  }
}

TEST_P(GridInParts, KnowsWhichCellsAreClockwise) {
  HighOrderMesh mesh = bent_grid(2);
  write(testing::turned(mesh, testing::every_third_cell));
  ASSERT_FALSE(quality(testing::turned(mesh, testing::every_third_cell)).clockwise.empty());
  expect_the_same_as_whole();
  write(testing::turned(mesh, testing::every_cell));
  expect_the_same_as_whole();
}

TEST_F(InParts, ShippedCasesAreJudgedAsAWhole) {
  for (const char* name : {"nine_triangles.msh", "circle_p5.msh", "annulus_p3.msh", "aerofoil_p4.msh", "far_vertex.msh",
                           "reentrant_3_of_5.msh", "reentrant_triangles_p2.msh", "pin_p3.msh", "solid_ball_p3.msh"}) {
    SCOPED_TRACE(name);
    write(testing::read_case(name));
    expect_the_same_as_whole();
  }
}

TEST_F(InParts, NodesOfNoCellAndElementsOnNoCellAreNamed) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 2, 2}, 2);
  for (int i = 0; i < 6; ++i) {
    mesh.coordinates.insert(mesh.coordinates.end(), {5.0 + i, i * 0.3, 0.1 * i * i});
    mesh.node_numbers.push_back(std::int64_t(1000 + mesh.node_count()));
  }
  mesh.node_blocks = {{3, 1, 0, std::int32_t(mesh.node_count())}};
  ElementBlock& border = mesh.blocks.emplace_back();
  border.shape = Shape::Triangle;
  border.order = 2;
  border.entity = 77;
  border.numbers = {100000};
  const auto last = std::int32_t(mesh.node_count());
  border.nodes = {last - 6, last - 5, last - 4, last - 3, last - 2, last - 1};
  write(mesh);
  expect_the_same_as_whole();
}

/// Faults: the sentence of the whole mesh, on all ranks.
class FaultInParts : public InParts {
 protected:
  void expect_the_same_fault() {
    const auto file = formats::read_file(path_);
    ASSERT_TRUE(file) << file.error().sentence;
    const auto sizes = summarise(file->mesh);
    ASSERT_FALSE(sizes);
    for_each_count([&](int count, const Expected<WholeQuality>& found) {
      ASSERT_FALSE(found) << count;
      EXPECT_EQ(found.error().sentence, sizes.error().sentence) << count;
    });
  }
  ElementBlock& cells(HighOrderMesh& mesh) {
    return *std::ranges::find_if(mesh.blocks,
                                 [](const ElementBlock& block) { return block.shape == Shape::Tetrahedron; });
  }
};

TEST_F(FaultInParts, ACellTwice) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 2, 2}, 2);
  ElementBlock& block = cells(mesh);
  block.numbers.push_back(99999);
  const std::vector<std::int32_t> again(block.nodes.begin() + 10 * 20, block.nodes.begin() + 10 * 21);
  block.nodes.insert(block.nodes.end(), again.begin(), again.end());
  write(mesh);
  expect_the_same_fault();
}

TEST_F(FaultInParts, ThreeCellsAtAFace) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 2, 2}, 1);
  ElementBlock& block = cells(mesh);
  const std::int32_t apex = block.nodes[4 * 70];
  block.numbers.push_back(99999);
  block.nodes.insert(block.nodes.end(), {block.nodes[0], block.nodes[1], block.nodes[3], apex});
  write(mesh);
  expect_the_same_fault();
}

TEST_F(FaultInParts, NeighboursWithDifferentNodesBetweenTheSameVertices) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 2, 2}, 2);
  ElementBlock& block = cells(mesh);
  const std::size_t middle = block.size() / 2;
  std::swap(block.nodes[10 * middle + 4], block.nodes[10 * middle + 5]);
  write(mesh);
  expect_the_same_fault();
}

TEST_F(FaultInParts, AnElementThatRefersToNoNode) {
  write(testing::grid(Filling::Tetrahedra, {3, 2, 2}, 2));
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  file.clear();
  file.seekp(std::streamoff(bytes.rfind("\n$EndElements")) - 8);
  const std::int64_t number = 123456;
  file.write(reinterpret_cast<const char*>(&number), sizeof number);
  file.close();
  const auto whole = formats::read_file(path_);
  ASSERT_FALSE(whole);
  for_each_count([&](int, const Expected<WholeQuality>& found) {
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().sentence, whole.error().sentence);
  });
}

TEST_F(InParts, FilesThatCannotBeReadInPartsAreRefused) {
  for_each_count([](int, const Expected<WholeQuality>& found) {
    ASSERT_FALSE(found);
    EXPECT_NE(found.error().sentence.find("cannot be opened"), std::string::npos);
  });
  ASSERT_TRUE(formats::write_file(testing::grid(Filling::Tetrahedra, {2, 2, 2}, 1), formats::Format::Msh22, path_));
  for_each_count([](int, const Expected<WholeQuality>& found) {
    ASSERT_FALSE(found);
    EXPECT_NE(found.error().sentence.find("With several processes, the mesh must be a binary file of Gmsh's MSH 4.1"),
              std::string::npos);
  });
}

TEST_F(InParts, TruncatedFilesAreRefused) {
  write(testing::grid(Filling::Tetrahedra, {3, 2, 2}, 2));
  const auto size = std::filesystem::file_size(path_);
  for (const double share : {0.999, 0.9, 0.5, 0.2, 0.01}) {
    std::filesystem::resize_file(path_, std::uintmax_t(share * double(size)));
    for_each_count([&](int, const Expected<WholeQuality>& found) { EXPECT_FALSE(found) << share; });
  }
}

}  // namespace
}  // namespace varimesh
