// What every code for batches of cells knows of them, on the processor and on a device: how many cells a batch has, and
// what is kept of a quadrature point.
#pragma once

#include <cstdint>

namespace varimesh {

/// Cells in a batch on every machine: one AVX-512 vector of floats, or two of AVX2.
inline constexpr int kBatch = 16;

/// Partial derivatives of the energy's density f(Q, J), times the weight, |det A| and the cell's energy_slope. Every
/// energy keeps these of each point. The products of some energies need more, which stand after them.
enum class KeptPartial : std::uint8_t { Q, J, JJ };

}  // namespace varimesh
