// Moves all nodes of a mesh together, those on its boundary included, after its boundary has slid bottom-up. Internal
// to core/slide.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/slide/slide_report.h"

namespace varimesh::detail {

/// What came of it.
struct CoupledReport {
  enum class Outcome : std::uint8_t {
    Taken,     ///< Otherwise the mesh is as bottom-up sliding has left it:
    TooFar,    ///< no state on the way was within the limits of distance,
    NoBetter,  ///< or none of those within was better,
    NoTime     ///< or the time was over.
  };
  Outcome outcome = Outcome::TooFar;
  int steps = 0;                 ///< Newton steps.
  std::int64_t left_before = 0;  ///< Cells that are not certified valid if only nodes inside the mesh move,
  std::int64_t left_after = 0;   ///< and if all move.

  /// A sentence for a person.
  std::string sentence() const;
};

/// How far and how long all nodes may move together.
struct CoupledLimits {
  double tolerance = 0;  ///< Of distances, in the mesh's unit of length; 0: twice the distances in the mesh as it came.
  /// After this many seconds, the seconds of bottom-up sliding included, no further step begins. The last state is then
  /// held back within the limits of distance, and the best state so far is taken. 0: no limit.
  double seconds = 0;
};

/// slide() with SlideOn::All, and then Newton's method for all nodes together (coupled_newton.h), with the targets of
/// the mesh as it came on the boundary, and as it has slid inside.
///
/// Nodes of periodic links stay where bottom-up sliding has left them, because different cells would move the two sides
/// of a period. First only nodes inside the mesh move; what comes of this is what bottom-up sliding can give. Then all
/// move. Of the states on the way, the one with the fewest weak cells is taken: those that are not certified valid, or
/// whose scaled Jacobian is below .02. If several are equal, it is the one with the fewest cells that are not certified
/// valid, and then the one with the highest proved scaled Jacobian. Neither the largest nor the rms distance between
/// boundary and geometry may exceed `tolerance` there, or what bottom-up sliding has left if that is more; with
/// tolerance 0, neither may exceed twice that of the mesh as it came. This holds for all surfaces together, and for all
/// edges on curves together; with tolerance 0, these may lie as far from their curves as the elements from their
/// surfaces. No more elements may be folded than after bottom-up sliding. If the state to which Newton's method comes
/// exceeds these distances, states a part of the way to it are tried, and one in which the boundary is held back only
/// where it exceeds them (hold_back.h), from where the nodes inside move once more. Then the boundary's energy gets a
/// higher weight. If weak cells are left after all that, it is done once more from the start, with a δ that falls
/// faster.
///
/// The nodes go back to where bottom-up sliding has left them if that leaves fewer weak cells or fewer that are not
/// certified valid, or as many of both with a larger smallest and mean scaled Jacobian, each after nodes inside the
/// mesh have moved. They also go back if as many cells are weak and some are not certified valid: that a few of them
/// are hardly valid now is worth nothing, and would keep a split from making room. Nodes of the boundary lie on their
/// entity afterwards, up to rounding. The result does not depend on the number of threads, unless the seconds end it.
/// Do not call it inside team.run(). Throws Interrupted if the work is to stop while nodes slide bottom-up, or if the
/// caller asks for it later. If the time of the team's token is over later, the boundary stays where sliding left it.
///
/// @param coupled  what came of the second part
SlideReport slide_coupled(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed,
                          const CoupledLimits& limits, const Team& team, CoupledReport& coupled);

}  // namespace varimesh::detail
