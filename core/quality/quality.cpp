// Samples det ∇χ_M of every cell: gradient operator × coordinates for a batch of cells at once, then determinants.
#include "core/quality/quality.h"

#include <Eigen/Core>
#include <cassert>
#include <limits>
#include <numeric>

#include "core/quality/cell_blocks.h"
#include "core/reference/basis.h"
#include "core/team.h"

namespace varimesh {
namespace {

using detail::CellBatch;

// ---------------------------------------------------------------------------------------------------------------------
// Tables of one shape and order
// ---------------------------------------------------------------------------------------------------------------------

struct LatticeTable {
  reference::Points points;
  std::vector<Eigen::MatrixXd> gradients;  // a points × nodes matrix a direction
  std::vector<Eigen::MatrixXd> straight;  // the same for the straight-sided cell: points × vertices; empty on simplices
};

LatticeTable lattice_table(Shape shape, int order, int intervals, int dimension) {
  LatticeTable table;
  table.points = reference::uniform_lattice(shape, intervals);
  table.gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, dimension, table.points);
  if (!reference::info(shape).affine)
    table.straight = reference::basis_gradients(shape, 1, reference::NodeSet::Equispaced, dimension, table.points);
  return table;
}

int default_intervals(int order) { return std::max(2 * order + 2, 8); }

// ---------------------------------------------------------------------------------------------------------------------
// Determinants of a batch
// ---------------------------------------------------------------------------------------------------------------------

/// Room for a batch, kept by each thread from batch to batch.
struct Workspace {
  Eigen::MatrixXd coordinates;             // nodes × (dimension · cells); column (cell, component)
  std::array<Eigen::MatrixXd, 3> columns;  // a direction each: points × (dimension · cells)
  Eigen::MatrixXd jacobian;                // points × cells
  Eigen::MatrixXd straight_jacobian;       // points × cells
};

/// Coordinates of a batch relative to each cell's first node: a mesh far from the origin keeps its digits.
void gather(const HighOrderMesh& mesh, const CellBatch& batch, int nodes, Eigen::MatrixXd& coordinates) {
  const int dimension = mesh.dimension;
  coordinates.resize(nodes, static_cast<Eigen::Index>(batch.count) * dimension);
  for (std::size_t i = 0; i < batch.count; ++i) {
    const std::int32_t* node = batch.nodes(i);
    const double* origin = mesh.coordinates.data() + 3 * static_cast<std::size_t>(node[0]);
    for (int component = 0; component < dimension; ++component) {
      double* column = coordinates.col(static_cast<Eigen::Index>(i) * dimension + component).data();
      for (int n = 0; n < nodes; ++n)
        column[n] = mesh.coordinates[3 * static_cast<std::size_t>(node[n]) + static_cast<std::size_t>(component)] -
                    origin[component];
    }
  }
}

/// det of the columns ∂χ/∂ξ_r of every cell: out is points × cells. Only the first `gradients[r].cols()` rows of the
/// coordinates count (the vertices come first in Gmsh's order).
void determinants(const std::vector<Eigen::MatrixXd>& gradients, int dimension, Workspace& work, Eigen::MatrixXd& out) {
  const Eigen::Index cells = work.coordinates.cols() / dimension;
  const Eigen::Index nodes = gradients[0].cols();
  for (int r = 0; r < dimension; ++r) {
    auto& column = work.columns[static_cast<std::size_t>(r)];
    column.noalias() = gradients[static_cast<std::size_t>(r)] * work.coordinates.topRows(nodes);
  }
  out.resize(gradients[0].rows(), cells);
  const auto& [gr, gs, gt] = work.columns;
  for (Eigen::Index e = 0; e < cells; ++e) {
    const auto r = [&](int c) { return gr.col(e * dimension + c).array(); };
    const auto s = [&](int c) { return gs.col(e * dimension + c).array(); };
    const auto t = [&](int c) { return gt.col(e * dimension + c).array(); };
    if (dimension == 2)
      out.col(e) = r(0) * s(1) - r(1) * s(0);
    else
      out.col(e) =
          r(0) * (s(1) * t(2) - s(2) * t(1)) - r(1) * (s(0) * t(2) - s(2) * t(0)) + r(2) * (s(0) * t(1) - s(1) * t(0));
  }
}

// ---------------------------------------------------------------------------------------------------------------------
// One cell
// ---------------------------------------------------------------------------------------------------------------------

/// Extremes of J in one cell with the signs as numbered, so that the mesh's orientation can be applied afterwards.
struct Extremes {
  double low = 0, high = 0, mean = 0;
  std::int32_t low_at = 0, high_at = 0;            // lattice points
  double distortion_low = 0, distortion_high = 0;  // of det ∇χ_M / det ∇χ_L, signless in the orientation
};

Extremes extremes(const Eigen::Ref<const Eigen::VectorXd>& jacobian) {
  Extremes e;
  Eigen::Index low = 0, high = 0;
  e.low = jacobian.minCoeff(&low);
  e.high = jacobian.maxCoeff(&high);
  e.mean = jacobian.mean();
  e.low_at = static_cast<std::int32_t>(low);
  e.high_at = static_cast<std::int32_t>(high);
  return e;
}

/// min / max, −1 where the value is nowhere positive.
double ratio(double low, double high) { return high > 0 ? low / high : -1.0; }

/// J of every cell on the lattice, as extremes.
struct Samples {
  std::vector<Extremes> cells;
  std::vector<CellBatch> batches;
  std::map<std::pair<Shape, int>, LatticeTable> tables;
  double sign = 1;  // −1 where the mesh is numbered clockwise
  int intervals = 0;

