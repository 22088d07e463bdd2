#include "core/solvers/descent/on_device/form_on_device.h"

#include <array>

#include "core/base/index.h"
#include "core/kernels/hessian/batch.h"

namespace varimesh {
namespace {

/// The inverse of a numbering: by place, what is there; −1: nothing.
std::vector<std::int32_t> at_places(const std::vector<std::size_t>& places, std::int32_t count) {
  std::vector<std::int32_t> there(at(count), -1);
  for (std::size_t i = 0; i < places.size(); ++i) there[places[i]] = static_cast<std::int32_t>(i);
  return there;
}

/// By column of an entry of PartProducts: its place.
std::vector<std::int32_t> as_places(const std::vector<std::size_t>& columns, const std::vector<std::size_t>& places) {
  std::vector<std::int32_t> result;
  result.reserve(columns.size());
  for (const std::size_t column : columns)
    result.push_back(static_cast<std::int32_t>(places.empty() ? column : places[column]));
  return result;
}

}  // namespace

FormOnDevice::FormOnDevice(device::Queue& queue, const device::Module* descent, device::CellsOnDevice& cells,
                           const Problem& problem, const ModalForm& form, const SpaceOnDevice& space,
                           CellValues& values, device::Joiner& joiner)
    : queue_(queue),
      cells_(cells),
      problem_(problem),
      form_(form),
      space_(space),
      values_(values),
      joiner_(joiner),
      gather_values_(queue.kernel(descent, "gather_values")),
      gather_shape_(queue.kernel(descent, "gather_shape")),
      slopes_(queue.kernel(descent, "slopes")),
      slopes_and_value_(queue.kernel(descent, "slopes_and_value")),
      sets_(problem.sets.size()) {
  for (std::size_t number = 0; number < sets_.size(); ++number) copy_set(number);
}

void FormOnDevice::copy_set(std::size_t number) {
  Set& set = sets_[number];
  const detail::PartProducts& products = form_.products(number);
  set.to_modes = copy_matrix(queue_, products.to_modes.there);
  set.to_nodes = copy_matrix(queue_, products.to_modes.back);
  const std::vector<std::size_t>& modes = products.to_modes.there.row_places;
  const std::vector<std::size_t>& nodes = products.to_modes.there.column_places;
  set.places = static_cast<std::int32_t>(products.modes);
  if (!modes.empty()) {
    set.places = space_.sets[number].places;  // a mode for each node of a line, along each axis
    queue_.fill(set.modes, at_places(modes, set.places));
    queue_.fill(set.locals, at_places(nodes, set.places));
  }
  queue_.fill(set.first, std::vector<std::int32_t>(products.first.begin(), products.first.end()));
  queue_.fill(set.columns, as_places(products.columns, modes));
  queue_.fill(set.entries, products.entries);
  std::vector<double> weights;
  for (const int degree : products.degrees) weights.push_back(form_.weight(degree));
  queue_.fill(set.weights, weights);
}

void FormOnDevice::take_frames() {
  const std::size_t pairs = at(triangle_size(problem_.dimension));
  for (std::size_t number = 0; number < sets_.size(); ++number) {
    const CellSet& cells = problem_.sets[number];
    std::vector<double> metrics(at(space_.sets[number].batches) * pairs * at(kBatch));
    for (std::int32_t cell = 0; cell < cells.count; ++cell) {
      double* to = metrics.data() + at(cell / kBatch) * pairs * at(kBatch) + at(cell % kBatch);
      const std::array<double, 6>& metric = form_.metrics()[at(cells.first) + at(cell)];
      for (std::size_t pair = 0; pair < pairs; ++pair) to[pair * at(kBatch)] = metric[pair];
    }
    queue_.fill(sets_[number].metrics, metrics);
  }
}

double* FormOnDevice::contributions_of(std::size_t number) const {
  return cells_.contributions().as<double>() + space_.sets[number].first * problem_.dimension;
}

double FormOnDevice::differentiate(std::size_t number, bool wants_value) {
  const Set& set = sets_[number];
  const std::int32_t batches = space_.sets[number].batches;
  values_.multiply(set.to_modes, batches);
  device::SlopesArguments a;
  a.batches = batches;
  a.places = set.places;
  a.modes = set.modes.as<const std::int32_t>();
  a.first = set.first.as<const std::int32_t>();
  a.columns = set.columns.as<const std::int32_t>();
  a.entries = set.entries.as<const double>();
  a.weights = set.weights.as<const double>();
  a.metrics = set.metrics.as<const double>();
  a.factor = 2.0 / problem_.cells;
  a.from = values_.now();
  a.to = values_.next();
  const std::int64_t threads = std::int64_t{kBatch} * batches * set.places;
  double value = 0;
  if (wants_value) {
    a.parts = joiner_.parts(threads);
    queue_.launch(slopes_and_value_, threads, a, device::kJoinBytes);
    value = joiner_.sum(threads);
  } else {
    queue_.launch(slopes_, threads, a);
  }
  values_.swap();
  values_.multiply_into(set.to_nodes, batches, contributions_of(number));
  return value;
}

double FormOnDevice::gradient() {
  double value = 0;
  for (std::size_t number = 0; number < sets_.size(); ++number) {
    const SpaceOnDevice::Set& space = space_.sets[number];
    device::ShapeArguments a;
    a.batches = space.batches;
    a.places = space.places;
    a.locals = sets_[number].locals.as<const std::int32_t>();
    a.cell_nodes = cells_.sets()[number]->nodes().as<const std::int32_t>();
    a.positions = cells_.positions_there().as<const double>();
    a.to = values_.now();
    queue_.launch(gather_shape_, std::int64_t{kBatch} * a.batches * a.places, a);
    value += differentiate(number, true);
  }
  return value / problem_.cells;
}

void FormOnDevice::multiply(const double* direction) {
  for (std::size_t number = 0; number < sets_.size(); ++number) {
    const SpaceOnDevice::Set& space = space_.sets[number];
    device::GatherArguments a;
    a.batches = space.batches;
    a.places = space.places;
    a.numbers = space.numbers.as<const std::int32_t>();
    a.vector = direction;
    a.to = values_.now();
    queue_.launch(gather_values_, std::int64_t{kBatch} * a.batches * a.places, a);
    differentiate(number, false);
  }
}

std::size_t FormOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Set& set : sets_)
    for (const device::Buffer* buffer : {&set.to_modes.numbers, &set.to_nodes.numbers, &set.locals, &set.modes,
                                         &set.first, &set.columns, &set.entries, &set.weights, &set.metrics})
      bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh
