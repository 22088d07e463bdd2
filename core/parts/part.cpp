#include "core/parts/part.h"

#include "core/quality/accuracy/team_accuracy.h"

namespace varimesh {

formats::ElementRange range_of_rank(std::int64_t total, int rank, int count) {
  const auto begin = [&](int r) { return total / count * r + total % count * r / count; };
  return {begin(rank), begin(rank + 1) - begin(rank)};
}

Expected<Part> read_part(const formats::PartedFile& file, const Ranks& ranks, int threads) {
  Part part;
  formats::ElementRange cells = range_of_rank(file.cells(), ranks.rank(), ranks.count());
  const std::int64_t end = file.aligned(cells.first + cells.count, kAccuracyBatch);
  cells.first = file.aligned(cells.first, kAccuracyBatch);
  cells.count = end - cells.first;
  part.first_cell = cells.first;
  auto mesh = file.read({{cells}, {range_of_rank(file.borders(), ranks.rank(), ranks.count())}}, threads, &part.places);
  if (!mesh) return tl::unexpected(mesh.error());
  part.mesh = std::move(*mesh);
  part.mesh.dimension = file.dimension();
  part.mesh.order = file.order();
  return part;
}

}  // namespace varimesh
