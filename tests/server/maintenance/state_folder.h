// A state directory for servers that follow each other, deleted at the end.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/server/service.h"

namespace varimesh::server::testing {

class StateFolder : public ::testing::Test {
 protected:
  StateFolder() {
    std::string name = ::testing::TempDir() + "varimesh-state-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    state_ = folder_ / "state";
  }
  ~StateFolder() override { std::filesystem::remove_all(folder_); }

  static ServerOptions options(Engine engine, const std::filesystem::path& state) {
    ServerOptions options = options_with(std::move(engine));
    options.state = state.string();
    options.limits.compress_after = std::chrono::minutes(0);
    return options;
  }

  std::filesystem::path file_of(const std::string& digest) const { return state_ / "meshes" / digest; }

  static std::string bytes_of(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void write(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }

  std::filesystem::path folder_, state_;
};

}  // namespace varimesh::server::testing
