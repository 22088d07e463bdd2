#include "client/mpi/quality_of_ranks.h"

#include <iostream>

#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/parts/quality_of_parts.h"

namespace varimesh::client {
namespace {

/// What no rank can do without the whole mesh.
Expected<void> check_flags(const QualityArguments& arguments) {
  const auto refuse = [](const std::string& flag, const char* what) {
    return bad_option("varimesh-mpi does not take " + flag +
                      ", because no process has the whole mesh; 'varimesh quality' " + what + " in one process.");
  };
  if (arguments.input == "-") return refuse("standard input", "reads it");
  if (!arguments.output.empty()) return refuse("--output", "writes the marked mesh");
  if (!arguments.report.empty()) return refuse("--report", "writes the page");
  if (arguments.layers) return refuse("--layers", "measures layers");
  if (arguments.repairs.any()) return refuse("flags that repair the mesh", "repairs it");
  return {};
}

}  // namespace

int quality_of_ranks(const QualityArguments& arguments, const Ranks& ranks) {
  end_at_first_interrupt();
  if (const auto checked = check_flags(arguments); !checked) return print_error(checked.error());
  const auto found =
      quality_of_parts({arguments.input, arguments.lattice, arguments.threads, arguments.shows_groups()}, ranks);
  if (!found) return print_error(found.error());
  for (const std::string& sentence : found->loose) std::cerr << "varimesh: " << sentence << "\n";
  return print_quality(arguments, {found->mesh, found->quality, found->unrepairable, found->left});
}

}  // namespace varimesh::client
