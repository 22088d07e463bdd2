// Files that announce more than they contain, or that consist of very many very small parts: what reading them takes
// stays within most_memory_to_read(), whether they are read or refused.
#include <gtest/gtest.h>

#include <random>
#include <sstream>
#include <utility>
#include <vector>

#include "core/base/io/allowance.h"
#include "core/formats/formats.h"
#include "core/formats/gmsh/types.h"
#include "core/formats/usual_memory.h"
#include "core/formats/xml/encoding.h"
#include "tests/core/memory/counted_heap.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

struct File {
  std::string name;
  std::string bytes;
};

const std::string kHead22 = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const std::string kHead41 = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
const std::string kNodes22 = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n";
const std::string kNodes41 = "$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n";
const std::string kTriangle22 = "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n";
const std::string kTriangle41 = "$Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n";

/// `make(i)` for 0 ≤ i < count, one after another.
template <class Make>
std::string many(int count, const Make& make) {
  std::string text;
  for (int i = 0; i < count; ++i) text += make(i);
  return text;
}

std::string section(const std::string& name, const std::string& contents) {
  return "$" + name + "\n" + contents + "$End" + name + "\n";
}

std::string number(std::int64_t value) { return std::to_string(value); }

// === MSH ==================================================================================================

std::vector<File> msh_files() {
  constexpr int kMany = 400'000;
  std::vector<File> files;
  // 20,000 groups of one entity, and 20,000 blocks without elements on it.
  files.push_back(
      {"GroupsTimesEmptyBlocks",
       kHead41 +
           section("Entities",
                   "0 0 1 0\n1 0 0 0 1 1 0 20000 " + many(20000, [](int i) { return number(i) + " "; }) + "0\n") +
           kNodes41 +
           section("Elements", "20001 1 1 1\n" + many(20000, [](int) { return "2 1 2 0\n"; }) + "2 1 2 1\n1 1 2 3\n")});
  files.push_back(
      {"EmptyBlocks", kHead41 + kNodes41 + section("Elements", number(kMany + 1) + " 1 1 1\n" + many(kMany, [](int) {
                                                                 return "0 1 15 0\n";
                                                               }) + "2 1 2 1\n1 1 2 3\n")});
  files.push_back(
      {"BlocksOfOneElement",
       kHead41 + kNodes41 + section("Elements", number(kMany) + " " + number(kMany) + " 1 9\n" + many(kMany, [](int i) {
                                                  return "0 " + number(i % 9) + " 15 1\n1 1\n";
                                                }))});
  files.push_back({"NodeBlocks",
                   kHead41 +
                       section("Nodes", number(kMany) + " 3 1 3\n" + many(kMany - 1, [](int) { return "0 1 0 0\n"; }) +
                                            "2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n") +
                       kTriangle41});
  files.push_back({"NodesOfFewBytes", kHead41 +
                                          section("Nodes", "1 400000 1 400000\n2 1 0 400000\n" +
                                                               many(kMany, [](int i) { return number(i + 1) + "\n"; }) +
                                                               many(kMany, [](int) { return "0 0 0\n"; })) +
                                          kTriangle41});
  files.push_back(
      {"ScatteredNodeNumbers",
       kHead22 +
           section("Nodes", number(kMany) + "\n" + many(kMany, [](int i) { return number(1 + 3 * i) + " 0 0 0\n"; })) +
           section("Elements", "1\n1 2 2 1 1 1 4 7\n")});
  files.push_back(
      {"Entities", kHead41 +
                       section("Entities", number(kMany) + " 0 0 0\n" +
                                               many(kMany, [](int i) { return number(i) + " 0 0 0 1 1\n"; })) +
                       kNodes41 + kTriangle41});
  files.push_back(
      {"Links41", kHead41 + kNodes41 + kTriangle41 +
                      section("Periodic", number(kMany) + "\n" + many(kMany, [](int) { return "0 1 1 0 0\n"; }))});
  files.push_back(
      {"Links22", kHead22 + kNodes22 + kTriangle22 +
                      section("Periodic", number(kMany) + "\n" + many(kMany, [](int) { return "0 1 1\n0\n"; }))});
  files.push_back({"LinkedNodes", kHead22 + kNodes22 + kTriangle22 +
                                      section("Periodic", "1\n0 1 1\n" + number(kMany) + "\n" +
                                                              many(kMany, [](int) { return "1 2\n"; }))});
  files.push_back(
      {"AlternatingElements", kHead22 + kNodes22 + section("Elements", number(kMany) + "\n" + many(kMany, [](int i) {
                                                                         return "1 15 2 0 " + number(i % 2) + " 1\n";
                                                                       }))});
  files.push_back({"ManyGroups", kHead22 + kNodes22 + section("Elements", number(kMany) + "\n" + many(kMany, [](int i) {
                                                                            return "1 15 1 " + number(i + 1) + " 1\n";
                                                                          }))});
  files.push_back({"ManyPartitions",
                   kHead22 + kNodes22 + section("Elements", "100000\n" + many(100'000, [](int i) {
                                                              return "1 15 " + number(7 + i % 2) + " 0 1 9 1 1 1 1" +
                                                                     std::string(i % 2 == 0 ? " 1\n" : " 1 1\n");
                                                            }))});
  const std::string cube = number(formats::gmsh_type_number(Shape::Hexahedron, 9));
  const std::string of_cube = many(1000, [](int) { return " 1"; });
  files.push_back({"AnnouncedElements", kHead22 + kNodes22 +
                                            section("Elements", "900000\n" + many(2000,
                                                                                  [&](int i) {
                                                                                    return number(i + 1) + " " + cube +
                                                                                           " 2 1 1" + of_cube + "\n";
                                                                                  })) +
                                            std::string(6'000'000, ' ')});
  files.push_back(
      {"ForeignSections", kHead22 + kNodes22 + kTriangle22 + many(kMany, [](int) { return "$A\n$EndA\n"; })});
  files.push_back(
      {"Names", kHead22 +
                    section("PhysicalNames", number(kMany) + "\n" +
                                                 many(kMany, [](int i) { return "0 " + number(i % 9) + " \"\"\n"; })) +
                    kNodes22 + kTriangle22});
  files.push_back({"NamesWithoutDimension",
                   "$MeshFormat\n2 0 8\n$EndMeshFormat\n" +
                       section("PhysicalNames",
                               number(kMany) + "\n" + many(kMany, [](int i) { return number(i % 9) + " \"a\"\n"; })) +
                       kNodes22 + kTriangle22});
  return files;
}

