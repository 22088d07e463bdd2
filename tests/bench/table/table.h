// The table as it is printed: Markdown, a line a figure.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "tests/bench/table/runs.h"

namespace varimesh::bench {

/// printf into a string.
[[gnu::format(printf, 1, 2)]] std::string text(const char* format, ...);

/// One figure, and what is said beside it.
struct Line {
  std::string what = {};
  std::string measured = {};             ///< As it was measured, with its unit.
  std::string normalised = {};           ///< The same on the reference machine; empty where that has no meaning.
  std::string target = {};               ///< Empty: none is set.
  std::vector<std::string> missed = {};  ///< What of the target is not met.
  std::string quality = {};              ///< Of the mesh returned.
  std::string peers = {};                ///< What others need or reach.
  bool judged = true;                    ///< Whether the figure can say anything about the target.
  bool disturbed = false;                ///< Other programs were at work meanwhile.
};

/// Prints lines as they come, and counts.
class Table {
 public:
  void head();
  void add(const Line& line);
  /// For what cannot be measured here.
  void skip(const std::string& what, const std::string& reason);
  /// What the marks mean, and how it went.
  void foot() const;

  int missed() const { return missed_; }
  int failed() const { return failed_; }
  /// A figure that could be measured but was not, because something went wrong.
  void fail(const std::string& what, const Error& error);

 private:
  int lines_ = 0, met_ = 0, missed_ = 0, skipped_ = 0, failed_ = 0, disturbed_ = 0;
};

/// What a row of the table works with.
struct Bench {
  Runner runner;
  Table table;
  bool small = false;  ///< Only what takes no time: small meshes in place of large ones.

  /// The run's outcome, or null: then the table says why.
  const Measured* measure(const std::string& what, const Run& run, Measured& into);
};

/// "0.675, 0 invalid, 0 uncertified"
std::string quality_of(const Measured& measured);

/// A row of the table: a name to ask for it by, and what measures it.
struct Row {
  const char* name;
  bool small;  ///< Belongs to the short run.
  void (*measure)(Bench&);
};

/// rows.cpp: runs of the library, as in the table of the goals.
extern const std::vector<Row> kCaseRows;
/// machine_rows.cpp: kernels, threads, instruction sets.
extern const std::vector<Row> kMachineRows;

}  // namespace varimesh::bench
