// MFEM's periodic meshes are cut open, and periodic links pair the nodes of both sides of the cut.
#include <gtest/gtest.h>

#include <set>
#include <sstream>

#include "core/formats/reading_notes.h"
#include "core/mesh/check.h"
#include "core/quality/quality.h"
#include "tests/core/support/formats.h"

namespace varimesh {
namespace {

/// The unit square of n × n squares of order 2, bent inside, whose opposite sides are one: in x, and in y if asked for.
std::string torus(int n, bool in_y, bool by_nodes) {
  std::ostringstream out;
  out.precision(17);
  const auto vertex = [&](int i, int j) { return i % n + n * (in_y ? j % n : j); };
  out << "MFEM mesh v1.0\n\ndimension\n2\n\nelements\n" << n * n << "\n";
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      out << "1 3 " << vertex(i, j) << " " << vertex(i + 1, j) << " " << vertex(i + 1, j + 1) << " " << vertex(i, j + 1)
          << "\n";
  out << "\nboundary\n" << (in_y ? 0 : 2 * n) << "\n";
  for (int i = 0; i < n && !in_y; ++i)
    for (const int j : {0, n}) out << (j == 0 ? 1 : 2) << " 1 " << vertex(i, j) << " " << vertex(i + 1, j) << "\n";
  out << "\nvertices\n"
      << n * (in_y ? n : n + 1)
      << "\n\nnodes\nFiniteElementSpace\nFiniteElementCollection: L2_T1_2D_P2\nVDim: 2\nOrdering: "
      << (by_nodes ? 0 : 1) << "\n\n";
  std::ostringstream second;  // the second components, if they come last
  second.precision(17);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      for (int b = 0; b < 3; ++b)
        for (int a = 0; a < 3; ++a) {
          const double x = (i + a / 2.0) / n, y = (j + b / 2.0) / n, bump = 0.2 * x * (1 - x) * y * (1 - y);
          out << x + bump << " ";
          (by_nodes ? second : out) << y + bump << "\n";
        }
  return out.str() + second.str();
}

TEST(MfemPeriodic, IsCutOpenWithLinks) {
  for (const bool in_y : {false, true})
    for (const bool by_nodes : {false, true}) {
      const int n = 4;
      const HighOrderMesh mesh = testing::read_back(torus(n, in_y, by_nodes));
      ASSERT_TRUE(check_structure(mesh)) << check_structure(mesh).error().sentence;
      EXPECT_EQ(mesh.node_count(), std::size_t((2 * n + 1) * (2 * n + 1))) << "of the whole square";
      const QualityReport found = quality(mesh, 0, 1);
      EXPECT_EQ(found.certified.valid, n * n);
      ASSERT_EQ(mesh.periodic.size(), in_y ? 2U : 1U);
      for (const PeriodicLink& link : mesh.periodic) {
        EXPECT_EQ(link.dimension, 1);
        EXPECT_EQ(link.nodes.size(), std::size_t(2 * n + 1));
        ASSERT_EQ(link.affine.size(), 16U);
        EXPECT_NEAR(link.affine[3] + link.affine[7], 1, 1e-12) << "along x or along y";
        for (const auto& [node, master] : link.nodes)
          for (std::size_t k = 0; k < 2; ++k)
            EXPECT_NEAR(mesh.coordinates[3 * std::size_t(node) + k],
                        mesh.coordinates[3 * std::size_t(master) + k] + link.affine[4 * k + 3], 1e-12);
        std::set<int> tags;
        for (const ElementBlock& block : mesh.blocks)
          if (block.shape == Shape::Line) tags.insert(block.entity);
        EXPECT_TRUE(tags.contains(link.entity) && tags.contains(link.master));
      }
      EXPECT_EQ(mesh.element_count(1), std::size_t(4 * n)) << "all sides of the square";
      EXPECT_EQ(formats::reading_notes(mesh).size(), 1U);
    }
}

TEST(MfemPeriodic, DamagedFilesAreReadOrRefused) { testing::expect_survives_flips(torus(3, true, false), 200); }

}  // namespace
}  // namespace varimesh
