#include "client/io/history.h"

#include <fmt/format.h>

#include "client/cli/names.h"
#include "core/base/io/output_file.h"

namespace varimesh::client {

Expected<void> write_history(const std::string& path, const std::vector<v1::Iteration>& history) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  std::string lines =
      "iteration,phase,energy,residual,relative_gradient,min_scaled_jacobian,invalid_elements,repairable_elements,"
      "active_nodes,products,linear_solve,device,seconds\n";
  for (const v1::Iteration& one : history)
    lines +=
        fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{},{},{},{},{},{},{:.6f}\n", one.number(),
                    spelled(one.phase()), one.energy(), one.residual(), one.relative_gradient(),
                    one.min_scaled_jacobian(), one.invalid_elements(), one.repairable_elements(), one.active_nodes(),
                    one.products(), spelled(one.linear_solve()), one.on_device() ? "gpu" : "cpu", one.seconds());
  file->write(lines);
  return file->commit();
}

}  // namespace varimesh::client
