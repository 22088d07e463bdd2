#include "core/device_kernels/cells_on_device.h"

#include <algorithm>

#include "core/device_kernels/cell_modules.h"
#include "core/device_kernels/general_cells.h"
#include "core/device_kernels/split_cells.h"
#include "core/kernels/hessian/batches.h"

namespace varimesh::device {

Possible<std::unique_ptr<CellsOnDevice>> CellsOnDevice::make(Device& device, const Problem& problem,
                                                             const Material& material) {
  std::unique_ptr<CellsOnDevice> cells(new CellsOnDevice(device, problem, material));
  Possible<void> done;
  for (const auto step :
       {&CellsOnDevice::copy_sets, &CellsOnDevice::load_sums, &CellsOnDevice::copy_nodes, &CellsOnDevice::place})
    if (done) done = (*cells.*step)();
  if (done) done = cells->weigh();
  if (!done) return tl::unexpected(done.error());
  return cells;
}

Possible<const Module*> CellsOnDevice::module_of(const KernelImage& image) {
  std::unique_ptr<Module>& kept = modules_[std::string(image.name)];
  if (kept == nullptr) {
    auto loaded = device_.load(image);
    if (!loaded) return tl::unexpected(loaded.error());
    kept = std::move(*loaded);
  }
  return kept.get();
}

Possible<void> CellsOnDevice::copy_sets() {
  rank_of_.assign(problem_.positions.size() / static_cast<std::size_t>(problem_.dimension),
                  static_cast<std::int32_t>(problem_.free.size()));
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
    rank_of_[static_cast<std::size_t>(problem_.free[rank])] = static_cast<std::int32_t>(rank);
  std::size_t first = 0;
  for (const CellSet& set : problem_.sets) {
    const SetPlace place{set, material_, first, rank_of_, fold_gradient(set).points};
    auto own = cell_kernels(set.shape, set.order, material_);
    // Simplices in registers have one target each.
    if (own && !own->kind.is_layered() && !set.affine) own.reset();
    auto tables = own ? split_tables(set, own->kind, place.slots) : std::nullopt;
    const KernelImage of_any_cell = general_kernels(set.dimension, material_);
    const auto module = module_of(tables ? own->image : of_any_cell);
    if (!module) return tl::unexpected(module.error());
    const auto general = module_of(of_any_cell);
    if (!general) return tl::unexpected(general.error());
    if (tables)
      sets_.push_back(std::make_unique<SplitCells>(device_, place, std::move(*tables)));
    else
      sets_.push_back(std::make_unique<GeneralCells>(device_, place));
    if (auto done = sets_.back()->copy(**module, **general); !done) return done;
    first += sets_.back()->contributions();
  }
  auto room = device_.allocate(first * 2 * static_cast<std::size_t>(problem_.dimension) * sizeof(float));
  if (!room) return tl::unexpected(room.error());
  contributions_ = std::move(*room);
  return {};
}

Possible<void> CellsOnDevice::load_sums() {
  if (modules_.empty()) return {};
  for (const auto& [name, kernel] : {std::pair<const char*, Kernel*>{"add_up_products", &add_up_products_},
                                     std::pair<const char*, Kernel*>{"add_up_gradients", &add_up_gradients_}}) {
    auto found = modules_.begin()->second->kernel(name);
    if (!found) return tl::unexpected(found.error());
    *kernel = std::move(*found);
  }
  return {};
}

Possible<void> CellsOnDevice::copy_nodes() {
  std::vector<std::size_t> first{0};
  for (const auto& set : sets_) first.push_back(first.back() + set->contributions());
  std::vector<std::int64_t> places;
  for (const Incidence& incidence : problem_.incidences) {
    const auto set = static_cast<std::size_t>(incidence.set);
    const auto nodes = static_cast<std::uint32_t>(problem_.sets[set].nodes_per_cell);
    places.push_back(
        static_cast<std::int64_t>(first[set] + contribution_index(incidence.cell, incidence.local, nodes, 1)));
  }
  Possible<void> done = keep(device_, offsets_, problem_.offsets);
  if (done) done = keep(device_, places_, places);
  const std::size_t d = static_cast<std::size_t>(problem_.dimension), free = problem_.free.size();
  const std::pair<Buffer*, std::size_t> sizes[] = {{&direction_, (free + 1) * d * sizeof(float)},
                                                   {&product_, free * d * sizeof(float)},
                                                   {&gradient_, free * d * sizeof(double)},
                                                   {&along_, (free + kBlock - 1) / kBlock * sizeof(double)}};
  for (const auto& [buffer, bytes] : sizes) {
    if (!done) return done;
    auto made = device_.allocate(bytes);
    if (!made) return tl::unexpected(made.error());
    *buffer = std::move(*made);
  }
  if (done) done = direction_.upload(std::span<const float>(std::vector<float>((free + 1) * d)));
  return done;
}

Possible<void> CellsOnDevice::place() { return keep(device_, positions_, problem_.positions); }

Possible<void> CellsOnDevice::weigh(std::span<const double> curvatures) {
  Possible<void> done;
  for (std::size_t s = 0; s < sets_.size() && done; ++s) {
    const CellSet& set = problem_.sets[s];
    done = sets_[s]->weigh(curvatures.empty() ? curvatures
                                              : curvatures.subspan(static_cast<std::size_t>(set.first),
                                                                   static_cast<std::size_t>(set.count)));
  }
  return done;
}

SharedArrays CellsOnDevice::shared() const {
  return {positions_.as<const double>(), direction_.as<const float>(), contributions_.as<float>()};
}

SumArguments CellsOnDevice::sum_arguments() const {
  SumArguments sums;
  sums.nodes = static_cast<std::int32_t>(problem_.free.size());
  sums.offsets = offsets_.as<const std::int64_t>();
  sums.places = places_.as<const std::int64_t>();
  sums.contributions = contributions_.as<const float>();
  sums.direction = direction_.as<const float>();
  sums.product = product_.as<float>();
  sums.gradient = gradient_.as<double>();
  sums.along = parts_ != nullptr ? parts_ : along_.as<double>();
  return sums;
}

Possible<std::vector<CellScan>> CellsOnDevice::scan() {
  std::vector<CellScan> scans(static_cast<std::size_t>(problem_.cells));
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->scan(shared());
  for (std::size_t s = 0; s < sets_.size() && done; ++s)
    done = sets_[s]->download_scans(std::span(scans).subspan(static_cast<std::size_t>(problem_.sets[s].first),
                                                             static_cast<std::size_t>(problem_.sets[s].count)));
  if (!done) return tl::unexpected(done.error());
  return scans;
}

Possible<void> CellsOnDevice::run_gradient(bool keeps, double scale) {
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->gradient(shared(), keeps);
  for (const auto& set : sets_)
    if (done && keeps) done = set->keep_cell_gradients(shared());
  SumArguments sums = sum_arguments();
  sums.scale = scale;
  if (done && sums.nodes > 0) done = device_.launch(add_up_gradients_, {sums.nodes, kBlock, 0}, &sums);
  return done;
}

Possible<void> CellsOnDevice::gradient(std::span<double> gradient) {
  const Possible<void> done = run_gradient(false);
  return done ? gradient_.download(gradient) : done;
}

Possible<void> CellsOnDevice::linearise(std::span<double> gradient) {
  const Possible<void> done = run_gradient(true);
  return done ? gradient_.download(gradient) : done;
}

Possible<void> CellsOnDevice::run_node_blocks() {
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->node_blocks(shared());
  return done;
}

Possible<void> CellsOnDevice::run_mean_tensors() {
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->mean_tensors(shared());
  return done;
}

Possible<void> CellsOnDevice::run_convex_part() {
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->keep_convex_part(shared());
  return done;
}

Possible<void> CellsOnDevice::run_product() {
  Possible<void> done;
  for (const auto& set : sets_)
    if (done) done = set->product(shared());
  for (const auto& set : sets_)
    if (done) done = set->add_norm_term(shared());
  SumArguments sums = sum_arguments();
  if (done && sums.nodes > 0)
    done = device_.launch(add_up_products_, {sums.nodes, kBlock, kBlock * static_cast<int>(sizeof(double))}, &sums);
  return done;
}

Possible<double> CellsOnDevice::multiply(std::span<const float> direction, std::span<float> product) {
  if (direction.empty()) return 0.0;
  Possible<void> done = direction_.upload(direction);
  if (done) done = run_product();
  std::vector<double> along(along_.bytes() / sizeof(double));
  if (done) done = product_.download(product);
  if (done) done = along_.download(std::span<double>(along));
  if (!done) return tl::unexpected(done.error());
  double sum = 0;
  for (const double part : along) sum += part;
  return sum;
}

std::size_t CellsOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Buffer* buffer :
       {&positions_, &contributions_, &offsets_, &places_, &direction_, &product_, &gradient_, &along_})
    bytes += buffer->bytes();
  for (const auto& set : sets_) bytes += set->memory();
  return bytes;
}

}  // namespace varimesh::device