// === MFEM =================================================================================================

std::vector<File> mfem_files() {
  constexpr int kMany = 300'000;
  const auto mesh = [](const std::string& elements, const std::string& sets, const std::string& boundary,
                       const std::string& rest, int dimension = 2) {
    return "MFEM mesh v1.3\n\ndimension\n" + number(dimension) + "\n\nelements\n" + elements + sets + "\nboundary\n" +
           boundary + "\nvertices\n" + rest + "\nmfem_mesh_end\n";
  };
  const std::string nodes = "\nnodes\nFiniteElementSpace\nFiniteElementCollection: H1_2D_P1\nVDim: 2\nOrdering: 1\n\n";
  const std::string three = "3\n2\n0 0\n1 0\n0 1\n";
  std::vector<File> files;
  files.push_back({"AlternatingAttributes",
                   mesh(number(kMany) + "\n" + many(kMany, [](int i) { return number(1 + i % 2) + " 2 0 1 2\n"; }), "",
                        "0\n", three)});
  files.push_back({"SetsTimesBlocks",
                   mesh(number(20000) + "\n" + many(20000, [](int i) { return number(1 + i % 2) + " 2 0 1 2\n"; }),
                        "\nattribute_sets\n20000\n" + many(20000, [](int) { return "\"\" 2 1 2\n"; }), "0\n", three)});
  files.push_back({"SetsOfManyAttributes", mesh("1\n1 2 0 1 2\n",
                                                "\nattribute_sets\n1\n\"a\" " + number(kMany) + " " +
                                                    many(kMany, [](int i) { return number(i + 1) + " "; }),
                                                "0\n", three)});
  files.push_back(
      {"EmptySets",
       mesh("1\n1 2 0 1 2\n", "\nattribute_sets\n" + number(kMany) + "\n" + many(kMany, [](int) { return "\"\" 0\n"; }),
            "0\n", three)});
  files.push_back(
      {"AnnouncedVertices", mesh("1\n1 2 0 1 2\n", "", "0\n", "2000000\n" + nodes + std::string(4'000'000, ' '))});
  files.push_back({"VerticesOfFewBytes", mesh("1\n1 2 0 1 2\n", "", "0\n",
                                              number(kMany) + "\n" + nodes + many(kMany, [](int) { return "0 0 "; }))});
  std::mt19937 random(7);
  files.push_back({"CubesWithoutCommonEdges",
                   mesh(number(60000) + "\n" +
                            many(60000,
                                 [&](int) {
                                   std::string line = "1 5";
                                   for (int v = 0; v < 8; ++v) line += " " + number(random() % 9999);
                                   return line + "\n";
                                 }),
                        "", "0\n",
                        "10000\n\nnodes\nFiniteElementSpace\nFiniteElementCollection: H1_3D_P1\nVDim: 3\nOrdering: "
                        "1\n\n" +
                            many(10000, [](int) { return "0 0 0 "; }),
                        3)});
  files.push_back(
      {"SidesOfOrderTen",
       mesh("1\n1 5 0 1 2 3 4 5 6 7\n", "", number(kMany) + "\n" + many(kMany, [](int) { return "1 3 0 1 2 3\n"; }),
            "8\n\nnodes\nFiniteElementSpace\nFiniteElementCollection: H1_3D_P10\nVDim: 3\nOrdering: 1\n\n" +
                many(1331, [](int) { return "0 0 0 "; }),
            3)});
  return files;
}

