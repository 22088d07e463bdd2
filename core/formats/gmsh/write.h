// Writes Gmsh's MSH files, and what the writers of versions 2.2 and 4.1 share. Internal to core/formats.
#pragma once

#include "core/base/io/buffered_output.h"
#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Writes a whole MSH file of version 2.2 or 4.1, ASCII or binary. A field becomes a section $ElementData, in which
/// cells have no value if it is 0. It is left out if such a cell has a number of more than 32 bits.
Expected<void> write_gmsh(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// Nodes, and node numbers of elements, in a piece that one thread writes: 200 to 600 KiB.
inline constexpr std::size_t kNodesPerPiece = 8192;
inline constexpr std::size_t kIndicesPerPiece = 65536;

/// Elements in such a piece.
constexpr std::size_t elements_per_piece(std::size_t nodes_per_element) {
  return kIndicesPerPiece / (nodes_per_element + 4) + 1;
}

/// Write the nodes, elements and periodic links, and in MSH 4.1 the entities.
void write_body_22(const HighOrderMesh& mesh, BufferedOutput& out);
void write_body_41(const HighOrderMesh& mesh, Format format, BufferedOutput& out);

/// The largest number of an element in an MSH 2.2 file, where elements in several groups are repeated with new numbers.
std::int64_t largest_number_22(const HighOrderMesh& mesh);

/// The section with this name that was read from this format, or null.
const ForeignSection* kept_section(const HighOrderMesh& mesh, Format format, std::string_view name);

}  // namespace varimesh::formats
