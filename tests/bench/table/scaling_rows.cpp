// Rows for the number of threads that the machine has: the same mesh with more threads, and a mesh that grows with the
// number of threads.
#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

/// 1, 2, 4, … and the number of cores.
std::vector<int> thread_counts() {
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::vector<int> counts;
  for (int threads = 1; threads < cores; threads *= 2) counts.push_back(threads);
  counts.push_back(cores);
  return counts;
}

std::string counted(int threads) { return text("%d thread%s", threads, threads == 1 ? "" : "s"); }

/// Threads that wait for a processor say nothing about how well the work is divided.
void mark(const Measured& m, Line& line) {
  line.disturbed = m.conditions.disturbed();
  line.judged = !line.disturbed;
}

/// The least speed-up of a whole run; 0: no goal.
double least_speed_up(int threads) { return threads == 2 ? 1.8 : threads == 16 ? 12 : 0; }

/// Whole runs to the default tolerance, set-up and reports included.
void strong(Bench& bench, Shape shape, int order) {
  const std::string name = cube_name(shape, order, bench.small ? 2'000 : 120'000);
  double alone = 0;
  for (const int threads : thread_counts()) {
    Line line{name + " to 1e-06, " + counted(threads) + " against 1"};
    Run run = until_tolerance(name, 1e-6);
    run.options.threads = threads;
    Measured m;
    if (!bench.measure(line.what, run, m)) return;
    const double seconds = m.wall.whole;
    if (threads == 1) alone = seconds;
    line.measured = text("%.2f", alone / seconds);
    line.normalised = text("%.3g s", m.conditions.normalised(seconds));
    line.quality = text("%.0f %% of %d times", 100 * alone / seconds / threads, threads);
    if (const double least = least_speed_up(threads); least > 0) {
      line.target = text("%g times", least);
      if (!(alone / seconds >= least)) line.missed.emplace_back("speed-up");
    }
    mark(m, line);
    bench.table.add(line);
  }
}

struct Phases {
  Method method;
  const char* what;
  int iterations;
};
constexpr Phases kPhases[] = {{Method::Sweeps, "a sweep", 6}, {Method::Newton, "a product of Newton's steps", 4}};

/// As many elements for every thread. A product of Newton's steps stands for its share of everything in the step.
void weak(Bench& bench, Shape shape, int order) {
  const std::int64_t each = bench.small ? 2'000 : 30'000;
  for (const Phases& phase : kPhases) {
    double alone = 0;
    for (const int threads : thread_counts()) {
      const std::string name = cube_name(shape, order, each * threads);
      Line line{name + ", " + phase.what + ", " + counted(threads)};
      Run run{name};
      run.options.method = phase.method;
      run.options.active_set = false;
      run.options.tolerance = 1e-14;
      run.options.max_iterations = phase.iterations;
      run.options.threads = threads;
      Measured m;
      if (!bench.measure(line.what, run, m)) return;
      const double seconds =
          phase.method == Method::Sweeps ? m.wall.sweep : m.wall.later / std::max(1.0, m.later_products);
      const double per_element = seconds * threads / static_cast<double>(m.elements);
      if (threads == 1) alone = per_element;
      line.measured = text("%.2f", alone / per_element);
      line.normalised = text("%.3g s", m.conditions.normalised(seconds));
      line.quality =
          text("share of ideal; %lld elements, %.0f products", static_cast<long long>(m.elements), m.later_products);
      mark(m, line);
      bench.table.add(line);
    }
  }
}

}  // namespace

const std::vector<Row> kScalingRows{
    {"scaling.strong.tetrahedra", When::Asked, [](Bench& b) { strong(b, Shape::Tetrahedron, 4); }},
    {"scaling.strong.hexahedra", When::Asked, [](Bench& b) { strong(b, Shape::Hexahedron, 3); }},
    {"scaling.weak.tetrahedra", When::Asked, [](Bench& b) { weak(b, Shape::Tetrahedron, 4); }},
    {"scaling.weak.hexahedra", When::Asked, [](Bench& b) { weak(b, Shape::Hexahedron, 3); }},
};

}  // namespace varimesh::bench
