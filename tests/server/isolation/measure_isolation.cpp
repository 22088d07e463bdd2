// Measures what a process of its own costs a job: the median time of runs with and without, by turns. On a machine that
// does other things too, the processor time says more than the time by the clock.
//
// Exit status: 0 if a process costs at most 15 ms by the clock; otherwise 1; 2 if nothing can be measured.
//
//   measure_isolation [RUNS [MESH]]        default: 51 runs of tests/cases/nine_triangles.msh
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "server/isolation/process_engine.h"

namespace {

using namespace varimesh;
using namespace varimesh::server;

/// What a process may cost a job, in milliseconds.
constexpr double kMost = 15;

class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

/// The milliseconds of one run: by the clock, and those of processors in this process and those that it has waited for.
struct Cost {
  double clock, processor;
};

double processor_milliseconds() {
  double sum = 0;
  for (const auto whose : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    ::getrusage(whose, &used);
    for (const timeval& part : {used.ru_utime, used.ru_stime})
      sum += 1e3 * static_cast<double>(part.tv_sec) + 1e-3 * static_cast<double>(part.tv_usec);
  }
  return sum;
}

Cost cost_of(const Engine& engine, const std::shared_ptr<const Blob>& mesh) {
  RunRequest request;
  request.input = mesh;
  request.options.threads = 1;
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.control.threads = [] { return 1; };
  hooks.given_up = [] { return false; };
  hooks.on_iteration = [](const Iteration&) { return Control::Continue; };
  hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return true; }; };
  const double used = processor_milliseconds();
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome = engine.run(std::move(request), hooks);
  if (!outcome || !outcome->lost.empty()) {
    std::fprintf(stderr, "a run failed: %s\n", (outcome ? outcome->lost : outcome.error().sentence).c_str());
    std::exit(1);
  }
  return {std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count(),
          processor_milliseconds() - used};
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::atoi(argv[1]) : 51;
  std::ifstream file(argc > 2 ? argv[2] : VARIMESH_SOURCE_DIR "/tests/cases/nine_triangles.msh");
  std::ostringstream text;
  text << file.rdbuf();
  const std::string program = find_worker();
  if (runs < 1 || text.str().empty() || program.empty()) {
    std::fprintf(stderr, "measure_isolation: a mesh and the program that VARIMESH_WORKER names are needed\n");
    return 2;
  }
  const auto mesh = std::make_shared<const Bytes>(text.str());
  const Engine here = core_engine(), there = process_engine({.program = program});
  cost_of(here, mesh);
  cost_of(there, mesh);
  std::vector<double> clock[2], processor[2];
  for (int i = 0; i < runs; ++i)
    for (const bool isolated : {false, true}) {
      const Cost cost = cost_of(isolated ? there : here, mesh);
      clock[isolated].push_back(cost.clock);
      processor[isolated].push_back(cost.processor);
    }
  const double more = median(clock[1]) - median(clock[0]);
  std::printf("median of %d runs: %.2f ms without, %.2f ms with a process, %.2f ms more, at most %.0f\n", runs,
              median(clock[0]), median(clock[1]), more, kMost);
  std::printf("processor time: %.2f ms without, %.2f ms with a process, %.2f ms more\n", median(processor[0]),
              median(processor[1]), median(processor[1]) - median(processor[0]));
  return more <= kMost ? 0 : 1;
}
