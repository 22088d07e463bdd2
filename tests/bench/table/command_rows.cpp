// Rows for the whole command: reading, checking, optimising, reporting and writing.
#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "tests/bench/table/command.h"
#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

/// Runs the command on a mesh of the table, which is found or made first.
Expected<CommandMeasured> run_on(const Bench& bench, const std::string& mesh, int threads) {
  const Expected<std::string> path = bench.runner.meshes().find(mesh);
  if (!path) return tl::unexpected(path.error());
  const std::filesystem::path& folder = bench.runner.meshes().cache();
  return run_command(bench.command, *path, (folder / "command-output.msh").string(), (folder / "command.log").string(),
                     threads);
}

/// Whether the rows can be measured. Otherwise the table says why not.
bool has_command(Bench& bench, const char* what) {
  if (bench.command.empty()) bench.table.skip(what, "no program varimesh is given");
  return !bench.command.empty();
}

int two_threads() { return static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 2U)); }

/// Binary file in and out, two threads.
void sizes_of(Bench& bench, Shape shape, int order) {
  if (!has_command(bench, "the whole command")) return;
  constexpr double kMostSeconds = 150, kMostBytes = 8.5e9;  // for a million tetrahedra of order 4
  for (const std::int64_t elements : sizes(bench)) {
    const std::string mesh = cube_name(shape, order, elements);
    Line time{mesh + text(", the whole command, %d threads", two_threads())};
    const auto m = run_on(bench, mesh, two_threads());
    if (!m) {
      bench.table.fail(time.what, m.error());
      continue;
    }
    const double seconds = m->conditions.normalised(m->wall);
    time.measured = text("%.3g s", m->wall);
    time.normalised = text("%.3g s", seconds);
    time.quality =
        text("%.0f us per element; processor %.3g s", 1e6 * seconds / static_cast<double>(elements), m->processor);
    time.disturbed = m->conditions.disturbed();
    time.judged = !time.disturbed;
    Line memory{mesh + ", the whole command, memory", text("%.3g GB", m->peak_bytes * 1e-9)};
    if (shape == Shape::Tetrahedron && elements == 1'000'000) {
      time.target = text("%g s", kMostSeconds);
      if (!(seconds <= kMostSeconds)) time.missed.emplace_back("time");
      memory.target = text("%g GB", kMostBytes * 1e-9);
      if (!(m->peak_bytes <= kMostBytes)) memory.missed.emplace_back("memory");
    }
    bench.table.add(time);
    bench.table.add(memory);
  }
}

/// Two threads against one for the whole command.
void threads_of(Bench& bench) {
  const std::string mesh = bench.small ? "sph276_p5" : "sph120k_p4";
  Line line{mesh + ", the whole command, 2 threads against 1", "", "", "1.8 times"};
  if (!has_command(bench, line.what.c_str())) return;
  if (two_threads() < 2) return bench.table.skip(line.what, "this machine has one core");
  constexpr int kPairs = 3;
  std::vector<double> ratios, busy;
  for (int pair = 0; pair < kPairs; ++pair) {
    const auto one = run_on(bench, mesh, 1), two = run_on(bench, mesh, 2);
    if (!one || !two) return bench.table.fail(line.what, one ? two.error() : one.error());
    ratios.push_back(one->wall / two->wall);
    busy.push_back(std::max(one->conditions.busy_cores, two->conditions.busy_cores));
    line.quality = text("%.3g s and %.3g s", one->wall, two->wall);
  }
  const double ratio = median(ratios);
  line.measured = text("%.2f", ratio);
  line.disturbed = Conditions{0, median(busy)}.disturbed();
  line.judged = !line.disturbed;
  if (!(ratio >= 1.8)) line.missed.emplace_back("speed-up");
  bench.table.add(line);
}

}  // namespace

const std::vector<Row> kCommandRows{
    {"command.threads", When::Asked, threads_of},
    {"command.tetrahedra", When::Asked, [](Bench& b) { sizes_of(b, Shape::Tetrahedron, 4); }},
    {"command.hexahedra", When::Asked, [](Bench& b) { sizes_of(b, Shape::Hexahedron, 3); }},
};

}  // namespace varimesh::bench
