// The engine that uses the numerical library.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/formats/formats.h"
#include "core/formats/usual_memory.h"
#include "server/engine/engine.h"
#include "server/engine/mesh_parts.h"
#include "server/engine/most_threads.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/groups.h"
#include "tests/core/support/meshes.h"

namespace varimesh::server {
namespace {

class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

/// Hooks of a run that nothing stops and whose output goes nowhere.
RunHooks hooks_that_note_admission(bool& admitted) {
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.given_up = [] { return false; };
  hooks.admit = [&admitted](std::int64_t) -> Expected<bool> { return admitted = true; };
  hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return true; }; };
  return hooks;
}

/// A square of two triangles with an element for a corner, as MESH_FORMAT_PARTS.
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
  ElementBlock corner;
  corner.shape = Shape::Point;
  corner.order = 1;
  corner.numbers = {3};
  corner.nodes = {0};
  mesh.blocks = {corner, block};
  std::string bytes;
  const auto written = write_mesh_parts(mesh, [&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  EXPECT_TRUE(written);
  return bytes;
}

/// The memory that a run asks for, in bytes.
std::int64_t admitted_bytes(const Options& options, bool judges, int lattice = 0) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(two_triangles());
  request.format = v1::MESH_FORMAT_PARTS;
  request.options = options;
  if (judges) request.quality.emplace().set_lattice(lattice);
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

TEST(MostThreads, IsOneAndOneMoreForEachPart) {
  EXPECT_EQ(most_threads(0, kPairsPerThread), 1);
  EXPECT_EQ(most_threads(0.99 * kPairsPerThread, kPairsPerThread), 1);
  EXPECT_EQ(most_threads(kPairsPerThread, kPairsPerThread), 2);
  EXPECT_EQ(most_threads(2.5 * kPairsPerThread, kPairsPerThread), 3);
  EXPECT_GT(most_threads(1e300, kPairsPerThread), 1000) << "no overflow";
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
  EXPECT_LT(judging, std::int64_t{64} << 20);
  EXPECT_EQ(admitted_bytes(costly, true), judging);
  EXPECT_GT(admitted_bytes(plain, false), judging) << "an optimisation needs more";
  EXPECT_GT(admitted_bytes(plain, true, 1000), judging + (std::int64_t{30} << 20)) << "a fine lattice needs memory";
}

TEST(CoreEngine, StopsJudgingAMesh) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(two_triangles());
  request.format = v1::MESH_FORMAT_PARTS;
  request.options.threads = 1;
  request.quality.emplace();
  RunHooks hooks;
  hooks.given_up = [] { return false; };
  hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return true; }; };
  hooks.control.stop_asked = [] { return true; };
  const auto cancelled = core_engine().run(request, hooks);
  ASSERT_TRUE(cancelled) << cancelled.error().sentence;
  EXPECT_TRUE(cancelled->stopped);

  hooks.control.stop_asked = [] { return false; };
  request.options.time_limit = 1e-9;
  const auto late = core_engine().run(request, hooks);
  ASSERT_FALSE(late);
  EXPECT_NE(late.error().sentence.find("time limit"), std::string::npos) << late.error().sentence;

  request.options.time_limit = 0;
  const auto judged = core_engine().run(request, hooks);
  ASSERT_TRUE(judged) << judged.error().sentence;
  EXPECT_FALSE(judged->stopped);
}

TEST(CoreEngine, RefusesAFormatWithoutATypeForTheElementsBeforeItComputes) {
  if (!varimesh::testing::use_hdf5()) GTEST_SKIP() << "SKIPPED: VariMesh is built without HDF5 (libhdf5-dev)";
  RunRequest request;
  request.input = std::make_shared<Bytes>(two_triangles());
  request.format = v1::MESH_FORMAT_PARTS;
  request.options.threads = 1;
  request.options.order = 7;
  request.outputs = {v1::MESH_FORMAT_VTU, v1::MESH_FORMAT_CGNS};
  bool admitted = false;
  const RunHooks hooks = hooks_that_note_admission(admitted);
  const auto refused = core_engine().run(request, hooks);
  ASSERT_FALSE(refused) << "CGNS ends at order 4";
  EXPECT_EQ(refused.error().kind, Error::Kind::BadOption);
  EXPECT_NE(refused.error().sentence.find("order 7"), std::string::npos) << refused.error().sentence;
  EXPECT_FALSE(admitted);

  request.outputs.pop_back();
  const auto done = core_engine().run(request, hooks);
  ASSERT_TRUE(done) << done.error().sentence;
  EXPECT_TRUE(admitted);
}

