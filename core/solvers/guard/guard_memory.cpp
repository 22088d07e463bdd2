#include "core/solvers/guard/guard_memory.h"

#include "core/problem/problem_memory.h"
#include "core/validity/certificate.h"

namespace varimesh {
namespace {

constexpr std::int64_t kDouble = sizeof(double), kCertificate = sizeof(Certificate);

}  // namespace

std::int64_t bytes_of_guard(const MeshCounts& counts) {
  const std::int64_t of_node = 1 + 2 * kDouble * counts.dimension + 3 * kDouble;  // free, positions, coordinates
  const std::int64_t best_ending = kDouble * counts.dimension * counts.free_nodes();
  // Certificates twice, and once more for the best ending; the nodes of each cell, unrepairable; which nodes and cells
  // have moved.
  const std::int64_t of_cell = 3 * kCertificate + static_cast<std::int64_t>(sizeof(void*) + 2 * sizeof(int)) + 2;
  return best_ending + of_node * counts.nodes() + of_cell * counts.cell_count() + bytes_of_conversion(counts);
}

std::int64_t bytes_of_best_mesh(const MeshCounts& counts) {
  // The best mesh and the one that is compared with it.
  return 2 * (3 * kDouble * counts.nodes() + kCertificate * counts.cell_count());
}

}  // namespace varimesh
