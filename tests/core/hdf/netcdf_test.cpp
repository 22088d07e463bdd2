// Exodus files in the kinds of netCDF before HDF5. The writer here has the layout of the format's specification.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/check.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/listed_elements.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

enum Type : std::uint8_t { kByte = 1, kChar = 2, kShort = 3, kInt = 4, kFloat = 5, kDouble = 6, kInt64 = 10 };

std::string big_endian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += char(value >> unsigned(8 * i) & 0xffU);
  return text;
}

struct Variable {
  std::string name;
  std::vector<int> dimensions;
  Type type;
  std::string values;  ///< Big-endian.
  std::string text_attribute, text;
};

/// A netCDF file: its dimensions (0 grows) and its variables.
class NetCdf {
 public:
  explicit NetCdf(int version) : version_(version) {}
  int dimension(std::int64_t length) {
    lengths_.push_back(length);
    return int(lengths_.size()) - 1;
  }
  void add(Variable variable) { variables_.push_back(std::move(variable)); }
  void integers(const std::string& name, std::vector<int> dimensions, const std::vector<std::int64_t>& values,
                Type type, const std::string& attribute = "", const std::string& text = "") {
    const int bytes = type == kInt64 ? 8 : type == kShort ? 2 : type == kByte ? 1 : 4;
    std::string all;
    for (const std::int64_t value : values) all += big_endian(std::uint64_t(value), bytes);
    add({name, std::move(dimensions), type, all, attribute, text});
  }
  void doubles(const std::string& name, std::vector<int> dimensions, const std::vector<double>& values) {
    std::string all;
    for (const double value : values) all += big_endian(std::bit_cast<std::uint64_t>(value), 8);
    add({name, std::move(dimensions), kDouble, all, "", ""});
  }

  std::string bytes() const {
    std::vector<std::uint64_t> begins(variables_.size(), 0);
    std::uint64_t at = header(begins).size();
    for (std::size_t v = 0; v < variables_.size(); ++v) {
      begins[v] = at;
      at += padded(variables_[v].values).size();
    }
    std::string all = header(begins);
    for (const Variable& variable : variables_) all += padded(variable.values);
    return all;
  }

 private:
  std::string count(std::uint64_t n) const { return big_endian(n, version_ == 5 ? 8 : 4); }
  static std::string padded(std::string text) {
    text.resize((text.size() + 3) / 4 * 4, '\0');
    return text;
  }
  std::string name(const std::string& text) const { return count(text.size()) + padded(text); }
  std::string list(int kind, std::size_t length) const {
    return big_endian(length == 0 ? 0 : std::uint64_t(kind), 4) + count(length);
  }
  std::string attribute(const std::string& called, const std::string& text) const {
    return list(12, 1) + name(called) + big_endian(kChar, 4) + name(text);
  }
  std::string header(const std::vector<std::uint64_t>& begins) const {
    std::string all = std::string("CDF") + char(version_) + count(0) + list(10, lengths_.size());
    for (std::size_t d = 0; d < lengths_.size(); ++d)
      all += name("d" + std::to_string(d)) + count(std::uint64_t(lengths_[d]));
    all += attribute("title", "made by a test") + list(11, variables_.size());
    for (std::size_t v = 0; v < variables_.size(); ++v) {
      const Variable& variable = variables_[v];
      all += name(variable.name) + count(variable.dimensions.size());
      for (const int d : variable.dimensions) all += count(std::uint64_t(d));
      all += variable.text_attribute.empty() ? list(12, 0) : attribute(variable.text_attribute, variable.text);
      all += big_endian(variable.type, 4) + count(padded(variable.values).size()) +
             big_endian(begins[v], version_ == 1 ? 4 : 8);
    }
    return all;
  }

  const int version_;
  std::vector<std::int64_t> lengths_;
  std::vector<Variable> variables_;
};