// === The tests ============================================================================================

/// Most bytes that reading holds at a time beside the file.
std::int64_t peak_of_reading(const std::string& bytes, int threads, std::string& outcome) {
  const std::int64_t before = testing::bytes_in_use();
  testing::forget_peak();
  {
    const auto file = formats::read(bytes, threads);
    outcome = file ? "read" : file.error().sentence;
  }
  return testing::peak_bytes() - before;
}

void expect_within_bounds(const std::vector<File>& files) {
  for (const File& file : files)
    for (const int threads : {1, 3}) {
      std::string outcome;
      const std::int64_t peak = peak_of_reading(file.bytes, threads, outcome);
      const auto size = std::int64_t(file.bytes.size());
      EXPECT_LE(peak, formats::most_memory_to_read(size, threads))
          << file.name << ", " << size << " bytes: " << outcome;
      ::testing::Test::RecordProperty(file.name + std::to_string(threads),
                                      std::to_string(size) + " bytes, peak " + std::to_string(peak) + ": " + outcome);
    }
}

TEST(MemoryOfReading, IsBoundedForMshFilesOfManySmallParts) { expect_within_bounds(msh_files()); }

TEST(MemoryOfReading, IsBoundedForMfemFilesOfManySmallParts) { expect_within_bounds(mfem_files()); }

/// A compressed file of Nektar++ with many vertices and nothing else. Their numbers are not consecutive, so the reader
/// sorts them.
File many_packed_vertices() {
  struct Vertex {
    std::int64_t id;
    double x[3];
  };
  constexpr std::int64_t kVertices = 2'000'000;
  std::string list, packed, text;
  list.reserve(kVertices * sizeof(Vertex));
  for (std::int64_t i = 0; i < kVertices; ++i) {
    const Vertex vertex{kVertices - i, {0.25 * double(i % 7), 0.5 * double(i % 3), 0}};
    list.append(reinterpret_cast<const char*>(&vertex), sizeof vertex);
  }
  formats::deflate_zlib(list, packed, 1);
  formats::encode_base64(packed, text);
  return {"nektar-vertices",
          R"(<NEKTAR><GEOMETRY DIM="3" SPACE="3"><VERTEX COMPRESSED="B64Z-LittleEndian" BITSIZE="64">)" + text +
              "</VERTEX></GEOMETRY></NEKTAR>"};
}

TEST(MemoryOfReading, IsBoundedForCompressedNektarFiles) { expect_within_bounds({many_packed_vertices()}); }

TEST(MemoryOfReading, ARefusalSaysWhy) {
  std::string outcome;
  peak_of_reading(msh_files().front().bytes, 1, outcome);
  EXPECT_NE(outcome.find("very many very small parts"), std::string::npos) << outcome;
  EXPECT_NE(outcome.find("in $Elements, line"), std::string::npos) << outcome;
}

/// What a reading gets besides what it may take at first.
struct Asked {
  int times = 0;
  std::int64_t bytes = 0;
};

/// As peak_of_reading(), for a caller who withholds what is seldom needed.
std::int64_t peak_with_claims(const std::string& bytes, int threads, std::string& outcome, Asked& asked) {
  WithheldMemory withheld(formats::seldom_needed_to_read(bytes), [&](std::int64_t more) {
    ++asked.times;
    asked.bytes += more;
    return true;
  });
  const WithheldMemory::Scope scope(&withheld);
  return peak_of_reading(bytes, threads, outcome);
}

