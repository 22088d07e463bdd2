// Meshes as sequences of MeshPart messages: reading takes bounded memory and gives a whole mesh or a sentence. What is
// written of the mesh can be read again, and writing that gives the same bytes.
#include "server/engine/mesh_parts.h"
#include "tests/fuzz/program/meshes.h"

using namespace varimesh;

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  fuzz::count_memory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto mesh = fuzz::within_memory(formats::most_memory_to_read(static_cast<std::int64_t>(size)),
                                        [&] { return server::read_mesh_parts(bytes); });
  if (!mesh) {
    fuzz::expect(!mesh.error().sentence.empty(), "a refusal has no sentence");
    return 0;
  }
  fuzz::expect_whole(*mesh);
  const auto write = [](const HighOrderMesh& each) {
    return fuzz::written([&](const Sink& sink) { return server::write_mesh_parts(each, sink); });
  };
  const std::string first = write(*mesh);
  fuzz::expect(!first.empty(), "the mesh cannot be written");
  const auto again = server::read_mesh_parts(first);
  fuzz::expect(again.has_value(), "what was written cannot be read");
  fuzz::expect(write(*again) == first, "writing what was read gives other bytes");
  return 0;
}
