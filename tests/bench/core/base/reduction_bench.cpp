// Inner products by Reduction, whose bits do not depend on the division of the work, beside a plain loop.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "core/base/reduction.h"

namespace varimesh {
namespace {

struct Vectors {
  explicit Vectors(std::size_t size) : a(size), b(size) {
    for (std::size_t i = 0; i < size; ++i) {
      a[i] = 1.0 / static_cast<double>(1 + i % 977);
      b[i] = static_cast<double>(static_cast<std::uint32_t>(i) * 2654435761U % 1'000'003U) / 1e6 - 0.5;
    }
  }
  std::vector<double> a, b;
};

void plain(benchmark::State& state) {
  const Vectors vectors(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    double sum = 0;
    for (std::size_t i = 0; i < vectors.a.size(); ++i) sum += vectors.a[i] * vectors.b[i];
    benchmark::DoNotOptimize(sum);
  }
}

void exact(benchmark::State& state) {
  const Vectors vectors(static_cast<std::size_t>(state.range(0)));
  const Team team(static_cast<int>(state.range(1)));
  const Reduction reduction(team);
  team.run([&] {
    for (auto _ : state)
      benchmark::DoNotOptimize(
          reduction.sum(vectors.a.size(), 16384, [&](std::size_t i) { return vectors.a[i] * vectors.b[i]; }));
  });
}

BENCHMARK(plain)->Arg(2'000)->Arg(100'000)->Arg(10'000'000)->Unit(benchmark::kMicrosecond);
BENCHMARK(exact)
    ->ArgsProduct({{2'000, 100'000, 10'000'000}, {1, 2}})
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace varimesh

BENCHMARK_MAIN();
