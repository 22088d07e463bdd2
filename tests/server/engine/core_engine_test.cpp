// The engine that uses the numerical library.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/engine/engine.h"
#include "server/engine/mesh_parts.h"

namespace varimesh::server {
namespace {

class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

/// A square of two triangles, as MESH_FORMAT_PARTS.
std::string two_triangles() {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  mesh.coordinates = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  mesh.node_numbers = {1, 2, 3, 4};
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.order = 1;
  block.numbers = {1, 2};
  block.nodes = {0, 1, 2, 0, 2, 3};
  mesh.blocks = {block};
  std::string bytes;
  const auto written = write_mesh_parts(mesh, [&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  EXPECT_TRUE(written);
  return bytes;
}

/// The memory that a run asks for, in bytes.
std::int64_t admitted_bytes(const Options& options, bool judges) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(two_triangles());
  request.format = v1::MESH_FORMAT_PARTS;
  request.options = options;
  if (judges) request.quality.emplace();
  std::int64_t asked = 0;
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.given_up = [] { return false; };
  hooks.admit = [&](std::int64_t bytes) -> Expected<bool> {
    asked = bytes;
    return true;
  };
  hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return true; }; };
  const auto summary = core_engine().run(std::move(request), hooks);
  EXPECT_TRUE(summary) << summary.error().sentence;
  return asked;
}

TEST(CoreEngine, AdmitsAMeshToBeJudgedWhateverTheOtherOptionsSay) {
  Options plain;
  plain.threads = 1;
  Options costly = plain;
  costly.order = 8;
  costly.repair = Repair::Split;
  costly.fix = {"no such group"};
  const std::int64_t judging = admitted_bytes(plain, true);
  EXPECT_GT(judging, 0);
  EXPECT_EQ(admitted_bytes(costly, true), judging);
  EXPECT_GT(admitted_bytes(plain, false), judging) << "an optimisation needs more";
}

}  // namespace
}  // namespace varimesh::server
