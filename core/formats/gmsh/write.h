// Writes Gmsh's MSH files, and what the writers of versions 2.2 and 4.1 share. Internal to core/formats.
#pragma once

#include "core/formats/buffered_output.h"
#include "core/formats/formats.h"

namespace varimesh::formats {

/// Writes a whole MSH file of version 2.2 or 4.1, ASCII or binary. MSH files have no fields, so they are ignored.
Expected<void> write_gmsh(const HighOrderMesh& mesh, Format format, const Sink& sink,
                          std::span<const CellField> fields);

/// Write the nodes, elements and periodic links, and in MSH 4.1 the entities.
void write_body_22(const HighOrderMesh& mesh, BufferedOutput& out);
void write_body_41(const HighOrderMesh& mesh, Format format, BufferedOutput& out);

/// The section with this name that was read from this format, or null.
const ForeignSection* kept_section(const HighOrderMesh& mesh, Format format, std::string_view name);

}  // namespace varimesh::formats
