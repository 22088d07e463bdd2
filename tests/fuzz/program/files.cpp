// Mesh files of every format: reading them takes bounded memory and gives a whole mesh or a sentence. What is written
// of the mesh in Gmsh's formats, MFEM's and Nektar++'s can be read again, and writing that gives the same bytes
// in Gmsh's.
#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/fuzz/program/meshes.h"

namespace {

using namespace varimesh;

/// MSH files may have coordinates that are no numbers. Nektar++'s reader refuses curves that do not meet their
/// vertices, as those do not.
bool are_numbers(const std::vector<double>& coordinates) {
  return std::ranges::all_of(coordinates, [](double x) { return std::isfinite(x); });
}

void write_and_read(const HighOrderMesh& mesh, formats::Format format) {
  if (format == formats::Format::Nektar && !are_numbers(mesh.coordinates)) return;
  const auto write = [&](const HighOrderMesh& each) {
    return fuzz::written([&](const Sink& sink) { return formats::write(each, format, sink); });
  };
  const std::string first = write(mesh);
  if (first.empty()) return;
  const auto again = formats::read(first);
  if (!again) std::fprintf(stderr, "%s\n%s\n", again.error().sentence.c_str(), first.substr(0, 4096).c_str());
  fuzz::expect(again.has_value(), "what was written cannot be read");
  fuzz::expect_whole(again->mesh);
  fuzz::expect(again->mesh.element_count(mesh.dimension) == mesh.element_count(mesh.dimension),
               "elements were lost or added");
  // MFEM's files have other nodes on curved elements, which are rounded, and none outside the elements; Nektar++'s
  // leave out inner nodes.
  using formats::Format;
  if (format == Format::Mfem || format == Format::Nektar) return;
  fuzz::expect(again->mesh.node_count() == mesh.node_count(), "nodes were lost or added");
  const std::string second = write(again->mesh);
  if (second != first) std::fprintf(stderr, "--- first\n%s\n--- second\n%s\n", first.c_str(), second.c_str());
  fuzz::expect(second == first, "writing what was read gives other bytes");
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  varimesh::fuzz::count_memory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto file = fuzz::within_memory(formats::most_memory_to_read(static_cast<std::int64_t>(size)),
                                        [&] { return formats::read(bytes); });
  if (!file) {
    fuzz::expect(!file.error().sentence.empty(), "a refusal has no sentence");
    return 0;
  }
  fuzz::expect_whole(file->mesh);
  // VTK's are only read: they have no tags above a thousand million, and leave out inner nodes.
  using formats::Format;
  for (const Format format :
       {Format::Msh22, Format::Msh22Binary, Format::Msh41, Format::Msh41Binary, Format::Mfem, Format::Nektar})
    write_and_read(file->mesh, format);
  return 0;
}