  double low(std::size_t cell) const { return sign > 0 ? cells[cell].low : -cells[cell].high; }
  double high(std::size_t cell) const { return sign > 0 ? cells[cell].high : -cells[cell].low; }
  std::int32_t low_at(std::size_t cell) const { return sign > 0 ? cells[cell].low_at : cells[cell].high_at; }
  double scaled_jacobian(std::size_t cell) const { return ratio(low(cell), high(cell)); }
};

void sample_batch(const HighOrderMesh& mesh, const CellBatch& batch, const LatticeTable& table, Workspace& work,
                  std::span<Extremes> out) {
  gather(mesh, batch, reference::node_count(batch.block->shape, batch.block->order), work.coordinates);
  determinants(table.gradients, mesh.dimension, work, work.jacobian);
  for (std::size_t i = 0; i < batch.count; ++i)
    out[batch.cell + i] = extremes(work.jacobian.col(static_cast<Eigen::Index>(i)));
  if (table.straight.empty()) return;
  determinants(table.straight, mesh.dimension, work, work.straight_jacobian);
  for (std::size_t i = 0; i < batch.count; ++i) {
    // A cell whose straight-sided form is itself inverted has no deformation gradient to speak of: nowhere positive.
    const auto straight = work.straight_jacobian.col(static_cast<Eigen::Index>(i)).array();
    const bool inverted = straight.minCoeff() <= 0 && straight.maxCoeff() >= 0;
    const auto distortion = work.jacobian.col(static_cast<Eigen::Index>(i)).array() / straight;
    out[batch.cell + i].distortion_low = inverted ? -1.0 : distortion.minCoeff();
    out[batch.cell + i].distortion_high = inverted ? -1.0 : distortion.maxCoeff();
  }
}

/// The sign that most cells have: a clockwise mesh is judged as its mirror image.
double orientation(const std::vector<Extremes>& cells) {
  const auto negative = std::ranges::count_if(cells, [](const Extremes& e) { return e.mean < 0; });
  return 2 * static_cast<std::size_t>(negative) > cells.size() ? -1.0 : 1.0;
}

Samples sample(const HighOrderMesh& mesh, int intervals, const Team& team) {
  assert(mesh.dimension == 2 || mesh.dimension == 3);
  Samples samples;
  samples.intervals = intervals > 0 ? intervals : default_intervals(mesh.order);
  samples.cells.resize(mesh.element_count(mesh.dimension));
  samples.tables = detail::tables_for_cells<LatticeTable>(
      mesh, [&](Shape shape, int order) { return lattice_table(shape, order, samples.intervals, mesh.dimension); });
  // About 400 kB of products a batch: they stay in the second-level cache until the determinants are taken.
  samples.batches = detail::cell_batches(mesh, [&](const ElementBlock& block) {
    const auto points = samples.tables.at({block.shape, block.order}).points.rows();
    return static_cast<std::size_t>(50000 / (points * mesh.dimension * mesh.dimension));
  });
  team.run([&] {
    team.for_ranges(samples.batches.size(), 1, [&](std::size_t begin, std::size_t end) {
      Workspace work;
      for (std::size_t b = begin; b != end; ++b) {
        const CellBatch& batch = samples.batches[b];
        sample_batch(mesh, batch, samples.tables.at({batch.block->shape, batch.block->order}), work, samples.cells);
      }
    });
  });
  samples.sign = orientation(samples.cells);
  return samples;
}

CellQuality cell_quality(const Samples& samples) {
  CellQuality quality;
  quality.scaled_jacobian.resize(samples.cells.size());
  quality.distortion_jacobian.resize(samples.cells.size());
  for (const CellBatch& batch : samples.batches) {
    const bool affine = reference::info(batch.block->shape).affine;
    for (std::size_t i = batch.cell; i < batch.cell + batch.count; ++i) {
      quality.scaled_jacobian[i] = samples.scaled_jacobian(i);
      quality.distortion_jacobian[i] = affine
                                           ? quality.scaled_jacobian[i]
                                           : ratio(samples.cells[i].distortion_low, samples.cells[i].distortion_high);
    }
  }
  return quality;
}

/// Where a lattice point of a cell lies in space.
std::array<double, 3> place(const HighOrderMesh& mesh, const CellBatch& batch, std::size_t i,
                            const reference::Points& point) {
  const ElementBlock& block = *batch.block;
  const Eigen::MatrixXd values =
      reference::basis_values(block.shape, block.order, reference::NodeSet::Equispaced, mesh.dimension, point);
  std::array<double, 3> at{};
  for (Eigen::Index n = 0; n < values.cols(); ++n)
    for (std::size_t c = 0; c < 3; ++c)
      at[c] += values(0, n) * mesh.coordinates[3 * static_cast<std::size_t>(batch.nodes(i)[n]) + c];
  return at;
}

std::vector<InvalidElement> invalid_elements(const HighOrderMesh& mesh, const Samples& samples,
                                             const CellQuality& quality) {
  std::vector<InvalidElement> invalid;
  for (const CellBatch& batch : samples.batches) {
    for (std::size_t i = 0; i < batch.count; ++i) {
      const std::size_t cell = batch.cell + i;
      if (samples.low(cell) > 0) continue;
      const LatticeTable& table = samples.tables.at({batch.block->shape, batch.block->order});
      invalid.push_back({batch.block->numbers[batch.first + i], quality.scaled_jacobian[cell],
                         place(mesh, batch, i, table.points.row(samples.low_at(cell)))});
    }
  }
  std::ranges::stable_sort(invalid, {}, &InvalidElement::scaled_jacobian);
  return invalid;
}

std::vector<UncertifiedElement> uncertified_elements(const HighOrderMesh& mesh,
                                                     const std::vector<Certificate>& certificates) {
  std::vector<UncertifiedElement> uncertified;
  for (const CellBatch& batch : detail::cell_batches(mesh, [](const ElementBlock& block) { return block.size(); }))
    for (std::size_t i = 0; i < batch.count; ++i) {
      const Certificate& certificate = certificates[batch.cell + i];
      if (certificate.answer != Certificate::Answer::Valid)
        uncertified.push_back({batch.block->numbers[batch.first + i], certificate.answer, certificate.place});
    }
  return uncertified;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// The doors
// ---------------------------------------------------------------------------------------------------------------------

std::vector<std::int64_t> uncertified_numbers(const QualityReport& report) {
  std::vector<std::int64_t> numbers;
  for (const UncertifiedElement& element : report.uncertified) numbers.push_back(element.number);
  return numbers;
}

CellQuality cell_quality(const HighOrderMesh& mesh, int intervals, int threads) {
  return cell_quality(sample(mesh, intervals, Team(threads)));
}

QualityReport quality(const HighOrderMesh& mesh, int intervals, int threads) {
  const Team team(threads);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  team.run([&] { certifier.certify(mesh.coordinates, certificates, team); });
  return quality(mesh, certifier, std::move(certificates), intervals, team);
}

QualityReport quality(const HighOrderMesh& mesh, const Certifier& certifier, std::vector<Certificate> certificates,
                      int intervals, const Team& team) {
  const Samples samples = sample(mesh, intervals, team);
  const CellQuality cells = cell_quality(samples);
  QualityReport report;
  report.lattice_intervals = samples.intervals;
  if (cells.scaled_jacobian.empty()) return report;
  report.min_scaled_jacobian = std::ranges::min(cells.scaled_jacobian);
  report.min_distortion_jacobian = std::ranges::min(cells.distortion_jacobian);
  double sum = 0;
  for (const double js : cells.scaled_jacobian) {
    sum += std::max(js, -1.0);
    const int bin = static_cast<int>(js * QualityReport::kBins);
    if (js > 0) ++report.histogram[static_cast<std::size_t>(std::min(bin, QualityReport::kBins - 1))];
  }
  report.mean_scaled_jacobian = sum / static_cast<double>(cells.scaled_jacobian.size());
  report.invalid = invalid_elements(mesh, samples, cells);
  report.invalid_elements = static_cast<std::int64_t>(report.invalid.size());
  report.uncertified = uncertified_elements(mesh, certificates);
  report.certified = certifier.sharpen(mesh.coordinates, certificates);
  double& bound = report.certified.min_scaled_jacobian_lower_bound;
  bound = std::max(bound, -1.0);
  return report;
}

}  // namespace varimesh
