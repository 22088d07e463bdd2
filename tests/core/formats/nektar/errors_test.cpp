// Bad files of Nektar++ are refused with a sentence that says what is wrong and where.
#include <gtest/gtest.h>

#include "core/formats/xml/encoding.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

/// Two triangles. Each part may be replaced.
struct Parts {
  std::string head = "<?xml version=\"1.0\"?>\n<NEKTAR>\n<GEOMETRY DIM=\"2\" SPACE=\"2\">\n";
  std::string vertices =
      "<VERTEX>\n<V ID=\"0\">0 0 0</V><V ID=\"1\">1 0 0</V>\n<V ID=\"2\">1 1 0</V><V ID=\"3\">0 1 0</V>\n</VERTEX>\n";
  std::string edges =
      "<EDGE><E ID=\"0\">0 1</E><E ID=\"1\">1 2</E><E ID=\"2\">2 0</E><E ID=\"3\">2 3</E><E ID=\"4\">3 0</E></EDGE>\n";
  std::string elements = "<ELEMENT><T ID=\"0\">0 1 2</T><T ID=\"1\">2 3 4</T></ELEMENT>\n";
  std::string curved =
      "<CURVED><E ID=\"0\" EDGEID=\"0\" NUMPOINTS=\"3\" TYPE=\"PolyEvenlySpaced\">0 0 0 .5 -.1 0 1 0 0</E></CURVED>\n";
  std::string composites = "<COMPOSITE><C ID=\"1\"> T[0-1] </C><C ID=\"2\"> E[0,3] </C></COMPOSITE>\n";
  std::string tail = "<DOMAIN> C[1] </DOMAIN>\n</GEOMETRY>\n</NEKTAR>\n";

  std::string whole() const { return head + vertices + edges + elements + curved + composites + tail; }
};

std::string with(std::string Parts::*part, const std::string& text) {
  Parts parts;
  parts.*part = text;
  return parts.whole();
}

TEST(NektarErrors, ReadsTheMeshThatTheyDamage) {
  const auto file = formats::read(Parts().whole());
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_EQ(file->format, Format::Nektar);
  EXPECT_EQ(file->mesh.order, 2);
  EXPECT_EQ(file->mesh.element_count(2), 2U);
  EXPECT_EQ(file->mesh.element_count(1), 2U);
}

TEST(NektarErrors, KindsOfFilesThatAreNotTaken) {
  EXPECT_SAYS("<NEKTAR></NEKTAR>", "no GEOMETRY");
  EXPECT_SAYS(with(&Parts::head, "<NEKTAR><GEOMETRY DIM=\"1\">"), "dimension 1");
  EXPECT_SAYS(with(&Parts::head, "<NEKTAR><GEOMETRY DIM=\"2\" HDF5FILE=\"a.nekg\">"), "NekMesh");
  EXPECT_SAYS(with(&Parts::head, "<NEKTAR><GEOMETRY>"), "attribute DIM is missing");
  EXPECT_SAYS(with(&Parts::vertices, "<VERTEX XSCALE=\"2\"></VERTEX>"), "XSCALE");
  EXPECT_SAYS("<?xml version=\"1.0\"?>\n<!DOCTYPE a [<!ENTITY b \"c\">]><NEKTAR>&b;</NEKTAR>", "document type");
}

TEST(NektarErrors, CoordinatesThatAreNotFinite) {
  const std::string fault = " has a coordinate that is not a finite number";
  EXPECT_SAYS(with(&Parts::vertices, "<VERTEX>\n<V ID=\"0\">0 0 0</V>\n<V ID=\"1\">nan 0 0</V></VERTEX>"),
              "vertex 1" + fault);
  EXPECT_SAYS(with(&Parts::curved,
                   "<CURVED><E ID=\"0\" EDGEID=\"0\" NUMPOINTS=\"3\" TYPE=\"PolyEvenlySpaced\">0 0 0 .5 inf 0 1 0 0</E>"
                   "</CURVED>"),
              "a point of a curve" + fault);
}

TEST(NektarErrors, NamesTheLine) { EXPECT_SAYS(with(&Parts::edges, "<EDGE><E ID=\"0\">0 b</E>"), "line 8"); }

