// Threads of one process as ranks, for tests.
#pragma once

#include <functional>

#include "core/ranks/ranks.h"

namespace varimesh {

/// Calls body(ranks) on `count` threads, each of which is a rank, and returns when all have returned. body() must not
/// throw.
void run_as_ranks(int count, const std::function<void(const Ranks&)>& body);

}  // namespace varimesh
