// Samples det ∇χ_M in every cell, and puts samples and certificates together to a report.
#include <Eigen/Core>
#include <cassert>
#include <mutex>
#include <optional>
#include <span>

#include "core/base/reduction.h"
#include "core/base/shared_work.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/certified_quality.h"
#include "core/quality/lattice_kernel.h"
#include "core/quality/sample_cells.h"
#include "core/quality/surface.h"
#include "core/reference/basis.h"
#include "core/validity/cell_batches.h"

namespace varimesh {
namespace {

using detail::CellBatch;
using detail::Extremes;
using detail::LatticeTable;

// ---------------------------------------------------------------------------------------------------------------------
// Samples
// ---------------------------------------------------------------------------------------------------------------------

constexpr std::size_t kCellsPerTask = 4096;
constexpr int kQuickIntervals = 2;

/// min / max; −1 if the value is nowhere positive.
double ratio(double low, double high) { return high > 0 ? low / high : -1.0; }

/// The extremes of J on the lattice in every cell.
struct Samples {
  std::vector<Extremes> cells;
  std::vector<CellBatch> batches;
  double sign = 1;  // −1 if the mesh is numbered clockwise
  int intervals = 0;

  double low(std::size_t cell) const { return sign > 0 ? cells[cell].low : -cells[cell].high; }
  double high(std::size_t cell) const { return sign > 0 ? cells[cell].high : -cells[cell].low; }
  std::int32_t low_at(std::size_t cell) const { return sign > 0 ? cells[cell].low_at : cells[cell].high_at; }
  double scaled_jacobian(std::size_t cell) const { return ratio(low(cell), high(cell)); }
};

/// The sign that most cells have. A clockwise mesh is judged as its mirror image.
double orientation(const std::vector<Extremes>& cells, const Team& team, const Ranks& ranks) {
  const std::int64_t negative =
      count_where(team, cells.size(), kCellsPerTask, [&](std::size_t cell) { return cells[cell].mean < 0; });
  return 2 * ranks.sum(negative) > ranks.sum(std::ssize(cells)) ? -1.0 : 1.0;
}

const LatticeTable& table_of(const ElementBlock& block, int intervals, int dimension) {
  return detail::lattice_table(block.shape, block.order, intervals, dimension);
}

/// @param coordinates of the nodes, as HighOrderMesh::coordinates
/// @param elsewhere   samples the cells if it can; may be null
Samples sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals, const Team& team,
               const Ranks& ranks = one_rank(), detail::SamplesElsewhere* elsewhere = nullptr) {
  assert(mesh.dimension == 2 || mesh.dimension == 3);
  Samples samples;
  samples.intervals = intervals > 0 ? intervals : report_intervals(mesh.order);
  samples.cells.resize(mesh.element_count(mesh.dimension));
  samples.batches = detail::batches_to_sample(mesh);
  team.run([&] {
    const bool is_done =
        elsewhere != nullptr && elsewhere->sample(mesh, coordinates, samples.intervals, team, samples.cells);
    if (!is_done) detail::sample_cells(mesh, coordinates, samples.intervals, samples.batches, team, samples.cells);
    samples.sign = orientation(samples.cells, team, ranks);
  });
  return samples;
}

Samples sample(const HighOrderMesh& mesh, int intervals, const Team& team) {
  return sample(mesh, mesh.coordinates, intervals, team);
}

/// The ratio of det F. If a valid cell is inverted with straight sides, det F says nothing about it, and the ratio is
/// Js.
double distortion_jacobian(const Samples& samples, std::size_t cell, bool affine) {
  const Extremes& extremes = samples.cells[cell];
  const bool straight_is_inverted = samples.low(cell) > 0 && !(extremes.distortion_low > 0);
  if (affine || straight_is_inverted) return samples.scaled_jacobian(cell);
  return ratio(extremes.distortion_low, extremes.distortion_high);
}

CellQuality cell_quality(const Samples& samples, const Team& team) {
  CellQuality quality;
  quality.scaled_jacobian.resize(samples.cells.size());
  quality.distortion_jacobian.resize(samples.cells.size());
  team.run([&] {
    team.for_ranges(samples.batches.size(), kCellsPerTask / detail::kMostLatticeLanes,
                    [&](std::size_t first, std::size_t last) {
                      for (const CellBatch& batch : std::span(samples.batches).subspan(first, last - first)) {
                        const bool affine = reference::info(batch.block->shape).affine;
                        for (std::size_t i = batch.cell; i < batch.cell + batch.count; ++i) {
                          quality.scaled_jacobian[i] = samples.scaled_jacobian(i);
                          quality.distortion_jacobian[i] = distortion_jacobian(samples, i, affine);
                        }
                      }
                    });
  });
  return quality;
}

/// Physical coordinates of a point of a batch's i-th cell.
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

/// Call it inside team.run().
std::vector<InvalidElement> invalid_elements(const HighOrderMesh& mesh, const Samples& samples,
                                             const CellQuality& quality, const Team& team) {
  std::vector<InvalidElement> invalid;
  for (const std::int32_t cell :
       indices_where(team, samples.cells.size(), kCellsPerTask, [&](std::size_t i) { return !(samples.low(i) > 0); })) {
    const auto number = static_cast<std::size_t>(cell);
    const CellBatch& batch = *(std::ranges::upper_bound(samples.batches, number, {}, &CellBatch::cell) - 1);
    const LatticeTable& table = table_of(*batch.block, samples.intervals, mesh.dimension);
    const std::size_t i = number - batch.cell;
    invalid.push_back({batch.block->numbers[batch.first + i], quality.scaled_jacobian[number],
                       place(mesh, batch, i, table.points().row(samples.low_at(number)))});
  }
  return invalid;
}

/// The summary of the whole mesh from those of its parts.
CertificateSummary whole(CertificateSummary part, const Ranks& ranks) {
  if (ranks.count() == 1) return part;
  std::array<std::int64_t, 3> counts{part.valid, part.invalid, part.undecided};
  const bool is_empty = counts[0] + counts[1] + counts[2] == 0;
  ranks.sum(counts);
  const double lower =
      ranks.smallest(is_empty ? std::numeric_limits<double>::max() : part.min_scaled_jacobian_lower_bound);
  return {counts[0], counts[1], counts[2], lower};
}

/// Call it inside team.run().
std::vector<UncertifiedElement> uncertified_elements(const HighOrderMesh& mesh,
                                                     std::span<const Certificate> certificates, const Team& team) {
  const std::vector<std::int32_t> cells = indices_where(
      team, certificates.size(), kCellsPerTask, [&](std::size_t cell) { return !certificates[cell].is_valid(); });
  std::vector<UncertifiedElement> uncertified;
  auto next = cells.begin();
  for (const CellBatch& block : detail::whole_blocks(mesh))
    for (; next != cells.end() && static_cast<std::size_t>(*next) < block.cell + block.count; ++next) {
      const Certificate& certificate = certificates[static_cast<std::size_t>(*next)];
      uncertified.push_back(
          {block.block->numbers[static_cast<std::size_t>(*next) - block.cell], certificate.answer, certificate.place});
    }
  return uncertified;
}

/// The smallest of the values that the ranks have. Call it inside team.run().
double smallest(const std::vector<double>& values, const Team& team, const Ranks& ranks) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return ranks.smallest(-Reduction(team).largest(
      values.size(), kCellsPerTask, [&](std::size_t i) { return -values[i]; }, -kInfinity));
}

