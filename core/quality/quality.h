// How good a mesh is: the scaled Jacobian and the distortion Jacobian of every cell, sampled on a dense lattice; what
// is proved; the loss of accuracy.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/layers/error/layer_error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/accuracy/accuracy.h"
#include "core/validity/certificate.h"

namespace varimesh {

/// A cell that is invalid: its Jacobian is not positive somewhere.
struct InvalidElement {
  std::int64_t number = 0;        ///< Element number as the file has it.
  double scaled_jacobian = 0;     ///< min J / max J (at most 0), dimensionless; −1 if J is nowhere positive.
  std::array<double, 3> place{};  ///< Physical coordinates of the sample with the smallest J.
};

/// A cell that is not certified valid.
struct UncertifiedElement {
  std::int64_t number = 0;  ///< Element number as the file has it.
  Certificate::Answer answer = Certificate::Answer::Undecided;
  std::array<double, 3> place{};  ///< Physical coordinates where J ≤ 0, or where it is in doubt.
};

/// The quality report of a mesh. Everything is dimensionless except the places. Samples prove nothing; `certified`
/// does.
struct QualityReport {
  static constexpr int kBins = 50;

  double min_scaled_jacobian = 0;      ///< The smallest Js = min det ∇χ_M / max det ∇χ_M of a cell.
  double mean_scaled_jacobian = 0;     ///< The mean Js of the cells, each clipped from below at −1.
  double min_distortion_jacobian = 0;  ///< The smallest such ratio for det F; Js on simplices and if det F < 0 < Js.
  std::int64_t invalid_elements = 0;
  std::array<std::int64_t, kBins> histogram{};  ///< Cells by Js, in kBins equal bins of [0, 1]; without invalid cells.
  std::vector<InvalidElement> invalid;          ///< Every invalid cell, worst first.
  int lattice_intervals = 0;                    ///< Intervals per edge of the sampled lattice.

  /// How many cells are proved valid, proved invalid, or neither, and a lower bound of Js over all cells. The bound is
  /// within 0.002 of the minimum, unless subdivision reaches its limits first.
  CertificateSummary certified;
  std::vector<UncertifiedElement> uncertified;  ///< Every cell that is not certified valid, in the mesh's order.

  /// How much accuracy a solver loses because cells are curved. Absent in quick_quality(), and if the mesh is a surface
  /// in space that does not lie in one plane.
  std::optional<Accuracy> accuracy;
  /// How well elements in layers hold solutions that decay from the wall. quality() leaves it out, because it takes
  /// the whole mesh to find layers. Runs that treat layers add it, unless an element in a layer is invalid or the run
  /// has to end at once. So do callers of layer_error().
  std::optional<LayerError> in_layers;

  /// Element numbers of the cells that are numbered clockwise (in space: left-handed), in the mesh's order. Everything
  /// above judges them as if they were turned.
  std::vector<std::int64_t> clockwise;

  /// Whether the mesh is a surface in space (is_surface() of core/mesh/check.h). Then J is n · (x_ξ × x_η) everywhere
  /// above, where n is the unit vector along the cell's mean normal. If the surface lies in one plane, all cells have
  /// the same n, and the mesh is judged as one in the plane.
  bool is_surface = false;
};

/// Js and the distortion Jacobian of each cell (elements of dimension mesh.dimension, in the mesh's order).
struct CellQuality {
  std::vector<double> scaled_jacobian;  ///< min J / max J; −1 if J is nowhere positive.
  std::vector<double> distortion_jacobian;
};

/// The element numbers of the report's uncertified cells.
std::vector<std::int64_t> uncertified_numbers(const QualityReport& report);

/// Intervals per edge of the lattice that cells of this order are sampled on.
int report_intervals(int order);

/// Samples every cell on the uniform lattice with `intervals` intervals per edge, vertices and edges included (0: the
/// default, max(2 P + 2, 8)). Cells that are numbered clockwise, all or some, are judged as if they were turned; their
/// neighbours tell them from cells that are inverted. `threads` 0 means all; the result does not depend on it. The mesh
/// must have passed check_structure(), or check_judgeable() if it is a surface in space.
CellQuality cell_quality(const HighOrderMesh& mesh, int intervals = 0, int threads = 0);
QualityReport quality(const HighOrderMesh& mesh, int intervals = 0, int threads = 0);

}  // namespace varimesh
