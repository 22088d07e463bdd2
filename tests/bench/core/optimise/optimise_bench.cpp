// Measures the kernel of a sweep (ns per quadrature point and visit) and the product with the Hessian (ns per element)
// on one thread, with GFLOP/s and the share of the yardstick's GFLOP/s, and the memory bandwidth for the roofline. The
// meshes are made here.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <string>

#include "tests/bench/core/optimise/loads.h"
#include "tests/bench/measure_yardstick.h"
#include "tests/core/support/meshes.h"

namespace varimesh::bench {
namespace {

using testing::Filling;

double yardstick_gflops = 0;

void say_rates(benchmark::State& state, double flops, const char* name, double items) {
  using benchmark::Counter;
  const double iterations = static_cast<double>(state.iterations());
  state.counters["GFLOP/s"] = Counter(flops * iterations * 1e-9, Counter::kIsRate);
  if (yardstick_gflops > 0)
    state.counters["of yardstick"] = Counter(flops * iterations * 1e-9 / yardstick_gflops, Counter::kIsRate);
  state.counters[name] = Counter(items * iterations * 1e-9, Counter::kIsRate | Counter::kInvert);
}

/// A shaken grid of about `cells` cells.
HighOrderMesh made_mesh(Filling filling, int order, int cells) {
  const int a_box = filling == Filling::Tetrahedra                                ? 12
                    : filling == Filling::Pyramids                                ? 6
                    : filling == Filling::Prisms || filling == Filling::Triangles ? 2
                                                                                  : 1;
  int n = 1;
  while ((testing::is_plane(filling) ? n * n : n * n * n) * a_box < cells) ++n;
  HighOrderMesh mesh = testing::grid(filling, {n, n, n}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  testing::shake(mesh, 0.01 / (n * order), 1);
  return mesh;
}

void sweep(benchmark::State& state, Filling filling, int order, Energy energy, int cells) {
  Options options;
  options.constants = Constants::Reference;
  options.energy = energy;
  SweepLoad load(made_mesh(filling, order, cells), options);
  for (auto _ : state) {
    state.PauseTiming();
    load.reset();
    load.sweep();  // the first sweep moves nodes far
    state.ResumeTiming();
    load.sweep();
  }
  say_rates(state, load.points() * flops_per_point(load.problem().dimension), "s/point/visit", load.points() * 1e9);
}

void product(benchmark::State& state, Energy energy, int cells) {
  Options options;
  options.constants = Constants::Reference;
  options.energy = energy;
  ProductLoad load(made_mesh(Filling::Tetrahedra, 4, cells), options);
  for (auto _ : state) load.product();
  say_rates(state, load.flops(), "s/element", load.cells() * 1e9);
}

/// a = b + s c over arrays that do not fit into a cache. It counts 24 bytes per entry, read or written. If the machine
/// reads what it is about to overwrite, it reads 8 more bytes, which are not counted.
void memory(benchmark::State& state) {
  constexpr std::size_t n = std::size_t{1} << 24;
  std::vector<double> a(n), b(n, 1.0), c(n, 2.0);
  for (auto _ : state) {
    for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + 3.0 * c[i];
    benchmark::DoNotOptimize(a.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * n * 24));
}

constexpr int kMesh = 10000, kCache = 90;  // cells

BENCHMARK_CAPTURE(sweep, tetrahedra_p4_cached, Filling::Tetrahedra, 4, Energy::Hyperelastic, kCache);
BENCHMARK_CAPTURE(sweep, tetrahedra_p4, Filling::Tetrahedra, 4, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(sweep, tetrahedra_p4_linear_elastic, Filling::Tetrahedra, 4, Energy::LinearElastic, kMesh);
BENCHMARK_CAPTURE(sweep, tetrahedra_p4_winslow, Filling::Tetrahedra, 4, Energy::Winslow, kMesh);
BENCHMARK_CAPTURE(sweep, tetrahedra_p4_distortion, Filling::Tetrahedra, 4, Energy::Distortion, kMesh);
BENCHMARK_CAPTURE(sweep, tetrahedra_p2, Filling::Tetrahedra, 2, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(sweep, triangles_p5, Filling::Triangles, 5, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(sweep, quadrilaterals_p4, Filling::Quadrilaterals, 4, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(sweep, hexahedra_p3, Filling::Hexahedra, 3, Energy::Hyperelastic, kMesh / 5);
BENCHMARK_CAPTURE(sweep, prisms_p2, Filling::Prisms, 2, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(sweep, pyramids_p3, Filling::Pyramids, 3, Energy::Hyperelastic, kMesh / 2);
BENCHMARK_CAPTURE(product, cached, Energy::Hyperelastic, kCache);
BENCHMARK_CAPTURE(product, mesh, Energy::Hyperelastic, kMesh);
BENCHMARK_CAPTURE(product, mesh_linear_elastic, Energy::LinearElastic, kMesh);
BENCHMARK_CAPTURE(product, mesh_winslow, Energy::Winslow, kMesh);
BENCHMARK_CAPTURE(product, mesh_distortion, Energy::Distortion, kMesh);
BENCHMARK(memory);

}  // namespace
}  // namespace varimesh::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  varimesh::bench::yardstick_gflops = varimesh::bench::yardstick().processor;
  benchmark::AddCustomContext("yardstick, GFLOP/s", std::to_string(varimesh::bench::yardstick_gflops));
  benchmark::RunSpecifiedBenchmarks();
}
