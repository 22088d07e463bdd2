// Layers that grow in a run: a run that is stopped meanwhile, and the mark in what is written.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/formats/formats.h"
#include "server/engine/engine.h"

namespace varimesh::server {
namespace {

/// Bytes in memory.
class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

/// Eight triangles, and a line at y = 0 that is the wall 7.
std::string square_with_a_wall() {
  std::string nodes, cells;
  int number = 0;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i)
      nodes += std::to_string(++number) + " " + std::to_string(0.5 * i) + " " + std::to_string(0.5 * j) + " 0\n";
  number = 0;
  const auto add = [&](const std::string& kind, int tag, std::initializer_list<int> members) {
    cells += std::to_string(++number) + " " + kind + " 2 " + std::to_string(tag) + " " + std::to_string(tag);
    for (const int node : members) cells += " " + std::to_string(node);
    cells += "\n";
  };
  for (const int first : {1, 2, 4, 5}) {
    add("2", 1, {first, first + 1, first + 4});
    add("2", 1, {first, first + 4, first + 3});
  }
  for (const auto& [tag, a, b] :
       {std::array{7, 1, 2}, {7, 2, 3}, {8, 3, 6}, {8, 6, 9}, {8, 9, 8}, {8, 8, 7}, {8, 7, 4}, {8, 4, 1}})
    add("1", tag, {a, b});
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n" + nodes + "$EndNodes\n$Elements\n" +
         std::to_string(number) + "\n" + cells + "$EndElements\n";
}

/// What came of a run that grows a layer of thickness .1 and splits it into three, and is stopped, or is late,
/// meanwhile.
struct Disturbed {
  Expected<RunOutcome> outcome;
  std::string notes;
  Expected<formats::MeshFile> written;
};

Disturbed run_while_it_grows(bool is_late) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(square_with_a_wall());
  request.options.threads = 1;
  request.options.method = Method::Newton;
  request.options.time_limit = is_late ? 1.5 : 0;
  v1::Layers& layers = request.layers.emplace();
  layers.add_walls("7");
  layers.set_grow(0.1);
  layers.set_layers(3);
  layers.set_growth(2);
  bool grows = false, has_waited = false;
  std::string written, notes;
  RunHooks hooks;
  hooks.given_up = [] { return false; };
  hooks.admit = [&](std::int64_t) -> Expected<bool> { return grows = true; };
  hooks.control.stop_asked = [&] {
    if (grows && is_late && !std::exchange(has_waited, true)) std::this_thread::sleep_for(std::chrono::seconds(2));
    return grows && !is_late;
  };
  hooks.on_note = [&](const std::string& note) { notes += note + "\n"; };
  hooks.open_output = [&](v1::MeshFormat) {
    return [&](std::string_view bytes) { return written.append(bytes), true; };
  };
  auto outcome = core_engine().run(std::move(request), hooks);
  return {std::move(outcome), std::move(notes), formats::read(written)};
}

/// Whoever stops a run while its layer grows gets the mesh as it came, and a sentence.
TEST(GrowingInARun, HandsOutTheMeshAsItCameIfTheLayerThatGrowsIsStopped) {
  const auto as_it_came = formats::read(square_with_a_wall());
  ASSERT_TRUE(as_it_came) << as_it_came.error().sentence;
  const Disturbed run = run_while_it_grows(false);
  ASSERT_TRUE(run.outcome) << run.outcome.error().sentence;
  EXPECT_TRUE(run.outcome->stopped);
  EXPECT_NE(run.notes.find("The run was stopped while the layer was grown, so the mesh gets no layers."),
            std::string::npos)
      << run.notes;
  ASSERT_TRUE(run.written) << run.written.error().sentence;
  EXPECT_EQ(run.written->mesh.coordinates, as_it_came->mesh.coordinates);
  EXPECT_EQ(run.written->mesh.element_count(2), 8U);
  EXPECT_FALSE(run.outcome->metrics.has_layers());
}

/// Whoever gave it too little time gets the layers that need no time.
TEST(GrowingInARun, MakesLayersInHasteIfTheTimeLimitPasses) {
  const Disturbed run = run_while_it_grows(true);
  ASSERT_TRUE(run.outcome) << run.outcome.error().sentence;
  EXPECT_FALSE(run.outcome->stopped);
  EXPECT_NE(run.notes.find("The time limit passed while it grew"), std::string::npos) << run.notes;
  ASSERT_TRUE(run.written) << run.written.error().sentence;
  EXPECT_EQ(run.written->mesh.element_count(2), 8U + 2 * 3);
  EXPECT_EQ(run.outcome->metrics.layers().layers(), 3);
}

/// The mark is in every file that can hold it, whether the cells were split or not.
TEST(GrowingInARun, MarksTheThicknessInFiles) {
  RunRequest request;
  request.input = std::make_shared<Bytes>(square_with_a_wall());
  request.options.threads = 1;
  request.outputs = {v1::MESH_FORMAT_MSH22, v1::MESH_FORMAT_MSH41, v1::MESH_FORMAT_VTU};
  v1::Layers& layers = request.layers.emplace();
  layers.add_walls("7");
  layers.set_grow(0.1);
  layers.set_layers(3);
  layers.set_growth(2);
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.given_up = [] { return false; };
  std::vector<std::string> written;
  hooks.open_output = [&](v1::MeshFormat) {
    const std::size_t k = written.size();
    written.emplace_back();
    return [&written, k](std::string_view bytes) { return written[k].append(bytes), true; };
  };
  const auto outcome = core_engine().run(std::move(request), hooks);
  ASSERT_TRUE(outcome) << outcome.error().sentence;
  ASSERT_EQ(written.size(), 3U);
  for (const std::string& bytes : written)
    EXPECT_NE(bytes.find("layer_thickness_share"), std::string::npos) << bytes.substr(0, 300);
  const std::string six_cells = "\"layer_thickness_share\"\n1\n0\n3\n0\n1\n6\n";
  EXPECT_NE(written[0].find(six_cells), std::string::npos);
  EXPECT_NE(written[1].find(six_cells), std::string::npos);
}

}  // namespace
}  // namespace varimesh::server
