#include "core/optimise/memory.h"

#include <cmath>

#include "core/energy/material.h"
#include "core/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"
#include "core/reference/quadrature.h"
#include "core/validity/certificate.h"

namespace varimesh {
namespace {

/// Bytes of one cell in the arrays of its set, of the Hessian's batches and of the guard.
double bytes_of_cell(Shape shape, int order, const Options& options, int hessian_entries, bool keeps_function) {
  const int degree = options.quadrature_degree > 0 ? options.quadrature_degree : 2 * order;
  const reference::ShapeInfo& info = reference::info(shape);
  const double d = info.dimension, square = d * d, nodes = reference::node_count(shape, order);
  const double points = static_cast<double>(reference::quadrature(shape, order, degree).weights.size());
  const double stride = std::ceil(points / kPointPadding) * kPointPadding;
  const double targets = (square + 1) * (info.affine ? 1 : stride);
  double bytes = 8 * (targets + (info.affine ? 0 : square + 1));  // A⁻¹ and its measure
  if (options.method != Method::Newton)
    bytes += 8 * (square + (keeps_function ? 1 : 0)) * stride;  // F and the energy's function of J
  bytes += nodes * (4 + sizeof(Incidence) + 2 * 4);             // lists of nodes of the mesh and the problem
  bytes += 3 * sizeof(Certificate) + sizeof(double) * 10 + 40;  // of the guard and the scans, and which cells are awake
  if (options.method == Method::Sweeps || options.max_iterations == 0) return bytes;
  bytes += points * (4 * hessian_entries + 2 * square) + 4 * (square + 1);                  // the linearisation
  if (options.p_norm > 1 || options.objective == Objective::Worst) bytes += 4 * nodes * d;  // the cells' gradients
  bytes += 4 * nodes * (2 * d + 1) + 4 * square * (info.affine ? 1 : points);               // products, ranks, A⁻¹
  const double coarse = reference::node_count(shape, std::min(order, 2));                   // nodes of the coarse level
  // Its tensors, places and matrix. Neighbouring cells share parts of a row.
  return bytes + 4 * tensor_size(info.dimension) + coarse * (4 + sizeof(Incidence)) +
         0.75 * coarse * coarse * (4 + 2 * square);
}

}  // namespace

std::int64_t memory_needed(const HighOrderMesh& mesh, const Options& options) {
  const int order = options.order > 0 ? options.order : mesh.order;
  const double d = mesh.dimension;
  const int entries = make_hessian_kernels(material(options), mesh.dimension)->entries();
  const bool keeps_function = make_kernels(material(options), mesh.dimension)->keeps_function();
  double bytes = 0;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension && block.size() > 0)
      bytes += static_cast<double>(block.size()) * bytes_of_cell(block.shape, order, options, entries, keeps_function);
  const double nodes = static_cast<double>(mesh.node_count()) * std::pow(double(order) / mesh.order, d);
  // Coordinates of the mesh, the guard and the best mesh; positions, steps and directions; which nodes are awake.
  bytes += nodes * (3 * 24 + 2 * 8 + d * (6 * 8 + 3 * 4) + 2 * d * (d + 1) + 60);
  if (options.objective == Objective::Worst) bytes += 24 * nodes;
  // It is not known in advance how many splits there will be. Coarse meshes have grown threefold, and two more copies
  // of them are kept.
  if (options.repair == Repair::Split) bytes *= 4;
  return static_cast<std::int64_t>(1.15 * bytes);
}

}  // namespace varimesh
