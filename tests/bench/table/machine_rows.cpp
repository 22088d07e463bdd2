// Rows for the kernels by themselves, for several threads against one, and for one instruction set against another.
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <thread>

#include "tests/bench/core/optimise/loads.h"
#include "tests/bench/measure_yardstick.h"
#include "tests/bench/table/table.h"
#include "tests/core/support/meshes.h"

namespace varimesh::bench {
namespace {

/// Processor time of a call, which other programs disturb little.
template <class Call>
double seconds_of(const Call& call) {
  const double start = processor_seconds();
  call();
  return processor_seconds() - start;
}

/// Seconds per call, from the best of ten batches of at least 0.05 s.
template <class Call>
double best_seconds(const Call& call) {
  double best = 1e300;
  int calls = 1;
  for (int batch = 0; batch < 10;) {
    const double seconds = seconds_of([&] {
      for (int i = 0; i < calls; ++i) call();
    });
    best = std::min(best, seconds / calls);
    if (seconds > 0.05)
      ++batch;
    else
      calls *= 2;
  }
  return best;
}

HighOrderMesh cached_mesh() {
  HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {2, 2, 2}, 4, testing::bent(3));
  testing::shake(mesh, 0.001, 1);
  return mesh;
}

// === Kernels ===

void add_share(double flops, const Conditions& conditions, double seconds, Line& line) {
  line.quality = text("%.1f GFLOP/s, %.0f %% of the yardstick", flops / seconds * 1e-9,
                      100 * flops / seconds * 1e-9 / conditions.yardstick);
  line.disturbed = conditions.disturbed();
}

void product(Bench& bench, Line line, double most, const HighOrderMesh& mesh) {
  Conditions conditions;
  const auto measured = in_child(
      [&] {
        ProductLoad load(mesh, reference_options());
        const double seconds = best_seconds([&] { load.product(); });
        return std::vector<double>{seconds, static_cast<double>(load.cells()), load.flops()};
      },
      Yardsticks::Take, conditions);
  if (!measured) return bench.table.fail(line.what, measured.error());
  const double seconds = (*measured)[0], cells = (*measured)[1];
  const double normalised = conditions.normalised(seconds) / cells * 1e6;
  line.measured = text("%.3f us", seconds / cells * 1e6);
  line.normalised = text("%.3f us", normalised);
  add_share((*measured)[2], conditions, seconds, line);
  if (!(normalised <= most)) line.missed.emplace_back("time");
  bench.table.add(line);
}

void products(Bench& bench) {
  product(bench, {"a product, P4 tetrahedra from cache", "", "", "0.35 us per element", {}, "", "prototype 0.34"}, 0.35,
          cached_mesh());
  if (bench.small) return;
  const Line line{"a product, sph10k_p4", "", "", "0.6 us per element", {}, "", "prototype 0.57"};
  const auto mesh = bench.runner.meshes().load("sph10k_p4");
  if (!mesh) return bench.table.fail(line.what, mesh.error());
  product(bench, line, 0.6, *mesh);
}

constexpr int kSweeps = 10;

/// Measures the second sweep from the initial mesh. The first sweep moves nodes far, and later ones find little to do.
void sweep_kernel(Bench& bench, const std::string& what, const HighOrderMesh& mesh) {
  Line line{what};
  Conditions conditions;
  const auto measured = in_child(
      [&] {
        SweepLoad load(mesh, reference_options());
        double seconds = 1e300;
        for (int i = 0; i < kSweeps; ++i) {
          load.reset();
          load.sweep();
          seconds = std::min(seconds, seconds_of([&] { load.sweep(); }));
        }
        return std::vector<double>{seconds, load.points()};
      },
      Yardsticks::Take, conditions);
  if (!measured) return bench.table.fail(line.what, measured.error());
  const double seconds = (*measured)[0], points = (*measured)[1];
  line.measured = text("%.2f ns", seconds / points * 1e9);
  line.normalised = text("%.2f ns", conditions.normalised(seconds) / points * 1e9);
  add_share(points * flops_per_point(mesh.dimension), conditions, seconds, line);
  bench.table.add(line);
}

void sweep_kernels(Bench& bench) {
  sweep_kernel(bench, "one point in one visit, P4 tetrahedra, cache", cached_mesh());
  if (bench.small) return;
  for (const char* name : {"sph10k_p4", "circ10k_p5"}) {
    const std::string what = std::string("one point in one visit, ") + name;
    const auto mesh = bench.runner.meshes().load(name);
    if (!mesh)
      bench.table.fail(what, mesh.error());
    else
      sweep_kernel(bench, what, *mesh);
  }
}

/// a = b + s c over arrays that do not fit into a cache.
void memory(Bench& bench) {
  Line line{"memory, a = b + s c, one thread"};
  Conditions conditions;
  constexpr std::size_t n = std::size_t{1} << 24;
  const auto measured = in_child(
      [&] {
        std::vector<double> a(n), b(n, 1.0), c(n, 2.0);
        const double seconds = best_seconds([&] {
          for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + 3.0 * c[i];
        });
        return std::vector<double>{seconds, a[n / 2]};
      },
      Yardsticks::Take, conditions);
  if (!measured) return bench.table.fail(line.what, measured.error());
  line.measured = text("%.1f GB/s", 24e-9 * static_cast<double>(n) / (*measured)[0]);
  line.quality = text("yardstick %.1f GFLOP/s", conditions.yardstick);
  line.disturbed = conditions.disturbed();
  bench.table.add(line);
}

// === Threads ===

Run some_iterations(const std::string& mesh, Method method, int threads) {
  Run run{mesh};
  run.options.method = method;
  run.options.active_set = false;
  run.options.tolerance = 1e-14;
  run.options.max_iterations = method == Method::Sweeps ? 6 : 4;
  run.options.threads = threads;
  return run;
}

/// How many times as much work `count` yardsticks do at the same time as one does by itself.
double yardstick_ratio(int count) {
  const double alone = yardstick().wall;
  double together = 0;
  for (const Yardstick& one : yardsticks(count)) together += one.wall;
  return alone > 0 ? together / alone : 0;
}

constexpr int kPairs = 10;

void threads_against_one(Bench& bench, const std::string& mesh, int threads, double least) {
  std::vector<double> yardstick_ratios;
  for (int pair = 0; pair < kPairs; ++pair) yardstick_ratios.push_back(yardstick_ratio(threads));
  const double bound = median(yardstick_ratios), target = std::min(least, 0.93 * bound);
  for (const Method method : {Method::Sweeps, Method::Newton}) {
    const char* phase = method == Method::Sweeps ? "sweep" : "Newton";
    Line line{mesh + text(", %d threads against 1, %s", threads, phase), "", "", text("%.2f times", target)};
    std::vector<double> ratios, busy;
    for (int pair = 0; pair < kPairs; ++pair) {
      const auto one = bench.runner.run_again(some_iterations(mesh, method, 1));
      const auto more = bench.runner.run_again(some_iterations(mesh, method, threads));
      if (!one || !more) return bench.table.fail(line.what, one ? more.error() : one.error());
      const auto seconds = [&](const Measured& m) { return method == Method::Sweeps ? m.wall.sweep : m.wall.later; };
      ratios.push_back(seconds(*one) / seconds(*more));
      busy.push_back(std::max(one->conditions.busy_cores, more->conditions.busy_cores));
    }
    // If threads wait for a processor, the ratio does not show how well the work is divided.
    line.disturbed = Conditions{0, median(busy)}.disturbed();
    line.judged = !line.disturbed;
    const double ratio = median(ratios);
    line.measured = text("%.2f", ratio);
    line.quality = text("%.2f to %.2f; yardsticks %.2f", *std::min_element(ratios.begin(), ratios.end()),
                        *std::max_element(ratios.begin(), ratios.end()), bound);
    if (!(ratio >= target)) line.missed.emplace_back("speed-up");
    bench.table.add(line);
  }
}

void threads(Bench& bench) {
  const std::string mesh = bench.small ? "sph276_p5" : "sph10k_p4";
  const unsigned cores = std::thread::hardware_concurrency();
  if (cores < 2) return bench.table.skip("two threads against one", "this machine has one core");
  threads_against_one(bench, mesh, 2, 1.85);
  if (cores < 16)
    bench.table.skip("16 threads against one", text("this machine has %u cores", cores));
  else
    threads_against_one(bench, mesh, 16, 13.6);
}

// === Instruction sets ===

/// The largest difference of coordinates, divided by the diagonal of the bounding box.
double distance(const std::vector<double>& a, const std::vector<double>& b) {
  std::array<double, 3> low{}, high{};
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    low[i % 3] = i < 3 ? a[i] : std::min(low[i % 3], a[i]);
    high[i % 3] = i < 3 ? a[i] : std::max(high[i % 3], a[i]);
    largest = std::max(largest, std::abs(a[i] - b[i]));
  }
  return largest / std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

/// Measures the run with at most AVX2 into `narrow`, and unrestricted into `wide`. False if a run failed.
bool both(Bench& bench, const std::string& what, Run run, Measured& narrow, Measured& wide) {
  if (!bench.measure(what, run, wide)) return false;
  run.avx2 = true;
  return bench.measure(what, run, narrow) != nullptr;
}

Line time_ratio(std::string what, const Measured& narrow, const Measured& wide, double Times::*of) {
  const double slow = narrow.normalised().*of, fast = wide.normalised().*of, ratio = fast > 0 ? slow / fast : 0;
  Line line{std::move(what), text("%.2f", ratio), "", "2.2 times the time"};
  line.quality = text("normalised %.3g s against %.3g s", slow, fast);
  line.disturbed = narrow.conditions.disturbed() || wide.conditions.disturbed();
  if (!(ratio > 0 && ratio <= 2.2)) line.missed.emplace_back("time");
  return line;
}

void avx2(Bench& bench) {
  const std::string mesh = bench.small ? "sph276_p5" : "sph10k_p4";
  if ((hwy::SupportedTargets() & HWY_AVX3) == 0)
    return bench.table.skip("AVX2 against AVX-512", "this processor has no AVX-512");
  Measured narrow, wide;
  Line same{mesh + ", AVX2 and AVX-512, a sweep", "", "", "1e-10 of the diagonal"};
  Run run = some_iterations(mesh, Method::Sweeps, 1);
  run.options.max_iterations = 1;
  run.want_coordinates = true;
  if (both(bench, same.what, run, narrow, wide)) {
    const double apart = distance(narrow.coordinates, wide.coordinates);
    same.measured = text("%.1e", apart);
    if (!(apart <= 1e-10)) same.missed.emplace_back("coordinates");
    bench.table.add(same);
  }
  const std::string sweeps = mesh + ", AVX2 over AVX-512, a sweep";
  if (both(bench, sweeps, some_iterations(mesh, Method::Sweeps, 1), narrow, wide))
    bench.table.add(time_ratio(sweeps, narrow, wide, &Times::sweep));
  Line energy{mesh + ", AVX2 and AVX-512, to 1e-5", "", "", "energies to 1e-10"};
  Run converging{mesh};
  converging.options.tolerance = 1e-5;
  converging.options.threads = 1;
  if (!both(bench, energy.what, converging, narrow, wide)) return;
  const double apart = std::abs(narrow.energy - wide.energy) / std::abs(wide.energy);
  energy.measured = text("%.1e", apart);
  if (!(apart <= 1e-10)) energy.missed.emplace_back("energy");
  if (!narrow.converged || !wide.converged) energy.missed.emplace_back("not converged");
  bench.table.add(energy);
  bench.table.add(time_ratio(mesh + ", AVX2 over AVX-512, to 1e-5", narrow, wide, &Times::whole));
}

}  // namespace

const std::vector<Row> kMachineRows{
    {"product", When::Short, products}, {"kernel", When::Short, sweep_kernels},
    {"memory", When::Short, memory},    {"threads", When::Full, threads},
    {"avx2", When::Short, avx2},
};

}  // namespace varimesh::bench