/// One hexahedron of order 1, bent by nothing, in a block with the id 40 and the name "fluid", and its bottom and top.
std::string hexahedron(int version, Type type = kInt) {
  NetCdf file(version);
  const int grows = file.dimension(0), nodes = file.dimension(8), one = file.dimension(1), letters = file.dimension(6),
            two = file.dimension(2);
  file.doubles("time_whole", {grows}, {});
  file.doubles("coordx", {nodes}, {0, 1, 1, 0, 0, 1, 1, 0});
  file.doubles("coordy", {nodes}, {0, 0, 1, 1, 0, 0, 1, 1});
  file.doubles("coordz", {nodes}, {0, 0, 0, 0, 1, 1, 1, 1.5});
  file.integers("eb_prop1", {one}, {40}, kInt, "name", "ID");
  file.add({"eb_names", {one, letters}, kChar, std::string("fluid\0", 6), "", ""});
  file.integers("connect1", {one, nodes}, {1, 2, 3, 4, 5, 6, 7, 8}, type, "elem_type", "HEX8");
  file.integers("ss_prop1", {one}, {7}, kInt);
  file.integers("elem_ss1", {two}, {1, 1}, type);
  file.integers("side_ss1", {two}, {5, 6}, type);
  return file.bytes();
}

TEST(NetCdf, EveryKindIsRead) {
  NEEDS_HDF5();
  for (const auto& [version, type] : {std::pair{1, kInt}, {2, kInt}, {5, kInt64}, {1, kShort}, {2, kByte}}) {
    const auto file = formats::read(hexahedron(version, type));
    ASSERT_TRUE(file) << file.error().sentence;
    EXPECT_EQ(file->format, formats::Format::Exodus);
    const HighOrderMesh& mesh = file->mesh;
    EXPECT_TRUE(check_structure(mesh));
    EXPECT_EQ(mesh.element_count(3), 1U);
    EXPECT_EQ(mesh.element_count(2), 2U);
    ASSERT_EQ(mesh.node_count(), 8U);
    EXPECT_EQ(mesh.coordinates[3 * 7 + 2], 1.5);
    std::vector<std::string> names;
    for (const PhysicalGroup& group : mesh.physical_groups) names.push_back(group.name);
    EXPECT_EQ(names, (std::vector<std::string>{"fluid", "side_set_7"})) << "version " << version;
  }
}

TEST(NetCdf, IsRefusedWhereverItIsCutShort) {
  NEEDS_HDF5();
  const std::string whole = hexahedron(2);
  ASSERT_EQ(testing::why_not(whole), "it was read");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto file = formats::read(whole.substr(0, size));
    ASSERT_FALSE(file) << "cut at byte " << size;
    EXPECT_GT(file.error().sentence.size(), 20U) << "cut at byte " << size;
  }
}

TEST(NetCdf, IsReadOrRefusedWithFlippedBytes) {
  NEEDS_HDF5();
  for (const int version : {1, 5}) testing::expect_survives_flips(hexahedron(version), 150);
}

TEST(NetCdf, SizesThatOverflowAreRefused) {
  NEEDS_HDF5();
  const std::string whole = hexahedron(5, kInt64);
  // CDF-5 has numbers of eight bytes. A name of at most four letters takes 12.
  constexpr std::size_t kDimensions = 16, kFirst = 24, kEach = 20, kLength = 12;
  const auto length_of = [](std::size_t dimension) { return kFirst + dimension * kEach + kLength; };
  const std::size_t ranks = whole.find("coordx") + 8, array = whole.find("connect1") + 8,
                    attribute = whole.find("elem_type") + 12, type = ranks + 8 + 8 + 12;
  constexpr std::uint64_t kHalf = std::uint64_t{1} << 63U, kAll = ~std::uint64_t{0}, kMost = kHalf - 1;
  const auto says = [&](std::size_t at, std::uint64_t value, const std::string& words) {
    EXPECT_SAYS(std::string(whole).replace(at, 8, big_endian(value, 8)), words) << " at byte " << at;
  };
  for (const std::uint64_t size : {kHalf, kAll, kAll - 2, kMost}) {
    says(kDimensions, size, "ends within its header");
    says(kFirst, size, "ends within its header");
    says(ranks, size, "has an array with a dimension that does not exist");
    says(ranks + 8, size, "has an array with a dimension that does not exist");
    says(attribute + 4, size, "ends within its header");
    says(type + 4 + 8, size, "ends before the values of 'coordx'");
  }
  for (const std::uint64_t size : {kHalf, kAll}) says(length_of(1), size, "has a dimension that is too long");
  // The number of nodes is the number of values of coordx, and of those in a row of connect1.
  for (const std::uint64_t nodes : {kMost, kMost / 8 + 1, kHalf / 2, kHalf / 4, std::uint64_t{1} << 40U})
    says(length_of(1), nodes, "is damaged");
  // Two such dimensions in an array that is read first.
  std::string both = whole;
  both.replace(length_of(1), 8, big_endian(kMost, 8)).replace(length_of(2), 8, big_endian(kMost, 8));
  EXPECT_GT(testing::why_not(both).size(), 20U);
  both.replace(array + 8, 8, big_endian(1, 8)).replace(array + 16, 8, big_endian(1, 8));
  EXPECT_GT(testing::why_not(both).size(), 20U);
}

