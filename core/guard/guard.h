// What is proved stays proved: cells that moved are certified again after every iteration, and the mesh that is handed
// out has lost none of the certificates that it came with.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// How a cell stands.
enum class Standing : std::uint8_t {
  Valid,         ///< Certified.
  Lost,          ///< Not certified, but certified in the kept state.
  Uncertified,   ///< Not certified, in no unrepairable group.
  Unrepairable,  ///< Not certified, in an unrepairable group.
};

/// Watches over a problem whose nodes move. Certificates are of the coordinates as they would be written now, so that
/// conversion and rounding are covered.
///
/// The optimiser may pass through meshes in which a cell has lost its certificate: the energy sees J at its quadrature
/// points only, and barring its way between them costs a hundred times the iterations where it would have come out on
/// the other side. So the guard keeps the best state seen, the latest in which no cell was uncertified that an earlier
/// kept state had certified. Where the run ends in a state that has lost some, the free nodes of these cells go back to
/// where they were in the kept state, and so do those of neighbours that this would lose, until none is lost. At worst
/// all of it is taken back, so this ends.
///
/// Everything is to be called inside team.run(), and the result does not depend on the number of threads.
class Guard {
 public:
  /// `certificates`: what `certifier` says of mesh.coordinates. `mesh` and `certifier` must outlive the guard.
  Guard(const HighOrderMesh& mesh, const Frame& frame, Problem& problem, const Certifier& certifier,
        std::vector<Certificate> certificates, const Team& team);

  /// Cells in these groups are kept out of the barrier for as long as they are not certified valid
  /// (CellSet::unrepairable)
  void set_unrepairable(std::span<const UnrepairableGroup> groups);

  /// After an iteration: certifies the cells that moved, and keeps the state where nothing is lost by that.
  void certify_moved();

  /// Puts back what is lost against the kept state, and keeps the outcome. Positions stay where they are.
  void restore_lost();

  /// The same, and moves the problem's nodes there. The deformation gradients are left to be rebuilt.
  void return_to_kept();

  /// Cells that are not certified valid as of the last certify_moved().
  std::int64_t uncertified() const { return uncertified_; }
  /// Those of them that are in no unrepairable group.
  std::int64_t repairable() const { return repairable_; }
  /// Cells that are certified valid in the kept state and were not at the last certify_moved().
  std::int64_t lost() const { return static_cast<std::int64_t>(lost_.size()); }

  /// Positions of the free nodes in the kept state and at the last look: all that tells this state from the first.
  template <class Archive>
  void state(Archive& archive) {
    std::vector<double> kept = free_of(positions_), seen = free_of(latest_positions_);
    archive(kept, seen);
    if constexpr (Archive::kReads)
      if (!restore(kept, seen)) archive.fail();
  }

  /// How the problem's cells stood at the last certify_moved(), by CellSet::first + cell.
  std::vector<Standing> standings() const;

  /// The kept state: the mesh's coordinates, and what is proved about them, one a cell in the mesh's order. The
  /// coordinates are made of the positions where they are not those of the last look.
  std::vector<double> coordinates() const;
  const std::vector<Certificate>& certificates() const { return certificates_; }
  /// Its cells that are not certified valid and in no unrepairable group.
  std::int64_t unrepaired() const;

  /// What all this took so far.
  double seconds() const { return seconds_; }

 private:
  /// Cells with a node that is not where `latest_positions_` has it, in order.
  std::vector<std::int32_t> moved_cells(const std::vector<double>& positions) const;
  /// Brings latest_certificates_… and lost_ up to date with nodes at these positions.
  void certify_at(const std::vector<double>& positions);
  void keep();
  std::vector<double> free_of(const std::vector<double>& positions) const;
  bool restore(const std::vector<double>& kept, const std::vector<double>& seen);
  void count();
  void write_unrepairable();

  const HighOrderMesh& mesh_;
  Problem& problem_;
  const Certifier& certifier_;
  const Team& team_;
  NodeConversion conversion_;
  std::vector<const std::int32_t*> cell_nodes_;  ///< By cell of the mesh.
  std::vector<int> cell_size_;
  std::vector<char> free_;          ///< By node.
  std::vector<char> unrepairable_;  ///< By cell: in an unrepairable group.
  std::vector<double> positions_;   ///< The kept state.
  std::vector<Certificate> certificates_;
  bool kept_is_latest_ = true;
  std::vector<double> latest_positions_;  ///< What was looked at last.
  std::vector<double> latest_coordinates_;
  std::vector<Certificate> latest_certificates_;
  std::vector<std::int32_t> lost_;
  std::int64_t uncertified_ = 0, repairable_ = 0;
  double seconds_ = 0;
};

}  // namespace varimesh
