#include "core/preconditioner/on_device/preconditioner_on_device.h"

#include "core/base/index.h"

namespace varimesh {

PreconditionerOnDevice::PreconditionerOnDevice(device::Queue& queue, const device::Module* solver,
                                               device::CellsOnDevice& cells, const Problem& problem,
                                               std::vector<BatchSet>& batches, device::Joiner& joiner, const Team& team)
    : queue_(queue),
      cells_(cells),
      problem_(problem),
      joiner_(joiner),
      level_(problem, batches, team),
      stretched_(problem, batches, StretchedCells::most_cells(problem), team),
      coarse_(queue, solver, level_, cells),
      groups_(queue, solver, problem.dimension),
      invert_block_(queue.kernel(solver, "invert_block")),
      share_residual_(queue.kernel(solver, "share_residual")),
      precondition_(queue.kernel(solver, "precondition")) {
  std::vector<Incidence> first_cell;
  for (std::size_t rank = 0; rank < problem.free.size(); ++rank)
    first_cell.push_back(problem.incidences[at(problem.offsets[rank])]);
  queue.fill(first_cell_, first_cell);
  const std::size_t nodes = problem.free.size(), d = at(problem.dimension);
  inverse_ = queue.room(nodes * at(triangle_size(problem.dimension)) * sizeof(float));
  queue.fill(shared_, std::vector<float>((nodes + 1) * d));
}

void PreconditionerOnDevice::make_blocks() {
  queue_.note(cells_.run_node_blocks());
  const device::SumArguments sums = cells_.sum_arguments();
  queue_.launch(
      invert_block_, sums.nodes,
      device::BlockArguments{sums.nodes, sums.offsets, sums.places, sums.contributions, inverse_.as<float>()});
}

void PreconditionerOnDevice::assemble() {
  coarse_.assemble();
  copy_groups();
}

void PreconditionerOnDevice::copy_groups() {
  if (!queue_.is_well()) return;
  stretched_.assemble(level_.tensors());
  groups_.copy(stretched_);
}

double PreconditionerOnDevice::apply(const float* residual, float* product) {
  device::NodeArguments a;
  a.nodes = static_cast<std::int32_t>(problem_.free.size());
  a.offsets = cells_.sum_arguments().offsets;
  a.first_cell = first_cell_.as<const device::CellOfNode>();
  a.sets = coarse_.sets();
  a.coarse = coarse_.solution();
  a.inverse = inverse_.as<const float>();
  a.residual = residual;
  a.product = product;
  a.shared = shared_.as<float>();
  queue_.launch(share_residual_, a.nodes, a);
  coarse_.solve(shared_.as<const float>());
  a.parts = joiner_.parts(a.nodes);
  queue_.launch(precondition_, a.nodes, a, device::kJoinBytes);
  const double along = joiner_.sum(a.nodes);
  return along + groups_.add(residual, product, joiner_);
}

std::size_t PreconditionerOnDevice::memory() const {
  return coarse_.memory() + groups_.memory() + first_cell_.bytes() + inverse_.bytes() + shared_.bytes();
}

}  // namespace varimesh
