// Reads the nodes of MFEM's meshes, and converts them to equispaced nodes.
#include <algorithm>
#include <cmath>

#include "core/formats/common/pieces.h"
#include "core/formats/mfem/read.h"
#include "core/formats/mfem/topology.h"
#include "core/formats/numbering/node_order.h"

namespace varimesh::formats {

namespace {

/// The cells of the mesh: blocks that have its dimension.
bool has_cells(const HighOrderMesh& mesh, const ElementBlock& block) {
  return reference::info(block.shape).dimension == mesh.dimension;
}

/// The elements have only their vertices until then.
MfemTopology topology_of(const MfemReading& reading) {
  const Cells cells(reading.mesh, reading.mesh.dimension);
  const auto vertices_of = [](Shape, std::span<const std::int32_t> nodes) {
    std::array<std::int32_t, 8> vertices{};
    std::copy(nodes.begin(), nodes.end(), vertices.begin());
    return vertices;
  };
  return MfemTopology(reading.mesh.dimension, reading.nodes.space.order, reading.vertices,
                      topology_cells(cells, vertices_of), reading.team, &reading.scanner);
}

/// The numbers of inner things of cells, summed up: MFEM's degrees of freedom, and nodes of the mesh.
struct Interiors {
  std::int64_t dofs = 0, nodes = 0;
};

Interiors count_interiors(const MfemReading& reading) {
  Interiors sum;
  for (const ElementBlock& block : reading.mesh.blocks) {
    if (!has_cells(reading.mesh, block)) continue;
    sum.dofs += std::int64_t(block.size()) * mfem_interior_count(reading.nodes.space, block.shape);
    sum.nodes += std::int64_t(block.size()) * inner_node_count(block.shape, reading.nodes.space.order);
  }
  return sum;
}

/// Gives every element its nodes in place of its vertices.
void set_element_nodes(MfemReading& reading, const MfemTopology& topology) {
  const int order = reading.nodes.space.order;
  std::int64_t interior = topology.interior_first();
  for (ElementBlock& block : reading.mesh.blocks) {
    const bool cells = has_cells(reading.mesh, block);
    const auto vertices = std::size_t(reference::info(block.shape).vertices);
    const auto count = std::size_t(reference::node_count(block.shape, order));
    const int inner = cells ? inner_node_count(block.shape, order) : 0;
    std::vector<std::int32_t> nodes;
    reading.scanner.reserve(nodes, block.size() * count);
    nodes.resize(block.size() * count);
    const auto is_lost = [&](std::size_t e) {
      return !topology.find_nodes(block.shape, {block.nodes.data() + e * vertices, vertices},
                                  std::int32_t(interior + std::int64_t(e) * inner), {nodes.data() + e * count, count});
    };
    if (const std::size_t lost = first_of(reading.team, block.size(), 1024, is_lost); lost < block.size())
      reading.scanner.fail("boundary element " + std::to_string(block.numbers[lost]) +
                           " (counted from 1, after the elements) is on no element of the mesh");
    interior += std::int64_t(block.size()) * inner;
    reading.scanner.allowance->give_back(block.nodes.capacity() * sizeof block.nodes[0]);
    block.nodes = std::move(nodes);
    block.order = order;
  }
}

// === Continuous spaces ===================================================================================

void read_values(MfemReading& reading, std::int64_t dofs) {
  Scanner& scan = reading.scanner;
  std::vector<double>& x = reading.mesh.coordinates;
  const auto components = std::size_t(reading.nodes.components);
  if (std::size_t(dofs) * components > scan.left()) scan.fail_truncated("the coordinates of all nodes");
  scan.reserve(x, 3 * std::size_t(dofs));
  x.assign(3 * std::size_t(dofs), 0.0);
  const std::size_t count = std::size_t(dofs) * components;
  std::size_t read_so_far = 0, node = 0, component = 0;
  const auto put = [&](double value) {
    x[3 * node + component] = value;
    ++read_so_far;
    if (reading.nodes.by_nodes) {
      if (++node == std::size_t(dofs)) node = 0, ++component;
    } else {
      if (++component == components) component = 0, ++node;
    }
  };
  const auto parse = [](const BytesPiece&, Scanner& from) {
    std::vector<double> read;
    const auto name = [] { return std::string("a node"); };  // the piece is read again for its number
    for (from.skip_space(); !from.at_end(); from.skip_space())
      read.push_back(from.finite(from.number("a node's coordinate"), name));
    return read;
  };
  const auto take = [&](const BytesPiece&, const std::vector<double>& read) {
    if (read.size() > count - read_so_far) return false;
    for (const double value : read) put(value);
    return true;
  };
  // A line has one number, or all components of a node.
  read_in_pieces(scan, reading.team, RecordCutter(scan, reading.nodes.by_nodes ? std::int64_t(count) : dofs, 0), parse,
                 take);
  const auto name = [&] { return "degree of freedom " + std::to_string(node) + " (counted from 0)"; };
  while (read_so_far < count) put(scan.finite(scan.number("a node's coordinate"), name));
}

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Converts degrees of freedom to nodes in place: first inside the cells, then inside faces, then inside edges, because
/// each step needs the degrees of freedom on the boundary of what it converts.
class InPlace {
 public:
  InPlace(const MfemReading& reading, std::vector<double>& x) : reading_(reading), space_(reading.nodes.space), x_(x) {
    for (const ElementBlock& block : reading.mesh.blocks) {
      if (!has_cells(reading.mesh, block)) continue;
      know(block.shape);
      for (const reference::Facet& face : faces_of(Sides::Mfem, block.shape)) know(face.shape);
    }
    know(Shape::Line);
  }

