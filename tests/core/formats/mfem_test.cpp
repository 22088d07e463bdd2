// MFEM's meshes: every shape, order and space comes back as it went, and so do groups. Bad files are refused.
#include "core/formats/mfem/mfem.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;
using testing::read_back;

/// Expects the same elements, in the same order, with the same nodes up to rounding, and the same attributes.
void expect_same_elements(const HighOrderMesh& a, const HighOrderMesh& b, double tolerance) {
  EXPECT_EQ(a.dimension, b.dimension);
  EXPECT_EQ(a.order, b.order);
  for (const int d : {a.dimension, a.dimension - 1}) {
    const Cells from(a, d), to(b, d);
    ASSERT_EQ(from.count(), to.count());
    for (std::size_t e = 0; e < from.count(); ++e) {
      ASSERT_EQ(from.shape(e), to.shape(e));
      const auto own = from.nodes(e), other = to.nodes(e);
      double gap = 0;
      for (std::size_t i = 0; i < own.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k)
          gap = std::max(
              gap, std::abs(a.coordinates[3 * std::size_t(own[i]) + k] - b.coordinates[3 * std::size_t(other[i]) + k]));
      EXPECT_LE(gap, tolerance) << "element " << e << " of dimension " << d;
      const auto group = [](const Cells& cells, std::size_t cell) {
        const auto& physical = cells.range_of(cell).block->physical;
        return physical.empty() ? 0 : physical.front();
      };
      if (group(from, e) != 0) {
        EXPECT_EQ(group(from, e), group(to, e));
      }
    }
  }
}

/// How far rounding can move a node on its way into a space and back: 16 rounding errors of a coordinate of size 1,
/// times the condition of the worst conversion. Open equispaced points need an extrapolation, which loses two digits
/// more than Gauss's points.
double rounding(const HighOrderMesh& mesh, const formats::MfemSpace& space) {
  double condition = 1;
  const auto consider = [&](Shape shape) {
    const formats::MfemConversion& conversion = formats::mfem_conversion(space, shape);
    const auto norm = [](const Eigen::MatrixXd& matrix) {
      return matrix.rows() == 0 ? 1.0 : matrix.cwiseAbs().rowwise().sum().maxCoeff();
    };
    condition = std::max(condition, norm(conversion.to_nodes) * norm(conversion.to_file));
  };
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension || space.continuous) consider(block.shape);
  if (space.continuous) consider(Shape::Line);
  return 16 * std::numeric_limits<double>::epsilon() * condition;
}

// === Every shape, order and space ========================================================================

struct Case {
  Filling filling;
  const char* space;  ///< Before "3D_P2"; empty: the default.
};

void PrintTo(const Case& each, std::ostream* out) { *out << testing::name(each.filling) << each.space; }

class MfemSpaces : public ::testing::TestWithParam<Case> {};

TEST_P(MfemSpaces, ComeBackAsTheyWent) {
  const auto [filling, space] = GetParam();
  for (int order = 1; order <= 5; ++order) {
    HighOrderMesh mesh = curved_grid(filling, order);
    const bool by_nodes = order % 2 == 0;
    if (*space != '\0') {
      const auto known =
          formats::mfem_space(std::string(space) + std::to_string(mesh.dimension) + "D_P" + std::to_string(order));
      ASSERT_TRUE(known) << known.error().sentence;
      formats::remember_mfem_nodes(mesh, {*known, mesh.dimension, by_nodes});
    }
    const std::string bytes = test::written(mesh, Format::Mfem);
    if (*space != '\0') {
      EXPECT_NE(bytes.find(std::string("FiniteElementCollection: ") + space), std::string::npos)
          << bytes.substr(0, 200);
      EXPECT_NE(bytes.find(by_nodes ? "Ordering: 0" : "Ordering: 1"), std::string::npos);
    }
    HighOrderMesh back = read_back(bytes);
    const auto sound = check_structure(back);
    EXPECT_TRUE(sound) << sound.error().sentence;
    const double tolerance = rounding(mesh, formats::mfem_nodes_of(mesh).space);
    expect_same_elements(mesh, back, tolerance);
    // Once it has MFEM's numbers, it has the same ones again.
    const HighOrderMesh again = read_back(test::written(back, Format::Mfem));
    ASSERT_EQ(back.blocks.size(), again.blocks.size());
    for (std::size_t b = 0; b < back.blocks.size(); ++b) EXPECT_EQ(back.blocks[b].nodes, again.blocks[b].nodes);
    EXPECT_EQ(back.physical_groups.size(), again.physical_groups.size());
    EXPECT_LE(testing::distance(back, again), tolerance);
  }
}

