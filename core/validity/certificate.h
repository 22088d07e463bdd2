// What is proved about the cells of a mesh: plain data. certifier.h says how it is proved.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// What is proved about one cell. Bounds are of J = det ∇χ_M with respect to the reference cell (shape.h), relative to
/// the mesh's orientation, in the cube (in 2-D the square) of the file's unit of length. They hold for the coordinates
/// as given.
struct Certificate {
  enum class Answer : std::uint8_t {
    Valid,      ///< J > 0 in the whole cell.
    Invalid,    ///< J ≤ 0 at `place`.
    Undecided,  ///< Neither could be proved within the options' limits; never counted as valid.
  };
  Answer answer = Answer::Undecided;
  double lower_bound = -std::numeric_limits<double>::max();  ///< J is nowhere smaller.
  double upper_bound = std::numeric_limits<double>::max();   ///< J is nowhere greater.
  /// min J / max J is no smaller. −1 if J is proved nowhere positive; the lowest double if nothing is known.
  double scaled_jacobian_lower_bound = -std::numeric_limits<double>::max();
  std::array<double, 3> place{};  ///< Physical coordinates where J ≤ 0 (invalid) or where it is in doubt (undecided).

  bool is_valid() const { return answer == Answer::Valid; }
};

inline bool are_valid(std::span<const Certificate> certificates) {
  return std::ranges::all_of(certificates, &Certificate::is_valid);
}

/// How much work a certificate may take.
struct CertificateOptions {
  int max_depth = 60;    ///< Bisections inside one another. Three halve the size of a 3-D cell.
  int max_cells = 4000;  ///< Parts that one cell may be cut into.
  /// After the answer is known, bounds are sharpened until min J / max J is known to within this. Infinity: not at all.
  double gap = std::numeric_limits<double>::infinity();
};

/// The certificates of a mesh in four numbers.
struct CertificateSummary {
  std::int64_t valid = 0;
  std::int64_t invalid = 0;
  std::int64_t undecided = 0;
  double min_scaled_jacobian_lower_bound = 0;  ///< Smallest over the cells.
};

/// Call it inside team.run().
CertificateSummary summarise(std::span<const Certificate> certificates, const Team& team = Team(1));

/// Certifies all cells of a mesh (elements of dimension mesh.dimension, in the mesh's order). `threads` 0 means all.
std::vector<Certificate> certify(const HighOrderMesh& mesh, const CertificateOptions& options = {}, int threads = 0);

}  // namespace varimesh
