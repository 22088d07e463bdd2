#include "core/parts/close_up.h"

#include <algorithm>

#include "core/base/index.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 2048;

/// Ascending places as ranges.
std::vector<formats::ElementRange> ranges_of(const std::vector<std::int64_t>& places) {
  std::vector<formats::ElementRange> ranges;
  for (const std::int64_t place : places) {
    if (ranges.empty() || ranges.back().first + ranges.back().count != place) ranges.push_back({place, 0});
    ++ranges.back().count;
  }
  return ranges;
}

void close_cuts(CloseUp& close, const Seams& seams) {
  const Cells cells(close.mesh, close.mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::int32_t f = close.facets.first[cell]; f < close.facets.first[cell + 1]; ++f) {
      if (close.facets.neighbour[at(f)] >= 0) continue;
      const FacetKey key = facet_key(close.mesh, cells, cell, at(f - close.facets.first[cell]));
      if (!seams.is_outer(key) && !std::ranges::binary_search(seams.unclear, key))
        close.facets.neighbour[at(f)] = static_cast<std::int32_t>(cell);
    }
}

}  // namespace

Expected<CloseUp> close_up(const formats::PartedFile& file, const Part& part, const std::vector<char>& shown,
                           const Seams& seams, const Ranks& ranks, const Team& team) {
  std::vector<std::int64_t> places;
  for (std::size_t cell = 0; cell < shown.size(); ++cell)
    if (shown[cell] != 0) places.push_back(part.first_cell + static_cast<std::int64_t>(cell));
  places = ranks.gather(places);
  CloseUp close;
  const auto done = ranks.together([&]() -> Expected<void> {
    if (!ranks.is_first()) return {};
    auto mesh = file.read({ranges_of(places), {{0, file.borders()}}}, team.threads(), &close.places);
    if (!mesh) return tl::unexpected(mesh.error());
    close.mesh = std::move(*mesh);
    close.mesh.dimension = file.dimension();
    close.mesh.order = file.order();
    team.run([&] { close.facets = facets(close.mesh, team); });
    close_cuts(close, seams);
    return {};
  });
  if (!done) return tl::unexpected(done.error());
  return close;
}

void show_notable(const Part& part, const Seams& seams, std::vector<char>& shown, const Team& team) {
  const Cells cells(part.mesh, part.mesh.dimension);
  team.run([&] {
    team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t cell = begin; cell < end; ++cell)
        for (std::size_t f = 0; f < reference::info(cells.shape(cell)).facets.size() && shown[cell] == 0; ++f)
          shown[cell] = seams.is_notable(facet_key(part.mesh, cells, cell, f)) ? 1 : 0;
    });
  });
}

void show_cells_at(const Part& part, const std::vector<std::int64_t>& nodes, std::vector<char>& shown) {
  if (nodes.empty()) return;
  std::vector<char> is_one(part.mesh.node_count());
  for (std::size_t node = 0; node < is_one.size(); ++node)
    is_one[node] = std::ranges::binary_search(nodes, part.mesh.node_numbers[node]) ? 1 : 0;
  const Cells cells(part.mesh, part.mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    if (std::ranges::any_of(cells.nodes(cell), [&](std::int32_t node) { return is_one[at(node)] != 0; }))
      shown[cell] = 1;
}

}  // namespace varimesh