std::vector<Case> cases() {
  std::vector<Case> list;
  for (const Filling filling : testing::kFillings) {
    list.push_back({filling, ""});
    list.push_back({filling, "H1_"});
    const bool pyramids =
        filling == Filling::Pyramids || filling == Filling::MixedSolid || filling == Filling::Tetrahedra;
    if (pyramids && filling != Filling::Tetrahedra) continue;
    for (const char* space : {"H1Pos_", "H1@U_", "L2_", "L2_T1_", "L2_T2_", "L2_T3_", "L2_T4_", "L2_T5_"})
      list.push_back({filling, space});
  }
  return list;
}

INSTANTIATE_TEST_SUITE_P(EveryShape, MfemSpaces, ::testing::ValuesIn(cases()), [](const auto& info) {
  std::string name = std::string(testing::name(info.param.filling)) + "_" + info.param.space;
  std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
  return name;
});

TEST(Mfem, TakesEveryOrderOfEveryShape) {
  for (const Shape shape :
       {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron})
    for (const int order : {6, 10}) {
      const HighOrderMesh mesh = test::one_cell(shape, order);
      expect_same_elements(mesh, read_back(test::written(mesh, Format::Mfem)), 1e-12);
    }
}

TEST(Mfem, KeepsEquispacedNodesBitForBit) {
  for (const char* space : {"H1@U_", "L2_T4_"}) {
    HighOrderMesh mesh = testing::grid(Filling::MixedPlane, {3, 2, 1}, 4, testing::bent(2));
    formats::remember_mfem_nodes(mesh, {*formats::mfem_space(std::string(space) + "2D_P4"), 2, false});
    expect_same_elements(mesh, read_back(test::written(mesh, Format::Mfem)), 0);
  }
}

TEST(Mfem, GivesTheSameBytesOnceItHasMfemsNumbers) {
  const HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {4, 1, 1}, 1);
  const std::string first = test::written(read_back(test::written(mesh, Format::Mfem)), Format::Mfem);
  EXPECT_EQ(test::written(read_back(first), Format::Mfem), first);
}

TEST(Mfem, ChainsWithGmshsFormats) {
  for (const Filling filling : testing::kFillings)
    for (int order = 1; order <= 5; ++order) {
      const HighOrderMesh mesh = curved_grid(filling, order);
      for (const Format other : {Format::Msh22, Format::Msh41Binary}) {
        const HighOrderMesh there = read_back(test::written(read_back(test::written(mesh, other)), Format::Mfem));
        expect_same_elements(mesh, there, 2e-14);
        const HighOrderMesh back = read_back(test::written(there, other));
        expect_same_elements(mesh, back, 2e-14);
        EXPECT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
      }
    }
}

// === Groups ==============================================================================================

TEST(Mfem, CarriesTheNamesOfGroups) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 1, 1}, 2);
  const std::string bytes = test::written(mesh, Format::Mfem);
  EXPECT_TRUE(bytes.starts_with("MFEM mesh v1.3\n"));
  EXPECT_NE(bytes.find("bdr_attribute_sets\n6\n\"left\" 1 1\n\"right\" 1 2\n"), std::string::npos);
  EXPECT_TRUE(bytes.ends_with("\nmfem_mesh_end\n"));
  const HighOrderMesh back = read_back(bytes);
  ASSERT_EQ(back.physical_groups.size(), 6U);
  EXPECT_EQ(back.physical_groups[1].name, "right");
  EXPECT_EQ(back.physical_groups[1].tag, 2);
  EXPECT_EQ(back.physical_groups[1].dimension, 2);
}

