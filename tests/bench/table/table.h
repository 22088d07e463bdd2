// Prints the table in Markdown, one line per figure.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "tests/bench/table/runs.h"

namespace varimesh::bench {

/// Formats like printf, into a string.
[[gnu::format(printf, 1, 2)]] std::string text(const char* format, ...);

/// One figure, and what is printed beside it.
struct Line {
  std::string what = {};
  std::string measured = {};             ///< The measured value with its unit.
  std::string normalised = {};           ///< The same on the reference machine; empty if that has no meaning.
  std::string target = {};               ///< The goal; empty: there is none.
  std::vector<std::string> missed = {};  ///< Which parts of the goal are missed.
  std::string quality = {};              ///< Quality of the resulting mesh.
  std::string peers = {};                ///< Figures of other programs.
  bool judged = true;                    ///< Whether the figure can be compared with the goal.
  bool disturbed = false;                ///< Other programs were running during the measurement.
};

/// Prints lines as they come, and counts them.
class Table {
 public:
  void head();
  void add(const Line& line);
  /// Reports a figure that cannot be measured here.
  void skip(const std::string& what, const std::string& reason);
  /// Prints the counts and what the marks mean.
  void foot() const;

  int missed() const { return missed_; }
  int failed() const { return failed_; }
  /// Reports a figure that could not be measured because something went wrong. If the input is bad, it is skipped.
  void fail(const std::string& what, const Error& error);

 private:
  int lines_ = 0, met_ = 0, missed_ = 0, skipped_ = 0, failed_ = 0, disturbed_ = 0;
};

/// What the function of a row gets.
struct Bench {
  Runner runner;
  Table table;
  bool small = false;  ///< Measure only what takes little time: small meshes instead of large ones.
  std::int64_t most_elements = std::numeric_limits<std::int64_t>::max();  ///< Leave out larger structured meshes.
  std::string command = {};  ///< The program varimesh; empty: rows for the whole command are skipped.

  /// The outcome of the run, or null; the table then says why.
  const Measured* measure(const std::string& what, const Run& run, Measured& into);
};

/// "0.675, 0 invalid, 0 uncertified"
std::string quality_of(const Measured& measured);

/// How many elements the structured meshes have: 30,000 to 1,000,000, or few if bench.small.
std::vector<std::int64_t> sizes(const Bench& bench);

/// When a row is measured. Every row is measured if its name is given.
enum class When : std::uint8_t {
  Short,  ///< With --short, and without flags.
  Full,   ///< Without flags.
  Asked,  ///< With --long, because it takes minutes to hours.
};

/// A row of the table: its name, and the function that measures it.
struct Row {
  const char* name;
  When when;
  void (*measure)(Bench&);
};

/// rows.cpp: whole runs of the library.
extern const std::vector<Row> kCaseRows;
/// linear_rows.cpp: meshes of order 1 with many vertices.
extern const std::vector<Row> kLinearRows;
/// machine_rows.cpp: kernels, threads, instruction sets.
extern const std::vector<Row> kMachineRows;
/// memory_rows.cpp: the estimate of a run's memory.
extern const std::vector<Row> kMemoryRows;
/// size_rows.cpp: time, memory and iterations as the mesh grows.
extern const std::vector<Row> kSizeRows;
/// scaling_rows.cpp: time as the number of threads grows.
extern const std::vector<Row> kScalingRows;
/// command_rows.cpp: the whole command, from file to file.
extern const std::vector<Row> kCommandRows;

}  // namespace varimesh::bench
