// The quality of a mesh that is too large for one rank: each rank reads and certifies its part.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/diagnosis/remedies.h"
#include "core/optimise/result.h"
#include "core/quality/quality.h"
#include "core/ranks/ranks.h"

namespace varimesh {

/// What `varimesh quality` says about a mesh. Only the first rank has the lists and sentences.
struct WholeQuality {
  MeshSummary mesh;
  QualityReport quality;
  std::vector<UnrepairableGroup> unrepairable;  ///< If they were asked for: those with elements that are not certified.
  WhatIsLeft left;
  std::vector<std::string> loose;  ///< loose_parts()
};

/// What quality_of_parts() is to do.
struct QualityOfParts {
  std::string path;       ///< A binary file of MSH 4.1.
  int intervals = 0;      ///< Of the lattice; 0: the default.
  int threads = 0;        ///< Of each rank; 0: as many as the machine has for the process.
  bool diagnoses = true;  ///< Whether to look for elements that cannot be repaired.
};

/// Each rank has a range of the cells, as many as every other rank, in the order of the file. Cells at the boundary, at
/// elements of one dimension less, and at facets or with nodes that are not clearly in order go also to the first rank,
/// which judges them as it judges a whole mesh. All ranks call it.
///
/// The result is that of quality(), diagnose() and loose_parts() for the whole mesh, bit for bit, for any number of
/// ranks. Errors are the same on all ranks: BadInput, as those of reading a file and of check_judgeable(); but if the
/// mesh has several faults, it may be another one. Surfaces in space are refused.
Expected<WholeQuality> quality_of_parts(const QualityOfParts& task, const Ranks& ranks);

}  // namespace varimesh