TEST(NektarErrors, WrongIndices) {
  EXPECT_SAYS(with(&Parts::edges, "<EDGE><E ID=\"0\">0 7</E></EDGE>"), "refers to vertex 7, which is not in the file");
  EXPECT_SAYS(with(&Parts::edges, "<EDGE><E ID=\"0\">1 1</E></EDGE>"), "the same vertex twice");
  EXPECT_SAYS(with(&Parts::elements, "<ELEMENT><T ID=\"0\">0 1 9</T></ELEMENT>"), "refers to edge 9");
  EXPECT_SAYS(with(&Parts::elements, "<ELEMENT><T ID=\"0\">0 1 3</T></ELEMENT>"), "do not go around");
  EXPECT_SAYS(with(&Parts::elements, "<ELEMENT><T ID=\"0\">0 1 2</T><T ID=\"0\">2 3 4</T></ELEMENT>"), "occurs twice");
  EXPECT_SAYS(with(&Parts::elements, "<ELEMENT><A ID=\"0\">0 1 2 3</A></ELEMENT>"), "no shape of dimension 2");
  EXPECT_SAYS(with(&Parts::composites, "<COMPOSITE><C ID=\"1\"> T[0-2] </C></COMPOSITE>"), "T[2]");
  EXPECT_SAYS(with(&Parts::composites, "<COMPOSITE><C ID=\"1\"> T[0] E[1] </C></COMPOSITE>"), "mixes dimensions");
  EXPECT_SAYS(with(&Parts::composites, "<COMPOSITE><C ID=\"1\"> T[3-0] </C></COMPOSITE>"), "backwards");
  EXPECT_SAYS(with(&Parts::composites, "<COMPOSITE><C ID=\"1\"> T0 </C></COMPOSITE>"), "a list such as");
}

TEST(NektarErrors, WrongCurves) {
  const auto curve = [](const std::string& attributes, const std::string& points) {
    return with(&Parts::curved, "<CURVED><E ID=\"0\" " + attributes + ">" + points + "</E></CURVED>");
  };
  const std::string good = "0 0 0 .5 -.1 0 1 0 0", type = " TYPE=\"PolyEvenlySpaced\"";
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"3\"" + type, good), "it was read");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"3\"" + type, "0 0 0 .5 -.1 0 1.0000015 0 0"), "it was read");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"3\"" + type, "0 0 0 .5 -.1 0 1.0001 0 0"), "does not meet its vertices");
  EXPECT_SAYS(curve("EDGEID=\"8\" NUMPOINTS=\"3\"" + type, good), "an edge that is not in the file");
  EXPECT_SAYS(curve("EDGEID=\"1\" NUMPOINTS=\"3\"" + type, good), "does not meet its vertices");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"4\"" + type, good), "a coordinate of a curve should follow");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"2\"" + type, good), "more numbers follow");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"999999999999\"" + type, good), "larger than the number of points");
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"3\" TYPE=\"Fourier\"", good), "'Fourier'");
  std::string many;
  for (int k = 0; k <= 11; ++k) many += std::to_string(k / 11.0) + " 0 0 ";
  EXPECT_SAYS(curve("EDGEID=\"0\" NUMPOINTS=\"12\"" + type, many), "order 1 to 10");
}

TEST(NektarErrors, CurvesWhosePointsAreMissing) {
  // A curve that refers to points of a list that is not there.
  constexpr std::int64_t kEvenlySpaced = 17;
  const auto packed = [](std::int64_t edge) {
    const std::int64_t record[] = {0, edge, 3, 0, 0, kEvenlySpaced};
    std::string stream, text;
    formats::deflate_zlib({reinterpret_cast<const char*>(record), sizeof record}, stream, 6);
    formats::encode_base64(stream, text);
    return "<CURVED COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\"><E>" + text + "</E></CURVED>\n";
  };
  const std::string two_of_one =
      "<CURVED><E ID=\"0\" EDGEID=\"0\" NUMPOINTS=\"3\" TYPE=\"PolyEvenlySpaced\">0 0 0 .5 -.1 0 1 0 0</E>"
      "<E ID=\"1\" EDGEID=\"0\" NUMPOINTS=\"3\" TYPE=\"PolyEvenlySpaced\">0 0 0 .5 -.2 0 1 0 0</E></CURVED>\n";
  EXPECT_SAYS(with(&Parts::curved, packed(1)), "refers to point 2, but there are 0");
  // After a curve of text, also where the points of the text would do.
  for (const std::int64_t edge : {0, 1})
    EXPECT_SAYS(with(&Parts::curved, Parts().curved + packed(edge)), "others refer to a list of points");
  EXPECT_SAYS(with(&Parts::curved, two_of_one), "it was read");
}

