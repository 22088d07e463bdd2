#include "core/layers/nodes_that_stay.h"

#include <Eigen/Core>
#include <algorithm>
#include <span>

#include "core/base/index.h"
#include "core/layers/columns.h"
#include "core/mesh/connectivity.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// Whether a cell belongs to a thin layer: all its vertices are in columns, and wherever two of them are in the same
/// column, the distance between them is small.
bool is_thin(const HighOrderMesh& mesh, const detail::Columns& columns, std::span<const std::int32_t> vertices) {
  const auto x = [&](std::int32_t node) { return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * at(node)]); };
  bool has_height = false;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::int32_t column = columns.column_of[at(vertices[i])];
    if (column < 0) return false;
    for (std::size_t j = 0; j < i; ++j) {
      if (columns.column_of[at(vertices[j])] != column) continue;
      has_height = true;
      if ((x(vertices[i]) - x(vertices[j])).norm() >= detail::kThin * columns.size[at(column)]) return false;
    }
  }
  return has_height;
}

}  // namespace

std::vector<bool> nodes_of_thin_layers(const HighOrderMesh& mesh, const Team& team) {
  const detail::Columns columns = detail::find_columns(mesh, facets(mesh, team));
  if (columns.empty()) return {};
  const Cells cells(mesh, mesh.dimension);
  std::vector<bool> stays(mesh.node_count(), false);
  std::vector<std::size_t> thin;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto nodes = cells.nodes(cell);
    if (!is_thin(mesh, columns, nodes.first(at(reference::info(cells.shape(cell)).vertices)))) continue;
    thin.push_back(cell);
    for (const std::int32_t node : nodes) stays[at(node)] = true;
  }
  if (thin.empty()) return {};
  std::vector<Certificate> certificates(cells.count());
  Certifier(mesh).certify(mesh.coordinates, certificates, team);
  const bool are_valid = std::ranges::all_of(thin, [&](std::size_t cell) { return certificates[cell].is_valid(); });
  return are_valid ? stays : std::vector<bool>();
}

}  // namespace varimesh
