// The table of formats: names, endings, and what is no mesh.
#include "core/formats/formats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "tests/core/hdf/program.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

TEST(FormatTable, NamesAreFoundAndListed) {
  EXPECT_EQ(formats::from_name("msh41-binary"), Format::Msh41Binary);
  const auto unknown = formats::from_name("stl");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().kind, Error::Kind::BadOption);
  EXPECT_NE(unknown.error().sentence.find("msh22-binary"), std::string::npos);
  EXPECT_EQ(unknown.error().sentence.find("ism"), std::string::npos) << "it cannot be written";
  for (const auto& chosen : {formats::for_output("o.ism", Format::Auto, Format::Auto),
                             formats::for_output("o", Format::Ism, Format::Auto)}) {
    ASSERT_FALSE(chosen);
    EXPECT_EQ(chosen.error().sentence.find("The format ism can only be read"), 0U) << chosen.error().sentence;
    EXPECT_NE(chosen.error().sentence.find("mfem, nektar, su2"), std::string::npos) << chosen.error().sentence;
  }
}

TEST(FormatTable, EndingsDecide) {
  EXPECT_EQ(formats::for_output("a/b.vtu", Format::Auto, Format::Msh22), Format::Vtu);
  EXPECT_EQ(formats::for_output("a/b.mesh", Format::Auto, Format::Msh22), Format::Mfem);
  EXPECT_EQ(formats::for_output("a/b.xml", Format::Auto, Format::Msh22), Format::Nektar);
  EXPECT_EQ(formats::for_output("b.msh", Format::Auto, Format::Mfem), Format::Msh41Binary);
  EXPECT_EQ(formats::for_output("b.MSH", Format::Auto, Format::Msh22), Format::Msh22);
  EXPECT_EQ(formats::for_output("b.msh", Format::Auto, Format::Auto), Format::Msh41Binary);
  EXPECT_EQ(formats::for_output("b.dat", Format::Msh41, Format::Auto), Format::Msh41);
  EXPECT_EQ(formats::for_output("/dev/null", Format::Auto, Format::Msh22), Format::Msh22);
  EXPECT_FALSE(formats::for_output("b.vtu", Format::Msh41, Format::Auto));
  EXPECT_FALSE(formats::for_output("b.msh", Format::Vtu, Format::Auto));
  EXPECT_EQ(formats::for_output("b.su2", Format::Auto, Format::Auto), Format::Su2);
  EXPECT_FALSE(formats::for_output("b.mesh", Format::Ism, Format::Auto)) << "can only be read";
  EXPECT_EQ(formats::for_output("b.mesh", Format::Auto, Format::Ism), Format::Mfem);
  EXPECT_EQ(formats::for_output("b.h5", Format::Auto, Format::Auto), Format::Hopr);
  EXPECT_EQ(formats::for_output("b.cgns", Format::Auto, Format::Auto), Format::Cgns);
  EXPECT_EQ(formats::for_output("b.pyfrm", Format::Auto, Format::Auto), Format::Pyfr);
  EXPECT_FALSE(formats::for_output("b.stl", Format::Auto, Format::Msh22));
  EXPECT_FALSE(formats::for_output("/dev/shm/b.stl", Format::Auto, Format::Msh22)) << "a folder for files in memory";
}

TEST(FormatTable, RecognisesAFileByItsBeginning) {
  EXPECT_EQ(formats::recognised("MFEM mesh v1.0\n"), Format::Mfem);
  EXPECT_EQ(formats::recognised("<?xml version=\"1.0\"?>\n<NEKTAR>"), Format::Nektar);
  EXPECT_EQ(formats::recognised("24 13 5\n0.5 -0.5 -0.5\n"), Format::Ism);
  EXPECT_EQ(formats::recognised("$MeshFormat\n"), Format::Msh22) << "the first of the family";
  EXPECT_EQ(formats::recognised("<VTKFile type=\"UnstructuredGrid\">"), Format::Vtu);
}

TEST(FormatTable, HasEveryFormatOnceByItsName) {
  std::size_t readable = 0;
  for (const formats::FormatInfo& info : formats::all()) {
    EXPECT_EQ(formats::from_name(info.name), info.format);
    readable += info.readable ? 1 : 0;
  }
  EXPECT_EQ(formats::all().size(), 15U);
  EXPECT_EQ(readable, 13U);
  EXPECT_EQ(formats::from_name("auto"), Format::Auto);
  EXPECT_EQ(formats::from_name(""), Format::Auto);
}

/// Files of formats that are only read cannot be made here: tests of their own make them. Whoever adds one adds it
/// here, and such a test: of files that are damaged, that stop, and whose coordinates are not finite.
TEST(FormatTable, FormatsThatAreOnlyReadHaveTestsOfTheirOwn) {
  std::set<std::string> only_read;
  for (const formats::FormatInfo& info : formats::all())
    if (info.readable && !info.writable) only_read.emplace(info.name);
  const std::map<std::string, const char*> tests = {{"abaqus", "tests/core/formats/abaqus/abaqus_test.cpp"},
                                                    {"exodus", "tests/core/hdf/exodus_test.cpp"},
                                                    {"gmf", "tests/core/formats/gmf/gmf_test.cpp"},
                                                    {"ism", "tests/core/formats/ism/ism_test.cpp"}};
  std::set<std::string> tested;
  for (const auto& [name, file] : tests) {
    tested.insert(name);
    EXPECT_NE(test::slurp(test::source_file(file)).find("not a finite number"), std::string::npos) << file;
  }
  EXPECT_EQ(only_read, tested);
}

TEST(Read, StopsInEveryFormatThatIsWritten) {
  const HighOrderMesh plane = testing::grid(testing::Filling::Triangles, {40, 40, 1}, 2);
  const HighOrderMesh solid = testing::grid(testing::Filling::Hexahedra, {8, 8, 8}, 2);
  const StopToken stop([] { return true; });
  const bool hdf5 = testing::use_hdf5();
  for (const formats::FormatInfo& info : formats::all()) {
    if (!info.readable || !info.writable) continue;
    if (!hdf5 && (info.format == Format::Hopr || info.format == Format::Cgns)) continue;
    const HighOrderMesh& mesh = info.format == Format::Hopr ? solid : plane;
    const std::string bytes = test::written(mesh, info.format);
    EXPECT_TRUE(formats::read(bytes, 1)) << info.name;
    const auto stopped = formats::read(bytes, 1, &stop);
    ASSERT_FALSE(stopped) << info.name;
    EXPECT_NE(stopped.error().sentence.find("stopped before its end"), std::string::npos) << info.name;
  }
}

TEST(Read, RefusesCoordinatesThatAreNotFinite) {
  const bool hdf5 = testing::use_hdf5();
  for (const formats::FormatInfo& info : formats::all()) {
    if (!info.readable || !info.writable) continue;
    if (!hdf5 && (info.format == Format::Hopr || info.format == Format::Cgns)) continue;
    for (const double wrong : {std::nan(""), HUGE_VAL, -HUGE_VAL})
      for (const int threads : {1, 3}) {
        HighOrderMesh mesh = testing::grid(testing::Filling::Hexahedra, {2, 2, 2}, 2);
        ASSERT_TRUE(formats::read(test::written(mesh, info.format))) << info.name;
        mesh.coordinates[1] = wrong;  // of a vertex, which every format has
        const auto file = formats::read(test::written(mesh, info.format), threads);
        ASSERT_FALSE(file) << info.name << " " << wrong;
        const std::string& sentence = file.error().sentence;
        EXPECT_NE(
            sentence.find("has a coordinate that is not a finite number; let the program that made the mesh write "
                          "it again"),
            std::string::npos)
            << info.name << ": " << sentence;
        EXPECT_TRUE(sentence.find(", byte ") != std::string::npos || sentence.find("(byte ") != std::string::npos ||
                    sentence.find("(row ") != std::string::npos)
            << info.name << ": " << sentence;
        const bool msh = info.extension == ".msh";
        if (msh) {
          EXPECT_NE(sentence.find("node " + std::to_string(mesh.node_numbers.front()) + " has"), std::string::npos)
              << sentence;
        }
      }
  }
}

TEST(Write, TakesTheBinaryMshFormatByDefault) {
  const HighOrderMesh mesh = test::one_cell(Shape::Triangle, 2);
  EXPECT_EQ(test::written(mesh, Format::Auto), test::written(mesh, Format::Msh41Binary));
}

}  // namespace
}  // namespace varimesh
