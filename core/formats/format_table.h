// The table of formats: everything that reading and writing need to know about a format. Internal to core/formats.
#pragma once

#include "core/base/team.h"
#include "core/formats/formats.h"

namespace varimesh::formats {

/// One format. A format that can only be written has no `recognises` and no `read`; one that can only be read has no
/// `write`.
struct FormatEntry {
  Format format;
  std::string_view name;
  std::string_view extension;
  /// Whether the bytes begin like a file of this format.
  bool (*recognises)(std::string_view bytes) = nullptr;
  /// Reads a file, inside team.run(). Errors are returned, or thrown as ReadFailure. A reader of files that others may
  /// have made counts its memory in an Allowance, which also looks at the team's token.
  Expected<MeshFile> (*read)(std::string_view bytes, const Team& team) = nullptr;
  /// Writes a file, inside team.run(). Formats without fields ignore `fields`.
  Expected<void> (*write)(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team) = nullptr;
  /// One sentence about what a file of this format cannot hold of the mesh, or nothing. Null if it holds everything.
  std::string (*left_out)(const HighOrderMesh& mesh) = nullptr;
  /// As check_sides() of formats.h, inside team.run(). Null if the format can hold any.
  Expected<void> (*check_sides)(const HighOrderMesh& mesh, const Team& team) = nullptr;
  /// Up to which order the format has serendipity elements, which `write` then gets if they came so. 0: it has none.
  int serendipity_order = 0;
  /// Whether a file can hold elements of several orders.
  bool several_orders = false;
};

/// The formats of this library. If several formats have the same extension, the last of them is the one that is written
/// if nothing else decides.
std::span<const FormatEntry> format_table();

/// The functions of formats.h and stoppable_write.h for any table.
Expected<Format> from_name(std::span<const FormatEntry> table, std::string_view name);
Expected<Format> for_output(std::span<const FormatEntry> table, std::string_view path, Format requested,
                            Format read_as);
Expected<MeshFile> read(std::span<const FormatEntry> table, std::string_view bytes, int threads = 1,
                        const StopToken* stop = nullptr);
Expected<void> write(std::span<const FormatEntry> table, const HighOrderMesh& mesh, Format format, const Sink& sink,
                     std::span<const CellField> fields, int threads = 1, const StopToken* stop = nullptr);

}  // namespace varimesh::formats
