// One mesh before and after: the same cells, found by their numbers, with two sets of coordinates and qualities.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/quality.h"

namespace varimesh::client {

/// A mesh that a report shows, with the quality of its cells.
struct Stage {
  std::shared_ptr<const HighOrderMesh> mesh;
  std::vector<std::int32_t> order;      ///< Which of its cells is cell c of the first stage.
  std::vector<double> scaled_jacobian;  ///< By the cells of the first stage.
};

/// One mesh, or two of the same cells.
class Stages {
 public:
  /// `after` may be null. Errors: BadInput where a mesh cannot be judged, or the two do not have the same cells.
  static Expected<Stages> create(std::shared_ptr<const HighOrderMesh> before,
                                 std::shared_ptr<const HighOrderMesh> after);

  std::size_t count() const { return stages_.size(); }
  const Stage& operator[](std::size_t stage) const { return stages_[stage]; }
  /// "before" and "after", or "before" alone.
  static const char* name(std::size_t stage) { return stage == 0 ? "before" : "after"; }

  const HighOrderMesh& mesh() const { return *stages_[0].mesh; }
  const Cells& cells() const { return cells_[0]; }
  /// x y z of node `local` of cell `cell`, in a stage.
  std::array<double, 3> point(std::size_t stage, std::size_t cell, int local) const;
  /// Mean of the cell's nodes: in a curved cell, unlike that of its vertices, mostly inside it.
  std::array<double, 3> middle(std::size_t stage, std::size_t cell) const;
  /// The longest distance from the cell's first node to another of its nodes.
  double size(std::size_t stage, std::size_t cell) const;
  /// Middle of the box round the first mesh: what positions are told relative to, so that single precision suffices.
  const std::array<double, 3>& centre() const { return centre_; }
  const std::array<double, 6>& box() const { return box_; }
  /// The cells with the smallest Js in a stage, worst first.
  std::vector<std::int32_t> worst(std::size_t stage, std::size_t most) const;

 private:
  std::vector<Stage> stages_;
  std::vector<Cells> cells_;
  std::array<double, 3> centre_{};
  std::array<double, 6> box_{};
};

}  // namespace varimesh::client
