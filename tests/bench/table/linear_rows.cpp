// Rows for meshes of order 1 with many vertices, where the problem of order 1 is the whole problem.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

constexpr double kMostApart = 1.2;  // products on one mesh against the other

bool is_close(double a, double b) { return std::max(a, b) <= kMostApart * std::min(a, b); }

/// Squares on either side of 200,000 free vertices. The mesh is raised to `order`.
void squares(Bench& bench, int order) {
  const std::array<int, 2> cells = bench.small ? std::array{20, 21} : std::array{448, 449};
  Measured first;
  for (const int one : cells) {
    Line line{text("%d x %d squares of order %d, CG iterations", one, one, order)};
    Run run = until_tolerance(square_name(one), 1e-6);
    run.options.method = Method::Newton;
    run.options.target = Target::Ideal;
    run.options.order = order;
    Measured m;
    if (!bench.measure(line.what, run, m)) return;
    line.measured = text("%.0f in the first step, %.1f per step", m.first_products, m.products);
    line.normalised = text("%.3g s", m.normalised().whole);
    line.target = text("within %.1f times of each other", kMostApart);
    line.quality = quality_of(m) + text("; %lld free nodes, %d steps, energy %.6g",
                                        static_cast<long long>(m.free_nodes), m.iterations, m.energy);
    line.disturbed = m.conditions.disturbed();
    if (one == cells[0]) first = m;
    if (!is_close(first.first_products, m.first_products)) line.missed.emplace_back("first step");
    if (!is_close(first.products, m.products)) line.missed.emplace_back("per step");
    if (!m.converged) line.missed.emplace_back("not converged");
    bench.table.add(line);
  }
}

/// Hexahedra of order 1 with about 20,000 and 200,000 free vertices.
void hexahedra(Bench& bench) {
  const std::array<std::int64_t, 2> sizes =
      bench.small ? std::array<std::int64_t, 2>{500, 5'000} : std::array<std::int64_t, 2>{21'400, 205'000};
  constexpr double kMost = 12;
  double before = 0;
  for (const std::int64_t size : sizes) {
    Run run = until_tolerance(cube_name(Shape::Hexahedron, 1, size), 1e-6);
    run.options.method = Method::Newton;
    run.options.target = Target::Ideal;
    Measured m;
    if (!bench.measure(run.mesh + ", a Newton step", run, m)) return;
    Line line{text("hexahedra of order 1, %lld free vertices, a step", static_cast<long long>(m.free_nodes))};
    const double step = m.normalised().each;
    if (before == 0) before = step;
    line.measured = text("%.3g s", m.times().each);
    line.normalised = text("%.3g s", step);
    if (!bench.small) line.target = text("%g times the first", kMost);  // for ten times as many vertices
    line.quality = quality_of(m) + text("; %.1f times the first; %.1f products", step / before, m.products);
    line.disturbed = m.conditions.disturbed();
    if (!(step <= kMost * before)) line.missed.emplace_back("time");
    if (!m.converged) line.missed.emplace_back("not converged");
    bench.table.add(line);
  }
}

}  // namespace

const std::vector<Row> kLinearRows{
    {"linear.squares", When::Full, [](Bench& b) { squares(b, 1); }},
    {"linear.squares.p2", When::Full, [](Bench& b) { squares(b, 2); }},
    {"linear.hexahedra", When::Full, hexahedra},
};

}  // namespace varimesh::bench
