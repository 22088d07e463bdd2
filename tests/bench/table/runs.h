// Runs of the library, each in a process of its own: its memory is its own, and so is its choice of instructions.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/options/options.h"
#include "tests/bench/table/meshes.h"

namespace varimesh::bench {

/// The figures are for the reference constants.
inline Options reference_options() {
  Options options;
  options.constants = Constants::Reference;
  return options;
}

/// What to run.
struct Run {
  std::string mesh;
  Options options = reference_options();
  bool avx2 = false;              ///< Use no instructions beyond AVX2.
  bool want_coordinates = false;  ///< Hand over the result's coordinates as well.
  int repeats = 1;                ///< Processes, one after the other, of which a sweep's seconds are the median.

  /// Tells it from every other run of the table.
  std::string key() const;
};

/// How a measurement was taken.
struct Conditions {
  double yardstick = 0;   ///< GFLOP/s of one thread by processor time, the best of before and after; 0: not taken.
  double busy_cores = 0;  ///< Mean number of cores that other programs kept busy meanwhile.

  bool disturbed() const { return busy_cores > 0.15; }
  /// Seconds as they were on a machine whose yardstick is at kReferenceGflops.
  double normalised(double seconds) const;
};

/// Seconds of a run.
struct Times {
  double whole = 0;  ///< Result::seconds.
  double sweep = 0;  ///< Median of iterations 2 to 6, and of that over Run::repeats; 0 where there are fewer.
  double later = 0;  ///< From the first iteration's end to the last's.
  double few = -1;   ///< Until the history first shows at most 12 cells not certified; −1: never.
};

/// What came of a run.
struct Measured {
  Conditions conditions;
  Times wall;       ///< The library's own seconds.
  Times processor;  ///< Processor time of all threads.
  bool one_thread = true;
  double energy = 0;    ///< Of the last iteration.
  double products = 0;  ///< A Newton step, mean.
  double min_scaled_jacobian = 0;
  double sweep_points = 0;  ///< Quadrature points a sweep visits, summed over nodes and their cells.
  double peak_bytes = 0;    ///< Of resident memory, reading the file included.
  std::int64_t elements = 0, invalid = 0, uncertified = 0;
  std::int64_t below_half = 0;  ///< Cells with a sampled scaled Jacobian under 0.5.
  int dimension = 0, iterations = 0;
  bool converged = false;
  std::vector<double> coordinates;

  /// The library's seconds; processor time where other programs took the processor away from one thread.
  const Times& times() const { return one_thread && conditions.disturbed() ? processor : wall; }
  Times normalised() const;
};

/// Runs things and remembers what came of them.
class Runner {
 public:
  explicit Runner(Meshes meshes) : meshes_(std::move(meshes)) {}

  /// The run's outcome, from memory where it was run before. Errors: the mesh is not to be had, the library refused,
  /// the process died.
  Expected<Measured> run(const Run& run);
  /// The same without looking in memory, and without yardsticks.
  Expected<Measured> run_again(const Run& run) const;

  const Meshes& meshes() const { return meshes_; }

 private:
  Meshes meshes_;
  std::map<std::string, Measured> remembered_;
};

/// 0 of nothing; the greater of the two in the middle.
double median(std::vector<double> of);

/// Seconds of processor time that this process has used.
double processor_seconds();

enum class Yardsticks { Take, Spare };

/// Numbers that `work` computes in a child process, and the conditions meanwhile. Errors: Internal, where the child
/// died.
Expected<std::vector<double>> in_child(const std::function<std::vector<double>()>& work, Yardsticks yardsticks,
                                       Conditions& conditions);

}  // namespace varimesh::bench
