// Rows for the estimate of a run's memory: it is compared with the most that the process has resident during the run.
#include <fstream>
#include <string>

#include "core/formats/formats.h"
#include "core/optimise/memory.h"
#include "core/optimise/optimiser.h"
#include "tests/bench/table/table.h"

namespace varimesh::bench {
namespace {

/// What does not grow with the mesh: the threads of the library and its tables.
constexpr double kSlack = 4 << 20;

/// Bytes of this process: "VmRSS:" what is resident now, "RssFile:" what of it is pages of files, such as the program
/// itself, "VmHWM:" the most that has been resident.
double resident(const std::string& key) {
  std::ifstream status("/proc/self/status");
  std::string word;
  double kibibytes = 0;
  while (status >> word)
    if (word == key && status >> kibibytes) break;
  return 1024 * kibibytes;
}

void estimate(Bench& bench, const std::string& mesh) {
  Line line{mesh + ", estimate of memory over the peak", "", "", "0.95 to 1.30"};
  const auto path = bench.runner.meshes().find(mesh);
  if (!path) return bench.table.fail(line.what, path.error());
  Conditions conditions;
  const auto measured = in_child(
      [&] {
        const double idle = resident("VmRSS:"), idle_pages = resident("RssFile:");
        auto file = formats::read_file(*path);
        if (!file) return std::vector<double>{};
        const auto needed = static_cast<double>(memory_needed(file->mesh, reference_options()));
        if (!optimise(std::move(file->mesh), reference_options())) return std::vector<double>{};
        // The pages of the program that the run was the first to use are not memory that it allocated.
        const double pages = resident("RssFile:") - idle_pages;
        return std::vector<double>{needed, resident("VmHWM:") - idle - pages};
      },
      Yardsticks::Spare, conditions);
  if (!measured) return bench.table.fail(line.what, measured.error());
  if (measured->size() != 2) return bench.table.fail(line.what, {Error::Kind::BadInput, "The run was refused."});
  const double needed = (*measured)[0], peak = (*measured)[1];
  line.measured = text("%.2f", needed / peak);
  line.quality = text("%.0f MB for %.0f MB", needed * 1e-6, peak * 1e-6);
  if (needed < 0.95 * peak - kSlack || needed > 1.3 * peak + kSlack) line.missed.emplace_back("memory");
  bench.table.add(line);
}

void estimates(Bench& bench) {
  estimate(bench, "sph276_p5");
  if (bench.small) return;
  for (const char* mesh :
       {"circ10k_p5", "circ10kc_p5", "nacabl_p4", "sphhex_p3", "sph10k_p4", "dlrf6_p4", "sph120k_p4"})
    estimate(bench, mesh);
}

}  // namespace

const std::vector<Row> kMemoryRows{{"estimate", When::Short, estimates}};

}  // namespace varimesh::bench
