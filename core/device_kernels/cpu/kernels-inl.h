// The kernels of one shape and order, and those of all cells, as the processor runs them in a device's place.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "core/device/device.h"
#include "core/device_kernels/kernels/cells-inl.h"
#include "core/device_kernels/kernels/linearised-inl.h"
#include "core/device_kernels/kernels/norm-inl.h"
#include "core/device_kernels/kernels/product-inl.h"
#include "core/energy/table-inl.h"

namespace varimesh::N_ONE_LANE {

using device::CellKernel;
using device::CpuKernel;

/// Calls work(number) for each cell of a block whose threads share cells as `parts` say.
template <int parts, class Work>
void for_cells_of_block(std::int32_t batches, std::int32_t block, std::int32_t threads, const Work& work) {
  const std::int64_t cells = threads / parts, first = block * cells;
  const std::int64_t last = std::min<std::int64_t>(first + cells, static_cast<std::int64_t>(batches) * kBatch);
  for (std::int64_t cell = first; cell < last; ++cell) work(Place<parts>::of(cell));
}

template <int d>
void add_up_products(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const device::SumArguments*>(arguments);
  std::vector<double> along(static_cast<std::size_t>(threads));
  for (std::int32_t thread = 0; thread < threads; ++thread)
    along[static_cast<std::size_t>(thread)] = add_up_product<d>(a, static_cast<std::int64_t>(block) * threads + thread);
  for (std::size_t width = along.size() / 2; width > 0; width /= 2)
    for (std::size_t i = 0; i < width; ++i) along[i] = along[i] + along[i + width];
  a.along[block] = along[0];
}

template <int d>
void add_up_gradients(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const device::SumArguments*>(arguments);
  for (std::int32_t thread = 0; thread < threads; ++thread)
    add_up_gradient<d>(a, static_cast<std::int64_t>(block) * threads + thread);
}

/// Calls a function of the p-norm's term for each thread of a block.
template <void (*function)(const device::NormArguments&, std::int64_t)>
void norm_kernel(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const device::NormArguments*>(arguments);
  for (std::int32_t thread = 0; thread < threads; ++thread)
    function(a, static_cast<std::int64_t>(block) * threads + thread);
}

/// Kernels that keep cells of one kind in registers.
template <class E, CellKind kind>
struct CpuKernels {
  static constexpr int d = kind.dimension;

  template <CellKernel kernel, class Work>
  static void on_cells(const void* arguments, std::int32_t block, std::int32_t threads, const Work& work) {
    const auto& a = *static_cast<const device::CellArguments*>(arguments);
    constexpr int parts = device::parts_of(kernel, kind);
    for_cells_of_block<parts>(a.batches, block, threads, [&](Place<parts> place) {
      CellOnDevice<E, kind, parts> cell(a, a.tables.derivatives, place);
      work(cell);
    });
  }
  static void energy(const void* arguments, std::int32_t block, std::int32_t threads) {
    on_cells<CellKernel::Energy>(arguments, block, threads, [](auto& cell) { cell.scan(); });
  }
  static void gradient(const void* arguments, std::int32_t block, std::int32_t threads) {
    on_cells<CellKernel::Gradient>(arguments, block, threads, [](auto& cell) { cell.template gradient<false>(); });
  }
  static void linearise(const void* arguments, std::int32_t block, std::int32_t threads) {
    on_cells<CellKernel::Gradient>(arguments, block, threads, [](auto& cell) { cell.template gradient<true>(); });
  }
  static void product(const void* arguments, std::int32_t block, std::int32_t threads) {
    const auto& a = *static_cast<const device::ProductArguments*>(arguments);
    constexpr int parts = device::parts_of(CellKernel::Product, kind);
    for_cells_of_block<parts>(a.batches, block, threads, [&](Place<parts> place) {
      ProductOnDevice<E, kind, parts>(a, a.tables.derivatives, place).multiply();
    });
  }

  static constexpr CpuKernel kKernels[] = {
      {"energy", energy},
      {"gradient", gradient},
      {"linearise", linearise},
      {"product", product},
      {"add_up_products", add_up_products<d>},
      {"add_up_gradients", add_up_gradients<d>},
      {"keep_cell_gradients", norm_kernel<keep_cell_gradient<d>>},
      {"along_cell_gradients", norm_kernel<along_cell_gradient<d>>},
      {"add_norm_terms", norm_kernel<add_norm_term<d>>},
  };
};

/// Kernels for cells of any shape and order.
template <class E, int d>
struct GeneralCpuKernels {
  using Thread = LinearisedThread<E, d>;
  using Arguments = device::GeneralArguments;

  /// Calls work(thread) for each thread of a block; each batch has `per_batch` × lane threads.
  template <class Work>
  static void on(const void* arguments, std::int32_t block, std::int32_t threads, std::int32_t Arguments::*per_batch,
                 const Work& work) {
    const auto& a = *static_cast<const Arguments*>(arguments);
    for (std::int32_t i = 0; i < threads; ++i) {
      const Thread thread(a, static_cast<std::int64_t>(block) * threads + i, per_batch == nullptr ? 1 : a.*per_batch);
      if (thread.exists()) work(thread);
    }
  }
  static void deform(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::points, [](const Thread& thread) { thread.deform(); });
  }
  static void scan(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, nullptr, [](const Thread& thread) { thread.scan(); });
  }
  static void range(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, nullptr, [](const Thread& thread) { thread.range(); });
  }
  static void stress(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::points, [](const Thread& thread) { thread.template stress<false>(); });
  }
  static void linearise(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::points, [](const Thread& thread) { thread.template stress<true>(); });
  }
  static void gradient(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::nodes, [](const Thread& thread) { thread.gradient(); });
  }
  static void change_stress(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::points, [](const Thread& thread) { thread.change_stress(); });
  }
  static void product(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::nodes, [](const Thread& thread) { thread.product(); });
  }
  static void node_block(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::nodes, [](const Thread& thread) { thread.node_block(); });
  }
  static void mean_tensor(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, nullptr, [](const Thread& thread) { thread.mean_tensor(); });
  }
  static void keep_convex_part(const void* arguments, std::int32_t block, std::int32_t threads) {
    on(arguments, block, threads, &Arguments::points, [](const Thread& thread) { thread.keep_convex_part(); });
  }

  static constexpr CpuKernel kKernels[] = {
      {"deform", deform},
      {"scan", scan},
      {"range", range},
      {"stress", stress},
      {"linearise", linearise},
      {"gradient", gradient},
      {"change_stress", change_stress},
      {"product", product},
      {"node_block", node_block},
      {"mean_tensor", mean_tensor},
      {"keep_convex_part", keep_convex_part},
      {"add_up_products", add_up_products<d>},
      {"add_up_gradients", add_up_gradients<d>},
      {"keep_cell_gradients", norm_kernel<keep_cell_gradient<d>>},
      {"along_cell_gradients", norm_kernel<along_cell_gradient<d>>},
      {"add_norm_terms", norm_kernel<add_norm_term<d>>},
  };
};

template <int d>
std::span<const CpuKernel> general_cpu_kernels(const Material& material) {
  return with_energy<d>(material, [](const auto& energy) {
    return std::span<const CpuKernel>(GeneralCpuKernels<std::decay_t<decltype(energy)>, d>::kKernels);
  });
}

/// Kernels of the hyperelastic energy.
template <CellKind kind>
std::span<const CpuKernel> cpu_kernels() {
  return CpuKernels<HyperelasticEnergy<kind.dimension>, kind>::kKernels;
}

}  // namespace varimesh::N_ONE_LANE
