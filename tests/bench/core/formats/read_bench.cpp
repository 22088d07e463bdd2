// Measures how fast a million tetrahedra are read, written and checked on one core. Bytes per second are bytes of the
// file.
#include <benchmark/benchmark.h>

#include "core/formats/formats.h"
#include "core/mesh/check.h"

namespace varimesh {
namespace {

using formats::Format;

// A grid of 55³ cubes, each cut into six tetrahedra, 998,250 in all. The coordinates need all their digits.
HighOrderMesh million() {
  constexpr std::int32_t n = 55, m = n + 1;
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  for (std::int32_t k = 0; k < m; ++k)
    for (std::int32_t j = 0; j < m; ++j)
      for (std::int32_t i = 0; i < m; ++i) {
        mesh.coordinates.insert(mesh.coordinates.end(), {i / 55.0 / 3, j / 55.0 / 7, k / 55.0 / 11});
        mesh.node_numbers.push_back(std::int64_t(mesh.node_numbers.size()) + 1);
      }
  mesh.node_blocks.push_back({-1, 0, 0, m * m * m});
  ElementBlock block{Shape::Tetrahedron, 1, 1, {1}, {}, {}, {}, {}};
  const std::int32_t steps[6][2] = {{1, m}, {m, 1}, {1, m * m}, {m * m, 1}, {m, m * m}, {m * m, m}};
  for (std::int32_t k = 0; k < n; ++k)
    for (std::int32_t j = 0; j < n; ++j)
      for (std::int32_t i = 0; i < n; ++i)
        for (int t = 0; t < 6; ++t) {
          const std::int32_t a = i + m * (j + m * k), b = a + steps[t][0], c = b + steps[t][1], d = a + 1 + m + m * m;
          // Even permutations of the three steps are right-handed, odd ones left-handed.
          const bool left = t == 1 || t == 2 || t == 5;
          block.nodes.insert(block.nodes.end(), {a, left ? c : b, left ? b : c, d});
          block.numbers.push_back(std::int64_t(block.numbers.size()) + 1);
        }
  mesh.blocks.push_back(std::move(block));
  return mesh;
}

const HighOrderMesh& mesh() {
  static const HighOrderMesh made = million();
  return made;
}

std::string bytes_of(Format format) {
  std::string bytes;
  (void)formats::write(mesh(), format, [&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  return bytes;
}

void read(benchmark::State& state) {
  const std::string bytes = bytes_of(Format(state.range(0)));
  for (auto _ : state) {
    auto file = formats::read(bytes);
    if (!file) state.SkipWithError(file.error().sentence.c_str());
    benchmark::DoNotOptimize(file);
  }
  state.SetBytesProcessed(std::int64_t(state.iterations() * bytes.size()));
}

void write(benchmark::State& state) {
  std::size_t size = 0;
  for (auto _ : state) {
    const auto done = formats::write(mesh(), Format(state.range(0)), [&](std::string_view piece) {
      size += piece.size();
      return true;
    });
    benchmark::DoNotOptimize(done);
  }
  state.SetBytesProcessed(std::int64_t(size));
}

void check_million(benchmark::State& state) {
  for (auto _ : state) {
    const auto checked = check_structure(mesh());
    if (!checked) state.SkipWithError(checked.error().sentence.c_str());
  }
}

BENCHMARK(read)->DenseRange(int(Format::Msh22), int(Format::Msh41Binary))->Unit(benchmark::kMillisecond);
BENCHMARK(write)->DenseRange(int(Format::Msh22), int(Format::Vtu))->Unit(benchmark::kMillisecond);
BENCHMARK(check_million)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace varimesh

BENCHMARK_MAIN();