TEST(NetCdf, ManyAttributesMustNotTakeMoreThanTheFileMay) {
  NEEDS_HDF5();
  // An attribute without a name and with one integer takes 16 bytes of a file.
  constexpr std::size_t kCount = 2'000'000;
  std::string all = std::string("CDF\1", 4) + big_endian(0, 4) + big_endian(0, 8) + big_endian(0, 8) +
                    big_endian(11, 4) + big_endian(1, 4);
  all += big_endian(1, 4) + std::string("x\0\0\0", 4) + big_endian(0, 4) + big_endian(12, 4) + big_endian(kCount, 4);
  const std::string one = big_endian(0, 4) + big_endian(kInt, 4) + big_endian(1, 4) + big_endian(7, 4);
  for (std::size_t i = 0; i < kCount; ++i) all += one;
  EXPECT_SAYS(all + big_endian(kInt, 4) + big_endian(4, 4) + big_endian(0, 4),
              "takes more than 8 times the memory of the file");
}

TEST(NetCdf, ArraysOfTimeStepsAreNotRead) {
  NEEDS_HDF5();
  NetCdf file(1);
  const int grows = file.dimension(0), nodes = file.dimension(3), one = file.dimension(1);
  file.doubles("time_whole", {grows}, {0.5, 1.5});
  file.doubles("coordx", {nodes}, {0, 1, 0});
  file.doubles("coordy", {nodes}, {0, 0, 1});
  file.doubles("vals_nod_var1", {grows, nodes}, {1, 2, 3, 4, 5, 6});
  file.integers("connect1", {one, nodes}, {1, 2, 3}, kInt, "elem_type", "TRI3");
  const auto read = formats::read(file.bytes());
  ASSERT_TRUE(read) << read.error().sentence;
  EXPECT_EQ(read->mesh.element_count(2), 1U);
  NetCdf moving(1);
  const int steps = moving.dimension(0), three = moving.dimension(3), block = moving.dimension(1);
  moving.doubles("coordx", {steps, three}, {0, 1, 0});
  moving.doubles("coordy", {three}, {0, 0, 1});
  moving.integers("connect1", {block, three}, {1, 2, 3}, kInt, "elem_type", "TRI3");
  EXPECT_SAYS(moving.bytes(), "coordx");
}

TEST(NetCdf, SaysWhatIsWrong) {
  NEEDS_HDF5();
  const std::string whole = hexahedron(1);
  const auto says = [&](std::size_t at, const std::string& bytes, const std::string& words) {
    EXPECT_SAYS(std::string(whole).replace(at, bytes.size(), bytes), words);
  };
  says(8, big_endian(99, 4), "has another list where one of the kind 10 must be");
  says(12, big_endian(0x7fffffff, 4), "ends within its header");
  const std::size_t type = whole.find("coordx") + 8 + 4 + 4 + 8;
  says(type, big_endian(77, 4), "has values of the unknown type 77");
  says(type + 8, big_endian(0x7fffffff, 4), "ends before the values of 'coordx'");
  NetCdf other(1);
  other.doubles("temperature", {other.dimension(2)}, {1, 2});
  EXPECT_SAYS(other.bytes(), "an HDF5 or netCDF file, but no mesh of HOPR, CGNS or Exodus");
}

}  // namespace
}  // namespace varimesh
