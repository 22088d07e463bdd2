// Files that are read and written in pieces by several threads: the same mesh, the same bytes and the same errors as by
// one thread, and the same mesh as the plain reader reads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>

#include "core/formats/formats.h"
#include "tests/core/support/meshes.h"

namespace varimesh::formats {
namespace {

using testing::Filling;

constexpr int kThreads[] = {1, 2, 3, 8};
constexpr Format kMsh[] = {Format::Msh22, Format::Msh22Binary, Format::Msh41, Format::Msh41Binary};

/// Whether our own code writes the format. The program of HDF5 writes the others, with one thread.
bool is_written_here(const FormatInfo& info) {
  return info.writable && info.format != Format::Hopr && info.format != Format::Cgns && info.format != Format::Pyfr;
}

std::string name_of(Format format) {
  for (const FormatInfo& info : all())
    if (info.format == format) return std::string(info.name);
  return "auto";
}

// Several pieces of nodes and elements in every format. Some elements are in two groups, some nodes have no element,
// and the numbers have gaps.
HighOrderMesh large_mesh() {
  HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {28, 20, 20}, 2, testing::bent(3));
  std::vector<ElementBlock> blocks;
  for (ElementBlock& block : mesh.blocks) {
    const auto nodes = static_cast<std::ptrdiff_t>(block.nodes.size() / block.size());
    const auto half = static_cast<std::ptrdiff_t>(block.size() / 2);
    ElementBlock rest = block;
    rest.numbers.erase(rest.numbers.begin(), rest.numbers.begin() + half);
    rest.nodes.erase(rest.nodes.begin(), rest.nodes.begin() + half * nodes);
    block.numbers.resize(static_cast<std::size_t>(half));
    block.nodes.resize(static_cast<std::size_t>(half * nodes));
    rest.entity += 100;
    rest.physical.push_back(77);
    rest.physical.push_back(78);
    if (half > 0) blocks.push_back(std::move(block));
    blocks.push_back(std::move(rest));
  }
  mesh.blocks = std::move(blocks);
  for (std::int64_t& number : mesh.node_numbers) number += number / 1000;
  mesh.coordinates.insert(mesh.coordinates.end(), {1e300, -1e-300, 1.0 / 3});
  mesh.node_numbers.push_back(mesh.node_numbers.back() + 10);
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  return mesh;
}

std::string written(const HighOrderMesh& mesh, Format format, int threads) {
  std::string bytes;
  const auto done = write(
      mesh, format,
      [&](std::string_view piece) {
        bytes += piece;
        return true;
      },
      {}, threads);
  EXPECT_TRUE(done) << done.error().sentence;
  return bytes;
}

void expect_same(const HighOrderMesh& a, const HighOrderMesh& b) {
  // Bit for bit, since a damaged file may have coordinates that are not numbers.
  ASSERT_EQ(a.coordinates.size(), b.coordinates.size());
  EXPECT_EQ(std::memcmp(a.coordinates.data(), b.coordinates.data(), 8 * a.coordinates.size()), 0);
  EXPECT_EQ(a.node_numbers, b.node_numbers);
  ASSERT_EQ(a.blocks.size(), b.blocks.size());
  for (std::size_t k = 0; k < a.blocks.size(); ++k) {
    EXPECT_EQ(a.blocks[k].shape, b.blocks[k].shape);
    EXPECT_EQ(a.blocks[k].order, b.blocks[k].order);
    EXPECT_EQ(a.blocks[k].entity, b.blocks[k].entity);
    EXPECT_EQ(a.blocks[k].physical, b.blocks[k].physical);
    EXPECT_EQ(a.blocks[k].partitions, b.blocks[k].partitions);
    EXPECT_EQ(a.blocks[k].numbers, b.blocks[k].numbers);
    EXPECT_EQ(a.blocks[k].repeat_numbers, b.blocks[k].repeat_numbers);
    EXPECT_EQ(a.blocks[k].nodes, b.blocks[k].nodes);
  }
}

// The same text with one number on each line of nodes and elements. Such lines are no records, so no piece of them can
// be read, and the plain reader reads all.
std::string one_number_per_line(std::string text) {
  for (const std::string section : {"Nodes", "Elements"}) {
    const std::size_t begin = text.find("$" + section), end = text.find("$End" + section);
    std::replace(text.begin() + static_cast<std::ptrdiff_t>(begin), text.begin() + static_cast<std::ptrdiff_t>(end),
                 ' ', '\n');
  }
  return text;
}

TEST(Pieces, AreWrittenAsOneThreadWritesThem) {
  const HighOrderMesh mesh = large_mesh();
  for (const FormatInfo& format : all()) {
    if (!is_written_here(format)) continue;
    const std::string one = written(mesh, format.format, 1);
    EXPECT_GT(one.size(), 3U << 19) << "the test needs several pieces";
    for (const int threads : kThreads)
      EXPECT_EQ(written(mesh, format.format, threads), one) << format.name << ", " << threads << " threads";
  }
}

TEST(Pieces, GiveTheMeshThatThePlainReaderReads) {
  const HighOrderMesh mesh = large_mesh();
  for (const Format format : {Format::Msh22, Format::Msh41}) {
    const std::string text = written(mesh, format, 1);
    const Format binary = format == Format::Msh22 ? Format::Msh22Binary : Format::Msh41Binary;
    const auto plain = read(one_number_per_line(text), 1);
    ASSERT_TRUE(plain) << plain.error().sentence;
    for (const int threads : kThreads)
      for (const std::string& bytes : {text, written(mesh, binary, 1)}) {
        const auto file = read(bytes, threads);
        ASSERT_TRUE(file) << file.error().sentence;
        expect_same(file->mesh, plain->mesh);
      }
  }
}

TEST(Pieces, KeepRepeatedElementsTogetherWhereverTheyAreCut) {
  // Elements of growing size, so that pieces end at every place among three repetitions.
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {14, 14, 14}, 3);
  for (ElementBlock& block : mesh.blocks) block.physical = {1, 2, 3};
  for (const Format format : {Format::Msh22, Format::Msh22Binary}) {
    const std::string bytes = written(mesh, format, 1);
    for (const int threads : kThreads) {
      const auto file = read(bytes, threads);
      ASSERT_TRUE(file) << file.error().sentence;
      ASSERT_EQ(file->mesh.blocks.size(), mesh.blocks.size());
      for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
        EXPECT_EQ(file->mesh.blocks[b].physical, mesh.blocks[b].physical);
        EXPECT_EQ(file->mesh.blocks[b].numbers, mesh.blocks[b].numbers);
        EXPECT_EQ(file->mesh.blocks[b].nodes, mesh.blocks[b].nodes);
      }
    }
  }
}

