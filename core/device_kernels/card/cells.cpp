// The kernels that keep cells of one kind in registers, of the hyperelastic energy, for a card. clang compiles this
// file to PTX, as CUDA, with no toolkit: CMakeLists.txt has the command. It defines
//   VARIMESH_KIND   the kind, as kernels/cell_kinds.h calls it
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/device_kernels/kernels/arguments.h"

// Everything from here to "end" is compiled for the card too. The headers above are the processor's.
#pragma clang force_cuda_host_device begin
#include "core/device_kernels/card/threads-inl.h"
#include "core/device_kernels/kernels/cells-inl.h"
#include "core/device_kernels/kernels/product-inl.h"
#include "core/energy/table-inl.h"
#pragma clang force_cuda_host_device end

namespace varimesh::N_ONE_LANE {
namespace {

using device::CellKernel;
using device::parts_of;
constexpr device::CellKind kKind = device::kinds::VARIMESH_KIND;
constexpr int d = kKind.dimension;
using CellEnergy = HyperelasticEnergy<d>;
constexpr int kParts[] = {parts_of(CellKernel::Energy, kKind), parts_of(CellKernel::Gradient, kKind),
                          parts_of(CellKernel::Product, kKind)};
using Product = ProductOnDevice<CellEnergy, kKind, kParts[2]>;

/// A copy of a table in the memory that the threads of a block share.
template <class T>
VARIMESH_ON_CARD const T* shared_copy(const T* table, int size) {
  T* const copy = reinterpret_cast<T*>(shared_numbers);
  for (int i = thread_of_block(); i < size; i += threads_of_block()) copy[i] = table[i];
  __syncthreads();
  return copy;
}

template <int parts, class Work>
VARIMESH_ON_CARD void for_cell(const device::CellArguments& a, const Work& work) {
  using Cell = CellOnDevice<CellEnergy, kKind, parts>;
  const double* table = shared_copy(a.tables.derivatives, Cell::Cells::size(a.tables));
  const std::int64_t number = thread();
  if (number >= static_cast<std::int64_t>(a.batches) * kBatch * parts) return;
  Cell cell(a, table, Place<parts>::of(number));
  work(cell);
}

}  // namespace

/// Tells this module from others. No kernel reads it.
extern "C" __attribute__((device)) int cell_kind = device::number_of(kKind);

VARIMESH_KERNEL energy(device::CellArguments a) {
  for_cell<kParts[0]>(
      a, [](auto& cell) __attribute__((always_inline)) { cell.scan(); });
}

VARIMESH_KERNEL gradient(device::CellArguments a) {
  for_cell<kParts[1]>(
      a, [](auto& cell) __attribute__((always_inline)) { cell.template gradient<false>(); });
}

VARIMESH_KERNEL linearise(device::CellArguments a) {
  for_cell<kParts[1]>(
      a, [](auto& cell) __attribute__((always_inline)) { cell.template gradient<true>(); });
}

VARIMESH_KERNEL product(device::ProductArguments a) {
  const float* table = shared_copy(a.tables.derivatives, Product::Cells::size(a.tables));
  const std::int64_t number = thread();
  if (number >= static_cast<std::int64_t>(a.batches) * kBatch * kParts[2]) return;
  Product(a, table, Place<kParts[2]>::of(number)).multiply();
}

}  // namespace varimesh::N_ONE_LANE

#include "core/device_kernels/card/sums-inl.h"
