// A patch of cells whose smallest scaled Jacobian is raised.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/reference/shape.h"
#include "core/solvers/maxmin/sample_table.h"

namespace varimesh {

/// Solves: over the free nodes of the patch, raise the smallest level of its cells.
///
/// The level of a cell at a sample i is y_i = J_i / M, with M = (mean_i |J_i|⁸)^(1/8) a smooth stand-in for the largest
/// J. A step goes to the nodes x + dx with the greatest
///
///     min_i (y_i + ∇y_i · dx) − ρ/2 Σ_n |dx_n|² / h_n²,
///
/// where i runs over the samples of all cells with a low level, n over the free nodes, and h_n is the shortest edge
/// of the cells around node n. This is the proximal form of the Gauss–Newton method for the minimum of smooth functions
/// (J. V. Burke, Descent methods for composite nondifferentiable optimization problems, Math. Programming 33, 1985).
/// Its dual is a quadratic program on the unit simplex. ρ falls after good steps and rises after bad ones; only steps
/// that raise the minimum are taken.
///
/// Unlike the barrier of untangling, it looks at values of J, not at its Bernstein coefficients: in a cell that is bent
/// as much as its boundary asks, some coefficients are negative although J is positive.
class MaxMinPatch {
 public:
  struct Cell {
    std::int32_t number = 0;  ///< In the mesh.
    Shape shape = Shape::Triangle;
    std::span<const std::int32_t> nodes;
    const SampleTable* samples = nullptr;  ///< At the uniform lattice of 2 P + 2 intervals, or a finer one.
    /// Its level counts as this much higher. A cell that has reached its limit elsewhere so does not hold the others.
    double shift = 0;
    std::vector<int> local;  ///< The free nodes by their number in the cell, and
    std::vector<int> place;  ///< by their place in free_nodes(). Set by the constructor.
  };

  /// `free_nodes` ascending, by their number in the mesh. `coordinates` as in HighOrderMesh::coordinates.
  MaxMinPatch(std::vector<Cell> cells, std::vector<std::int32_t> free_nodes, int dimension,
              const std::vector<double>& coordinates);

  /// What raise() came to, by cell.
  struct Levels {
    std::vector<double> level;            ///< Without the shift.
    std::vector<double> scaled_jacobian;  ///< min J / max J at the samples.
    double smallest = 0;                  ///< Of the levels with their shifts.
    std::int64_t looks = 0;               ///< How often the samples of a cell were computed.
  };

  /// Moves the free nodes in `coordinates` until every cell without a shift has the scaled Jacobian `aim` at its
  /// samples, or no step raises the smallest level. Call it inside team.run(). The result does not depend on the number
  /// of threads. If the team's token interrupts it, the coordinates are those after some step.
  Levels raise(std::vector<double>& coordinates, double aim, const Team& team);

  /// The levels at these coordinates.
  Levels look_at_cells(const std::vector<double>& coordinates, const Team& team) const;

  /// Those with at least one free node, in the order given.
  const std::vector<Cell>& cells() const { return cells_; }
  const std::vector<std::int32_t>& free_nodes() const { return free_; }

 private:
  /// A cell at some coordinates.
  struct Seen {
    Eigen::VectorXd jacobian;
    double norm = 1;  ///< M.
    double level = 0, scaled_jacobian = 0;
  };
  /// How the levels of some samples of one cell change with z = dx / h of its free nodes.
  struct Slopes {
    Eigen::Index first = 0;  ///< The row of the first sample.
    Eigen::MatrixXd rows;    ///< samples × (dimension · free nodes of the cell)
  };
  /// Samples with a low level, and how their levels change: a matrix A of size rows × (dimension · free nodes), whose
  /// entries are zero but for the nodes of each row's cell.
  struct Rows {
    Eigen::VectorXd level;           ///< With the shifts.
    std::vector<Slopes> slopes;      ///< By cell.
    std::vector<std::int32_t> cell;  ///< By row.
  };
  Eigen::VectorXd times(const Rows& rows, const Eigen::VectorXd& z) const;                   ///< A z
  Eigen::VectorXd transposed_times(const Rows& rows, const Eigen::VectorXd& weights) const;  ///< Aᵀ w
  Eigen::VectorXd column(const Rows& rows, Eigen::Index row) const;                          ///< Of A Aᵀ.
  /// [direction][component][padded point]
  using ByPoint = std::vector<double>;

  void differentiate(const Cell& cell, const std::vector<double>& coordinates, ByPoint& derivatives) const;
  /// Of the derivatives: ∂J/∂F.
  void find_cofactors(const ByPoint& derivatives, ByPoint& cofactors) const;
  Seen look(const Cell& cell, const std::vector<double>& coordinates) const;
  /// Looks at all cells and returns their smallest level.
  double look_at_all(const std::vector<double>& coordinates, std::vector<Seen>& seen, const Team& team) const;
  static Levels levels(const std::vector<Seen>& seen, double smallest);
  bool is_reached(const std::vector<Seen>& seen, double aim) const;
  Rows rows(const std::vector<double>& coordinates, const std::vector<Seen>& seen, double smallest,
            const Team& team) const;
  void fill_rows(const Cell& cell, const Seen& seen, const std::vector<Eigen::Index>& samples,
                 const std::vector<double>& coordinates, Slopes& slopes, Rows& rows) const;
  void move(const Eigen::VectorXd& z, const std::vector<double>& from, std::vector<double>& to) const;

  std::vector<Cell> cells_;
  std::vector<std::int32_t> free_;
  std::vector<double> size_;  ///< h by free node.
  int dimension_;
};

}  // namespace varimesh
