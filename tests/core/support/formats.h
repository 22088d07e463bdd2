// What the tests of all readers of files do: a curved mesh, why a file is refused, and damaged files.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "core/formats/formats.h"
#include "tests/core/support/meshes.h"

namespace varimesh::testing {

/// A grid under a polynomial map of degree `order`, which the space of every shape holds.
inline HighOrderMesh curved_grid(Filling filling, int order) {
  HighOrderMesh mesh = grid(filling, {2, 1, 1}, order);
  const bool solid = mesh.dimension == 3;
  move_nodes(mesh, [&](Place at) {
    const auto [x, y, z] = at;
    return Place{x + 0.1 * std::pow(y, order), y + 0.1 * std::pow(solid ? z : x, order),
                 solid ? z + 0.1 * std::pow(x, order) : 0};
  });
  return mesh;
}

inline HighOrderMesh read_back(const std::string& bytes) {
  const auto file = formats::read(bytes);
  EXPECT_TRUE(file) << (file ? "" : file.error().sentence);
  return file ? file->mesh : HighOrderMesh{};
}

/// The sentence that refuses a file.
inline std::string why_not(const std::string& bytes) {
  const auto mesh = formats::read(bytes);
  return mesh ? "it was read" : mesh.error().sentence;
}

#define EXPECT_SAYS(bytes, words) \
  EXPECT_NE(testing::why_not(bytes).find(words), std::string::npos) << testing::why_not(bytes)

/// Cuts the file short in 200 places before `end`, and expects a sentence for each.
inline void expect_refused_if_cut(const std::string& whole, std::size_t end) {
  ASSERT_EQ(why_not(whole), "it was read");
  for (std::size_t k = 0; k < 200; ++k) {
    const std::string cut = whole.substr(0, k * end / 200);
    EXPECT_FALSE(formats::read(cut)) << "cut at byte " << cut.size();
    EXPECT_GT(why_not(cut).size(), 20U);
  }
}

/// Changes one byte of the file, `times` times, and expects a sentence or a mesh whose elements have its nodes.
inline void expect_survives_flips(const std::string& whole, int times) {
  std::mt19937 random(20160926);
  for (int k = 0; k < times; ++k) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = char(random() & 0xff);
    const auto mesh = formats::read(damaged);
    if (!mesh) {
      EXPECT_GT(mesh.error().sentence.size(), 20U);
    } else {
      for (const ElementBlock& block : mesh->mesh.blocks)
        for (const std::int32_t node : block.nodes) ASSERT_LT(std::size_t(node), mesh->mesh.node_count());
    }
  }
}

}  // namespace varimesh::testing
