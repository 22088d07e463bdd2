#include "client/report/packing.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

namespace varimesh::client {
namespace {

std::string from_base64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(digits.find(c));
    if ((count += 6) < 8) continue;
    count -= 8;
    bytes += static_cast<char>(bits >> count & 255);
  }
  return bytes;
}

/// The bytes of the arrays, still transposed.
std::string unpacked(const Packing& packing) {
  const std::string deflated = from_base64(*packing.base64());
  std::string bytes(1 << 20, '\0');
  uLongf size = bytes.size();
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size, reinterpret_cast<const Bytef*>(deflated.data()),
                       deflated.size()),
            Z_OK);
  bytes.resize(size);
  return bytes;
}

template <class Number>
std::vector<Number> array(const Packing& packing, const std::string& name) {
  const auto& entry = packing.directory().at(name);
  const std::string bytes = unpacked(packing);
  const std::size_t offset = entry.at("offset"), length = entry.at("length");
  std::vector<Number> values(length);
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte)
    for (std::size_t i = 0; i < length; ++i)
      reinterpret_cast<char*>(values.data())[i * sizeof(Number) + byte] = bytes[offset + byte * length + i];
  return values;
}

TEST(Packing, KeepsNumbersBitForBit) {
  Packing packing;
  const std::vector<double> doubles{0.1, -1e300, 3};
  const std::vector<float> floats{0.5F, -2, 1e-20F, 7, 8};
  const std::vector<std::uint8_t> bytes{1, 255, 0};
  packing.add("doubles", doubles);
  packing.add("floats", floats);
  packing.add("bytes", bytes);
  EXPECT_EQ(array<double>(packing, "doubles"), doubles);
  EXPECT_EQ(array<float>(packing, "floats"), floats);
  EXPECT_EQ(array<std::uint8_t>(packing, "bytes"), bytes);
}

TEST(Packing, DescribesArraysAtAlignedOffsets) {
  Packing packing;
  packing.add("three", std::vector<std::uint8_t>{1, 2, 3});
  packing.add("two", std::vector<float>{1, 2});
  EXPECT_EQ(packing.directory()["three"], (nlohmann::ordered_json{{"type", "Uint8"}, {"offset", 0}, {"length", 3}}));
  EXPECT_EQ(packing.directory()["two"], (nlohmann::ordered_json{{"type", "Float32"}, {"offset", 8}, {"length", 2}}));
}

TEST(Packing, StoresWholeNumbersAsDifferences) {
  Packing packing;
  packing.add("numbers", std::vector<std::int32_t>{5, 6, 4, -2147483647 - 1});
  EXPECT_EQ(array<std::int32_t>(packing, "numbers"), (std::vector<std::int32_t>{5, 1, -2, 2147483644}));
}

}  // namespace
}  // namespace varimesh::client
