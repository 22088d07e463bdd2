// Measures how many cells per second are sampled and certified on one thread. To normalise the figures, multiply them
// by 82 and divide by the yardstick's GFLOP/s.
#include <benchmark/benchmark.h>

#include "core/quality/quality.h"
#include "core/validity/certifier.h"
#include "tests/core/support/made_cells.h"

namespace varimesh {
namespace {

constexpr int kCells = 2000;

/// Good cells that share no nodes, shaken a little.
HighOrderMesh good_cells(const benchmark::State& state) {
  const int order = static_cast<int>(state.range(1));
  return testing::shaken_cells(Shape(state.range(0)), order, kCells, 0.02 / (order * order), 1);
}

void certifying(benchmark::State& state) {
  const HighOrderMesh mesh = good_cells(state);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  const Team team(1);
  for (auto _ : state) certifier.certify(mesh.coordinates, certificates, team);
  if (summarise(certificates).valid != kCells) state.SkipWithError("the cells should all be valid");
  state.SetItemsProcessed(state.iterations() * kCells);
}

void sampling(benchmark::State& state) {
  const HighOrderMesh mesh = good_cells(state);
  for (auto _ : state) benchmark::DoNotOptimize(cell_quality(mesh, 0, 1));
  state.SetItemsProcessed(state.iterations() * kCells);
}

void shapes_and_orders(benchmark::internal::Benchmark* bench) {
  for (const Shape shape : testing::kCellShapes)
    for (const int order : {2, 3, 4}) bench->Args({static_cast<int>(shape), order});
}

BENCHMARK(certifying)->Apply(shapes_and_orders)->Unit(benchmark::kMillisecond);
BENCHMARK(sampling)->Apply(shapes_and_orders)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace varimesh

BENCHMARK_MAIN();
