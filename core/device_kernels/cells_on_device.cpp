#include "core/device_kernels/cells_on_device.h"

#include <algorithm>
#include <string>

#include "core/device_kernels/cell_modules.h"
#include "core/device_kernels/splits.h"
#include "core/kernels/hessian/batches.h"

namespace varimesh::device {
namespace {

constexpr int kBlock = 128;

std::int32_t batches_of(const CellSet& set) { return (set.count + kBatch - 1) / kBatch; }

/// A table of derivatives as CellArguments and ProductArguments describe it. `slots`: the quadrature point of each
/// slot.
///
/// @param repeats  whether the padding repeats the last point, and the mean is appended; else the padding is 0
template <class T>
std::vector<T> table_of(const CellSet& set, const std::vector<int>& slots, int parts, bool repeats) {
  const int per_part = (set.nodes_per_cell + parts - 1) / parts;
  const int padded = padded_points(set.points, parts);
  std::vector<T> table;
  for (int row = 0; row < padded + (repeats ? 1 : 0); ++row)
    for (int part = 0; part < parts; ++part)
      for (int k = 0; k < set.dimension; ++k)
        for (int n = part * per_part; n < (part + 1) * per_part; ++n) {
          double number = 0;
          if (n < set.nodes_per_cell) {
            const double* derivatives = set.derivatives_of(n) + k * set.stride;
            if (row < set.points || (row < padded && repeats))
              number = derivatives[slots[static_cast<std::size_t>(std::min(row, set.points - 1))]];
            else if (row == padded)
              for (int q = 0; q < set.points; ++q) number += derivatives[q] / set.points;
          }
          table.push_back(static_cast<T>(number));
        }
  return table;
}

/// Rearranges `size` numbers per cell to batch × number × lane. Lanes past the last cell repeat it.
template <class T, class Numbers>
std::vector<T> in_batches(const CellSet& set, int size, const Numbers& number) {
  std::vector<T> out;
  out.reserve(static_cast<std::size_t>(batches_of(set)) * static_cast<std::size_t>(size) * kBatch);
  for (std::int32_t b = 0; b < batches_of(set); ++b)
    for (int i = 0; i < size; ++i)
      for (int lane = 0; lane < kBatch; ++lane)
        out.push_back(static_cast<T>(number(std::min(b * kBatch + lane, set.count - 1), i)));
  return out;
}

}  // namespace

Possible<std::unique_ptr<CellsOnDevice>> CellsOnDevice::make(Device& device, const Problem& problem,
                                                             const Material& material) {
  const auto image = problem.sets.size() == 1 && problem.sets[0].affine
                         ? cell_kernels(problem.sets[0].shape, problem.sets[0].order, material)
                         : std::nullopt;
  if (!image)
    return fault(Fault::Kind::NoKernels,
                 "There are kernels only for meshes of tetrahedra of orders 2 to 5 whose target is constant in each "
                 "element.");
  std::unique_ptr<CellsOnDevice> cells(new CellsOnDevice(device, problem, material));
  Possible<void> done = cells->load(*image);
  for (const auto step : {&CellsOnDevice::copy_tables, &CellsOnDevice::copy_cells, &CellsOnDevice::copy_nodes,
                          &CellsOnDevice::make_results, &CellsOnDevice::place, &CellsOnDevice::weigh})
    if (done) done = (*cells.*step)();
  if (!done) return tl::unexpected(done.error());
  return cells;
}

Possible<void> CellsOnDevice::load(const KernelImage& image) {
  auto module = device_.load(image);
  if (!module) return tl::unexpected(module.error());
  module_ = std::move(*module);
  const std::pair<const char*, Kernel*> kernels[] = {{"energy", &energy_},
                                                     {"gradient", &gradient_},
                                                     {"linearise", &linearise_},
                                                     {"product", &product_},
                                                     {"add_up_products", &add_up_products_},
                                                     {"add_up_gradients", &add_up_gradients_}};
  for (const auto& [name, kernel] : kernels) {
    auto found = module_->kernel(name);
    if (!found) return tl::unexpected(found.error());
    *kernel = std::move(*found);
  }
  entries_ = make_hessian_kernels(material_, set_.dimension)->entries();
  return {};
}

template <class T>
Possible<void> CellsOnDevice::keep(Buffer& buffer, const std::vector<T>& numbers) {
  if (buffer.bytes() == numbers.size() * sizeof(T) && !numbers.empty())
    return buffer.upload(std::span<const T>(numbers));
  auto made = device_.allocate_with(std::span<const T>(numbers));
  if (!made) return tl::unexpected(made.error());
  buffer = std::move(*made);
  return {};
}

Possible<void> CellsOnDevice::copy_tables() {
  const std::vector<int> slots = fold_gradient(set_).points;
  const auto parts = [&](CellKernel kernel) { return parts_of(kernel, set_.nodes_per_cell); };
  std::vector<double> weights;
  for (const int point : slots) weights.push_back(set_.weights[static_cast<std::size_t>(point)]);
  weights.resize(weights.size() + 4);  // as many as a turn may add
  Possible<void> done = keep(weights_, weights);
  if (done) done = keep(energy_table_, table_of<double>(set_, slots, parts(CellKernel::Energy), true));
  if (done) done = keep(gradient_table_, table_of<double>(set_, slots, parts(CellKernel::Gradient), true));
  if (done) done = keep(product_table_, table_of<float>(set_, slots, parts(CellKernel::Product), false));
  return done;
}

Possible<void> CellsOnDevice::copy_cells() {
  const int size = set_.dimension * set_.dimension;
  std::vector<std::int32_t> rank_of(problem_.positions.size() / static_cast<std::size_t>(problem_.dimension),
                                    static_cast<std::int32_t>(problem_.free.size()));
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
    rank_of[static_cast<std::size_t>(problem_.free[rank])] = static_cast<std::int32_t>(rank);
  const auto node = [&](std::int32_t cell, int n) {
    return set_.nodes[static_cast<std::size_t>(cell) * static_cast<std::size_t>(set_.nodes_per_cell) +
                      static_cast<std::size_t>(n)];
  };
  Possible<void> done = keep(nodes_, in_batches<std::int32_t>(set_, set_.nodes_per_cell, node));
  if (done)
    done = keep(ranks_, in_batches<std::int32_t>(set_, set_.nodes_per_cell, [&](std::int32_t cell, int n) {
                  return rank_of[static_cast<std::size_t>(node(cell, n))];
                }));
  if (done)
    done =
        keep(inverse_target_,
             in_batches<double>(set_, size, [&](std::int32_t cell, int i) { return set_.inverse_target_of(cell)[i]; }));
  if (done)
    done = keep(measure_, in_batches<double>(set_, 1, [&](std::int32_t cell, int) { return *set_.measure_of(cell); }));
  if (done && !set_.left_factor.empty())
    done = keep(left_factor_,
                in_batches<double>(set_, size, [&](std::int32_t cell, int i) { return set_.left_factor_of(cell)[i]; }));
  return done;
}

Possible<void> CellsOnDevice::copy_nodes() {
  std::vector<std::int64_t> places;
  for (const Incidence& incidence : problem_.incidences)
    places.push_back(static_cast<std::int64_t>(
        contribution_index(incidence.cell, incidence.local, static_cast<std::uint32_t>(set_.nodes_per_cell), 1)));
  Possible<void> done = keep(offsets_, problem_.offsets);
  if (done) done = keep(places_, places);
  return done;
}

Possible<void> CellsOnDevice::make_results() {
  const std::size_t d = static_cast<std::size_t>(set_.dimension), points = static_cast<std::size_t>(set_.points);
  const std::size_t lanes = static_cast<std::size_t>(batches_of(set_)) * kBatch, free = problem_.free.size();
  const std::pair<Buffer*, std::size_t> sizes[] = {
      {&scans_, lanes * 3 * sizeof(double)},
      {&contributions_, lanes * static_cast<std::size_t>(set_.nodes_per_cell) * 2 * d * sizeof(float)},
      {&linearisation_, lanes * points * static_cast<std::size_t>(entries_) * sizeof(float)},
      {&deformation_, lanes * points * d * d * sizeof(std::int16_t)},
      {&mean_, lanes * (d * d + 1) * sizeof(float)},
      {&direction_, (free + 1) * d * sizeof(float)},
      {&product_vector_, free * d * sizeof(float)},
      {&gradient_vector_, free * d * sizeof(double)},
      {&along_, (free + kBlock - 1) / kBlock * sizeof(double)}};
  for (const auto& [buffer, bytes] : sizes) {
    auto made = device_.allocate(bytes);
    if (!made) return tl::unexpected(made.error());
    *buffer = std::move(*made);
  }
  return {};
}

Possible<void> CellsOnDevice::place() { return keep(positions_, problem_.positions); }

Possible<void> CellsOnDevice::weigh() {
  Possible<void> done = keep(delta_squared_, in_batches<double>(set_, 1, [&](std::int32_t cell, int) {
                               return set_.delta_squared[static_cast<std::size_t>(cell)];
                             }));
  if (!done) return done;
  std::vector<double> slopes = in_batches<double>(set_, 1, [&](std::int32_t cell, int) {
    return set_.energy_slope.empty() ? 1.0 : set_.energy_slope[static_cast<std::size_t>(cell)];
  });
  std::fill(slopes.begin() + set_.count, slopes.end(), 0.0);
  return keep(slope_, slopes);
}

CellArguments CellsOnDevice::cell_arguments(const Buffer& derivatives) const {
  CellArguments a;
  a.material = material_;
  a.batches = batches_of(set_);
  a.points = set_.points;
  a.derivatives = derivatives.as<const double>();
  a.weights = weights_.as<const double>();
  a.nodes = nodes_.as<const std::int32_t>();
  a.inverse_target = inverse_target_.as<const double>();
  a.left_factor = left_factor_.as<const double>();
  a.measure = measure_.as<const double>();
  a.delta_squared = delta_squared_.as<const double>();
  a.slope = slope_.as<const double>();
  a.positions = positions_.as<const double>();
  a.scans = scans_.as<double>();
  a.contributions = contributions_.as<float>();
  a.linearisation = linearisation_.as<float>();
  a.deformation = deformation_.as<std::int16_t>();
  a.mean = mean_.as<float>();
  return a;
}

Possible<std::vector<CellScan>> CellsOnDevice::scan() {
  CellArguments arguments = cell_arguments(energy_table_);
  const std::int64_t lanes = std::int64_t{batches_of(set_)} * kBatch;
  const Launch launch{lanes * parts_of(CellKernel::Energy, set_.nodes_per_cell), kBlock,
                      static_cast<int>(energy_table_.bytes())};
  Possible<void> done = device_.launch(energy_, launch, &arguments);
  std::vector<double> numbers(static_cast<std::size_t>(lanes) * 3);
  if (done) done = scans_.download(std::span<double>(numbers));
  if (!done) return tl::unexpected(done.error());
  std::vector<CellScan> scans(static_cast<std::size_t>(set_.count));
  for (std::size_t cell = 0; cell < scans.size(); ++cell) {
    const double* from = numbers.data() + cell / kBatch * 3 * kBatch + cell % kBatch;
    scans[cell] = {from[0], from[kBatch], from[2 * kBatch]};
  }
  return scans;
}

Possible<void> CellsOnDevice::gradient(std::span<double> gradient) { return run_gradient(gradient_, gradient); }
Possible<void> CellsOnDevice::linearise(std::span<double> gradient) { return run_gradient(linearise_, gradient); }

Possible<void> CellsOnDevice::run_gradient(const Kernel& kernel, std::span<double> gradient) {
  CellArguments arguments = cell_arguments(gradient_table_);
  const std::int64_t threads =
      std::int64_t{batches_of(set_)} * kBatch * parts_of(CellKernel::Gradient, set_.nodes_per_cell);
  Possible<void> done =
      device_.launch(kernel, {threads, kBlock, static_cast<int>(gradient_table_.bytes())}, &arguments);
  SumArguments sums;
  sums.nodes = static_cast<std::int32_t>(problem_.free.size());
  sums.offsets = offsets_.as<const std::int64_t>();
  sums.places = places_.as<const std::int64_t>();
  sums.contributions = contributions_.as<const float>();
  sums.gradient = gradient_vector_.as<double>();
  if (done) done = device_.launch(add_up_gradients_, {sums.nodes, kBlock, 0}, &sums);
  if (done && !gradient.empty()) done = gradient_vector_.download(gradient);
  return done;
}

Possible<double> CellsOnDevice::multiply(std::span<const float> direction, std::span<float> product) {
  if (direction.empty()) return 0.0;
  std::vector<float> padded(direction.begin(), direction.end());
  padded.resize(direction.size() + static_cast<std::size_t>(set_.dimension));  // zeros for the fixed nodes
  Possible<void> done = direction_.upload(std::span<const float>(padded));
  ProductArguments arguments;
  arguments.material = material_;
  arguments.batches = batches_of(set_);
  arguments.points = set_.points;
  arguments.derivatives = product_table_.as<const float>();
  arguments.inverse_target = inverse_target_.as<const double>();
  arguments.left_factor = left_factor_.as<const double>();
  arguments.linearisation = linearisation_.as<const float>();
  arguments.deformation = deformation_.as<const std::int16_t>();
  arguments.mean = mean_.as<const float>();
  arguments.ranks = ranks_.as<const std::int32_t>();
  arguments.direction = direction_.as<const float>();
  arguments.contributions = contributions_.as<float>();
  const std::int64_t threads =
      std::int64_t{batches_of(set_)} * kBatch * parts_of(CellKernel::Product, set_.nodes_per_cell);
  if (done) done = device_.launch(product_, {threads, kBlock, static_cast<int>(product_table_.bytes())}, &arguments);
  SumArguments sums;
  sums.nodes = static_cast<std::int32_t>(problem_.free.size());
  sums.offsets = offsets_.as<const std::int64_t>();
  sums.places = places_.as<const std::int64_t>();
  sums.contributions = contributions_.as<const float>();
  sums.direction = direction_.as<const float>();
  sums.product = product_vector_.as<float>();
  sums.along = along_.as<double>();
  const Launch launch{sums.nodes, kBlock, kBlock * static_cast<int>(sizeof(double))};
  if (done) done = device_.launch(add_up_products_, launch, &sums);
  std::vector<double> along(static_cast<std::size_t>(launch.blocks()));
  if (done) done = product_vector_.download(product);
  if (done) done = along_.download(std::span<double>(along));
  if (!done) return tl::unexpected(done.error());
  double sum = 0;
  for (const double part : along) sum += part;
  return sum;
}

std::size_t CellsOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Buffer* buffer : {&energy_table_,   &gradient_table_,  &product_table_, &weights_, &nodes_,
                               &ranks_,          &inverse_target_,  &left_factor_,   &measure_, &delta_squared_,
                               &slope_,          &positions_,       &offsets_,       &places_,  &direction_,
                               &product_vector_, &gradient_vector_, &along_,         &scans_,   &contributions_,
                               &linearisation_,  &deformation_,     &mean_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh::device
