// The parts of every cell, a batch of cells at a time, and their sums in the mesh's order.
#include "core/quality/accuracy/accuracy.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <span>

#include "core/base/reduction.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/validity/cell_batches.h"

namespace varimesh {
namespace {

using detail::CellBatch;
using detail::PartsTable;

constexpr std::size_t kCellsPerTask = 2048;

/// Matrices of one batch, which a thread keeps from batch to batch.
struct Workspace {
  Eigen::MatrixXd nodes;       ///< Coordinates relative to the cell's first node: nodes × (cells · d).
  Eigen::MatrixXd modes;       ///< Coefficients of the modes: modes × (cells · d).
  Eigen::MatrixXd multiplied;  ///< A block of PartsTable::products times `modes`.
  Eigen::MatrixXd gradient;    ///< Mean gradients: d × (cells · d), transposed.
};

void gather(std::span<const double> coordinates, std::size_t d, const CellBatch& batch, Eigen::Index nodes,
            Eigen::MatrixXd& out) {
  out.resize(nodes, static_cast<Eigen::Index>(batch.count * d));
  for (std::size_t i = 0; i < batch.count; ++i) {
    const std::int32_t* const list = batch.nodes(i);
    for (std::size_t c = 0; c < d; ++c) {
      const auto x = [&](Eigen::Index n) { return coordinates[3 * static_cast<std::size_t>(list[n]) + c]; };
      for (Eigen::Index n = 0; n < nodes; ++n) out(n, static_cast<Eigen::Index>(i * d + c)) = x(n) - x(0);
    }
  }
}

/// V_E and m_s of the cells of a batch.
void measure_cells(std::span<const double> coordinates, int d, const CellBatch& batch, const StopToken* stop,
                   CellAccuracy& out) {
  thread_local Workspace work;
  const PartsTable& table =
      detail::parts_table(batch.block->shape, batch.block->order, reference::NodeSet::Equispaced, stop);
  const double measure = reference::info(batch.block->shape).measure;
  gather(coordinates, static_cast<std::size_t>(d), batch, table.to_modes.cols(), work.nodes);
  work.modes.noalias() = table.to_modes * work.nodes;
  work.gradient.noalias() = table.mean_gradient * work.nodes;

  std::vector<Eigen::MatrixXd> metrics(batch.count);  // J⁻¹ J⁻ᵀ
  for (std::size_t i = 0; i < batch.count; ++i) {
    const Eigen::MatrixXd transposed = work.gradient.middleCols(static_cast<Eigen::Index>(i) * d, d);
    const double determinant = transposed.determinant();
    out.volumes[batch.cell + i] = measure * std::abs(determinant);
    if (determinant == 0) continue;
    const Eigen::MatrixXd inverse = transposed.inverse();
    metrics[i] = inverse.transpose() * inverse;
  }
  for (std::size_t part = 0; part < table.products.size(); ++part) {
    const Eigen::Index first = table.first[part], count = table.first[part + 1] - first;
    const auto modes = work.modes.middleRows(first, count);
    const auto square = [&](std::size_t i) -> double& { return out.modal_parts[(batch.cell + i) * out.parts + part]; };
    for (int a = 0, pair = 0; a < d; ++a)
      for (int b = a; b < d; ++b, ++pair) {
        work.multiplied.noalias() = table.products[part][static_cast<std::size_t>(pair)] * modes;
        for (std::size_t i = 0; i < batch.count; ++i) {
          if (metrics[i].size() == 0) continue;
          const Eigen::Index columns = static_cast<Eigen::Index>(i) * d;
          const double product =
              modes.middleCols(columns, d).cwiseProduct(work.multiplied.middleCols(columns, d)).sum();
          square(i) += (a == b ? 1 : 2) * metrics[i](a, b) * product;
        }
      }
    for (std::size_t i = 0; i < batch.count; ++i)
      square(i) =
          metrics[i].size() == 0 ? std::numeric_limits<double>::infinity() : std::sqrt(std::max(square(i), 0.0));
  }
}

/// a_E from the parts, if the volumes of all cells are known.
double loss(const double* parts, std::size_t count, double volume, double total, int dimension) {
  const double step = std::pow(volume / total, 2.0 / dimension);
  double sum = 0, weight = 1;
  for (std::size_t part = count; part-- > 0;) sum += (weight *= step) * parts[part] * parts[part];
  return volume > 0 ? std::sqrt(sum) : std::numeric_limits<double>::infinity();
}

/// Gives all ranks what each has measured of its share of the batches.
void gather_shares(const std::vector<CellBatch>& batches, RankShare mine, const Ranks& sharers, CellAccuracy& found) {
  const auto cell_of = [&](std::size_t batch) {
    return batch < batches.size() ? batches[batch].cell : found.volumes.size();
  };
  const auto gather = [&](std::vector<double>& numbers, std::size_t width) {
    const auto at = [&](std::size_t batch) {
      return numbers.begin() + static_cast<std::ptrdiff_t>(cell_of(batch) * width);
    };
    numbers = sharers.gather_everywhere(std::vector<double>(at(mine.begin), at(mine.end)));
  };
  gather(found.modal_parts, found.parts);
  gather(found.volumes, 1);
}

/// The parts and volumes of the cells of a mesh with its nodes at `coordinates`, without their losses. Call it inside
/// team.run().
CellAccuracy measure_parts(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                           const Ranks& sharers) {
  const std::size_t cells = mesh.element_count(mesh.dimension);
  CellAccuracy found;
  found.parts = static_cast<std::size_t>(std::max(mesh.order - 1, 0));
  found.modal_parts.resize(cells * found.parts);
  found.volumes.resize(cells);
  const auto batches = detail::cell_batches(mesh, [](const ElementBlock&) { return kAccuracyBatch; });
  if (sharers.count() > 1) team.look_together();
  const RankShare mine = share_of(batches.size(), sharers);
  team.for_ranges(mine.end - mine.begin, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t batch = mine.begin + begin; batch < mine.begin + end; ++batch)
      measure_cells(coordinates, mesh.dimension, batches[batch], team.stop(), found);
  });
  if (sharers.count() > 1) gather_shares(batches, mine, sharers, found);
  return found;
}

/// cell_accuracy() of a mesh with its nodes at `coordinates`. Call it inside team.run().
CellAccuracy measure(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                     const Ranks& ranks = one_rank(), const Ranks& sharers = one_rank()) {
  CellAccuracy found = measure_parts(mesh, coordinates, team, sharers);
  const std::size_t cells = found.volumes.size();
  found.loss.resize(cells);
  const double total =
      ranks.sum(Reduction(team).exact(cells, kCellsPerTask, [&](std::size_t cell) { return found.volumes[cell]; }));
  if (found.parts == 0) return found;
  team.for_ranges(cells, kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      found.loss[cell] =
          loss(&found.modal_parts[cell * found.parts], found.parts, found.volumes[cell], total, mesh.dimension);
  });
  return found;
}

/// The sums over the cells of V_E, of V_E a_E², and of V_E m_s² for each part.
struct VolumeSums {
  std::vector<ExactSum> sums;
  std::int64_t collapsed = 0;  ///< Cells without a volume.

  explicit VolumeSums(std::size_t parts) : sums(2 + parts) {}

  void add(const CellAccuracy& cells, std::size_t cell) {
    const double volume = cells.volumes[cell];
    if (volume == 0) {
      ++collapsed;
      return;
    }
    sums[0].add(volume);
    sums[1].add(volume * cells.loss[cell] * cells.loss[cell]);
    for (std::size_t part = 0; part < cells.parts; ++part) {
      const double value = cells.modal_parts[cell * cells.parts + part];
      sums[2 + part].add(volume * value * value);
    }
  }

  void add(const VolumeSums& other) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i].add(other.sums[i]);
    collapsed += other.collapsed;
  }
};

