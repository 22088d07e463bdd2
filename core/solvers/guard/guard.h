// Keeps every certificate: cells that moved are certified again after every iteration, and the resulting mesh has lost
// none of the certificates that the input mesh had.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/merit/merit.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/ranks/ranks.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// What is known about a cell.
enum class Standing : std::uint8_t {
  Valid,         ///< Certified valid.
  Lost,          ///< Not certified valid, but it is in the kept state.
  Uncertified,   ///< Not certified valid, and in no unrepairable group.
  Unrepairable,  ///< Not certified valid, and in an unrepairable group.
};

/// Watches over a problem whose nodes move. Certificates are for the coordinates as they would be written to a file
/// now, so they cover conversion and rounding.
///
/// The optimiser may pass through meshes in which a cell has lost its certificate. The energy sees J at its quadrature
/// points only. Such a step often leads to a valid mesh on the other side, and forbidding it costs a hundred times the
/// iterations. So the guard keeps a state: the latest one in which no cell is uncertified that an earlier kept state
/// had certified. If the run ends in a state that has lost certificates, the free nodes of the cells concerned go back
/// to where they are in the kept state. If that costs a neighbour its certificate, the neighbour's free nodes go back
/// too, until nothing is lost. In the worst case all nodes go back, so this ends.
///
/// The same is tried on the way, whenever a state with lost certificates may lead to fewer uncertified cells than any
/// before. The best outcome is remembered, and return_to_best() makes it the kept state at the end. So a run that is
/// stopped earlier never has fewer uncertified cells. The iterations do not notice.
///
/// Certifying may be interrupted (core/base/stop_token.h). Then the kept state is what it was before.
///
/// Call everything inside team.run(). The result does not depend on the number of threads.
class Guard {
 public:
  /// `certificates` are those of `certifier` for mesh.coordinates, one per cell in the mesh's order. All references
  /// must outlive the guard. `ranks`: share the work of certifying, and call everything together.
  Guard(const HighOrderMesh& mesh, const Frame& frame, Problem& problem, const Certifier& certifier,
        std::vector<Certificate> certificates, const Team& team, const Ranks& ranks = one_rank());

  /// Keeps the cells of these groups out of the barrier while they are not certified valid (CellSet::unrepairable).
  void set_unrepairable(std::span<const UnrepairableGroup> groups);

  /// After an iteration: certifies the cells that moved, and keeps the state if no certificate is lost. If some are
  /// lost, tries what the run would have if it ended here.
  void certify_moved();

  /// Restores what is lost compared with the kept state, and keeps the outcome. The problem's positions do not change.
  void restore_lost();

  /// The same, and moves the problem's nodes to the kept state. The caller must rebuild the deformation gradients.
  void return_to_kept();

  /// At the end of a run, after restore_lost(): if an earlier iteration would have ended with fewer uncertified cells,
  /// the kept state becomes that one. Returns whether it did. It is never interrupted.
  bool return_to_best();

  /// restore_lost() and return_to_best(), and moves the problem's nodes to the kept state, which is what the run would
  /// hand out if it ended now. The caller must rebuild the deformation gradients.
  void return_to_ending();

  /// Cells that are not certified valid as of the last certify_moved().
  std::int64_t uncertified() const { return uncertified_; }
  /// Those of them that are in no unrepairable group.
  std::int64_t repairable() const { return repairable_; }
  /// Cells that would not be certified valid if the run ended with the last certify_moved().
  std::int64_t fewest() const { return best_.positions.empty() ? kept_uncertified_ : best_.merit.uncertified; }
  /// Cells that are certified valid in the kept state but were not at the last certify_moved().
  std::int64_t lost() const { return static_cast<std::int64_t>(lost_.size()); }

  /// Checkpoints hold the positions of the free nodes in the kept state, in the best one if it is another, and at the
  /// last certify_moved(). Everything else follows from them.
  template <class Archive>
  void state(Archive& archive) {
    std::vector<double> kept = free_positions(problem_, positions_);
    std::vector<double> latest = free_positions(problem_, latest_positions_);
    archive(kept, latest, best_.positions);
    if constexpr (Archive::kReads)
      if (!restore(kept, latest)) archive.fail();
  }

