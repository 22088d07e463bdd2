// Every format and every chain of two formats: a known polynomial maps the straight grid to every node of every
// element.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::Filling;
using testing::Place;

/// The polynomial of degree `order` of testing::curved_grid().
Place bent(const Place& at, int order, bool solid) {
  const auto [x, y, z] = at;
  return {x + 0.1 * std::pow(y, order), y + 0.1 * std::pow(solid ? z : x, order),
          solid ? z + 0.1 * std::pow(x, order) : 0};
}

std::array<long, 3> rounded(const Place& at) {
  return {std::lround(at[0] * 1e7), std::lround(at[1] * 1e7), std::lround(at[2] * 1e7)};
}

Place place_of(const HighOrderMesh& mesh, std::int32_t node) {
  const double* x = mesh.coordinates.data() + 3 * std::size_t(node);
  return {x[0], x[1], x[2]};
}

/// The straight place of each vertex of the grid, by the place to which the polynomial moves it.
std::map<std::array<long, 3>, Place> straight_places(Filling filling, int order) {
  const HighOrderMesh straight = testing::grid(filling, {2, 1, 1}, 1);
  std::map<std::array<long, 3>, Place> all;
  for (std::size_t node = 0; node < straight.node_count(); ++node) {
    const Place at = place_of(straight, std::int32_t(node));
    all[rounded(bent(at, order, straight.dimension == 3))] = at;
  }
  return all;
}

/// The vertices at one step from the first one along the lattice's directions. All cells of the grid are affine images.
std::array<int, 3> directions(Shape shape) {
  switch (shape) {
    case Shape::Quadrilateral:
      return {1, 3, 0};
    case Shape::Pyramid:
    case Shape::Hexahedron:
      return {1, 3, 4};
    default:
      return {1, 2, 3};
  }
}

/// The largest distance of a node of a cell, or of a side in a group, from where the polynomial puts it. `outlines`:
/// without the inner nodes of 3-D cells.
double gap(const HighOrderMesh& mesh, Filling filling, int order, bool outlines) {
  const auto straight = straight_places(filling, order);
  double largest = 0;
  for (const int d : {mesh.dimension, mesh.dimension - 1}) {
    const Cells cells(mesh, d);
    for (std::size_t e = 0; e < cells.count(); ++e) {
      const Shape shape = cells.shape(e);
      const auto nodes = cells.nodes(e);
      std::vector<Place> corners;
      for (int v = 0; v < reference::info(shape).vertices; ++v) {
        const auto found = straight.find(rounded(place_of(mesh, nodes[std::size_t(v)])));
        if (found == straight.end()) return HUGE_VAL;
        corners.push_back(found->second);
      }
      const auto& lattice = reference::lattice(shape, mesh.order);
      const auto& places = reference::node_places(shape, mesh.order);
      const auto along = directions(shape);
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (outlines && places[i].dimension == 3) continue;
        Place at = corners[0];
        for (std::size_t k = 0; k < std::size_t(d); ++k)
          for (std::size_t c = 0; c < 3; ++c)
            at[c] += (corners[std::size_t(along[k])][c] - corners[0][c]) * lattice[i][k] / mesh.order;
        const Place wanted = bent(at, order, mesh.dimension == 3), own = place_of(mesh, nodes[i]);
        for (std::size_t c = 0; c < 3; ++c) largest = std::max(largest, std::abs(wanted[c] - own[c]));
      }
    }
  }
  return largest;
}

/// Whether files of this format can hold the grid, and be read.
bool takes(Format format, Filling filling, int order) {
  switch (format) {
    case Format::Hopr:
      return !testing::is_plane(filling) && testing::use_hdf5();
    case Format::Cgns:
      return order <= 4 && testing::use_hdf5();
    default:
      return true;
  }
}

constexpr Format kFormats[] = {Format::Msh22,  Format::Msh41Binary, Format::Vtu, Format::Mfem,
                               Format::Nektar, Format::Hopr,        Format::Cgns};

struct Chain {
  Filling filling;
  Format first;
};

std::string name(const Chain& chain) {
  for (const formats::FormatInfo& info : formats::all())
    if (info.format == chain.first) {
      std::string text = testing::name(chain.filling) + std::string(info.name);
      std::erase(text, '-');
      return text;
    }
  return "";
}

void PrintTo(const Chain& chain, std::ostream* out) { *out << name(chain); }

class Chains : public ::testing::TestWithParam<Chain> {};

TEST_P(Chains, MapAKnownPolynomialThroughEveryNode) {
  const auto [filling, first] = GetParam();
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = testing::curved_grid(filling, order);
    if (!takes(first, filling, order)) continue;
    const HighOrderMesh once = testing::read_back(test::written(mesh, first));
    ASSERT_EQ(once.element_count(once.dimension), mesh.element_count(mesh.dimension));
    ASSERT_EQ(once.element_count(once.dimension - 1), mesh.element_count(mesh.dimension - 1));
    EXPECT_LE(gap(once, filling, order, first == Format::Nektar && order > 2), 1e-12) << "order " << order;
    for (const Format second : kFormats) {
      if (!takes(second, filling, order)) continue;
      const HighOrderMesh twice = testing::read_back(test::written(once, second));
      const bool outlines = order > 2 && (first == Format::Nektar || second == Format::Nektar);
      ASSERT_EQ(twice.element_count(twice.dimension), mesh.element_count(mesh.dimension));
      EXPECT_LE(gap(twice, filling, order, outlines), 1e-12) << "order " << order << ", then format " << int(second);
      // MFEM gives every cell an attribute, which becomes a group.
      EXPECT_GE(twice.physical_groups.size(), mesh.physical_groups.size()) << "then format " << int(second);
    }
  }
}

/// The highest order of a format's elements.
int highest(Format format, Filling filling) {
  if (format == Format::Cgns) return 4;
  const bool simplices = filling == Filling::Triangles || filling == Filling::Quadrilaterals ||
                         filling == Filling::MixedPlane || filling == Filling::Tetrahedra;
  const bool gmsh = format == Format::Msh22 || format == Format::Msh41Binary;
  return gmsh && !simplices ? 9 : 10;
}

TEST_P(Chains, MapAKnownPolynomialAtTheHighestOrder) {
  const auto [filling, first] = GetParam();
  for (const int order : {7, highest(first, filling)}) {
    if (order > highest(first, filling) || !takes(first, filling, order)) continue;
    const HighOrderMesh mesh = testing::curved_grid(filling, order);
    const HighOrderMesh once = testing::read_back(test::written(mesh, first));
    ASSERT_EQ(once.order, order);
    ASSERT_EQ(once.element_count(once.dimension), mesh.element_count(mesh.dimension));
    // The grid is two units long, so coordinates go up to 2 to the power of the order.
    EXPECT_LE(gap(once, filling, order, first == Format::Nektar), 1e-12 * std::pow(2, order)) << "order " << order;
  }
}

std::vector<Chain> chains() {
  std::vector<Chain> all;
  for (const Filling filling : testing::kFillings)
    for (const Format first : kFormats) all.push_back({filling, first});
  return all;
}

INSTANTIATE_TEST_SUITE_P(EveryShapeAndFormat, Chains, ::testing::ValuesIn(chains()),
                         [](const auto& info) { return name(info.param); });

}  // namespace
}  // namespace varimesh
