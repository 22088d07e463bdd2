// Measures what a process of its own costs a job: the median time of runs with and without, by turns.
//
//   measure_isolation [RUNS [MESH]]        default: 51 runs of tests/cases/nine_triangles.msh
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

class Bytes : public Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  std::string bytes_;
};

/// The milliseconds of one run.
double milliseconds_of(const Engine& engine, const std::shared_ptr<const Blob>& mesh) {
  RunRequest request;
  request.input = mesh;
  request.options.threads = 1;
  RunHooks hooks;
  hooks.control.stop_asked = [] { return false; };
  hooks.control.threads = [] { return 1; };
  hooks.given_up = [] { return false; };
  hooks.on_iteration = [](const Iteration&) { return Control::Continue; };
  hooks.open_output = [](v1::MeshFormat) { return [](std::string_view) { return true; }; };
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome = engine.run(std::move(request), hooks);
  if (!outcome || !outcome->lost.empty()) {
    std::fprintf(stderr, "a run failed: %s\n", (outcome ? outcome->lost : outcome.error().sentence).c_str());
    std::exit(1);
  }
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
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
  milliseconds_of(here, mesh);
  milliseconds_of(there, mesh);
  std::vector<double> without, with;
  for (int i = 0; i < runs; ++i) {
    without.push_back(milliseconds_of(here, mesh));
    with.push_back(milliseconds_of(there, mesh));
  }
  std::printf("median of %d runs: %.2f ms without, %.2f ms with a process, %.2f ms more\n", runs, median(without),
              median(with), median(with) - median(without));
}
