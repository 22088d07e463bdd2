// Places the nodes of a mesh where the curves of a Nektar++ file say. Internal to core/formats.
#pragma once

#include <Eigen/Core>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/formats/mfem/topology.h"
#include "core/formats/nektar/blending.h"
#include "core/formats/nektar/file.h"

namespace varimesh::formats {

/// A cell of a file: its vertices and the first node inside it.
struct NektarCell {
  std::span<const std::int32_t> vertices;
  std::int32_t interior = 0;
};

// === Points that are read one after another ==============================================================

/// The node that each point of the file places: a node; kNoNode: none; kMeets − node: a node that it must meet.
struct NektarPointNodes {
  static constexpr std::int32_t kNoNode = -1, kMeets = -2;
  std::vector<std::int32_t> nodes;
  std::vector<bool> placed;  ///< By node: whether a point places it.
};

/// Finds them, for files whose curves have evenly spaced points of the mesh's order, as most files have. Nothing if the
/// points must be in memory. `nodes`: of the mesh; `cell_of(element)`: for 2-D. Throws ReadFailure if a curve is of an
/// edge that is not there, or if only some curves have points of their own.
std::optional<NektarPointNodes> nektar_point_nodes(const NektarFile& file, const NektarCorners& corners,
                                                   const MfemTopology& topology, int order, std::size_t nodes,
                                                   const std::function<NektarCell(std::int32_t element)>& cell_of,
                                                   FileAllowance& allowance);

/// Reads the points and places their nodes. The vertices and the nodes on straight edges must be in place. Returns
/// false if a point does not meet its node to within rounding. Throws ReadFailure. Call it inside team.run().
bool place_nektar_points(const NektarFile& file, const NektarPointNodes& points, HighOrderMesh& mesh,
                         FileAllowance& allowance, const Team& team);

/// Places the nodes of edges that are straight: those that no point places. `nodes`: of a cell.
void place_straight_edges(Shape shape, std::span<const std::int32_t> nodes, const std::vector<bool>& placed,
                          HighOrderMesh& mesh);

// === Points in memory ====================================================================================

/// Places the nodes of curves of any kind, whose points the file has in memory.
class NektarPlacing {
 public:
  NektarPlacing(const NektarFile& file, HighOrderMesh& mesh) : file_(file), mesh_(mesh) {}

  /// Places the inner nodes of a curved edge or face, whose vertices and, if it is a face, edges are in place. Throws
  /// ReadFailure if the curve does not meet them.
  void place_curve(Shape shape, const NektarCurve& curve, std::span<const std::int32_t> nodes);
  void place_edges(const MfemTopology& topology);
  /// Places the curved faces.
  void place_faces(const NektarCorners& corners, const MfemTopology& topology, std::vector<bool>& placed);

 private:
  [[noreturn]] void fail(const std::string& what) const;
  Eigen::Map<Eigen::RowVector3d> at(std::int32_t node) {
    return Eigen::Map<Eigen::RowVector3d>(mesh_.coordinates.data() + 3 * std::ptrdiff_t(node));
  }
  const Eigen::MatrixXd& to_nodes(Shape shape, int degree, NektarPoints points);

  const NektarFile& file_;
  HighOrderMesh& mesh_;
  std::map<std::tuple<Shape, int, NektarPoints>, Eigen::MatrixXd> to_nodes_;
};

/// The degree of a curve with this many points; 0 if there is none. `shape`: a line, or the shape of a face.
int nektar_degree(Shape shape, std::int64_t points);

/// Places nodes that follow from those on the boundary of their cell or face. One thread at a time.
class NektarBlender {
 public:
  explicit NektarBlender(HighOrderMesh& mesh) : mesh_(mesh) {}
  void blend(const NektarBlending& blending, std::span<const std::int32_t> nodes);
  /// Whether the boundary that was blended last needs functions that VariMesh's cell does not have.
  bool leaves_space(const NektarBlending& blending) const;

 private:
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  HighOrderMesh& mesh_;
  Columns known_, found_;
};

// === Faults ==============================================================================================

/// Keeps the first fault of a loop that threads share. They may find faults in any order, and a fault that left the
/// loop would be that of the fastest thread.
class FirstFault {
 public:
  /// Calls body(). If it throws a ReadFailure, keeps it with this index.
  template <class Body>
  void guard(std::size_t index, const Body& body) {
    try {
      body();
    } catch (ReadFailure& failure) {
      const std::lock_guard lock(mutex_);
      if (first_ && first_->first < index) return;
      first_.emplace(index, std::move(failure));
    }
  }

  /// After the loop: throws the fault with the smallest index, if there is one.
  void throw_it() const {
    if (first_) throw ReadFailure(first_->second);
  }

 private:
  std::mutex mutex_;
  std::optional<std::pair<std::size_t, ReadFailure>> first_;
};

}  // namespace varimesh::formats
