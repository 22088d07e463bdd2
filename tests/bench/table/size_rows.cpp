// Rows that show how time, memory and conjugate-gradient iterations grow with the mesh. The meshes are structured, and
// similar to each other at all sizes.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

constexpr double kKiB = 1024, kGigabyte = 1e9;
constexpr double kMillion = 1e6;

const char* plural(Shape shape) { return reference::info(shape).plural.data(); }

// === Time and memory ===

constexpr double kMostGrowth = 1.15;    // of the time per element
constexpr double kMillionPeak = 8.5e9;  // bytes, for a million tetrahedra of order 4

/// One thread, to the default tolerance.
void growth(Bench& bench, Shape shape, int order) {
  double first = 0;
  for (const std::int64_t elements : sizes(bench)) {
    const std::string name = cube_name(shape, order, elements);
    Measured m;
    if (!bench.measure(name + " to 1e-06", until_tolerance(name, 1e-6), m)) continue;
    const auto count = static_cast<double>(m.elements);
    const double each = m.normalised().whole / count;
    if (first == 0) first = each;
    Line time{text("%lld %s of order %d to 1e-06", static_cast<long long>(m.elements), plural(shape), order)};
    time.measured = text("%.3g s", m.times().whole);
    time.normalised = text("%.3g s", m.normalised().whole);
    time.target = text("%.2f times the first per element", kMostGrowth);
    time.quality = quality_of(m) + text("; %.0f us per element, %.2f times the first; %d iterations", 1e6 * each,
                                        each / first, m.iterations);
    time.disturbed = m.conditions.disturbed();
    if (!(each <= kMostGrowth * first)) time.missed.emplace_back("time");
    if (!m.converged) time.missed.emplace_back("not converged");
    bench.table.add(time);
    Line memory{
        text("%lld %s of order %d, memory at the peak", static_cast<long long>(m.elements), plural(shape), order)};
    memory.measured = text("%.3g GB", m.peak_bytes / kGigabyte);
    memory.quality = text("%.2f KiB per element; estimated %.2f times the peak", m.peak_bytes / kKiB / count,
                          m.estimated_bytes / m.peak_bytes);
    if (shape == Shape::Tetrahedron && order == 4 && elements == static_cast<std::int64_t>(kMillion)) {
      memory.target = text("%.3g GB", kMillionPeak / kGigabyte);
      if (m.peak_bytes > kMillionPeak) memory.missed.emplace_back("memory");
    }
    bench.table.add(memory);
  }
}

// === Conjugate gradients ===

/// A stiffness against volume, and the most iterations per step that it may take.
struct Stiffness {
  double lambda;  ///< 0: the reference constant.
  double most;
};
constexpr std::array<Stiffness, 3> kStiffnesses{{{0, 25}, {10, 36}, {160, 70}}};
constexpr double kReferenceLambda = 1 / 0.6;
constexpr double kMostIterationGrowth = 1.3;

/// About what a run takes per node, from 8.5 GB for 11 million nodes of tetrahedra of order 4.
constexpr double kBytesPerNode = 800;

/// Whether the machine's memory is enough for a run on this mesh.
bool fits(Shape shape, int order, std::int64_t elements) {
  const double nodes = static_cast<double>(elements) * std::pow(order, 3) / (shape == Shape::Hexahedron ? 1 : 6);
  const double memory = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  return nodes * kBytesPerNode < 0.8 * memory;
}

/// The number of iterations does not depend on the number of threads, so all of them are used.
Run counting_run(Shape shape, int order, std::int64_t elements, double lambda) {
  Run run = until_tolerance(cube_name(shape, order, elements), 1e-6, lambda);
  run.options.threads = 0;
  // A straight-sided mesh has nothing to do for the straight-sided target.
  if (order == 1) run.options.target = Target::Ideal;
  return run;
}

void iterations(Bench& bench, Shape shape, int order, const Stiffness& stiffness) {
  Line line{text("%s of order %d, lambda %.3g, CG iterations per step", plural(shape), order,
                 stiffness.lambda > 0 ? stiffness.lambda : kReferenceLambda)};
  line.target = text("%g, growing at most %.1f times", stiffness.most, kMostIterationGrowth);
  double least = 0, most = 0, growth = 1;
  bool all_converged = true;
  for (const std::int64_t elements : sizes(bench)) {
    if (!fits(shape, order, elements)) {
      line.quality += text("; %lld elements do not fit into memory", static_cast<long long>(elements));
      continue;
    }
    Measured m;
    if (!bench.measure(line.what, counting_run(shape, order, elements, stiffness.lambda), m)) return;
    least = least == 0 ? m.products : std::min(least, m.products);
    most = std::max(most, m.products);
    growth = std::max(growth, least > 0 ? m.products / least : 0);
    all_converged = all_converged && m.converged;
    line.measured += text("%s%.1f", line.measured.empty() ? "" : ", ", m.products);
    line.quality += text("%s%lld elements: %d steps, most in one %.0f", line.quality.empty() ? "" : "; ",
                         static_cast<long long>(m.elements), m.iterations, m.most_products);
  }
  if (!(least > 0)) line.missed.emplace_back("no step");
  if (!(most <= stiffness.most)) line.missed.emplace_back("iterations");
  if (!(growth <= kMostIterationGrowth)) line.missed.emplace_back("growth");
  if (!all_converged) line.missed.emplace_back("not converged");
  bench.table.add(line);
}

template <Shape shape, int order>
void iterations(Bench& bench) {
  for (const Stiffness& stiffness : kStiffnesses) iterations(bench, shape, order, stiffness);
}

}  // namespace

std::vector<std::int64_t> sizes(const Bench& bench) {
  std::vector<std::int64_t> all{30'000, 120'000, 480'000, 1'000'000};
  if (bench.small) all = {1'000, 4'000};
  std::erase_if(all, [&](std::int64_t size) { return size > bench.most_elements; });
  return all;
}

const std::vector<Row> kSizeRows{
    {"size.tetrahedra", When::Asked, [](Bench& b) { growth(b, Shape::Tetrahedron, 4); }},
    {"size.hexahedra", When::Asked, [](Bench& b) { growth(b, Shape::Hexahedron, 3); }},
    {"cg.tetrahedra.p1", When::Asked, iterations<Shape::Tetrahedron, 1>},
    {"cg.tetrahedra.p2", When::Asked, iterations<Shape::Tetrahedron, 2>},
    {"cg.tetrahedra.p3", When::Asked, iterations<Shape::Tetrahedron, 3>},
    {"cg.tetrahedra.p4", When::Asked, iterations<Shape::Tetrahedron, 4>},
    {"cg.tetrahedra.p5", When::Asked, iterations<Shape::Tetrahedron, 5>},
    {"cg.tetrahedra.p6", When::Asked, iterations<Shape::Tetrahedron, 6>},
    {"cg.hexahedra.p1", When::Asked, iterations<Shape::Hexahedron, 1>},
    {"cg.hexahedra.p2", When::Asked, iterations<Shape::Hexahedron, 2>},
    {"cg.hexahedra.p3", When::Asked, iterations<Shape::Hexahedron, 3>},
    {"cg.hexahedra.p4", When::Asked, iterations<Shape::Hexahedron, 4>},
    {"cg.hexahedra.p5", When::Asked, iterations<Shape::Hexahedron, 5>},
    {"cg.hexahedra.p6", When::Asked, iterations<Shape::Hexahedron, 6>},
};

}  // namespace varimesh::bench
