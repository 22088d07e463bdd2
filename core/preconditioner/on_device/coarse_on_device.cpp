#include "core/preconditioner/on_device/coarse_on_device.h"

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/kernels/hessian/batches.h"

namespace varimesh {

static_assert(sizeof(device::CellOfNode) == sizeof(Incidence) && sizeof(Incidence) == 8,
              "incidences are copied as they are");

CoarseOnDevice::CoarseOnDevice(device::Queue& queue, const device::Module* solver, CoarseLevel& level,
                               device::CellsOnDevice& cells)
    : queue_(queue),
      level_(level),
      cells_on_device_(cells),
      dimension_(cells.sets().front()->cells().dimension),
      multigrid_(queue, solver, dimension_),
      factorise_(queue.kernel(solver, "factorise_diagonal")),
      assemble_(queue.kernel(solver, "assemble_block")),
      restrict_(queue.kernel(solver, "restrict_cell")),
      add_up_(queue.kernel(solver, "add_up_coarse")),
      relax_first_(queue.kernel(solver, "relax_first")),
      relax_last_(queue.kernel(solver, "relax_last")),
      residual_kernel_(queue.kernel(solver, "coarse_residual")),
      to_vertex_(queue.kernel(solver, "restrict_to_vertex")),
      from_vertices_(queue.kernel(solver, "correct_from_vertices")),
      unscale_(queue.kernel(solver, "unscale")) {
  if (!is_used()) return;
  copy_sets();
  copy_pattern();
  copy_transfers();
}

void CoarseOnDevice::copy_sets() {
  std::int64_t first = 0;
  for (std::size_t s = 0; s < level_.space().sets.size(); ++s) {
    const CoarseSpace::Set& from = level_.space().sets[s];
    Set& to = of_set_.emplace_back();
    queue_.fill(to.nodes, from.nodes);
    queue_.fill(to.stiffness, from.stiffness);
    queue_.fill(to.value_begin, from.values.begin);
    queue_.fill(to.value_column, from.values.column);
    queue_.fill(to.value_factor, from.values.factor);
    const SparseRows& rows = level_.to_coarse()[s];
    queue_.fill(to.begin, rows.begin);
    queue_.fill(to.column, rows.column);
    queue_.fill(to.factor, rows.factor);
    to.first = first;
    first += std::int64_t{kBatch} * cells_on_device_.sets()[s]->batches() * from.nodes_per_cell;
  }
  point_to_tensors();
}

void CoarseOnDevice::point_to_tensors() {
  std::vector<device::CoarseSet> sets;
  for (std::size_t s = 0; s < of_set_.size(); ++s) {
    const Set& set = of_set_[s];
    const device::Buffer& tensors = tensors_.empty() ? cells_on_device_.sets()[s]->tensors() : tensors_[s];
    sets.push_back({level_.space().sets[s].nodes_per_cell, set.nodes.as<const std::int32_t>(),
                    set.stiffness.as<const float>(), set.value_begin.as<const std::int64_t>(),
                    set.value_column.as<const std::int32_t>(), set.value_factor.as<const float>(),
                    tensors.as<const float>()});
  }
  queue_.fill(sets_, sets);
}

void CoarseOnDevice::copy_pattern() {
  const NodeCells& cells = level_.cells();
  std::vector<std::int64_t> places;
  places.reserve(cells.incidences.size());
  for (const Incidence& in : cells.incidences) {
    const auto nodes = static_cast<std::uint32_t>(level_.space().sets[at(in.set)].nodes_per_cell);
    places.push_back(of_set_[at(in.set)].first +
                     static_cast<std::int64_t>(contribution_index(in.cell, in.local, nodes, 1)));
  }
  queue_.fill(cell_begin_, cells.begin);
  queue_.fill(cells_, cells.incidences);
  queue_.fill(places_, places);
  const NodePattern& pattern = level_.pattern();
  std::vector<std::int32_t> row(pattern.column.size());
  for (std::size_t i = 0; i + 1 < pattern.begin.size(); ++i)
    std::fill(row.begin() + pattern.begin[i], row.begin() + pattern.begin[i + 1], static_cast<std::int32_t>(i));
  queue_.fill(begin_, pattern.begin);
  queue_.fill(column_, pattern.column);
  queue_.fill(row_, row);
  const std::size_t square = at(dimension_) * at(dimension_), nodes = at(level_.space().count);
  entry_ = queue_.room(row.size() * square * sizeof(std::int16_t));
  inverse_factor_ = queue_.room(nodes * square * sizeof(float));
  // In space the fourth number of a node is not written, and must be a number.
  const std::vector<float> zeros(nodes * at(padded(dimension_)));
  for (device::Buffer* vector : {&right_, &x_, &residual_}) queue_.fill(*vector, zeros);
}

void CoarseOnDevice::copy_transfers() {
  if (!level_.linear().is_used()) return;
  const SparseRows &above = level_.linear().to_above(), &below = level_.linear().from_above();
  queue_.fill(above_begin_, above.begin);
  queue_.fill(above_column_, above.column);
  queue_.fill(above_factor_, above.factor);
  queue_.fill(below_begin_, below.begin);
  queue_.fill(below_column_, below.column);
  queue_.fill(below_factor_, below.factor);
}

device::CoarseArguments CoarseOnDevice::arguments() const {
  device::CoarseArguments a;
  a.nodes = a.last = level_.space().count;
  a.blocks = static_cast<std::int64_t>(level_.pattern().column.size());
  a.sets = sets();
  a.cell_begin = cell_begin_.as<const std::int64_t>();
  a.cells = cells_.as<const device::CellOfNode>();
  a.begin = begin_.as<const std::int64_t>();
  a.column = column_.as<const std::int32_t>();
  a.row = row_.as<const std::int32_t>();
  a.entry = entry_.as<std::int16_t>();
  a.inverse_factor = inverse_factor_.as<float>();
  a.places = places_.as<const std::int64_t>();
  a.contributions = cells_on_device_.contributions().as<const float>();
  a.right = right_.as<float>();
  a.x = x_.as<float>();
  a.residual = residual_.as<float>();
  if (!level_.linear().is_used()) return a;
  a.vertices = level_.linear().vertices();
  a.above_begin = above_begin_.as<const std::int64_t>();
  a.above_column = above_column_.as<const std::int32_t>();
  a.above_factor = above_factor_.as<const float>();
  a.below_begin = below_begin_.as<const std::int64_t>();
  a.below_column = below_column_.as<const std::int32_t>();
  a.below_factor = below_factor_.as<const float>();
  return a;
}

void CoarseOnDevice::assemble() {
  if (!is_used()) return;
  queue_.note(cells_on_device_.run_mean_tensors());
  tensors_.clear();
  for (std::size_t s = 0; s < of_set_.size(); ++s)
    queue_.download(cells_on_device_.sets()[s]->tensors(), std::span<float>(level_.tensors_to_fill()[s]));
  make_matrix();
}

void CoarseOnDevice::assemble_from_level() {
  if (!is_used()) return;
  tensors_.resize(of_set_.size());
  for (std::size_t s = 0; s < of_set_.size(); ++s) queue_.fill(tensors_[s], level_.tensors()[s]);
  make_matrix();
}

void CoarseOnDevice::make_matrix() {
  point_to_tensors();
  const device::CoarseArguments a = arguments();
  queue_.launch(factorise_, a.nodes, a);
  queue_.launch(assemble_, a.blocks, a);
  if (!queue_.is_well() || !level_.linear().is_used()) return;
  level_.assemble_below();
  multigrid_.copy(level_.linear().multigrid());
}

void CoarseOnDevice::run_colour(const device::Kernel& kernel, std::size_t colour) {
  device::CoarseArguments a = arguments();
  a.first = level_.colours()[colour];
  a.last = level_.colours()[colour + 1];
  queue_.launch(kernel, std::int64_t{device::kRowParts} * (a.last - a.first), a);
}

void CoarseOnDevice::solve(const float* shared) {
  if (!is_used() || !queue_.is_well()) return;
  for (std::size_t s = 0; s < of_set_.size(); ++s) {
    const device::SetOnDevice& cells = *cells_on_device_.sets()[s];
    device::RestrictArguments a;
    a.batches = cells.batches();
    a.nodes = cells.cells().nodes_per_cell;
    a.coarse = level_.space().sets[s].nodes_per_cell;
    a.begin = of_set_[s].begin.as<const std::int64_t>();
    a.column = of_set_[s].column.as<const std::int32_t>();
    a.factor = of_set_[s].factor.as<const float>();
    a.ranks = cells.ranks().as<const std::int32_t>();
    a.values = shared;
    a.contributions = cells_on_device_.contributions().as<float>() + of_set_[s].first * dimension_;
    queue_.launch(restrict_, std::int64_t{kBatch} * a.batches * a.coarse, a);
  }
  device::CoarseArguments a = arguments();
  queue_.launch(add_up_, a.nodes, a);
  const std::size_t colours = level_.colours().size() - 1;
  for (std::size_t colour = 0; colour < colours; ++colour) run_colour(relax_first_, colour);
  if (level_.linear().is_used()) {
    a.linear_right = multigrid_.right();
    a.linear_solution = multigrid_.solution();
    queue_.launch(residual_kernel_, std::int64_t{device::kRowParts} * a.nodes, a);
    queue_.launch(to_vertex_, a.vertices, a);
    multigrid_.apply();
    queue_.launch(from_vertices_, a.nodes, a);
  }
  for (std::size_t colour = colours; colour-- > 0;) run_colour(relax_last_, colour);
  queue_.launch(unscale_, a.nodes, a);
}

std::size_t CoarseOnDevice::memory() const {
  std::size_t bytes = multigrid_.memory();
  for (const Set& set : of_set_)
    for (const device::Buffer* buffer : {&set.nodes, &set.stiffness, &set.value_begin, &set.value_column,
                                         &set.value_factor, &set.begin, &set.column, &set.factor})
      bytes += buffer->bytes();
  for (const device::Buffer* buffer :
       {&sets_, &cell_begin_, &cells_, &places_, &begin_, &column_, &row_, &entry_, &inverse_factor_, &right_, &x_,
        &residual_, &above_begin_, &above_column_, &above_factor_, &below_begin_, &below_column_, &below_factor_})
    bytes += buffer->bytes();
  for (const device::Buffer& tensors : tensors_) bytes += tensors.bytes();
  return bytes;
}

}  // namespace varimesh
