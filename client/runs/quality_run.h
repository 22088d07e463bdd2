// What `varimesh quality` is asked and what it prints, for the plain command and for the one with ranks.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/cli/common_flags.h"
#include "client/io/inputs.h"
#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"

namespace varimesh::client {

struct QualityArguments {
  CommonFlags common;
  std::string input, output, report;
  Repairs repairs;
  int lattice = 0;
  int threads = 0;
  bool certify = false, diagnose = false, layers = false;

  /// Whether the groups of elements that cannot be repaired are shown.
  bool shows_groups() const { return diagnose || common.json || !output.empty() || !report.empty(); }
};

/// What is known about the mesh.
struct JudgedMesh {
  const MeshSummary& mesh;
  const QualityReport& quality;
  const std::vector<UnrepairableGroup>& groups;
  const WhatIsLeft& left;
};

/// Prints the document or the summary. Returns the exit status.
int print_quality(const QualityArguments& arguments, const JudgedMesh& judged);

/// Does what the arguments ask for, and returns the exit status.
using QualityRun = std::function<int(const QualityArguments&)>;
}  // namespace varimesh::client
