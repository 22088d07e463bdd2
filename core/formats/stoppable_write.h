// Writing that a token can stop.
#pragma once

#include <span>

#include "core/base/stop_token.h"
#include "core/formats/formats.h"

namespace varimesh::formats {

/// write() of formats.h.
/// @param stop    if it asks to stop, writing ends soon, with the error Output; may be null
Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                     int threads, const StopToken* stop);

}  // namespace varimesh::formats
