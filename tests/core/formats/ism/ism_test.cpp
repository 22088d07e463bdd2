// HOHQMesh's ISM meshes: curved sides are read where the format has them, and bad files are refused.
#include "core/formats/ism/ism.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <sstream>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using Place = std::array<double, 3>;
using Map = std::function<Place(double, double, double)>;

/// The unit square or cube under a map as a file of one element, all sides curved. Points are listed as HOHQMesh does.
std::string one_element(int dimension, int order, const Map& map, const std::string& version = "") {
  constexpr std::array<std::array<int, 3>, 8> kCorners = {
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  std::ostringstream out;
  out.precision(17);
  const auto put = [&](double x, double y, double z) {
    const Place at = map(x, y, z);
    out << at[0] << " " << at[1] << " " << at[2] << "\n";
  };
  const int corners = dimension == 2 ? 4 : 8;
  if (!version.empty()) out << version << "\n";
  out << corners << (version.empty() ? " " : " 4 ") << "1 " << order << "\n";
  for (int c = 0; c < corners; ++c)
    put(kCorners[std::size_t(c)][0], kCorners[std::size_t(c)][1], kCorners[std::size_t(c)][2]);
  if (!version.empty()) out << "1 2 1 0 1 0\n2 3 1 0 2 0\n3 4 1 0 3 0\n4 1 1 0 4 0\n";
  for (int c = 1; c <= corners; ++c) out << c << " ";
  out << (version == "ISM-MM" ? "iron" : "") << "\n";
  const auto at = [&](int k) { return (1 - std::cos(k * std::numbers::pi / order)) / 2; };
  if (dimension == 2) {
    out << "1 1 1 1\n";
    for (int k = 0; k <= order; ++k) put(at(k), 0, 0);
    for (int k = 0; k <= order; ++k) put(1, at(k), 0);
    for (int k = 0; k <= order; ++k) put(at(k), 1, 0);
    for (int k = 0; k <= order; ++k) put(0, at(k), 0);
    out << "bottom --- top left\n";
    return out.str();
  }
  out << "1 1 1 1 1 1\n";
  const std::array<std::function<void(double, double)>, 6> faces = {
      [&](double u, double v) { put(u, 0, v); }, [&](double u, double v) { put(u, 1, v); },
      [&](double u, double v) { put(u, v, 0); }, [&](double u, double v) { put(1, u, v); },
      [&](double u, double v) { put(u, v, 1); }, [&](double u, double v) { put(0, u, v); }};
  for (const auto& face : faces)
    for (int j = 0; j <= order; ++j)
      for (int i = 0; i <= order; ++i) face(at(i), at(j));
  out << "front back bottom --- top left\n";
  return out.str();
}

/// A polynomial of this degree whose interior is the transfinite one of its boundary.
Map bent(int dimension, int order) {
  return [=](double x, double y, double z) {
    return Place{x + 0.1 * std::pow(y, order), y + 0.2 * x * std::pow(dimension == 3 ? z : x, order - 1),
                 dimension == 3 ? z + 0.1 * std::pow(x, order) : 0};
  };
}

TEST(Ism, MapsAPolynomialThroughEveryNode) {
  for (const int dimension : {2, 3})
    for (int order = 1; order <= 10; ++order) {
      const Map map = bent(dimension, order);
      const auto file = formats::read(one_element(dimension, order, map));
      ASSERT_TRUE(file) << file.error().sentence;
      EXPECT_EQ(file->format, Format::Ism);
      const HighOrderMesh& mesh = file->mesh;
      ASSERT_EQ(mesh.order, order);
      const Cells cells(mesh, dimension);
      ASSERT_EQ(cells.count(), 1U);
      const auto& lattice = reference::lattice(cells.shape(0), order);
      double gap = 0;
      for (std::size_t i = 0; i < lattice.size(); ++i) {
        const Place wanted =
            map(double(lattice[i][0]) / order, double(lattice[i][1]) / order, double(lattice[i][2]) / order);
        for (std::size_t k = 0; k < 3; ++k)
          gap = std::max(gap, std::abs(wanted[k] - mesh.coordinates[3 * std::size_t(cells.nodes(0)[i]) + k]));
      }
      // Rounding of a sum over all points of the cell's boundary.
      EXPECT_LE(gap, 1e-15 * std::pow(order + 1, dimension)) << dimension << "-D, order " << order;
      EXPECT_EQ(mesh.element_count(dimension - 1), dimension == 2 ? 3U : 5U) << "sides with names";
    }
}

TEST(Ism, ReadsTheLaterVersions) {
  const auto plain = formats::read(one_element(2, 4, bent(2, 4)));
  for (const std::string version : {"ISM-V2", "ISM-MM"}) {
    const auto file = formats::read(one_element(2, 4, bent(2, 4), version));
    ASSERT_TRUE(file) << file.error().sentence;
    EXPECT_EQ(file->mesh.coordinates, plain->mesh.coordinates);
    EXPECT_EQ(file->mesh.physical_groups.size(), version == "ISM-MM" ? 4U : 3U);
    if (version == "ISM-MM") {
      EXPECT_EQ(file->mesh.physical_groups[0].name, "iron");
      EXPECT_EQ(file->mesh.blocks[0].physical, std::vector<int>{1});
    }
  }
}

TEST(Ism, WritesItAsMsh) {
  const auto file = formats::read(one_element(3, 3, bent(3, 3)));
  ASSERT_TRUE(file);
  const auto back = formats::read(test::written(file->mesh, Format::Msh41));
  ASSERT_TRUE(back) << back.error().sentence;
  const Cells from(file->mesh, 3), to(back->mesh, 3);
  for (std::size_t i = 0; i < from.nodes(0).size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(file->mesh.coordinates[3 * std::size_t(from.nodes(0)[i]) + k],
                back->mesh.coordinates[3 * std::size_t(to.nodes(0)[i]) + k]);
  EXPECT_EQ(back->mesh.physical_groups.size(), 5U);
  EXPECT_TRUE(check_structure(back->mesh));
}

TEST(IsmErrors, AreSaid) {
  const std::string whole = one_element(2, 2, bent(2, 2));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = whole;
    EXPECT_NE(changed.find(from), std::string::npos);
    return changed.replace(changed.find(from), from.size(), to);
  };
  EXPECT_SAYS(whole, "it was read");
  EXPECT_SAYS(with("4 1 2\n", "4 1 11\n"), "order is 11");
  EXPECT_SAYS(with("4 1 2\n", "400 1 2\n"), "ends at byte");
  EXPECT_SAYS(with("4 1 2\n", "4 2 2\n"), "an element should follow");
  EXPECT_SAYS(with("1 2 3 4", "1 2 3 5"), "refers to node 5, but the nodes are 1 to 4");
  EXPECT_SAYS(with("1 2 3 4", "1 2 3 3"), "the same node twice");
  EXPECT_SAYS(with("1 2 3 4", "1 2 3"), "an element has 3 nodes");
  EXPECT_SAYS(with("1 2 3 4", "1 4 3 2"), "does not meet its nodes");
  EXPECT_SAYS(with("1 1 1 1", "1 1 1 2"), "must be 0 or 1");
  EXPECT_SAYS(with("bottom --- top left", "bottom --- top"), "3 names of sides");
  EXPECT_SAYS(whole + "7", "something follows");
  const std::size_t corners = whole.find('\n') + 1;
  EXPECT_SAYS(whole.substr(0, corners) + "nan" + whole.substr(corners + 1),
              "node 1 has a coordinate that is not a finite number");
  EXPECT_SAYS("ISM-V3\n1 2 3 4\n", "not ISM, ISM-V2 or ISM-MM");
  EXPECT_SAYS("ISM-V2\n4 1 2\n", "the numbers of nodes, edges, elements");
}

TEST(DamagedIsmFile, IsRefusedWhereverItIsCutShort) {
  for (const std::string& whole : {one_element(2, 4, bent(2, 4), "ISM-MM"), one_element(3, 2, bent(3, 2))})
    testing::expect_refused_if_cut(whole, whole.find_last_of(' '));  // then follows only a name
}

TEST(DamagedIsmFile, IsReadOrRefusedWithFlippedBytes) {
  for (const std::string& whole : {one_element(2, 4, bent(2, 4), "ISM-V2"), one_element(3, 2, bent(3, 2))})
    testing::expect_survives_flips(whole, 2000);
}

}  // namespace
}  // namespace varimesh
