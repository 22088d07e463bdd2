// What reading changed in a mesh. HighOrderMesh::foreign keeps it from reading to writing, under names that no format
// writes. Internal to core/formats.
#pragma once

#include <string>
#include <vector>

#include "core/mesh/changes/completion/complete.h"

namespace varimesh::formats {

/// Notes sentences for reading_notes().
void note_reading(HighOrderMesh& mesh, const std::vector<std::string>& sentences);

/// Notes which shapes came as serendipity elements of the mesh's order.
void remember_serendipity(HighOrderMesh& mesh, const std::vector<Shape>& shapes);

/// These shapes, if the mesh has the order that it had then.
std::vector<Shape> serendipity_of(const HighOrderMesh& mesh);

/// Notes which elements were raised to the mesh's order.
void remember_lower(HighOrderMesh& mesh, const std::vector<CameLower>& lower);

/// These elements, if keep_orders() was called and the mesh has the order that it had then.
std::vector<CameLower> lower_of(const HighOrderMesh& mesh);

/// Whether a section holds such notes.
bool is_reading_note(const ForeignSection& section);

}  // namespace varimesh::formats
