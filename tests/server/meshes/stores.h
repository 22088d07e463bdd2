// Mesh stores for tests, in temporary directories.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"

namespace varimesh::server::testing {

using Time = std::chrono::steady_clock::time_point;

inline DirectoryMeshSettings settings_with(std::function<Time()> clock = std::chrono::steady_clock::now) {
  DirectoryMeshSettings settings;
  settings.max_mesh_bytes = 1000;
  settings.lifetime = std::chrono::hours(24);
  settings.clock = std::move(clock);
  return settings;
}

inline std::unique_ptr<DirectoryMeshStore> new_store(std::function<Time()> clock = std::chrono::steady_clock::now) {
  return std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings_with(std::move(clock))));
}

/// Writes a result and returns its digest and size. If the store refuses it, the test fails, and the digest says why.
inline StoredBytes write(MeshStore& store, const std::string& bytes) {
  const auto refused = [](const auto& answer) {
    ADD_FAILURE() << answer.error().sentence;
    return StoredBytes{answer.error().sentence, 0};
  };
  const auto writer = store.create();
  if (!writer) return refused(writer);
  EXPECT_TRUE((*writer)->append(bytes));
  const auto stored = (*writer)->commit();
  return stored ? *stored : refused(stored);
}

/// Returns the bytes of a stored mesh; a sentence if the store refuses them.
inline std::string read_whole(MeshStore& store, const std::string& digest) {
  const auto opened = store.open(digest);
  return opened ? std::string((*opened)->bytes()) : opened.error().sentence;
}

/// Text that compresses well.
inline std::string long_text(int lines) {
  std::string text;
  for (int i = 0; i < lines; ++i) text += std::to_string(i) + " 0.123456 " + std::to_string(i % 7) + "\n";
  return text;
}

}  // namespace varimesh::server::testing
