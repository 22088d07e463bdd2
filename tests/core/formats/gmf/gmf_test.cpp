// GMF's meshes: text and binary, all versions, any order of nodes that the file declares, and bad files.
#include "core/formats/gmf/gmf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "core/mesh/check.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/listed_elements.h"

namespace varimesh {
namespace {

using testing::Filling;

struct Names {
  Shape shape;
  std::string name;
  char letter;                  ///< P or Q.
  std::array<int, 4> codes;     ///< Of orders 1 to 4.
  std::array<int, 4> ordering;  ///< The same.
};

const std::vector<Names> kNames = {{Shape::Triangle, "Triangles", 'P', {6, 24, 90, 91}, {143, 129, 130, 144}},
                                   {Shape::Quadrilateral, "Quadrilaterals", 'Q', {7, 27, 88, 89}, {145, 131, 132, 146}},
                                   {Shape::Tetrahedron, "Tetrahedra", 'P', {8, 30, 96, 97}, {147, 133, 134, 148}},
                                   {Shape::Pyramid, "Pyramids", 'P', {49, 87, 100, 101}, {149, 135, 136, 150}},
                                   {Shape::Prism, "Prisms", 'P', {9, 86, 102, 103}, {151, 137, 138, 152}},
                                   {Shape::Hexahedron, "Hexahedra", 'Q', {10, 33, 98, 99}, {153, 139, 140, 154}}};

/// The numbers of a file, written as text, or as binary of some version and byte order.
class File {
 public:
  File(int version, bool binary, bool swapped) : version_(version), binary_(binary), swapped_(swapped) {
    if (binary)
      raw(std::int32_t{1}), raw(std::int32_t(version));
    else
      text_ << "MeshVersionFormatted " << version << "\n# a comment\n";
  }
  void begin(const std::string& name, int code) {
    if (!binary_) {
      text_ << "\n" << name << "\n";
      return;
    }
    end();
    raw(std::int32_t(code));
    next_ = bytes_.size();
    version_ < 3 ? raw(std::int32_t{0}) : raw(std::int64_t{0});
  }
  void small(int value) { binary_ ? raw(std::int32_t(value)) : void(text_ << value << "\n"); }
  void integer(std::int64_t value) {
    if (!binary_)
      text_ << value << " ";
    else
      version_ < 4 ? raw(std::int32_t(value)) : raw(value);
  }
  void real(double value) {
    if (!binary_)
      text_ << value << " ";
    else
      version_ == 1 ? raw(float(value)) : raw(value);
  }
  std::string take() {
    if (!binary_) return text_.str() + "\nEnd\n";
    begin("End", 54);
    return bytes_;
  }
  std::ostringstream& text() { return text_; }