  /// What was known about the problem's cells at the last certify_moved(), by CellSet::first + cell.
  std::vector<Standing> standings() const;

  /// The kept state: the mesh's coordinates (3 per node, interleaved), and their certificates, one per cell in the
  /// mesh's order.
  std::vector<double> coordinates() const;
  /// The same, in memory that is there already if the list has this size.
  void copy_coordinates(std::vector<double>& coordinates) const;
  /// The same if the last certify_moved() has kept its state, and empty otherwise. The guard's next change ends it.
  std::span<const double> coordinates_in_place() const {
    return kept_is_latest_ ? std::span<const double>(latest_coordinates_) : std::span<const double>();
  }
  const std::vector<Certificate>& certificates() const { return certificates_; }
  /// The same of the state at the last certify_moved().
  std::vector<double> latest_coordinates() const { return {latest_coordinates_.begin(), latest_coordinates_.end()}; }
  const std::vector<Certificate>& latest_certificates() const { return latest_certificates_; }
  /// Computes the certificates.
  const Certifier& certifier() const { return certifier_; }
  /// By cell in the mesh's order: 1 if nothing makes the cell valid, as far as set_unrepairable() was told
  /// (cells_beyond_repair()).
  const std::vector<char>& beyond_repair() const { return beyond_repair_; }
  /// The cells of the kept state that are not certified valid and in no unrepairable group.
  std::int64_t unrepaired() const;

  /// Seconds spent in certify_moved() and restore_lost() so far.
  double seconds() const { return seconds_; }

 private:
  /// The cells for which is(cell) is true, in ascending order. It is never interrupted, so the lists and counts always
  /// fit the certificates.
  template <class Is>
  std::vector<std::int32_t> cells_where(const Is& is) const;
  /// Cells with a node that is not where `latest_positions_` has it, in ascending order.
  std::vector<std::int32_t> moved_cells(const std::vector<double>& positions) const;
  /// Brings lost_ and everything named latest_ up to date with nodes at these positions.
  void certify_at(const std::vector<double>& positions);
  void keep();
  /// Finds what restore_lost() would lead to, and remembers it if it is the best so far. Afterwards the state that was
  /// certified last is certified again.
  void try_to_end_here();
  /// From the latest state: moves nodes of lost cells back until nothing is lost, and certifies the outcome.
  void put_back_lost();
  /// From best_.positions and the positions of free nodes in the kept and in the latest state; false if there are too
  /// few or too many.
  bool restore(const std::vector<double>& kept, const std::vector<double>& latest);
  void count();
  void write_unrepairable();

  /// A state that a run would have ended with.
  struct Ending {
    std::vector<double> positions;  ///< Of the free nodes, as free_positions(); empty: there is none.
    std::vector<Certificate> certificates;
    Merit merit;
  };

  const HighOrderMesh& mesh_;
  Problem& problem_;
  const Certifier& certifier_;
  const Team& team_;
  const Ranks& ranks_;
  NodeConversion conversion_;
  std::vector<const std::int32_t*> cell_nodes_;  ///< By cell of the mesh.
  std::vector<int> cell_size_;
  std::vector<char> free_;             ///< By node.
  std::vector<char> unrepairable_;     ///< By cell: in an unrepairable group.
  std::vector<char> beyond_repair_;    ///< By cell: in a group that is beyond repair.
  UntouchedVector<double> positions_;  ///< The kept state.
  std::vector<Certificate> certificates_;
  std::int64_t kept_uncertified_ = 0;
  Ending best_;  ///< Has fewer uncertified cells than the kept state.
  bool kept_is_latest_ = true;
  UntouchedVector<double> latest_positions_;  ///< The state that was certified last.
  UntouchedVector<double> latest_coordinates_;
  std::vector<Certificate> latest_certificates_;
  std::vector<std::int32_t>
      unfinished_;  ///< Cells whose latest coordinates and certificates an interruption has spoilt.
  std::vector<std::int32_t> lost_;
  std::int64_t uncertified_ = 0, repairable_ = 0;
  double seconds_ = 0;
};

}  // namespace varimesh
