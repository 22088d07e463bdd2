// Measures how long runs of every phase, shape and order go on after they are to stop. Takes minutes:
//   build/release/tests/core/optimise/core_stop_times              ends with 1 if one takes longer than promised
//   build/release/tests/core/optimise/core_stop_times --list       prints the names of the runs
//   build/release/tests/core/optimise/core_stop_times NAME…        only the runs whose names contain one of these
// VARIMESH_SEED sets the random moments. VARIMESH_YARDSTICK is the speed of the machine as docs/performance.md defines
// it (82 if not set): seconds are multiplied by it and divided by 82.
// Each run has a process of its own, so tables that runs share do not exist at its start.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <optional>
#include <random>

#include "tests/core/optimise/stopped_runs.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::RunToStop;

constexpr int kStopsPerRun = 8;

double number_from(const char* variable, double otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtod(text, nullptr);
}

/// Processor seconds of the process. The runs have one thread, so other programs do not count.
double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::vector<RunToStop> runs_to_measure() {
  std::vector<RunToStop> runs = testing::runs_of_all_phases();
  for (RunToStop& run : runs) run.options.threads = 1;
  const auto add = [&](const std::string& name, HighOrderMesh mesh, const std::function<void(Options&)>& set) {
    runs.push_back(testing::run_to_stop(name, std::move(mesh), set));
  };
  for (const Filling filling : testing::kFillings)
    for (const int order : {1, 2, 4, 6, 8, 10}) {
      const std::string name = std::string(testing::name(filling)) + "_order_" + std::to_string(order);
      const bool plane = testing::is_plane(filling);
      const std::array<int, 3> counts = plane ? std::array{6, 6, 1} : std::array{2, 2, order > 6 ? 1 : 2};
      add(name, testing::pushed(filling, counts, order, 0.1 / order), [](Options& o) { o.max_iterations = 10; });
      if (order >= 4)
        add(name + "_tangled", testing::pushed(filling, counts, order, 0.5 / order), [](Options& o) {
          o.until = Until::Valid;
          o.max_iterations = 10;
        });
    }
  add("large_tetrahedra", testing::pushed(Filling::Tetrahedra, {14, 14, 14}, 4, 0.002), [](Options&) {});
  add("large_tangled_tetrahedra", testing::pushed(Filling::Tetrahedra, {14, 14, 14}, 3, 0.03),
      [](Options& o) { o.until = Until::Valid; });
  add("large_hexahedra", testing::pushed(Filling::Hexahedra, {24, 24, 24}, 3, 0.002), [](Options&) {});
  return runs;
}

/// How long a run took to its end, and from the moment when it was to stop to the result; in processor seconds.
struct Ending {
  double whole = 0, after = 0;
  double gap = 0;        ///< The longest time between two looks at the token, until it stopped the run.
  double gap_begin = 0;  ///< When that time began.
};

/// @param moment  when the run is to stop, in processor seconds after its start; infinity: never
Ending stop_here_at(const RunToStop& run, double moment) {
  Ending ending;
  const double start = processor_seconds();
  double last = 0;
  RunControl control;
  control.stop_asked = [&] {
    const double now = processor_seconds() - start;
    if (now - last > ending.gap) {
      ending.gap = now - last;
      ending.gap_begin = last;
    }
    last = now;
    return now >= moment;
  };
  const auto result = optimise(run.mesh, run.options, {}, control);
  ending.whole = processor_seconds() - start;
  ending.after = ending.whole - moment;
  EXPECT_TRUE(result);
  if (result) testing::expect_sound(run, *result);
  return ending;
}

/// The same in a process of its own. Nothing if the process fails or the result is not sound.
std::optional<Ending> stop_at(const RunToStop& run, double moment) {
  std::fflush(stdout);
  std::array<int, 2> pipe_ends{};
  if (pipe(pipe_ends.data()) != 0) return std::nullopt;
  const pid_t child = fork();
  if (child == 0) {
    const Ending ending = stop_here_at(run, moment);
    const bool is_written = write(pipe_ends[1], &ending, sizeof(ending)) == sizeof(ending);
    std::fflush(stdout);
    _exit(is_written && !::testing::UnitTest::GetInstance()->ad_hoc_test_result().Failed() ? 0 : 1);
  }
  close(pipe_ends[1]);
  Ending ending;
  const bool is_read = child > 0 && read(pipe_ends[0], &ending, sizeof(ending)) == sizeof(ending);
  close(pipe_ends[0]);
  int status = 1;
  if (child > 0) waitpid(child, &status, 0);
  if (!is_read || status != 0) return std::nullopt;
  return ending;
}

/// Prints a line about the run; true if all its endings are within the bound.
bool measure(const RunToStop& run) {
  const double normal = number_from("VARIMESH_YARDSTICK", 82) / 82;
  const auto cells = static_cast<double>(run.mesh.element_count(run.mesh.dimension));
  const double bound = 0.5 + 0.1 * cells / 100'000;
  std::mt19937 random(static_cast<unsigned>(number_from("VARIMESH_SEED", 19)));
  double longest = 0, moment_of_longest = 0;
  bool is_sound = true;
  const auto stop = [&](double moment) {
    const std::optional<Ending> ending = stop_at(run, moment);
    is_sound = is_sound && ending;
    if (!ending || normal * ending->after <= longest) return;
    longest = normal * ending->after;
    moment_of_longest = moment;
  };
  stop(0);
  const double at_once = longest;
  const std::optional<Ending> unstopped = stop_at(run, std::numeric_limits<double>::infinity());
  if (!is_sound || !unstopped) {
    std::printf("%-34s FAILED\n", run.name.c_str());
    return false;
  }
  for (int i = 0; i < kStopsPerRun; ++i) stop(std::uniform_real_distribution<double>(0, unstopped->whole)(random));
  stop(unstopped->gap_begin + 0.1 * unstopped->gap);  // when nothing looks at the token for the longest time
  std::printf(
      "%-34s %6.0f cells  whole %7.3f s, between looks %6.3f s  ending %6.3f s, stopped at %7.3f s, at once %6.3f s  "
      "bound %5.3f s  %s\n",
      run.name.c_str(), cells, normal * unstopped->whole, normal * unstopped->gap, longest, moment_of_longest, at_once,
      bound,
      !is_sound          ? "FAILED"
      : longest <= bound ? "met"
                         : "NOT MET");
  std::fflush(stdout);
  return is_sound && longest <= bound;
}

}  // namespace
}  // namespace varimesh

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  const std::vector<std::string> names(argv + 1, argv + argc);
  bool all_met = true;
  for (const varimesh::testing::RunToStop& run : varimesh::runs_to_measure()) {
    const auto wanted = [&](const std::string& name) { return run.name.find(name) != std::string::npos; };
    if (names == std::vector<std::string>{"--list"})
      std::printf("%s\n", run.name.c_str());
    else if (names.empty() || std::ranges::any_of(names, wanted))
      all_met = varimesh::measure(run) && all_met;
  }
  return all_met ? 0 : 1;
}
