// The small meshes in tests/cases.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "core/formats/formats.h"

namespace varimesh::testing {

/// Reads a mesh by its file name. If it cannot be read, the test fails and the mesh is empty.
inline HighOrderMesh read_case(const std::string& name) {
  auto file = formats::read_file(std::string(VARIMESH_SOURCE_DIR) + "/tests/cases/" + name);
  EXPECT_TRUE(file) << (file ? "" : file.error().sentence);
  return file ? std::move(file->mesh) : HighOrderMesh{};
}

}  // namespace varimesh::testing