void expect_within_claims(const std::vector<File>& files, int& more) {
  for (const File& file : files)
    for (const int threads : {1, 3}) {
      std::string outcome;
      Asked asked;
      const std::int64_t peak = peak_with_claims(file.bytes, threads, outcome, asked);
      const auto size = std::int64_t(file.bytes.size());
      const std::int64_t seldom = formats::seldom_needed_to_read(file.bytes);
      EXPECT_LE(peak, formats::most_memory_to_read(size, threads) - seldom + asked.bytes) << file.name << outcome;
      EXPECT_LE(asked.times, 2) << file.name;
      EXPECT_LE(asked.bytes, seldom) << file.name;
      more += asked.times > 0 ? 1 : 0;
    }
}

TEST(MemoryOfReading, UnusualFilesAskForMoreBeforeTheyTakeIt) {
  int more = 0;
  expect_within_claims(msh_files(), more);
  expect_within_claims(mfem_files(), more);
  EXPECT_GT(more, 0);
}

TEST(MemoryOfReading, EndsIfMoreIsNotGiven) {
  const std::vector<File> files = msh_files();
  for (const File& file : files) {
    int asked = 0;
    WithheldMemory withheld(formats::most_memory_to_read(std::int64_t(file.bytes.size())), [&](std::int64_t) {
      ++asked;
      return false;
    });
    const WithheldMemory::Scope scope(&withheld);
    const auto read = formats::read(file.bytes, 3);
    ASSERT_FALSE(read) << file.name;
    EXPECT_EQ(asked, 1) << file.name;
  }
}

TEST(MemoryOfReading, OrdinaryMeshesTakeWhatIsUsual) {
  for (const testing::Filling filling : testing::kFillings)
    for (const int order : {1, 2, 4})
      for (const formats::FormatInfo& format : formats::all()) {
        // The regular lists of these grids compress to a small part of their size.
        if (!format.readable || format.format == formats::Format::Nektar) continue;
        const int count = testing::is_plane(filling) ? 200 / order : 24 / order;
        const HighOrderMesh mesh =
            testing::grid(filling, {count, count, testing::is_plane(filling) ? 1 : count}, order);
        std::string bytes;
        if (!formats::write(mesh, format.format, [&](std::string_view piece) {
              bytes += piece;
              return true;
            }))
          continue;
        for (const int threads : {1, 3}) {
          std::string outcome;
          Asked asked;
          const std::int64_t peak = peak_with_claims(bytes, threads, outcome, asked);
          const std::int64_t usual = 8 * std::int64_t(bytes.size()) - formats::seldom_needed_to_read(bytes);
          constexpr std::int64_t kPieces = std::int64_t{1} << 20;
          EXPECT_EQ(outcome, "read");
          EXPECT_EQ(asked.times, 0) << format.name << ", order " << order;
          EXPECT_LE(peak, usual + threads * kPieces) << format.name << ", order " << order << ", " << bytes.size();
        }
      }
}

TEST(MemoryOfReading, OrdinaryMeshesTakeFarLessThanTheBound) {
  for (const testing::Filling filling : testing::kFillings)
    for (const int order : {1, 2, 5})
      for (const formats::FormatInfo& format : formats::all()) {
        if (!format.readable) continue;
        const int count = testing::is_plane(filling) ? 100 / order : 16 / order;
        const HighOrderMesh mesh =
            testing::grid(filling, {count, count, testing::is_plane(filling) ? 1 : count}, order);
        std::string bytes, outcome;
        if (!formats::write(mesh, format.format, [&](std::string_view piece) {
              bytes += piece;
              return true;
            }))
          continue;
        const std::int64_t peak = peak_of_reading(bytes, 1, outcome);
        // VTK's cells do not have the inner nodes of such pyramids.
        if (outcome.find("is a pyramid of order 5") != std::string::npos) continue;
        EXPECT_EQ(outcome, "read");
        // The regular lists of these grids compress to a small part of their size, so compressed files have the bound
        // of all files.
        const bool compressed = format.format == formats::Format::Nektar || format.format == formats::Format::Vtu;
        const double most = compressed ? 8 * double(bytes.size()) + (64 << 20) : 4 * double(bytes.size()) + (4 << 20);
        EXPECT_LT(double(peak), most) << format.name;
      }
}

}  // namespace
}  // namespace varimesh
