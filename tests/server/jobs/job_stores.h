// The stores that job_store_conformance.h tests: one line per store, and a class that opens it.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "server/jobs/sqlite_jobs.h"
#include "tests/server/jobs/job_store_conformance.h"

namespace varimesh::server::testing {

class InMemory : public StorePlace {
 public:
  std::unique_ptr<JobStore> open(const JobStoreSettings& settings) override { return jobs_in_memory(settings); }
};

class InFile : public StorePlace {
 public:
  InFile() {
    std::string name = ::testing::TempDir() + "varimesh-jobs-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~InFile() override { std::filesystem::remove_all(directory_); }
  std::unique_ptr<JobStore> open(const JobStoreSettings& settings) override {
    auto store = open_sqlite_jobs((directory_ / "jobs.sqlite").string(), settings);
    if (!store) ADD_FAILURE() << store.error().sentence;
    return std::move(*store);
  }
  const std::filesystem::path& directory() const { return directory_; }

 private:
  std::filesystem::path directory_;
};

inline const StoreKind kMemory{"Memory", [] { return std::make_unique<InMemory>(); }};
inline const StoreKind kSqlite{"Sqlite", [] { return std::make_unique<InFile>(); }};

inline const std::vector<StoreKind> kStores{kMemory, kSqlite};
inline const std::vector<StoreKind> kDurableStores{kSqlite};

}  // namespace varimesh::server::testing