  /// `dofs`: the first degree of freedom inside the cells.
  void convert_cells(std::int64_t dofs) {
    for_each_cell([&](const ElementBlock& block, std::size_t e, std::span<const std::int32_t> nodes) {
      const MfemConversion& conversion = *conversions_[std::size_t(block.shape)];
      const Eigen::Index inner = mfem_interior_count(space_, block.shape), made = conversion.to_nodes.rows();
      if (inner == 0) return;
      known_.resize(conversion.to_nodes.cols(), 3);
      Columns& known = known_;
      for (Eigen::Index i = 0; i < known.rows() - inner; ++i) known.row(i) = at(nodes[std::size_t(i)]);
      for (Eigen::Index i = 0; i < inner; ++i) known.row(known.rows() - inner + i) = at(std::int32_t(dofs + i));
      if (conversion.left.size() > 0) check_left(conversion, known, block.numbers[e]);
      found_.noalias() = conversion.to_nodes * known;
      for (Eigen::Index i = 0; i < made; ++i) at(std::int32_t(dofs + i)) = found_.row(i);
      dofs += inner;
    });
  }

  void convert_faces() {
    if (copies(Shape::Triangle) && copies(Shape::Quadrilateral)) return;
    std::vector<bool> done(x_.size() / 3, false);
    for_each_cell([&](const ElementBlock& block, std::size_t, std::span<const std::int32_t> nodes) {
      const auto faces = faces_of(Sides::Mfem, block.shape);
      const MfemLocalNodes& local = *local_[std::size_t(block.shape)];
      for (std::size_t f = 0; f < faces.size(); ++f) convert_part(faces[f].shape, local.whole_faces[f], nodes, done);
    });
  }

  void convert_edges() {
    if (copies(Shape::Line)) return;
    std::vector<bool> done(x_.size() / 3, false);
    for_each_cell([&](const ElementBlock& block, std::size_t, std::span<const std::int32_t> nodes) {
      const auto edges = edges_of(Sides::Mfem, block.shape);
      const MfemLocalNodes& local = *local_[std::size_t(block.shape)];
      std::vector<int> whole;
      for (std::size_t e = 0; e < edges.size(); ++e) {
        if (space_.order == 1 || done[std::size_t(nodes[std::size_t(local.edges[e][0])])]) continue;
        whole = {edges[e][0], edges[e][1]};
        whole.insert(whole.end(), local.edges[e].begin(), local.edges[e].end());
        convert_part(Shape::Line, whole, nodes, done);
      }
    });
  }

  /// Moves the nodes inside cells to where the mesh has them: pyramids have fewer nodes than degrees of freedom.
  void close_gaps(std::int64_t dofs) {
    std::int64_t to = dofs;
    for_each_cell([&](const ElementBlock& block, std::size_t, std::span<const std::int32_t>) {
      const int nodes = inner_node_count(block.shape, space_.order);
      std::copy_n(x_.begin() + 3 * dofs, 3 * nodes, x_.begin() + 3 * to);
      to += nodes;
      dofs += mfem_interior_count(space_, block.shape);
    });
    x_.resize(std::size_t(3 * to));
  }

 private:
  template <class Body>
  void for_each_cell(const Body& body) {
    for (const ElementBlock& block : reading_.mesh.blocks) {
      if (!has_cells(reading_.mesh, block)) continue;
      const auto count = std::size_t(reference::node_count(block.shape, space_.order));
      for (std::size_t e = 0; e < block.size(); ++e) {
        reading_.scanner.look();
        body(block, e, std::span(block.nodes.data() + e * count, count));
      }
    }
  }