 private:
  template <class T>
  std::string bytes_of(T value) const {
    std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
    if (swapped_) std::reverse(bytes.begin(), bytes.end());
    return bytes;
  }
  template <class T>
  void raw(T value) {
    bytes_ += bytes_of(value);
  }
  void end() {
    if (next_ == 0) return;
    const std::string at = version_ < 3 ? bytes_of(std::int32_t(bytes_.size())) : bytes_of(std::int64_t(bytes_.size()));
    bytes_.replace(next_, at.size(), at);
  }
  int version_;
  bool binary_, swapped_;
  std::ostringstream text_;
  std::string bytes_;
  std::size_t next_ = 0;
};

/// A place of a node: barycentric in simplices and triangles of prisms.
std::vector<int> place(Shape shape, int order, int node) {
  const auto at = reference::lattice(shape, order)[std::size_t(node)];
  switch (shape) {
    case Shape::Triangle:
      return {order - at[0] - at[1], at[0], at[1]};
    case Shape::Tetrahedron:
      return {order - at[0] - at[1] - at[2], at[0], at[1], at[2]};
    case Shape::Prism:
      return {order - at[0] - at[1], at[0], at[1], at[2]};
    case Shape::Quadrilateral:
      return {at[0], at[1]};
    default:
      return {at[0], at[1], at[2]};
  }
}

/// The file of a mesh, with the nodes of its elements in an order that nobody has.
std::string file_of(const HighOrderMesh& mesh, int version, bool binary, bool swapped = false) {
  File file(version, binary, swapped);
  file.text().precision(17);
  const auto p = std::size_t(mesh.order - 1);
  file.begin("Dimension", 3);
  file.small(3);
  std::mt19937 random(7);
  for (const ElementBlock& block : mesh.blocks) {
    const auto names =
        std::find_if(kNames.begin(), kNames.end(), [&](const Names& n) { return n.shape == block.shape; });
    const std::string name = names->name + (p == 0 ? "" : std::string(1, names->letter) + std::to_string(mesh.order));
    const std::size_t stride = nodes_per_element(block);
    std::vector<int> order(stride);
    for (std::size_t i = 0; i < stride; ++i) order[i] = int(i);
    if (p > 0) std::shuffle(order.begin(), order.end(), random);
    file.begin(name, names->codes[p]);
    file.integer(std::int64_t(block.size()));
    for (std::size_t e = 0; e < block.size(); ++e) {
      for (const int node : order) file.integer(block.nodes[e * stride + std::size_t(node)] + 1);
      file.integer(5);
    }
    if (p == 0) continue;
    file.begin(name + "Ordering", names->ordering[p]);
    file.integer(std::int64_t(stride));
    for (const int node : order)
      for (const int x : place(block.shape, mesh.order, node)) file.integer(x);
  }
  file.begin("Vertices", 4);
  file.integer(std::int64_t(mesh.node_count()));
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    for (std::size_t k = 0; k < 3; ++k) file.real(mesh.coordinates[3 * n + k]);
    file.integer(1);
  }
  return file.take();
}

TEST(Gmf, IsReadWithTheOrderOfNodesThatItDeclares) {
  for (const Filling filling : {Filling::Triangles, Filling::Quadrilaterals, Filling::Tetrahedra, Filling::Pyramids,
                                Filling::Prisms, Filling::Hexahedra})
    for (int order = 1; order <= 4; ++order) {
      HighOrderMesh mesh = testing::numbered_cells(testing::curved_grid(filling, order));
      for (const bool binary : {false, true}) {
        // Elements come kind by kind, in the order of the format's table.
        std::map<std::int64_t, std::vector<double>> own;
        const auto file = formats::read(file_of(mesh, 2, binary));
        ASSERT_TRUE(file) << file.error().sentence;
        EXPECT_EQ(file->format, formats::Format::Gmf);
        EXPECT_EQ(file->mesh.order, order);
        EXPECT_TRUE(check_structure(file->mesh)) << check_structure(file->mesh).error().sentence;
        std::multiset<std::vector<double>> wanted, found;
        for (const auto& [number, places] : testing::places_of(mesh, mesh.dimension)) wanted.insert(places);
        for (const auto& [number, places] : testing::places_of(file->mesh, mesh.dimension)) found.insert(places);
        EXPECT_EQ(found, wanted) << reference::info(mesh.blocks[0].shape).name << " of order " << order;
        EXPECT_EQ(file->mesh.blocks.at(0).physical, std::vector<int>{5});
      }
    }
}

TEST(Gmf, VersionsHaveNumbersOfSeveralSizes) {
  const HighOrderMesh mesh = testing::numbered_cells(testing::grid(Filling::Hexahedra, {2, 2, 2}, 2));
  const auto wanted = testing::places_of(mesh, 3);
  for (int version = 1; version <= 4; ++version)
    for (const bool swapped : {false, true})
      EXPECT_EQ(testing::places_of(testing::read_back(file_of(mesh, version, true, swapped)), 3), wanted) << version;
}

const std::string kStart = "MeshVersionFormatted 2\nDimension 2\nVertices\n4\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n";

TEST(Gmf, ElementsOfOrderTwoMayHaveTheKeywordOfOrderOne) {
  const std::string nodes =
      "MeshVersionFormatted 2\nDimension 2\nVertices\n6\n0 0 1\n2 0 1\n0 2 1\n1 0 1\n1 1 1\n0 1 1\n";
  EXPECT_EQ(testing::read_back(nodes + "Triangles\n1\n1 2 3 4 5 6 1\nEnd\n").order, 2);
  EXPECT_EQ(testing::read_back(nodes + "Triangles\n2\n1 2 3 1 4 5 6\n1\nEnd\n").order, 1);
}

/// Gmsh writes its own order of nodes, without a word about it. Others who write quadrilaterals of order 2 agree.
TEST(Gmf, NodesWithoutAnOrderingAreInTheUsualOne) {
  const std::string nodes =
      "MeshVersionFormatted 2\nDimension 2\nVertices\n9\n0 0 1\n2 0 1\n2 2 1\n0 2 1\n1 0 1\n2 1 1\n1 2 1\n0 1 1\n"
      "1 1 1\n";
  for (const char* keyword : {"Quadrilaterals", "QuadrilateralsQ2"}) {
    const HighOrderMesh mesh = testing::read_back(nodes + keyword + "\n1\n1 2 3 4 5 6 7 8 9 1\nEnd\n");
    EXPECT_EQ(mesh.order, 2) << keyword;
    EXPECT_EQ(mesh.blocks.at(0).nodes, (std::vector<std::int32_t>{0, 1, 2, 3, 4, 5, 6, 7, 8})) << keyword;
  }
  for (const auto& [filling, keyword] :
       {std::pair(Filling::Hexahedra, "Hexahedra"), std::pair(Filling::Tetrahedra, "Tetrahedra")})
    for (const int order : {2, 3, 4}) {
      const HighOrderMesh cube = testing::numbered_cells(testing::curved_grid(filling, order));
      std::ostringstream out;
      out.precision(17);
      out << "MeshVersionFormatted 2\nDimension\n3\nVertices\n" << cube.node_count() << "\n";
      for (std::size_t n = 0; n < cube.coordinates.size(); n += 3)
        out << cube.coordinates[n] << " " << cube.coordinates[n + 1] << " " << cube.coordinates[n + 2] << " 1\n";
      out << keyword << "\n" << cube.blocks[0].size() << "\n";
      std::vector<int> places(nodes_per_element(cube.blocks[0]));
      for (std::size_t i = 0; i < places.size(); ++i) places[i] = int(i);
      if (places.size() == 10) std::swap(places[8], places[9]);  // Gmsh's own order is that of MSH files elsewhere
      for (std::size_t e = 0; e < cube.blocks[0].size(); ++e) {
        for (const int i : places) out << cube.blocks[0].nodes[e * places.size() + std::size_t(i)] + 1 << " ";
        out << "1\n";
      }
      EXPECT_EQ(testing::places_of(testing::read_back(out.str() + "End\n"), 3), testing::places_of(cube, 3))
          << keyword << order;
    }
}

TEST(Gmf, ReferencesThatAreNoTagsAreGroupsWithNames) {
  const std::string two =
      "MeshVersionFormatted 2\nDimension 2\nVertices\n6\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n2 0 1\n2 1 1\n";
  const HighOrderMesh mesh = testing::read_back(two +
                                                "Quadrilaterals\n2\n1 2 3 4 5000000000\n2 5 6 3 1\nEdges\n2\n"
                                                "1 2 -7\n2 5 0\nEnd\n");
  std::map<std::pair<int, std::string>, int> named;
  for (const PhysicalGroup& group : mesh.physical_groups) named[{group.dimension, group.name}] = group.tag;
  ASSERT_EQ(named.size(), 2U);
  const int large = named.at({2, "reference_5000000000"}), negative = named.at({1, "reference_-7"});
  EXPECT_GT(large, 1) << "1 is the other element's reference";
  EXPECT_NE(negative, large);
  std::multiset<std::vector<int>> groups;
  for (const ElementBlock& block : mesh.blocks) groups.insert(block.physical);
  EXPECT_EQ(groups, (std::multiset<std::vector<int>>{{large}, {1}, {negative}, {}}));
}

/// A count that is too small would hide elements, and a file that was cut between two sections lacks some.
TEST(Gmf, NothingIsLeftOutInSilence) {
  const std::string element = "Quadrilaterals\n1\n1 2 3 4 1\n";
  EXPECT_SAYS(kStart + "Quadrilaterals\n1\n1 2 3 4 1\n1 2 3 4 2\nEnd\n", "Quadrilaterals has more numbers than it");
  EXPECT_SAYS(kStart + "7 7 7\n" + element + "End\n", "Vertices has more numbers than it announces");
  EXPECT_SAYS(kStart + element, "it does not finish with End");
  EXPECT_SAYS(kStart + element + "En", "it does not finish with End");
  EXPECT_SAYS(kStart + element + element + "End\n", "Quadrilaterals occurs twice");
  EXPECT_EQ(testing::why_not(kStart + element + "# said by hand\nEnd\nnotes after the end"), "it was read");
  const HighOrderMesh mesh = testing::numbered_cells(testing::grid(Filling::Hexahedra, {2, 2, 2}, 1));
  for (const bool swapped : {false, true}) {
    std::string file = file_of(mesh, 2, true, swapped);
    ASSERT_EQ(testing::why_not(file), "it was read");
    const std::size_t count = 28;  // behind the versions, the dimension, and the head of the hexahedra
    const std::size_t low = count + (swapped ? 3 : 0);
    ASSERT_EQ(file[low], 8);
    file[low] = 7;
    EXPECT_SAYS(file, "Hexahedra has more numbers than it announces");
  }
  // Two bytes between the vertices and the end. Each section says where the next one begins.
  std::string file = file_of(mesh, 2, true, false);
  std::int32_t vertices = 0, end = 0;
  std::memcpy(&vertices, file.data() + 24, sizeof vertices);
  std::memcpy(&end, file.data() + vertices + 4, sizeof end);
  file.insert(std::size_t(end), "ab");
  end += 2;
  std::memcpy(file.data() + vertices + 4, &end, sizeof end);
  EXPECT_SAYS(file, "Vertices has 2 bytes more than its count says");
}

TEST(Gmf, BadFilesAreRefused) {
  EXPECT_EQ(testing::why_not(kStart + "Quadrilaterals\n1\n1 2 3 4 1\nCorners\n1\n1\nEnd\n"), "it was read");
  EXPECT_SAYS(kStart + "Quadrilaterals\n1\n1 2 3 5 1\nEnd\n", "have the vertex 5, but vertices are 1 to 4");
  EXPECT_SAYS(kStart + "Quadrilaterals\n2\n1 2 3 4 1\nEnd\n", "an element's vertex");
  EXPECT_SAYS(kStart + "Quadrilaterals\n20000000\n1 2 3 4 1\nEnd\n", "announces");
  EXPECT_SAYS(kStart + "QuadrilateralsQ3\n1\n1 2 3 4 1 1 1 1 1 1 1 1 1 1 1 1 1\nEnd\n",
              "but not QuadrilateralsQ3Ordering");
  EXPECT_SAYS(kStart + "TrianglesP2Ordering\n6\n2 0 0 2 0 0 0 0 2 1 1 0 0 1 1 1 0 1\n", "has a place twice");
  EXPECT_SAYS("MeshVersionFormatted 2\nDimension 4\n", "VariMesh takes 2 and 3");
  EXPECT_SAYS("MeshVersionFormatted 2\nDimension 3\nEnd\n", "it has no Vertices");
  EXPECT_SAYS("MeshVersionFormatted 2\nDimension 2\nVertices\n1\n0 nan 0\nEnd\n", "is not a finite number");
  EXPECT_SAYS(kStart + "BezierBasis\n1\n", "control points");
}

TEST(Gmf, DamagedFilesAreReadOrRefused) {
  const HighOrderMesh mesh = testing::numbered_cells(testing::curved_grid(Filling::Hexahedra, 2));
  for (const bool binary : {false, true}) {
    const std::string whole = file_of(mesh, 3, binary);
    testing::expect_survives_flips(whole, 300);
    testing::expect_refused_if_cut(whole, whole.size() - (binary ? 16 : 5));
  }
}

}  // namespace
}  // namespace varimesh
