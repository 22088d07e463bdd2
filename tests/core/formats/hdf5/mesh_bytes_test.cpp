// A mesh arrives as it was sent, and a mesh that is not whole does not arrive.
#include "core/formats/hdf5/mesh_bytes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using formats::FileAllowance;
using formats::hdf5::Incoming;
using formats::hdf5::Outgoing;

std::string sent(HighOrderMesh mesh, bool keeps = true) {
  std::string bytes;
  Outgoing to([&](std::string_view part) { bytes += part; });
  if (keeps)
    formats::hdf5::send_mesh(std::as_const(mesh), to);
  else
    formats::hdf5::send_mesh(std::move(mesh), to);
  to.flush();
  return bytes;
}

/// Behind its end everything is zero. It comes in parts of at most `most` bytes.
HighOrderMesh received(std::string_view bytes, std::size_t most = 1'000'000, std::size_t file_bytes = 1 << 20) {
  Incoming from([&](std::span<char> to) {
    const std::size_t count = std::min(to.size(), most), there = std::min(count, bytes.size());
    std::fill(std::copy_n(bytes.begin(), there, to.begin()), to.begin() + std::ptrdiff_t(count), '\0');
    bytes.remove_prefix(there);
    return count;
  });
  FileAllowance allowance(file_bytes);
  return formats::hdf5::receive_mesh(from, allowance);
}

/// A mesh with something in every list.
HighOrderMesh full() {
  HighOrderMesh mesh = testing::curved_grid(testing::Filling::Prisms, 3);
  mesh.blocks[0].physical = {3, 5};
  mesh.blocks[0].repeat_numbers.assign(mesh.blocks[0].size(), 77);
  mesh.blocks[0].partitions = {1, 2};
  mesh.node_blocks = {{2, 7, 0, std::int32_t(mesh.node_count()), std::vector<double>(2 * mesh.node_count(), .5)}};
  mesh.entities = {{2, 7, {0, 0, 0, 1, 1, 1}, {3}, {-1, 2}}};
  mesh.physical_groups = {{3, 3, "fluid"}, {2, 4, ""}};
  mesh.periodic = {{2, 1, 2, std::vector<double>(16, 1), {{0, 1}, {2, 3}}}};
  mesh.foreign = {{"Zones", "2", "cgns"}};
  return mesh;
}

TEST(MeshBytes, ArriveAsTheyWereSent) {
  const HighOrderMesh mesh = full();
  const std::string bytes = sent(mesh);
  EXPECT_EQ(sent(mesh, false), bytes);
  for (const std::size_t most : {std::size_t(1), std::size_t(1000), bytes.size()}) {
    const HighOrderMesh back = received(bytes, most);
    EXPECT_EQ(sent(back), bytes);
    EXPECT_EQ(back.coordinates, mesh.coordinates);
    EXPECT_EQ(back.blocks[0].nodes, mesh.blocks[0].nodes);
    EXPECT_EQ(back.physical_groups[0].name, "fluid");
    EXPECT_EQ(back.periodic[0].nodes, mesh.periodic[0].nodes);
  }
}

TEST(MeshBytes, OfAMeshThatIsNotWholeAreRefused) {
  using Change = std::function<void(HighOrderMesh&)>;
  const auto nodes = [](const HighOrderMesh& mesh) { return std::int32_t(mesh.node_count()); };
  const std::vector<Change> changes = {
      [](HighOrderMesh& mesh) { mesh.dimension = 4; },
      [](HighOrderMesh& mesh) { mesh.dimension = -1; },
      [](HighOrderMesh& mesh) { mesh.order = 11; },
      [](HighOrderMesh& mesh) { mesh.coordinates.pop_back(); },
      [](HighOrderMesh& mesh) { mesh.coordinates[4] = NAN; },
      [](HighOrderMesh& mesh) { mesh.node_numbers.pop_back(); },
      [](HighOrderMesh& mesh) { mesh.node_numbers[3] = mesh.node_numbers[2]; },
      [](HighOrderMesh& mesh) { mesh.node_numbers[3] = 0; },
      [](HighOrderMesh& mesh) { mesh.node_blocks[0].count -= 1; },
      [](HighOrderMesh& mesh) { mesh.node_blocks[0].first = 1; },
      [](HighOrderMesh& mesh) { mesh.node_blocks[0].parameters.pop_back(); },
      [](HighOrderMesh& mesh) { mesh.node_blocks[0].dimension = 4; },
      [](HighOrderMesh& mesh) { mesh.blocks[0].shape = Shape(8); },
      [](HighOrderMesh& mesh) { mesh.blocks[0].order = 0; },
      [](HighOrderMesh& mesh) { mesh.blocks[0].nodes.pop_back(); },
      [](HighOrderMesh& mesh) { mesh.blocks[0].nodes.clear(); },
      [&](HighOrderMesh& mesh) { mesh.blocks[0].nodes[5] = nodes(mesh); },
      [](HighOrderMesh& mesh) { mesh.blocks[0].nodes[5] = -1; },
      [](HighOrderMesh& mesh) { mesh.blocks[0].numbers[0] = -1; },
      [](HighOrderMesh& mesh) { mesh.blocks[0].physical[0] = INT_MIN; },
      [](HighOrderMesh& mesh) { mesh.blocks[0].repeat_numbers.pop_back(); },
      [](HighOrderMesh& mesh) { mesh.entities[0].dimension = 4; },
      [](HighOrderMesh& mesh) { mesh.entities[0].boundary[0] = INT_MIN; },
      [](HighOrderMesh& mesh) { mesh.physical_groups[1].dimension = -1; },
      [](HighOrderMesh& mesh) { mesh.periodic[0].affine.pop_back(); },
      [&](HighOrderMesh& mesh) { mesh.periodic[0].nodes[1].second = nodes(mesh); },
      [](HighOrderMesh& mesh) { mesh.foreign[0].format = "msh41"; },
  };
  for (std::size_t k = 0; k < changes.size(); ++k) {
    HighOrderMesh mesh = full();
    changes[k](mesh);
    EXPECT_THROW(received(sent(std::move(mesh))), ReadFailure) << "change " << k;
  }
}

TEST(MeshBytes, TakeNoMoreMemoryThanIsAllowed) {
  const std::string bytes = sent(full());
  EXPECT_THROW(received(bytes.substr(0, 8) + std::string("\0\0\0\0\0\0\0\1", 8)), ReadFailure);
  EXPECT_THROW(received(bytes.substr(0, 8) + std::string("\0\0\0\0\1\0\0\0", 8)), ReadFailure);
}

}  // namespace
}  // namespace varimesh