  Eigen::Map<Eigen::RowVector3d> at(std::int32_t node) {
    return Eigen::Map<Eigen::RowVector3d>(x_.data() + 3 * std::ptrdiff_t(node));
  }

  /// Converts what is inside an edge or face whose nodes, in Gmsh's order, are those `local` numbers of the cell.
  void convert_part(Shape shape, const std::vector<int>& local, std::span<const std::int32_t> nodes,
                    std::vector<bool>& done) {
    const MfemConversion& conversion = *conversions_[std::size_t(shape)];
    const auto inner = std::size_t(conversion.to_nodes.rows()), boundary = local.size() - inner;
    if (inner == 0 || done[std::size_t(nodes[std::size_t(local[boundary])])]) return;
    const std::vector<int>& in_file_order = *file_order_[std::size_t(shape)];
    known_.resize(Eigen::Index(local.size()), 3);
    for (std::size_t i = 0; i < local.size(); ++i) {
      const auto own = i < boundary ? i : std::size_t(in_file_order[i]);
      known_.row(Eigen::Index(i)) = at(nodes[std::size_t(local[own])]);
    }
    found_.noalias() = conversion.to_nodes * known_;
    for (std::size_t i = 0; i < inner; ++i) {
      const std::int32_t node = nodes[std::size_t(local[boundary + i])];
      at(node) = found_.row(Eigen::Index(i));
      done[std::size_t(node)] = true;
    }
  }

  void check_left(const MfemConversion& conversion, const Columns& known, std::int64_t number) const {
    constexpr double kRounding = 1e-9;
    const double size = (known.colwise().maxCoeff() - known.colwise().minCoeff()).maxCoeff();
    if ((conversion.left * known).lpNorm<Eigen::Infinity>() <= kRounding * size) return;
    reading_.scanner.fail("pyramid " + std::to_string(number) +
                          " (counted from 1) is curved inside in a way that pyramids of VariMesh cannot take, because "
                          "MFEM's have more nodes; give VariMesh the mesh before MFEM curved it");
  }

  /// Looks up what all cells of a shape share.
  void know(Shape shape) {
    conversions_[std::size_t(shape)] = &mfem_conversion(space_, shape);
    local_[std::size_t(shape)] = &mfem_local_nodes(shape, space_.order);
    file_order_[std::size_t(shape)] = &gmsh_nodes(NodeOrder::Mfem, shape, space_.order);
  }

  /// Whether every degree of freedom inside an edge or face of this shape is the node that has its place already.
  bool copies(Shape shape) const {
    const MfemConversion* conversion = conversions_[std::size_t(shape)];
    if (conversion == nullptr) return true;  // the mesh has none
    const Eigen::MatrixXd& matrix = conversion->to_nodes;
    const std::vector<int>& order = *file_order_[std::size_t(shape)];
    const Eigen::Index boundary = matrix.cols() - matrix.rows();
    for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
      Eigen::Index column = 0;
      if (matrix.row(row).maxCoeff(&column) != 1 || matrix.row(row).cwiseAbs().sum() != 1) return false;
      if (column < boundary || order[std::size_t(column)] != boundary + row) return false;
    }
    return true;
  }

  const MfemReading& reading_;
  const MfemSpace& space_;
  std::vector<double>& x_;
  std::array<const MfemConversion*, kShapes> conversions_{};
  std::array<const MfemLocalNodes*, kShapes> local_{};
  std::array<const std::vector<int>*, kShapes> file_order_{};
  Columns known_, found_;  // kept, so that cells need no allocation of their own
};

void read_continuous(MfemReading& reading, const MfemTopology& topology) {
  const Interiors interiors = count_interiors(reading);
  const std::int64_t first = topology.interior_first(), dofs = first + interiors.dofs;
  if (dofs > kMostNodes)
    reading.scanner.fail("the mesh has " + std::to_string(dofs) + " nodes, more than VariMesh takes");
  read_values(reading, dofs);
  set_element_nodes(reading, topology);
  std::vector<double> x = std::move(reading.mesh.coordinates);
  InPlace in_place(reading, x);
  in_place.convert_cells(first);
  if (reading.mesh.dimension == 3) in_place.convert_faces();
  in_place.convert_edges();
  if (interiors.nodes != interiors.dofs) in_place.close_gaps(first);
  reading.mesh.coordinates = std::move(x);
}

// === Discontinuous spaces ================================================================================

/// Thrown if cells with a common vertex, edge or face are at different places.
struct Apart {};

/// Collects the nodes that cells have in common, and finds cells that do not agree on one.
class Joining {
 public:
  Joining(MfemReading& reading, std::size_t nodes) : x_(reading.mesh.coordinates), known_(3 * nodes, false) {
    reading.scanner.reserve(x_, 3 * nodes);
    x_.assign(3 * nodes, 0.0);
  }