/// Two triangles of order 2 in space with a node each on their common edge; that of the second is at this y.
std::string two_nodes_on_an_edge(const std::string& y) {
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 1\n5 .5 0 0\n6 1 .5 0\n"
         "7 .5 .5 0\n8 .5 " +
         y +
         " 0\n9 .5 1 .5\n10 0 .5 .5\n$EndNodes\n$Elements\n2\n1 9 2 1 1 1 2 3 5 6 7\n2 9 2 1 1 1 3 4 8 9 10\n"
         "$EndElements\n";
}

TEST(CoreEngine, RefusesAFormatThatCannotHoldTheSidesBeforeItComputes) {
  for (const v1::MeshFormat format : {v1::MESH_FORMAT_MFEM, v1::MESH_FORMAT_NEKTAR, v1::MESH_FORMAT_VTU})
    for (const char* y : {".5", ".55"}) {
      RunRequest request;
      request.input = std::make_shared<Bytes>(two_nodes_on_an_edge(y));
      request.options.threads = 1;
      request.quality.emplace();  // only surfaces that are judged may have such sides
      request.outputs = {format};
      bool admitted = false;
      const RunHooks hooks = hooks_that_note_admission(admitted);
      const auto done = core_engine().run(request, hooks);
      const bool can_hold = format == v1::MESH_FORMAT_VTU || std::string_view(y) == ".5";
      EXPECT_EQ(admitted, can_hold) << format << " " << y;
      if (can_hold) continue;
      ASSERT_FALSE(done);
      EXPECT_EQ(done.error().kind, Error::Kind::BadOption);
      EXPECT_NE(done.error().sentence.find("has other nodes on an edge or face than an element with the same vertices"),
                std::string::npos)
          << done.error().sentence;
    }
}

TEST(CoreEngine, AsksForMoreMemoryOnlyIfTheMeshTurnsOutToNeedIt) {
  constexpr int kMany = 600'000;
  std::string groups =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n$Elements\n" +
      std::to_string(kMany) + "\n";
  for (int i = 1; i <= kMany; ++i) groups += "1 15 1 " + std::to_string(i) + " 1\n";
  RunRequest request;
  request.input = std::make_shared<Bytes>(groups + "$EndElements\n");
  request.options.threads = 1;
  std::vector<std::int64_t> claims;
  bool gives = true;
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.admit_reading = [&](std::int64_t, std::int64_t most) -> Expected<bool> {
    claims.push_back(most);
    return gives || claims.size() == 1;
  };
  const auto most = formats::most_memory_to_read(static_cast<std::int64_t>(request.input->bytes().size()));
  EXPECT_FALSE(core_engine().run(request, hooks)) << "it has no cells";
  ASSERT_GE(claims.size(), 2u);
  EXPECT_LE(claims.size(), 3u);
  EXPECT_TRUE(std::ranges::is_sorted(claims));
  EXPECT_LT(claims.front(), most);
  EXPECT_LE(claims.back(), most);

  claims.clear();
  gives = false;
  const auto given_up = core_engine().run(request, hooks);
  ASSERT_TRUE(given_up) << given_up.error().sentence;
  EXPECT_TRUE(given_up->stopped);
  EXPECT_EQ(claims.size(), 2u);
}

/// A file of many nodes that is read in a fraction of a second.
std::string many_nodes() {
  std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n400000\n";
  for (int i = 1; i <= 400000; ++i) text += std::to_string(i) + " 0.25 0.5 0\n";
  return text + "$EndNodes\n$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n";
}

TEST(CoreEngine, LooksAtCancelAndTimeLimitWhileItReads) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(many_nodes());
  request.options.threads = 1;
  std::atomic<int> asked = 0;
  std::int64_t least = 0, most = 0;
  RunHooks hooks;
  hooks.admit_reading = [&](std::int64_t at_least, std::int64_t at_most) -> Expected<bool> {
    EXPECT_EQ(asked, 0) << "before it is read";
    least = at_least;
    most = at_most;
    return true;
  };
  hooks.admit = [&](std::int64_t) -> Expected<bool> {
    ADD_FAILURE() << "the mesh was read to its end";
    return false;
  };
  hooks.control.stop_asked = [&] { return ++asked > 3; };
  hooks.given_up = [] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a look takes so long that reading takes seconds
    return false;
  };
  const auto cancelled = core_engine().run(request, hooks);
  ASSERT_TRUE(cancelled) << cancelled.error().sentence;
  EXPECT_TRUE(cancelled->stopped);
  EXPECT_GT(least, 0);
  const std::string_view bytes = request.input->bytes();
  EXPECT_EQ(most, formats::most_memory_to_read(static_cast<std::int64_t>(bytes.size())) -
                      formats::seldom_needed_to_read(bytes));

  asked = 0;
  hooks.control.stop_asked = [] { return false; };
  hooks.given_up = [] { return true; };
  const auto given_up = core_engine().run(request, hooks);
  ASSERT_TRUE(given_up) << given_up.error().sentence;
  EXPECT_TRUE(given_up->stopped);

  hooks.given_up = nullptr;
  request.options.time_limit = 1e-6;
  const auto late = core_engine().run(request, hooks);
  ASSERT_FALSE(late);
  EXPECT_NE(late.error().sentence.find("time limit"), std::string::npos) << late.error().sentence;

  hooks.admit_reading = [&](std::int64_t, std::int64_t) -> Expected<bool> { return false; };
  const auto refused = core_engine().run(request, hooks);
  ASSERT_TRUE(refused);
  EXPECT_TRUE(refused->stopped) << "it is not admitted";
}

