// Proves that cells are valid, or that they are not: Bernstein coefficients bound the Jacobian, with every rounding
// counted.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/bounding_box.h"
#include "core/mesh/high_order_mesh.h"
#include "core/ranks/ranks.h"
#include "core/validity/certificate.h"

namespace varimesh {

namespace detail {
class MeasuresElsewhere;
}

/// Certifies the cells of one mesh, as often as its nodes move.
///
/// The method is that of A. Johnen, J.-F. Remacle, C. Geuzaine, Geometrical validity of curvilinear finite elements,
/// J. Comp. Phys. 233, 2013. J is a polynomial (on pyramids after a change of variables, see bernstein.h), so it lies
/// between its least and its greatest Bernstein coefficient, and the coefficients at corners are values of J. If all
/// coefficients are positive, the cell is valid. If one at a corner is not positive, the cell is invalid. Otherwise the
/// cell is cut in two where the coefficients bend most.
///
/// Every rounding error is bounded, and the bound counts against the answer; rounding_bound-inl.h has the derivation.
/// If the answer is lost in this error, the cell is examined again with nodes converted in 113 bits and products in
/// long double. If that gives no answer either, the cell is called undecided.
class Certifier {
 public:
  /// Keeps a reference to the mesh, whose elements must stay as they are; its nodes may move. Call it inside
  /// team.run().
  explicit Certifier(const HighOrderMesh& mesh, CertificateOptions options = {}, const Team& team = Team(1));
  /// The same for a part of a mesh. `box` and `sign` are the box and the detail::orientation() of the whole mesh, so
  /// that cells get the same certificates as in the whole mesh.
  Certifier(const HighOrderMesh& part, const BoundingBox& box, double sign, CertificateOptions options = {});

  /// How closely sharpen() finds the mesh's minimum if not told otherwise.
  static constexpr double kMinimumGap = 0.002;

  /// Lets certify() measure many cells elsewhere (certificate_kernel.h) before it decides. The bound on rounding, and
  /// all that the first look leaves open, stay on the processor. `elsewhere` may be null, and must outlive the object.
  void measure_with(detail::MeasuresElsewhere* elsewhere) { elsewhere_ = elsewhere; }

  /// The number of cells of the mesh.
  std::size_t cells() const { return cells_.size(); }

  /// Certifies every cell (elements of dimension mesh.dimension, in the mesh's order) with its nodes at `coordinates`
  /// (x y z of each node of the mesh, interleaved). `certificates` has cells() entries. Call it inside team.run(); the
  /// result does not depend on the number of threads. If the team's token interrupts it, each entry is either as it was
  /// or the new certificate.
  /// @param ranks  the ranks that call this together, each with the whole mesh. Each rank certifies a share of the
  ///               cells, and all ranks get all certificates
  void certify(std::span<const double> coordinates, std::span<Certificate> certificates, const Team& team,
               const Ranks& ranks = one_rank()) const;

  /// Certifies only the cells with these numbers (from 0) and keeps the other entries of `certificates`.
  void certify(std::span<const double> coordinates, std::span<const std::int32_t> cells,
               std::span<Certificate> certificates, const Team& team, const Ranks& ranks = one_rank()) const;

  /// Whether the straight-sided form of each cell is sound: J of the map of order 1 on the cell's vertices is proved
  /// positive in the whole reference cell, by the same method. 1 or 0 per cell. Positive values at the corners would
  /// not be enough: hexahedra and prisms with straight sides may be inverted on an edge, on a face or inside although
  /// they are sound at all corners. (On the other shapes J is constant or bilinear.) `coordinates` and `team` as for
  /// certify().
  std::vector<char> sound_with_straight_sides(std::span<const double> coordinates, const Team& team) const;

  /// Sharpens the certificate of the cell with the smallest lower bound of the scaled Jacobian, again and again, until
  /// the mesh's minimum is known to within `gap`. Only few cells must be cut for that. Returns the summary. Call it
  /// inside team.run(). If the team's token interrupts it, all certificates hold as far as they were sharpened.
  CertificateSummary sharpen(std::span<const double> coordinates, std::span<Certificate> certificates, double gap,
                             const Team& team) const;

 private:
  struct Cell {
    const ElementBlock* block;
    const std::int32_t* nodes;
  };
  /// The cells themselves, or the cells of order 1 on their vertices.
  enum class Form : std::uint8_t { Curved, StraightSided };
  template <class Visit>
  void visit_on_one_thread(std::span<const double> coordinates, std::span<const std::int32_t> cells, Form form,
                           const StopToken* stop, const Visit& visit) const;
  void certify_on_one_thread(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                             std::span<Certificate> certificates, const StopToken* stop) const;
  void certify_here(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                    std::span<Certificate> certificates, const Team& team) const;
  std::vector<std::int32_t> certify_elsewhere(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                                              std::span<Certificate> certificates, const Team& team) const;

  CertificateOptions options_;
  std::vector<Cell> cells_;
  std::vector<std::int32_t> all_;  // 0, 1, 2, …
  double scale_ = 1;               // a power of two
  double sign_ = 1;                // −1 if the mesh is numbered clockwise
  detail::MeasuresElsewhere* elsewhere_ = nullptr;
};

}  // namespace varimesh