  /// Takes component c of the nodes of a cell. Throws Apart.
  void take(std::size_t c, std::span<const std::int32_t> nodes, const Eigen::VectorXd& values) {
    const double size = values.maxCoeff() - values.minCoeff();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const std::size_t at = 3 * std::size_t(nodes[i]) + c;
      const double value = values(Eigen::Index(i));
      if (!known_[at]) x_[at] = value;
      known_[at] = true;
      if (!is_one_place(x_[at], value, size)) throw Apart();
    }
  }

 private:
  std::vector<double>& x_;
  std::vector<bool> known_;
};

/// Reads the nodes of all cells, and calls take(component, block, element, values of its nodes).
template <class Take>
void for_cell_values(MfemReading& reading, const Take& take) {
  Scanner& scan = reading.scanner;
  const auto components = std::size_t(reading.nodes.components);
  // By nodes: one pass over the cells per component. Otherwise one pass for all.
  const std::size_t passes = reading.nodes.by_nodes ? components : 1, together = components / passes;
  for (std::size_t pass = 0; pass < passes; ++pass)
    for (const ElementBlock& block : reading.mesh.blocks) {
      if (!has_cells(reading.mesh, block)) continue;
      const MfemConversion& conversion = mfem_conversion(reading.nodes.space, block.shape);
      const Eigen::Index n = conversion.to_nodes.cols();
      Eigen::MatrixXd values(n, Eigen::Index(together));
      for (std::size_t e = 0; e < block.size(); ++e) {
        scan.look();
        const auto name = [&] { return "a node of element " + std::to_string(block.numbers[e]); };
        for (Eigen::Index i = 0; i < n; ++i)
          for (Eigen::Index c = 0; c < values.cols(); ++c)
            values(i, c) = scan.finite(scan.number("a node's coordinate"), name);
        const Eigen::MatrixXd found = conversion.to_nodes * values;
        for (std::size_t c = 0; c < together; ++c) take(pass + c, block, e, found.col(Eigen::Index(c)));
      }
    }
}

/// Reads the nodes again, each cell's for itself, and cuts the mesh open where cells are apart.
void read_apart(MfemReading& reading) {
  std::vector<std::size_t> first;  // of the nodes of each block
  std::size_t count = 0;
  for (const ElementBlock& block : reading.mesh.blocks) {
    first.push_back(count);
    if (has_cells(reading.mesh, block)) count += block.nodes.size();
  }
  std::vector<double> places;
  reading.scanner.reserve(places, 3 * count);
  places.assign(3 * count, 0.0);
  for_cell_values(reading, [&](std::size_t c, const ElementBlock& block, std::size_t e, const Eigen::VectorXd& values) {
    const auto of_block = first[std::size_t(&block - reading.mesh.blocks.data())];
    const auto n = std::size_t(values.size());
    for (std::size_t i = 0; i < n; ++i) places[3 * (of_block + e * n + i) + c] = values(Eigen::Index(i));
  });
  cut_open(reading, places);
}

void read_discontinuous(MfemReading& reading, const MfemTopology& topology) {
  const Interiors interiors = count_interiors(reading);
  const std::int64_t count = topology.interior_first() + interiors.nodes;
  if (count > kMostNodes)
    reading.scanner.fail("the mesh has " + std::to_string(count) + " nodes, more than VariMesh takes");
  Scanner& scan = reading.scanner;
  if (std::size_t(interiors.dofs) * std::size_t(reading.nodes.components) > scan.left())
    scan.fail_truncated("the coordinates of all nodes");
  set_element_nodes(reading, topology);
  const std::size_t begin = scan.offset();
  try {
    Joining joining(reading, std::size_t(count));
    for_cell_values(reading,
                    [&](std::size_t c, const ElementBlock& block, std::size_t e, const Eigen::VectorXd& values) {
                      const auto n = std::size_t(values.size());
                      joining.take(c, {block.nodes.data() + e * n, n}, values);
                    });
  } catch (const Apart&) {
    scan.go_to(begin);
    read_apart(reading);
  }
}

}  // namespace

void read_mfem_nodes(MfemReading& reading) {
  const MfemSpace& space = reading.nodes.space;
  for (const ElementBlock& block : reading.mesh.blocks)
    if (const std::string why = why_not_in_space(space, block.shape); has_cells(reading.mesh, block) && !why.empty())
      reading.scanner.fail(why);
  reading.mesh.order = space.order;
  const MfemTopology topology = topology_of(reading);
  if (space.continuous)
    read_continuous(reading, topology);
  else
    read_discontinuous(reading, topology);
}

}  // namespace varimesh::formats
