// Runs the program varimesh as a user does, from file to file.
#pragma once

#include <string>

#include "core/base/error.h"
#include "tests/bench/table/runs.h"

namespace varimesh::bench {

/// What a run of the program took.
struct CommandMeasured {
  Conditions conditions;
  double wall = 0;        ///< Seconds from the start of the program to its end.
  double processor = 0;   ///< Seconds of all its threads.
  double peak_bytes = 0;  ///< Resident memory.
};

/// Runs `program optimise mesh -o output` with the reference constants, to the default tolerance. The output is removed
/// afterwards; what the program says goes to `log`. Errors: Internal if it cannot be started or fails.
Expected<CommandMeasured> run_command(const std::string& program, const std::string& mesh, const std::string& output,
                                      const std::string& log, int threads);

}  // namespace varimesh::bench
