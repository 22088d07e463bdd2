// What the parts of the load program share.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "tests/faults/caller.h"

namespace varimesh::server::testing {

/// Prints every check, and counts those that fail.
class Verdict {
 public:
  /// `judges_figures`: whether a figure above its limit is a failure. That makes sense on an otherwise idle machine.
  explicit Verdict(bool judges_figures) : judges_figures_(judges_figures) {}
  void expect(bool held, const std::string& what);
  /// Checks that a figure does not exceed its limit.
  void expect_at_most(double figure, double limit, const std::string& unit, const std::string& what);
  bool all_held() const { return violations_ == 0; }

 private:
  const bool judges_figures_;
  int violations_ = 0;
};

struct Setting {
  bool short_form = false;
  std::string program;  ///< The path of the server.
};
using Trial = std::function<void(const Setting&, Verdict&)>;
/// The trials by name. Each part of the program has its own.
std::map<std::string, Trial> watching_trials();
std::map<std::string, Trial> job_trials();
std::map<std::string, Trial> mesh_trials();

}  // namespace varimesh::server::testing
