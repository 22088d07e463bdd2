// Runs the library, each time in a process of its own, so that memory is measured and instructions chosen per run.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/options/options.h"
#include "tests/bench/table/meshes.h"

namespace varimesh::bench {

/// All figures are for the reference constants.
inline Options reference_options() {
  Options options;
  options.constants = Constants::Reference;
  return options;
}

/// One run of the library.
struct Run {
  std::string mesh;
  Options options = reference_options();
  bool avx2 = false;              ///< Use at most AVX2.
  bool want_coordinates = false;  ///< Also return the coordinates of the result.
  int repeats = 1;                ///< Number of processes, one after the other; the seconds of a sweep are the median.

  /// Distinguishes this run from all other runs of the table.
  std::string key() const;
};

/// A run on one thread until the residual is at most `tolerance`; `lambda` 0: the reference constant.
inline Run until_tolerance(const std::string& mesh, double tolerance, double lambda = 0) {
  Run run{mesh};
  run.options.tolerance = tolerance;
  run.options.lambda = lambda;
  run.options.threads = 1;
  return run;
}

/// The conditions under which a measurement was taken.
struct Conditions {
  double yardstick = 0;   ///< GFLOP/s of one thread by processor time, the better of before and after; 0: not measured.
  double busy_cores = 0;  ///< Mean number of cores that other programs kept busy during the measurement.

  bool disturbed() const { return busy_cores > 0.15; }
  /// Converts seconds to those of a machine whose yardstick runs at kReferenceGflops.
  double normalised(double seconds) const;
};

/// Seconds of a run.
struct Times {
  double whole = 0;  ///< Result::seconds.
  double sweep =
      0;  ///< Median over iterations 2 to 6, and its median over Run::repeats; 0 if there are fewer iterations.
  double later = 0;  ///< From the end of the first iteration to the end of the last.
  double each = 0;   ///< From the start to the end of the last iteration, per iteration.
  double few = -1;   ///< Until the history first shows at most 12 cells not certified; −1: never.
};

/// The outcome of a run.
struct Measured {
  Conditions conditions;
  Times wall;       ///< The library's own seconds.
  Times processor;  ///< Processor time of all threads.
  bool one_thread = true;
  double energy = 0;          ///< After the last iteration.
  double products = 0;        ///< Mean number of products per Newton step.
  double first_products = 0;  ///< Products of the first Newton step.
  double most_products = 0;   ///< The largest number of products in a step.
  double later_products = 0;  ///< Products of all iterations after the first.
  double min_scaled_jacobian = 0;
  double sweep_points = 0;     ///< Quadrature points that a sweep visits, summed over nodes and their cells.
  double peak_bytes = 0;       ///< Resident memory, including that for reading the file.
  double estimated_bytes = 0;  ///< memory_needed().
  std::int64_t elements = 0, free_nodes = 0, invalid = 0, uncertified = 0;
  std::int64_t below_half = 0;  ///< Cells with a sampled scaled Jacobian below 0.5.
  int dimension = 0, iterations = 0;
  bool converged = false;
  std::vector<double> coordinates;

  /// The library's seconds; processor time if the run has one thread and other programs disturbed it.
  const Times& times() const { return one_thread && conditions.disturbed() ? processor : wall; }
  Times normalised() const;
};

/// Executes runs and remembers their outcomes.
class Runner {
 public:
  explicit Runner(Meshes meshes) : meshes_(std::move(meshes)) {}

  /// The outcome of the run, remembered if it was executed before. Errors: the mesh cannot be found or made, the
  /// library refused it, or the process died.
  Expected<Measured> run(const Run& run);
  /// Executes the run again, without yardsticks, and does not remember the outcome.
  Expected<Measured> run_again(const Run& run) const;

  const Meshes& meshes() const { return meshes_; }

 private:
  Meshes meshes_;
  std::map<std::string, Measured> remembered_;
};

/// The median; of two values in the middle the larger, and 0 if there are none.
double median(std::vector<double> of);

/// Seconds of processor time that this process has used.
double processor_seconds();

enum class Yardsticks { Take, Spare };

/// The numbers that `work` computes in a child process, and the conditions during this time. Errors: Internal if the
/// child died.
Expected<std::vector<double>> in_child(const std::function<std::vector<double>()>& work, Yardsticks yardsticks,
                                       Conditions& conditions);

}  // namespace varimesh::bench