TEST(Mfem, GivesElementsInSeveralGroupsAnAttributeOfTheirOwn) {
  HighOrderMesh mesh = test::one_cell(Shape::Triangle, 1);
  ElementBlock second = mesh.blocks[0];
  second.physical = {5, 9};
  second.numbers = {8};
  second.nodes = {0, 2, 3};
  mesh.blocks.push_back(second);
  mesh.coordinates.insert(mesh.coordinates.end(), {-3, 0, 0});
  mesh.node_numbers.push_back(99);
  mesh.physical_groups.push_back({2, 9, "second"});
  const std::string bytes = test::written(mesh, Format::Mfem);
  EXPECT_NE(bytes.find("attribute_sets\n2\n\"the cell\" 2 1 5\n\"second\" 1 1\n"), std::string::npos) << bytes;
  const HighOrderMesh back = read_back(bytes);
  ASSERT_EQ(back.blocks.size(), 2U);
  EXPECT_EQ(back.blocks[0].physical.size(), 2U) << "its attribute, and the set of both";
  EXPECT_EQ(test::written(back, Format::Mfem),
            test::written(read_back(test::written(back, Format::Mfem)), Format::Mfem));
}

/// A triangle and some lines: pairs of nodes, counted from 0. Node 3 is on no triangle.
HighOrderMesh triangle_with_lines(const std::vector<std::int32_t>& lines) {
  HighOrderMesh mesh = test::one_cell(Shape::Triangle, 1);
  mesh.coordinates.insert(mesh.coordinates.end(), {5, 5, 0});
  mesh.node_numbers.push_back(99);
  ElementBlock block;
  block.shape = Shape::Line;
  block.order = 1;
  block.nodes = lines;
  for (std::size_t line = 0; line < lines.size() / 2; ++line) block.numbers.push_back(100 + std::int64_t(line));
  mesh.blocks.push_back(block);
  return mesh;
}

TEST(Mfem, LeavesOutElementsOfTheBoundaryThatAreNoSides) {
  const HighOrderMesh stray = triangle_with_lines({0, 1, 2, 3});
  EXPECT_NE(formats::left_out(stray, Format::Mfem).find("1 boundary element that is no side of an element"),
            std::string::npos);
  EXPECT_EQ(read_back(test::written(stray, Format::Mfem)).element_count(1), 1U);
  const HighOrderMesh sides = triangle_with_lines({0, 1, 1, 2});
  EXPECT_EQ(formats::left_out(sides, Format::Mfem).find("boundary element"), std::string::npos);
  EXPECT_EQ(read_back(test::written(sides, Format::Mfem)).element_count(1), 2U);
}

TEST(Mfem, RefusesElementsThatDoNotShareTheNodesOfTheirSides) {
  for (const Filling filling : testing::kFillings) {
    HighOrderMesh mesh = testing::grid(filling, {2, 2, 2}, 2);
    const std::string whole = test::written(mesh, Format::Mfem);
    // The last element gets copies of all its nodes that are no vertices.
    ElementBlock& block = mesh.blocks[0];
    const auto vertices = std::size_t(reference::info(block.shape).vertices);
    const std::size_t before = mesh.node_count();
    for (std::size_t i = block.nodes.size() - block.nodes.size() / block.size() + vertices; i < block.nodes.size();
         ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        mesh.coordinates.push_back(mesh.coordinates[3 * std::size_t(block.nodes[i]) + c]);
      block.nodes[i] = std::int32_t(mesh.node_numbers.size());
      mesh.node_numbers.push_back(10'000 + block.nodes[i]);
    }
    EXPECT_EQ(test::written(mesh, Format::Mfem), whole) << "nodes at one place do no harm";
    for (std::size_t node = before; node < mesh.node_count(); ++node) mesh.coordinates[3 * node] += 0.01;
    for (const Format format : {Format::Mfem, Format::Nektar}) {
      const auto refused = formats::write(mesh, format, [](std::string_view) { return true; });
      ASSERT_FALSE(refused);
      const std::string last = "Element " + std::to_string(block.numbers.back()) + " has other nodes on an edge";
      EXPECT_TRUE(refused.error().sentence.starts_with(last)) << refused.error().sentence;
    }
    EXPECT_EQ(read_back(test::written(mesh, Format::Msh22)).node_count(), mesh.node_count());
  }
}

TEST(Mfem, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {1, 1, 1}, 2);
  EXPECT_EQ(formats::left_out(read_back(test::written(mesh, Format::Mfem)), Format::Mfem), "");
  mesh.periodic.push_back({});
  mesh.entities.push_back({});
  mesh.blocks[0].numbers[0] = 77;
  EXPECT_EQ(formats::left_out(mesh, Format::Mfem),
            "MFEM's format has no place for periodic links, entities of the geometry and the numbers of nodes and "
            "elements; the file leaves them out.");
  EXPECT_EQ(formats::left_out(mesh, Format::Msh41), "");
}

}  // namespace
}  // namespace varimesh