VolumeSums volume_sums(const CellAccuracy& cells, const Team& team) {
  VolumeSums all(cells.parts);
  std::mutex mutex;
  team.for_ranges(cells.volumes.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    VolumeSums mine(cells.parts);
    for (std::size_t cell = begin; cell < end; ++cell) mine.add(cells, cell);
    const std::scoped_lock lock(mutex);
    all.add(mine);
  });
  return all;
}

}  // namespace

CellAccuracy cell_accuracy(const HighOrderMesh& mesh, const Team& team, const Ranks& sharers) {
  CellAccuracy cells;
  team.run([&] { cells = measure(mesh, mesh.coordinates, team, one_rank(), sharers); });
  return cells;
}

Accuracy accuracy(const HighOrderMesh& mesh, const Team& team, const Ranks& ranks) {
  return accuracy(mesh, mesh.coordinates, team, ranks);
}

Accuracy accuracy(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team, const Ranks& ranks,
                  const Ranks& sharers) {
  const std::size_t parts = static_cast<std::size_t>(std::max(mesh.order - 1, 0));
  VolumeSums all(parts);
  team.run([&] { all = volume_sums(measure(mesh, coordinates, team, ranks, sharers), team); });
  ranks.sum(all.sums);
  const std::int64_t collapsed = ranks.sum(all.collapsed);
  const double total = all.sums[0].value();
  Accuracy found;
  found.modal_parts.resize(parts);
  if (parts == 0 || (total == 0 && collapsed == 0)) return found;
  const auto root = [&](const ExactSum& sum) {
    return collapsed > 0 ? std::numeric_limits<double>::infinity() : std::sqrt(sum.value() / total);
  };
  found.loss = root(all.sums[1]);
  for (std::size_t part = 0; part < parts; ++part) found.modal_parts[part] = root(all.sums[2 + part]);
  return found;
}

double local_wave(const HighOrderMesh& mesh) {
  const auto cells = static_cast<double>(std::max<std::size_t>(mesh.element_count(mesh.dimension), 1));
  return std::pow(cells, -1.0 / mesh.dimension);
}

double local_loss(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                  const Ranks& sharers) {
  const double wave = local_wave(mesh);
  double mean = 0;
  team.run([&] {
    const CellAccuracy cells = measure_parts(mesh, coordinates, team, sharers);
    const auto square_of = [&](std::size_t cell) {
      double square = 0, weight = 1;
      for (std::size_t part = cells.parts; part-- > 0;) {
        const double value = cells.modal_parts[cell * cells.parts + part];
        square += (weight *= wave * wave) * value * value;
      }
      return square;
    };
    const std::size_t count = cells.volumes.size();
    if (count > 0) mean = Reduction(team).sum(count, kCellsPerTask, square_of) / static_cast<double>(count);
  });
  return std::sqrt(mean);
}

CellAccuracy cell_accuracy(const HighOrderMesh& mesh, int threads) { return cell_accuracy(mesh, Team(threads)); }
Accuracy accuracy(const HighOrderMesh& mesh, int threads) { return accuracy(mesh, Team(threads)); }

std::int64_t bytes_of_accuracy(const MeshCounts& counts) {
  const std::int64_t cells = counts.cell_count();
  return cells * std::int64_t{sizeof(double)} * (std::max(counts.order - 1, 0) + 2) +
         cells / static_cast<std::int64_t>(kAccuracyBatch) * static_cast<std::int64_t>(sizeof(CellBatch));
}

std::int64_t bytes_of_accuracy_tables(const MeshCounts& counts) {
  std::int64_t numbers = 0;
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const auto shape = static_cast<Shape>(s);
    const std::int64_t d = reference::info(shape).dimension, nodes = reference::node_count(shape, counts.order);
    numbers += nodes * (nodes + d);
    for (int degree = 2; degree <= counts.order; ++degree) {
      const std::int64_t modes = reference::node_count(shape, degree) - reference::node_count(shape, degree - 1);
      numbers += d * (d + 1) / 2 * modes * modes;
    }
  }
  return numbers * std::int64_t{sizeof(double)};
}

}  // namespace varimesh