TEST(NektarErrors, TheFirstFaultIsSaidForAnyNumberOfThreads) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Quadrilaterals, {160, 100, 1}, 2, testing::bent(2));
  mesh.foreign.push_back({"text", "", "nektar"});
  std::string bytes = test::written(mesh, Format::Nektar);
  // Threads take 4,096 curves at a time. All but the first thread meet their fault at once.
  std::size_t at = bytes.find("<CURVED>"), first = 0;
  const std::size_t end = bytes.find("</CURVED>");
  for (int curve = 1; (at = bytes.find("<E ", at)) < end; ++curve) {
    at = bytes.find_first_not_of(" \n", bytes.find('>', at) + 1);
    if (curve == 4000) first = at;
    if (curve == 4000 || (curve > 1 && curve % 4096 == 1)) bytes[at] = 'x';
  }
  ASSERT_GT(first, 0U);
  const auto one = formats::read(bytes, 1);
  ASSERT_FALSE(one);
  EXPECT_NE(one.error().sentence.find("a coordinate of a curve was expected"), std::string::npos)
      << one.error().sentence;
  for (int trial = 0; trial < 10; ++trial) {
    const auto several = formats::read(bytes, 4);
    ASSERT_FALSE(several);
    EXPECT_EQ(several.error().sentence, one.error().sentence);
  }
}

TEST(NektarErrors, DamagedCompressedLists) {
  const auto packed = [](const std::string& text) {
    return with(&Parts::vertices, "<VERTEX COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">" + text + "</VERTEX>");
  };
  EXPECT_SAYS(packed("%%%"), "not base64");
  EXPECT_SAYS(packed("AAAA"), "damaged or incomplete");
  std::string stream, text;
  formats::deflate_zlib("1234567", stream, 6);
  formats::encode_base64(stream, text);
  EXPECT_SAYS(packed(text), "no multiple of 32");
  EXPECT_SAYS(with(&Parts::vertices, "<VERTEX COMPRESSED=\"gz\"></VERTEX>"), "compression is not");
}

TEST(NektarErrors, AFewBytesNeverTakeMuchMemory) {
  // A gigabyte of zeros, compressed.
  const std::string zeros(std::size_t(1) << 28, '\0');
  std::string stream, text;
  formats::deflate_zlib(zeros, stream, 9);
  formats::encode_base64(stream, text);
  EXPECT_SAYS(with(&Parts::vertices, "<VERTEX COMPRESSED=\"B64Z-LittleEndian\">" + text + "</VERTEX>"),
              "8 times the memory of the file");
  std::string deep;
  for (int k = 0; k < 100; ++k) deep += "<a>";
  EXPECT_SAYS("<NEKTAR>" + deep, "nested too deeply");
}

// === Damaged files =======================================================================================

std::vector<std::string> sound_files() {
  std::vector<std::string> files{Parts().whole()};
  HighOrderMesh mesh = testing::grid(testing::Filling::MixedSolid, {3, 1, 1}, 3);
  files.push_back(test::written(mesh, Format::Nektar));
  mesh.foreign.push_back({"text", "", "nektar"});
  files.push_back(test::written(mesh, Format::Nektar));
  return files;
}

TEST(DamagedNektarFile, IsRefusedWhereverItIsCutShort) {
  for (const std::string& whole : sound_files()) testing::expect_refused_if_cut(whole, whole.size());
}

TEST(DamagedNektarFile, IsReadOrRefusedWithFlippedBytes) {
  for (const std::string& whole : sound_files()) testing::expect_survives_flips(whole, 1000);
}

}  // namespace
}  // namespace varimesh
