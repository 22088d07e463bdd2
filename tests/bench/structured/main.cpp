// Writes a mesh for measurements: a cube with a spherical hole, of any size and order.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/formats/formats.h"
#include "tests/bench/structured/structured_mesh.h"

namespace {

using namespace varimesh;

constexpr const char* kUsage =
    "structured_mesh tetrahedra|hexahedra ORDER ELEMENTS OUTPUT.msh [NODE_SHIFT]\n"
    "structured_mesh squares CELLS_PER_SIDE OUTPUT.msh\n"
    "Writes binary MSH 4.1. The first makes a cube with a spherical hole, with about so many elements. The second "
    "makes\n"
    "a square with quadrilaterals of order 1. NODE_SHIFT: how far free nodes that are not vertices are shifted at\n"
    "random, as a share of the distance between nodes; default 0.\n";

/// A number without anything behind it, or −1.
double number(const char* text) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  return end != text && *end == '\0' ? value : -1;
}

Expected<HighOrderMesh> make(int argc, char** argv) {
  if (std::strcmp(argv[1], "squares") == 0) return bench::perturbed_square(static_cast<int>(number(argv[2])));
  bench::StructuredMesh wanted;
  wanted.shape = std::strcmp(argv[1], "hexahedra") == 0 ? Shape::Hexahedron : Shape::Tetrahedron;
  wanted.order = static_cast<int>(number(argv[2]));
  wanted.elements = static_cast<std::int64_t>(number(argv[3]));
  if (argc == 6) wanted.node_shift = number(argv[5]);
  return bench::cube_with_hole(wanted);
}

}  // namespace

int main(int argc, char** argv) {
  const bool squares = argc == 4 && std::strcmp(argv[1], "squares") == 0;
  const bool cube =
      (argc == 5 || argc == 6) && (std::strcmp(argv[1], "tetrahedra") == 0 || std::strcmp(argv[1], "hexahedra") == 0);
  if (!squares && !cube) {
    std::fputs(kUsage, stderr);
    return 2;
  }
  const Expected<HighOrderMesh> mesh = make(argc, argv);
  if (!mesh) {
    std::fprintf(stderr, "structured_mesh: %s\n", mesh.error().sentence.c_str());
    return 2;
  }
  const Expected<void> written = formats::write_file(*mesh, formats::Format::Msh41Binary, argv[squares ? 3 : 4]);
  if (!written) {
    std::fprintf(stderr, "structured_mesh: %s\n", written.error().sentence.c_str());
    return 1;
  }
  std::printf("%zu elements of order %d, %zu nodes\n", mesh->element_count(mesh->dimension), mesh->order,
              mesh->node_count());
  return 0;
}