/// A job on one thread that judges a mesh and writes it.
RunRequest written_as(v1::MeshFormat format, const HighOrderMesh& mesh) {
  std::string bytes;
  const auto written = formats::write(mesh, formats::Format::Msh41, [&](auto piece) {
    bytes += piece;
    return true;
  });
  EXPECT_TRUE(written);
  RunRequest request;
  request.input = std::make_shared<Bytes>(bytes);
  request.options.threads = 1;
  request.quality.emplace();
  request.outputs = {format};
  return request;
}

TEST(CoreEngine, LooksAtCancelAndTimeLimitWhileItWrites) {
  NEEDS_HDF5();
  // HDF5 needs some twenty seconds to make it before its first byte comes.
  const RunRequest request = written_as(v1::MESH_FORMAT_CGNS, varimesh::testing::square_in(100'000));
  const auto run = [&](double time_limit, const auto& control) {
    const auto writes = std::make_shared<std::atomic<bool>>(false);
    bool admitted = false;
    RunHooks hooks = hooks_that_note_admission(admitted);
    hooks.open_output = [writes](v1::MeshFormat) {
      *writes = true;
      return [](std::string_view) { return true; };
    };
    control(hooks, writes);
    RunRequest own = request;
    own.options.time_limit = time_limit;
    const auto begun = std::chrono::steady_clock::now();
    auto outcome = core_engine().run(std::move(own), hooks);
    EXPECT_TRUE(*writes);
    return std::pair(std::move(outcome),
                     std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
  };
  auto late = std::async(std::launch::async, [&] { return run(2, [](RunHooks&, const auto&) {}); });
  const auto [cancelled, seconds] = run(
      0, [](RunHooks& hooks, const auto& writes) { hooks.control.stop_asked = [writes] { return writes->load(); }; });
  ASSERT_TRUE(cancelled) << cancelled.error().sentence;
  EXPECT_TRUE(cancelled->stopped && cancelled->unwritten);
  EXPECT_LT(seconds, 20) << "nothing has come for 10 s";
  const auto [out_of_time, seconds_too] = late.get();
  ASSERT_FALSE(out_of_time);
  EXPECT_NE(out_of_time.error().sentence.find("time limit"), std::string::npos) << out_of_time.error().sentence;
  EXPECT_LT(seconds_too, 20);
  const auto [given_up, at_once] =
      run(0, [](RunHooks& hooks, const auto& writes) { hooks.given_up = [writes] { return writes->load(); }; });
  ASSERT_TRUE(given_up) << given_up.error().sentence;
  EXPECT_TRUE(given_up->stopped && given_up->unwritten);
  EXPECT_LT(at_once, 9) << "nobody needs the result";
}

TEST(CoreEngine, MarksOfCellsAreNoSilence) {
  using varimesh::testing::Filling;
  // Its marks take two seconds. A result that no byte comes of is given up after one.
  const RunRequest request = written_as(
      v1::MESH_FORMAT_VTU, varimesh::testing::grid(Filling::Hexahedra, {5, 5, 5}, 8, varimesh::testing::bent(3)));
  bool admitted = false, opened = false;
  std::string bytes;
  RunHooks hooks = hooks_that_note_admission(admitted);
  hooks.given_up = [&] { return opened; };
  hooks.open_output = [&](v1::MeshFormat) {
    opened = true;
    return [&](std::string_view piece) {
      bytes += piece;
      return true;
    };
  };
  const auto outcome = core_engine().run(request, hooks);
  ASSERT_TRUE(outcome) << outcome.error().sentence;
  EXPECT_FALSE(outcome->stopped || outcome->unwritten);
  EXPECT_TRUE(bytes.ends_with("</VTKFile>\n"));
}

}  // namespace
}  // namespace varimesh::server
