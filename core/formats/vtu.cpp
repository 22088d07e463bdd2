// Writes VTK unstructured grids.
#include "core/formats/vtu.h"

namespace varimesh::formats {

Expected<void> write_vtu(const HighOrderMesh&, const Sink&, std::span<const CellField>) {
  return bad_option("VTU is not written yet.");
}

}  // namespace varimesh::formats