// Every element in one group of the file, as other writers than Gmsh make it.
TEST(Pieces, BeginInsideGroupsOfBinaryElements) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {16, 16, 16}, 2);
  std::erase_if(mesh.blocks, [](const ElementBlock& block) { return block.shape != Shape::Tetrahedron; });
  ASSERT_EQ(mesh.blocks.size(), 1U);
  mesh.blocks[0].physical = {5};
  const std::string bytes = written(mesh, Format::Msh22Binary, 1);
  const std::size_t begin = bytes.find('\n', bytes.find("$Elements\n") + 10) + 1, end = bytes.find("\n$EndElements");
  const std::size_t record = (end - begin) / mesh.blocks[0].size();
  std::string grouped = bytes.substr(0, begin) + bytes.substr(begin, 4);
  const auto count = static_cast<std::int32_t>(mesh.blocks[0].size());
  grouped.append(reinterpret_cast<const char*>(&count), 4);
  grouped += bytes.substr(begin + 8, 4);
  for (std::size_t at = begin; at < end; at += record) grouped += bytes.substr(at + 12, record - 12);
  for (const std::string& tail : {bytes.substr(end), std::string()}) {  // whole, and cut off
    const auto one = read(grouped + tail, 1);
    EXPECT_EQ(one.has_value(), !tail.empty());
    for (const int threads : kThreads) {
      const auto several = read(grouped + tail, threads);
      ASSERT_EQ(several.has_value(), one.has_value());
      if (one)
        expect_same(several->mesh, mesh);
      else
        EXPECT_EQ(several.error().sentence, one.error().sentence);
    }
  }
}

TEST(Pieces, ReportTheFirstFaultOfTheFile) {
  const HighOrderMesh mesh = large_mesh();
  std::mt19937 random(3);
  int refused = 0;
  for (const Format format : kMsh) {
    const std::string bytes = written(mesh, format, 1);
    for (int trial = 0; trial < 12; ++trial) {
      std::string damaged = bytes;
      for (int k = 0; k < 3; ++k) damaged[200 + random() % (damaged.size() - 200)] = static_cast<char>(random() % 128);
      if (trial % 4 == 3) damaged.resize(damaged.size() / 2 + random() % 1000);
      const auto one = read(damaged, 1);
      refused += one ? 0 : 1;
      for (const int threads : {2, 3, 8}) {
        const auto several = read(damaged, threads);
        ASSERT_EQ(several.has_value(), one.has_value()) << name_of(format) << ", trial " << trial;
        if (one)
          expect_same(several->mesh, one->mesh);
        else
          EXPECT_EQ(several.error().sentence, one.error().sentence) << name_of(format) << ", trial " << trial;
      }
    }
  }
  EXPECT_GT(refused, 20) << "the test must damage files";
}

TEST(Pieces, NameTheLineAndTheNodeOfAFault) {
  const HighOrderMesh mesh = large_mesh();
  std::string text = written(mesh, Format::Msh22, 1);
  const std::size_t nodes = text.find("$Nodes\n"), place = text.find("\n60060 ", nodes) + 1;
  const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(place), '\n');
  text[place + 7] = 'x';
  for (const int threads : kThreads) {
    const auto file = read(text, threads);
    ASSERT_FALSE(file);
    EXPECT_NE(file.error().sentence.find("in $Nodes, line " + std::to_string(line) + ","), std::string::npos)
        << file.error().sentence;
  }
}

TEST(Pieces, StopWhenTheSinkStops) {
  const HighOrderMesh mesh = large_mesh();
  for (const FormatInfo& format : all())
    for (const int threads : kThreads) {
      if (!is_written_here(format)) continue;
      int calls = 0;
      const auto done = write(
          mesh, format.format, [&](std::string_view) { return ++calls < 3; }, {}, threads);
      ASSERT_FALSE(done) << format.name;
      EXPECT_EQ(done.error().kind, Error::Kind::Output);
      EXPECT_EQ(calls, 3) << "a sink that has refused a piece gets no more";
    }
}

}  // namespace
}  // namespace varimesh::formats