/// Σ of the scaled Jacobians, each at least −1. Call it inside team.run().
ExactSum sum_of(const std::vector<double>& scaled_jacobians, const Team& team) {
  return Reduction(team).exact(scaled_jacobians.size(), kCellsPerTask,
                               [&](std::size_t cell) { return std::max(scaled_jacobians[cell], -1.0); });
}

/// Adds the scaled Jacobians of the cells to the histogram. Call it inside team.run().
void fill_histogram(const std::vector<double>& scaled_jacobians, const Team& team, QualityReport& report) {
  std::mutex mutex;
  team.for_ranges(scaled_jacobians.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    decltype(report.histogram) mine{};
    for (std::size_t cell = begin; cell < end; ++cell) {
      const double js = scaled_jacobians[cell];
      const int bin = static_cast<int>(js * QualityReport::kBins);
      if (js > 0) ++mine[static_cast<std::size_t>(std::min(bin, QualityReport::kBins - 1))];
    }
    const std::scoped_lock lock(mutex);
    for (std::size_t bin = 0; bin < mine.size(); ++bin) report.histogram[bin] += mine[bin];
  });
}

/// Everything except what is proved. Call it inside team.run().
QualityReport report_on(const HighOrderMesh& mesh, const Samples& samples, std::span<const Certificate> certificates,
                        const Team& team, const Ranks& ranks = one_rank()) {
  const CellQuality cells = cell_quality(samples, team);
  QualityReport report;
  report.lattice_intervals = samples.intervals;
  const std::int64_t count = ranks.sum(std::ssize(cells.scaled_jacobian));
  if (count == 0) return report;
  report.min_scaled_jacobian = smallest(cells.scaled_jacobian, team, ranks);
  report.min_distortion_jacobian = smallest(cells.distortion_jacobian, team, ranks);
  fill_histogram(cells.scaled_jacobian, team, report);
  ranks.sum(report.histogram);
  report.mean_scaled_jacobian = ranks.sum(sum_of(cells.scaled_jacobian, team)) / static_cast<double>(count);
  report.invalid = ranks.gather(invalid_elements(mesh, samples, cells, team));
  std::ranges::stable_sort(report.invalid, {}, &InvalidElement::scaled_jacobian);
  report.invalid_elements = ranks.sum(std::ssize(report.invalid));
  report.uncertified = ranks.gather(uncertified_elements(mesh, certificates, team));
  return report;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// Public functions
// ---------------------------------------------------------------------------------------------------------------------

int report_intervals(int order) { return std::max(2 * order + 2, 8); }

std::vector<std::int64_t> uncertified_numbers(const QualityReport& report) {
  std::vector<std::int64_t> numbers;
  for (const UncertifiedElement& element : report.uncertified) numbers.push_back(element.number);
  return numbers;
}

CellQuality cell_quality(const HighOrderMesh& mesh, int intervals, int threads) {
  const Team team(threads);
  std::optional<detail::JudgedMesh> judged;
  team.run([&] { judged.emplace(mesh, team); });
  return cell_quality(sample(judged->mesh(), intervals, team), team);
}

QualityReport quality(const HighOrderMesh& mesh, int intervals, int threads) {
  return quality(mesh, intervals, Team(threads));
}

namespace {

/// quality(), with certificates that hold if the mesh is judged as it is.
QualityReport judge(const HighOrderMesh& mesh, int intervals, std::vector<Certificate> certificates, const Team& team,
                    const Facets* facets) {
  std::optional<detail::JudgedMesh> judged;
  std::optional<Certifier> certifier;
  team.run([&] {
    judged.emplace(mesh, team, facets);
    certifier.emplace(judged->mesh(), CertificateOptions{}, team);
    const bool is_as_it_came = judged->surface() == nullptr && judged->clockwise().empty();
    if (is_as_it_came && certificates.size() == certifier->cells()) return;
    certificates.assign(certifier->cells(), {});
    certifier->certify(judged->mesh().coordinates, certificates, team);
  });
  QualityReport report = quality(judged->mesh(), *certifier, std::move(certificates), intervals, team);
  report.clockwise = judged->clockwise();
  if (judged->surface() != nullptr) judged->surface()->put_in_space(report);
  return report;
}

}  // namespace

QualityReport quality(const HighOrderMesh& mesh, int intervals, const Team& team, const Facets* facets) {
  return judge(mesh, intervals, {}, team, facets);
}

QualityReport quality(const HighOrderMesh& mesh, std::vector<Certificate> certificates, const Team& team) {
  return judge(mesh, 0, std::move(certificates), team, nullptr);
}

CellQuality cell_quality(const HighOrderMesh& mesh, const Team& team) {
  return cell_quality(sample(mesh, 0, team), team);
}

ScaledJacobians scaled_jacobians(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                                 detail::SamplesElsewhere* elsewhere) {
  const std::vector<double> of_cells =
      cell_quality(sample(mesh, coordinates, 0, team, one_rank(), elsewhere), team).scaled_jacobian;
  ScaledJacobians out{1, 0};
  if (of_cells.empty()) return out;
  team.run([&] {
    out.smallest = std::min(1.0, smallest(of_cells, team, one_rank()));
    out.mean = sum_of(of_cells, team).value() / static_cast<double>(of_cells.size());
  });
  return out;
}

QualityReport quality(const HighOrderMesh& mesh, const Certifier& certifier, std::vector<Certificate> certificates,
                      int intervals, const Team& team, const Ranks& ranks, detail::SamplesElsewhere* elsewhere) {
  const Samples samples = sample(mesh, mesh.coordinates, intervals, team, ranks, elsewhere);
  QualityReport report;
  team.run([&] { report = report_on(mesh, samples, certificates, team, ranks); });
  report.accuracy =
      accuracy(mesh, mesh.coordinates, team, ranks, elsewhere != nullptr ? elsewhere->sharers() : one_rank());
  // Each rank sharpens its own minimum, and the least of these is that of the mesh.
  team.run([&] {
    report.certified = whole(certifier.sharpen(mesh.coordinates, certificates, Certifier::kMinimumGap, team), ranks);
  });
  return report;
}

QualityReport quick_quality(const HighOrderMesh& mesh, std::span<const Certificate> certificates, const Team& team) {
  const Team unstopped = team.without_stop();
  const Samples samples = sample(mesh, kQuickIntervals, unstopped);
  QualityReport report;
  unstopped.run([&] {
    report = report_on(mesh, samples, certificates, unstopped);
    report.certified = summarise(certificates, unstopped);
  });
  return report;
}

}  // namespace varimesh
