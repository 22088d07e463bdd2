// A parallel loop whose results keep their order. Internal to the library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/base/team.h"

namespace varimesh::detail {

/// Runs make(i, out) for i = 0, …, count − 1 and appends what it puts into `out` to `result`, in the order of i. A task
/// takes `chunk` of them. Call it inside team.run(); the result does not depend on the number of threads.
template <class Item, class Make>
void gather(const Team& team, std::size_t count, std::size_t chunk, std::vector<Item>& result, Make&& make) {
  std::vector<std::vector<Item>> parts((count + chunk - 1) / chunk);
  team.for_each(static_cast<std::int32_t>(parts.size()), 1, [&](std::int32_t part) {
    const std::size_t first = at(part) * chunk;
    for (std::size_t i = first; i < std::min(count, first + chunk); ++i) {
      team.look();
      make(i, parts[at(part)]);
    }
  });
  for (std::vector<Item>& part : parts) std::ranges::move(part, std::back_inserter(result));
}

}  // namespace varimesh::detail
