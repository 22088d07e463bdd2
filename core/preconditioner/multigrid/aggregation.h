// Strong connections of a matrix, and its rows grouped into aggregates by them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/preconditioner/multigrid/level_matrix.h"

namespace varimesh::multigrid {

/// Which entries count as strong connections. Rows i and j are strongly connected if −a_ij ≥ θ √(m_i m_j), where m_i is
/// the largest −a_ik of row i. On a stretched mesh only neighbours across the thin side are: relaxation makes an error
/// smooth there and nowhere else. A positive entry, as bilinear functions have along the long side, is never strong.
/// The usual measure a_ij² / (a_ii a_jj) (Vaněk, Mandel and Brezina 1996) would take these for strong, and the corner
/// entries of bilinear functions on an unstretched mesh for weak.
///
/// A row that has no strong connection by this rule, because all its neighbours belong to a much stiffer material, is
/// "led": its strong connections are those with −a_ij ≥ θ m_i, and they count for this row only.
class Strength {
 public:
  Strength(const Team& team, const LevelMatrix& matrix, double threshold);

  /// True if the entry `value` in that row and column ties the row to the column.
  bool is_strong(std::size_t row, std::size_t column, float value) const {
    return -value >= (kind_[row] == kLed ? scale_[row] * scale_[row] : scale_[row] * scale_[column]) && value < 0;
  }
  /// True for a row that needs no correction by a coarser level: relaxation by itself makes its error small, because
  /// its diagonal entry is at least ten times the sum of the others, or because there are no others.
  bool is_alone(std::size_t row) const { return kind_[row] == kAlone; }
  bool is_led(std::size_t row) const { return kind_[row] == kLed; }

 private:
  enum Kind : std::uint8_t { kMutual, kLed, kAlone };
  std::vector<float> scale_;  ///< √(θ m_i); infinite if is_alone(row).
  std::vector<Kind> kind_;
};

/// Disjoint sets of rows.
struct Aggregates {
  std::int32_t count = 0;
  std::vector<std::int32_t> of_row;  ///< −1 for a row in none.
};

/// Forms the aggregates. Each has a root row and the root's strong neighbours. Two roots are always more than two
/// strong connections apart, and no further root could be added. A row that is left over joins the neighbour with the
/// strongest connection, and so does a row that is led. Rows are chosen in rounds by hashed priorities (Bell, Dalton
/// and Olson, "Exposing fine-grained parallelism in algebraic multigrid methods", SIAM J. Sci. Comput. 34, 2012), so
/// that threads share the work and the result does not depend on them.
Aggregates aggregate(const Team& team, const LevelMatrix& matrix, const Strength& strength);

}  // namespace varimesh::multigrid
