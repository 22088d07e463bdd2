// Where the bytes of a file go that is written.
#pragma once

#include <functional>
#include <string_view>

namespace varimesh {

/// Receives the bytes of a file piece by piece, in order. Returns false to stop, for example if the disk is full or a
/// pipe is broken. The pieces may come from different threads, but one after another.
using Sink = std::function<bool(std::string_view)>;

}  // namespace varimesh
