// Certifies cells: first with the batched kernel, which is enough for nearly all, then the few others by subdivision.
#include "core/validity/certifier.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "core/base/index.h"
#include "core/base/reduction.h"
#include "core/base/shared_work.h"
#include "core/validity/cell_batches.h"
#include "core/validity/certificate_kernel.h"
#include "core/validity/orientation.h"
#include "core/validity/subdivision.h"

namespace varimesh {
namespace {

using detail::CellToCertify;

/// Cells that a task takes at a time: enough to fill vectors, and few enough to share out the hard ones.
constexpr std::size_t kGrain = 64;
constexpr std::size_t kCellsPerTask = 16384;
constexpr std::size_t kCellsPerChunk = 1024;  // that are searched for the lowest
/// Cells are measured elsewhere if they are at least one in this many: the coordinates of all nodes go there first.
constexpr std::size_t kShareElsewhere = 8;
/// A few cells are certified sooner than their certificates go from rank to rank.
constexpr std::size_t kFewestToShare = 256;

/// A power of two that brings the largest extent of the cells to between 1/2 and 1; 1 if they have no finite extent.
double power_of_two_scale(const BoundingBox& box) {
  double extent = 0;
  for (std::size_t c = 0; c < 3; ++c) extent = std::max(extent, box.high[c] / 2 - box.low[c] / 2);
  if (!(extent > 0) || !std::isfinite(extent)) return 1;
  int exponent = 0;
  std::frexp(extent, &exponent);
  return std::ldexp(1.0, std::clamp(-exponent - 1, -1000, 1000));
}

/// The certificate that follows from the kernel's output in one lane; false if it does not tell enough.
bool certify_lane(const CellToCertify& cell, const detail::KernelOutput& output, std::size_t lane, double gap,
                  Certificate& certificate) {
  const double error = output.error[lane];
  const std::size_t corners = cell.table->corners.size();
  double lowest = output.corner[0][lane], highest = lowest;
  std::size_t lowest_corner = 0;
  for (std::size_t k = 1; k < corners; ++k) {
    highest = std::max(highest, output.corner[k][lane]);
    if (output.corner[k][lane] < lowest) {
      lowest = output.corner[k][lane];
      lowest_corner = k;
    }
  }
  const double lower = output.least[lane] - error;
  const bool valid = lower > 0;
  const bool invalid = !valid && lowest + error <= 0;
  if (!valid && !invalid) return false;
  if (valid && detail::is_blunt(error, lower)) return false;
  const double greatest = output.greatest[lane] + error;
  if (std::isfinite(gap) && highest > error &&
      (lowest + error - lower) / (highest - error) + std::max(lower, 0.0) * (1 / (highest - error) - 1 / greatest) >
          gap)
    return false;
  certificate = {};
  certificate.answer = valid ? Certificate::Answer::Valid : Certificate::Answer::Invalid;
  detail::set_bounds(cell, lower, greatest, highest - error, certificate);
  if (invalid) certificate.place = detail::physical_place(cell, cell.table->corner_at[lowest_corner]);
  return true;
}

/// Cells that were measured elsewhere.
struct Measured {
  const detail::JacobianTable& table;
  std::span<const double> coordinates;
  std::span<const std::int32_t* const> nodes;
  double scale, sign;
};

/// Certifies those for which their measures are enough, and sets their entries of `is_certified`.
/// @param numbers  of the cells, which are numbers in `certificates`
void certify_measured(const Measured& cells, std::span<const double> measures, double gap,
                      std::span<const std::int32_t> numbers, std::span<Certificate> certificates,
                      std::span<char> is_certified, const Team& team) {
  constexpr std::size_t kBatch = detail::kMeasuredTogether;
  const std::size_t batch_size = detail::measures_of(cells.table) * kBatch, count = cells.nodes.size();
  const std::size_t lanes = std::min(detail::kernel_lanes(), kBatch);
  team.for_ranges((count + kBatch - 1) / kBatch, kGrain, [&](std::size_t begin, std::size_t end) {
    detail::KernelOutput output;
    for (std::size_t first = begin * kBatch; first < std::min(end * kBatch, count); first += lanes) {
      const double* const own = measures.data() + first / kBatch * batch_size + first % kBatch;
      const std::size_t together = std::min(lanes, count - first);
      detail::judge_measures(cells.table, own, kBatch, together, output);
      for (std::size_t lane = 0; lane < together; ++lane) {
        const std::size_t i = first + lane;
        const CellToCertify cell{&cells.table, cells.coordinates.data(), cells.nodes[i], cells.scale, cells.sign};
        is_certified[i] = certify_lane(cell, output, lane, gap, certificates[at(numbers[i])]) ? 1 : 0;
      }
    }
  });
}

/// The coefficients of the cell in one lane, and the bound on their error.
detail::Coefficients<double> known_coefficients(const CellToCertify& cell, const detail::KernelOutput& output,
                                                std::size_t lane) {
  detail::Coefficients<double> known{{}, output.error[lane]};
  known.values.resize(static_cast<std::size_t>(cell.table->jacobian.size()));
  const std::size_t lanes = detail::kernel_lanes();
  for (std::size_t k = 0; k < known.values.size(); ++k) known.values[k] = output.coefficients[k * lanes + lane];
  return known;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// Certifier
// ---------------------------------------------------------------------------------------------------------------------

Certifier::Certifier(const HighOrderMesh& mesh, CertificateOptions options, const Team& team)
    : Certifier(mesh, bounding_box(mesh, team), detail::orientation(mesh, team), options) {}

Certifier::Certifier(const HighOrderMesh& mesh, const BoundingBox& box, double sign, CertificateOptions options)
    : options_(options), scale_(power_of_two_scale(box)), sign_(sign) {
  assert(mesh.dimension == 2 || mesh.dimension == 3);
  for (const detail::CellBatch& batch : detail::whole_blocks(mesh))
    for (std::size_t i = 0; i < batch.count; ++i) cells_.push_back({batch.block, batch.nodes(i)});
  all_.resize(cells_.size());
  std::iota(all_.begin(), all_.end(), 0);
}

/// Runs the kernel on these cells and calls visit(cell number, cell, the kernel's output, lane) for each.
template <class Visit>
void Certifier::visit_on_one_thread(std::span<const double> coordinates, std::span<const std::int32_t> cells, Form form,
                                    const StopToken* stop, const Visit& visit) const {
  thread_local std::vector<double> workspace;
  const std::size_t lanes = detail::kernel_lanes();
  detail::KernelOutput output;
  for (std::size_t first = 0; first < cells.size();) {
    look(stop);
    const ElementBlock& block = *cells_[static_cast<std::size_t>(cells[first])].block;
    detail::KernelInput input;
    input.table = &detail::jacobian_table(block.shape, form == Form::Curved ? block.order : 1);
    input.coordinates = coordinates.data();
    input.scale = scale_;
    input.sign = sign_;
    while (input.cells < lanes && first + input.cells < cells.size()) {
      const Cell& cell = cells_[static_cast<std::size_t>(cells[first + input.cells])];
      if (cell.block->shape != block.shape || cell.block->order != block.order) break;
      input.nodes[input.cells++] = cell.nodes;
    }
    detail::bernstein_kernel(input, workspace, output);
    for (std::size_t lane = 0; lane < input.cells; ++lane) {
      const CellToCertify cell{input.table, coordinates.data(), input.nodes[lane], scale_, sign_};
      visit(static_cast<std::size_t>(cells[first + lane]), cell, output, lane);
    }
    first += input.cells;
  }
}

void Certifier::certify_on_one_thread(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                                      std::span<Certificate> certificates, const StopToken* stop) const {
  visit_on_one_thread(
      coordinates, cells, Form::Curved, stop,
      [&](std::size_t number, const CellToCertify& cell, const detail::KernelOutput& output, std::size_t lane) {
        if (!certify_lane(cell, output, lane, options_.gap, certificates[number]))
          certificates[number] = detail::subdivide(cell, options_, known_coefficients(cell, output, lane), stop);
      });
}

std::vector<char> Certifier::sound_with_straight_sides(std::span<const double> coordinates, const Team& team) const {
  std::vector<char> sound(cells_.size(), 0);
  team.for_ranges(cells_.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    visit_on_one_thread(
        coordinates, std::span(all_).subspan(begin, end - begin), Form::StraightSided, team.stop(),
        [&](std::size_t number, const CellToCertify& cell, const detail::KernelOutput& output, std::size_t lane) {
          const bool clear = output.least[lane] - output.error[lane] > 0;
          sound[number] =
              clear || detail::subdivide(cell, {}, known_coefficients(cell, output, lane), team.stop()).is_valid();
        });
  });
  return sound;
}

void Certifier::certify(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                        std::span<Certificate> certificates, const Team& team, const Ranks& ranks) const {
  if (ranks.count() == 1 || cells.size() < kFewestToShare) return certify_here(coordinates, cells, certificates, team);
  team.look_together();
  const auto [begin, end] = share_of(cells.size(), ranks);
  const std::span<const std::int32_t> mine = cells.subspan(begin, end - begin);
  certify_here(coordinates, mine, certificates, team);
  std::vector<Certificate> found;
  for (const std::int32_t cell : mine) found.push_back(certificates[at(cell)]);
  found = ranks.gather_everywhere(found);
  for (std::size_t i = 0; i < cells.size(); ++i) certificates[at(cells[i])] = found[i];
}

void Certifier::certify_here(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                             std::span<Certificate> certificates, const Team& team) const {
  assert(certificates.size() == cells_.size());
  std::vector<std::int32_t> left;
  if (elsewhere_ != nullptr && cells.size() >= cells_.size() / kShareElsewhere) {
    left = certify_elsewhere(coordinates, cells, certificates, team);
    cells = left;
  }
  team.for_ranges(cells.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    certify_on_one_thread(coordinates, cells.subspan(begin, end - begin), certificates, team.stop());
  });
}

/// Measures the cells elsewhere and certifies those for which that is enough. Returns the others.
std::vector<std::int32_t> Certifier::certify_elsewhere(std::span<const double> coordinates,
                                                       std::span<const std::int32_t> cells,
                                                       std::span<Certificate> certificates, const Team& team) const {
  const struct Forgets {
    detail::MeasuresElsewhere& elsewhere;
    ~Forgets() { elsewhere.forget(); }
  } forgets{*elsewhere_};
  bool is_well = elsewhere_->take(coordinates);
  std::vector<std::int32_t> left;
  std::vector<double> measures;
  std::vector<const std::int32_t*> nodes;
  std::vector<char> is_certified;
  for (std::size_t first = 0, last = 0; first < cells.size(); first = last) {
    team.look();
    const ElementBlock& block = *cells_[at(cells[first])].block;
    const auto is_alike = [&](const Cell& cell) {
      return cell.block->shape == block.shape && cell.block->order == block.order;
    };
    nodes.clear();
    for (; last < cells.size() && last - first < kCellsPerTask && is_alike(cells_[at(cells[last])]); ++last)
      nodes.push_back(cells_[at(cells[last])].nodes);
    const detail::JacobianTable& table = detail::jacobian_table(block.shape, block.order);
    is_certified.assign(nodes.size(), 0);
    is_well = is_well && elsewhere_->measure({&table, scale_, sign_, nodes}, measures);
    if (is_well)
      certify_measured({table, coordinates, nodes, scale_, sign_}, measures, options_.gap, cells.subspan(first),
                       certificates, is_certified, team);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      if (is_certified[i] == 0) left.push_back(cells[first + i]);
  }
  return left;
}

void Certifier::certify(std::span<const double> coordinates, std::span<Certificate> certificates, const Team& team,
                        const Ranks& ranks) const {
  certify(coordinates, all_, certificates, team, ranks);
}

CertificateSummary Certifier::sharpen(std::span<const double> coordinates, std::span<Certificate> certificates,
                                      double gap, const Team& team) const {
  CertificateOptions options = options_;
  options.gap = gap;
  const auto later = [&](std::int32_t a, std::int32_t b) {
    const double x = certificates[static_cast<std::size_t>(a)].scaled_jacobian_lower_bound;
    const double y = certificates[static_cast<std::size_t>(b)].scaled_jacobian_lower_bound;
    return x != y ? x > y : a > b;
  };
  const auto lowest_of = [&](std::size_t chunk) {
    const std::size_t begin = chunk * kCellsPerChunk, size = std::min(kCellsPerChunk, cells_.size() - begin);
    return std::ranges::max(std::span(all_).subspan(begin, size), later);
  };
  std::vector<std::int32_t> order(chunks_of(cells_.size(), kCellsPerChunk));  // the lowest cell of each chunk
  for_chunks(team, cells_.size(), kCellsPerChunk,
             [&](std::size_t chunk, std::size_t, std::size_t) { order[chunk] = lowest_of(chunk); });
  std::ranges::make_heap(order, later);
  std::vector<bool> sharp(cells_.size(), false);
  while (!order.empty() && !sharp[static_cast<std::size_t>(order.front())]) {
    std::ranges::pop_heap(order, later);
    const auto cell = static_cast<std::size_t>(order.back());
    const ElementBlock& block = *cells_[cell].block;
    const Certificate better = detail::subdivide(
        {&detail::jacobian_table(block.shape, block.order), coordinates.data(), cells_[cell].nodes, scale_, sign_},
        options, team.stop());
    // An answer that was given once is kept. The search for a sharper bound may spend its budget and end with another
    // answer.
    if (better.answer == certificates[cell].answer &&
        better.scaled_jacobian_lower_bound >= certificates[cell].scaled_jacobian_lower_bound)
      certificates[cell] = better;
    sharp[cell] = true;
    order.back() = lowest_of(cell / kCellsPerChunk);
    std::ranges::push_heap(order, later);
  }
  return summarise(certificates, team);
}

CertificateSummary summarise(std::span<const Certificate> certificates, const Team& team) {
  CertificateSummary summary;
  if (certificates.empty()) return summary;
  const auto answers = [&](Certificate::Answer answer) {
    return count_where(team, certificates.size(), kCellsPerTask,
                       [&](std::size_t cell) { return certificates[cell].answer == answer; });
  };
  summary.valid = answers(Certificate::Answer::Valid);
  summary.invalid = answers(Certificate::Answer::Invalid);
  summary.undecided = static_cast<std::int64_t>(certificates.size()) - summary.valid - summary.invalid;
  summary.min_scaled_jacobian_lower_bound = -Reduction(team).largest(
      certificates.size(), kCellsPerTask,
      [&](std::size_t cell) { return -certificates[cell].scaled_jacobian_lower_bound; },
      -std::numeric_limits<double>::max());
  return summary;
}

std::vector<Certificate> certify(const HighOrderMesh& mesh, const CertificateOptions& options, int threads) {
  const Team team(threads);
  std::vector<Certificate> certificates;
  team.run([&] {
    const detail::OrientedMesh oriented(mesh, team);
    const Certifier certifier(oriented.mesh(), options, team);
    certificates.resize(certifier.cells());
    certifier.certify(mesh.coordinates, certificates, team);
  });
  return certificates;
}

}  // namespace varimesh
