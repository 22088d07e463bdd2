// The tests that every mesh store must pass that servers share. INSTANTIATE_TEST_SUITE_P adds a new store to them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <memory>
#include <set>
#include <string>

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {

using Digests = std::set<std::string>;

inline Digests both(const Digests& one, const Digests& other) {
  Digests digests;
  std::set_intersection(one.begin(), one.end(), other.begin(), other.end(), std::inserter(digests, digests.end()));
  return digests;
}

/// Where the stores of several servers keep their meshes, for one test.
class SharedPlace {
 public:
  virtual ~SharedPlace() = default;
  /// Opens another server's store.
  virtual std::unique_ptr<MeshStore> open(const DirectoryMeshSettings& settings, AskNeeded needed) = 0;
  /// Whether the bytes of a mesh are there. This is no use of it.
  virtual bool has(const std::string& digest) = 0;
  /// Changes the first byte of a mesh.
  virtual void damage(const std::string& digest) = 0;
  /// How often the longest test repeats its steps.
  virtual int repetitions() const { return 300; }
};

using MakeSharedPlace = std::function<std::unique_ptr<SharedPlace>()>;

/// Uploads a mesh unless the store says that it has it, and returns its digest.
inline std::string upload(MeshStore& store, const std::string& bytes, const std::string& owner = {}) {
  const auto ticket = store.begin_upload("id", sha256(bytes), static_cast<std::int64_t>(bytes.size()), owner);
  if (!ticket) return ticket.error().sentence;
  if (ticket->complete) return sha256(bytes);
  EXPECT_TRUE(store.append(*ticket, 0, bytes));
  const auto stored = store.finish_upload(*ticket);
  return stored ? stored->digest : stored.error().sentence;
}

/// Two servers, and what the jobs in their database need.
class SharedStoreConformance : public ::testing::TestWithParam<MakeSharedPlace> {
 protected:
  void SetUp() override {
    place_ = GetParam()();
    one_ = open();
    two_ = open();
  }
  std::unique_ptr<MeshStore> open();
  /// Both servers sweep once a minute; in a long time, once in five minutes.
  void wait(std::chrono::minutes time);

  std::unique_ptr<SharedPlace> place_;
  Time now_{std::chrono::hours(1000)};
  Digests needed_;
  bool is_away_ = false;
  std::function<void()> on_question_;
  std::unique_ptr<MeshStore> one_, two_;
};

}  // namespace varimesh::server::testing
