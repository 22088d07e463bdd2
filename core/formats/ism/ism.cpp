#include "core/formats/ism/ism.h"

#include <Eigen/Core>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>

#include "core/base/io/scanner.h"
#include "core/base/io/text.h"
#include "core/formats/common/file_allowance.h"
#include "core/formats/common/format.h"
#include "core/formats/mfem/space.h"
#include "core/formats/mfem/topology.h"
#include "core/formats/nektar/blending.h"
#include "core/formats/numbering/node_order.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

constexpr std::string_view kNoName = "---";

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    while (!line.empty() && is_space(line.front())) line.remove_prefix(1);
    if (line.empty()) return words;
    std::size_t length = 0;
    while (length < line.size() && !is_space(line[length])) ++length;
    words.push_back(line.substr(0, length));
    line.remove_prefix(length);
  }
}

/// Whether the word is a whole number from 0 on.
bool is_count(std::string_view word) {
  return !word.empty() && word.size() < 10 && word.find_first_not_of("0123456789") == std::string_view::npos;
}

bool is_number(std::string_view word) {
  double value = 0;
  if (word.starts_with('+')) word.remove_prefix(1);
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && stop == word.data() + word.size();
}

/// Values at equispaced nodes of a line from those at Chebyshev–Lobatto points: row and column 0 and `order` are the
/// ends.
Eigen::MatrixXd from_chebyshev(int order) {
  Eigen::VectorXd points(order + 1);
  for (int j = 0; j <= order; ++j) points(j) = (1 - std::cos(j * std::numbers::pi / order)) / 2;
  Eigen::MatrixXd matrix(order + 1, order + 1);
  for (int i = 0; i <= order; ++i)
    for (int j = 0; j <= order; ++j) {
      double value = 1;
      const double at = i == order ? points(order) : double(i) / order;
      for (int k = 0; k <= order; ++k)
        if (k != j) value *= (at - points(k)) / (points(j) - points(k));
      matrix(i, j) = value;
    }
  return matrix;
}

struct Element {
  std::array<std::int32_t, 8> vertices{};
  std::array<std::int64_t, 6> curve{};  ///< The first point of each side in the list of points; −1 if it is straight.
  std::array<int, 6> name{};            ///< Tags of the sides' groups; 0 for none.
  int material = 0;
};

class Reading {
 public:
  Reading(std::string_view bytes, const StopToken* stop) : scan_(bytes), allowance_(bytes.size(), stop) {}

  HighOrderMesh take() {
    header();
    nodes();
    for (std::int64_t k = 0; k < edges_; ++k)
      for (int i = 0; i < 6; ++i) (void)scan_.text_integer("a number of an edge");
    if (edges_ > 0) scan_.line();
    for (std::int64_t e = 0; e < count_; ++e) element();
    scan_.skip_space();
    if (!scan_.at_end()) scan_.fail("something follows the last element");
    place();
    return std::move(mesh_);
  }

 private:
  // === The file ==========================================================================================

  void header() {
    std::string_view first = scan_.line();
    const bool versioned = first.starts_with("ISM");
    const bool has_edges = first == "ISM-V2" || first == "ISM-MM";
    if (versioned && !has_edges && first != "ISM") scan_.fail("the version is not ISM, ISM-V2 or ISM-MM");
    if (versioned) first = scan_.line();
    const std::vector<std::string_view> words = words_of(first);
    if (words.size() != (has_edges ? 4U : 3U) || !std::all_of(words.begin(), words.end(), is_count))
      scan_.fail("the numbers of nodes, " + std::string(has_edges ? "edges, " : "") +
                 "elements and the polynomial order were expected");
    std::vector<std::int64_t> numbers;
    for (const std::string_view word : words) numbers.push_back(std::stoll(std::string(word)));
    vertices_ = numbers[0];
    edges_ = has_edges ? numbers[1] : 0;
    count_ = numbers[numbers.size() - 2];
    mesh_.order = int(numbers.back());
    if (mesh_.order < 1 || mesh_.order > kMaxOrder)
      scan_.fail("the polynomial order is " + std::to_string(mesh_.order) + "; VariMesh takes 1 to " +
                 std::to_string(kMaxOrder));
    // A node has three numbers, an edge six, and an element at least twelve words.
    if (6 * vertices_ + 12 * edges_ + 24 * count_ > std::int64_t(scan_.left()) + 2)
      scan_.fail_truncated("everything that the first numbers announce");
  }

  void nodes() {
    allowance_.take(std::size_t(vertices_), 3 * sizeof(double));
    const auto name = [&] { return "node " + std::to_string(corners_.size() / 3 + 1); };
    for (std::int64_t k = 0; k < 3 * vertices_; ++k)
      corners_.push_back(scan_.finite(scan_.text_number("a node's coordinate"), name));
    scan_.line();
  }

  int tag(int dimension, std::string_view name) {
    if (name == kNoName) return 0;
    const auto [found, fresh] =
        tags_.try_emplace({dimension, std::string(name)}, int(mesh_.physical_groups.size()) + 1);
    if (fresh) mesh_.physical_groups.push_back({dimension, found->second, std::string(name)});
    return found->second;
  }

  void element() {
    allowance_.take(1, sizeof(Element));
    Element made;
    const std::vector<std::string_view> words = words_of(scan_.line());
    std::size_t corners = 0;
    while (corners < words.size() && is_count(words[corners])) ++corners;
    if (corners != 4 && corners != 8) {
      if (scan_.at_end()) scan_.fail_truncated("an element");
      scan_.fail("an element has " + std::to_string(corners) + " nodes; 4 or 8 were expected");
    }
    const Shape shape = corners == 4 ? Shape::Quadrilateral : Shape::Hexahedron;
    if (mesh_.dimension == 0) mesh_.dimension = reference::info(shape).dimension;
    if (reference::info(shape).dimension != mesh_.dimension) scan_.fail("elements of 4 and 8 nodes are mixed");
    for (std::size_t v = 0; v < corners; ++v) {
      const std::int64_t number = std::stoll(std::string(words[v]));
      if (number < 1 || number > vertices_)
        scan_.fail("an element refers to node " + std::to_string(number) + ", but the nodes are 1 to " +
                   std::to_string(vertices_));
      made.vertices[v] = std::int32_t(number - 1);
    }
    if (words.size() > corners) made.material = tag(mesh_.dimension, words[corners]);
    const std::size_t sides = faces_of(Sides::Ism, shape).size();
    std::array<bool, 6> curved{};
    for (std::size_t s = 0; s < sides; ++s) {
      const std::int64_t flag = scan_.text_integer("whether a side is curved");
      if (flag != 0 && flag != 1) scan_.fail("whether a side is curved must be 0 or 1");
      curved[s] = flag == 1;
    }
    const std::int64_t points = mesh_.dimension == 2 ? mesh_.order + 1 : (mesh_.order + 1) * (mesh_.order + 1);
    for (std::size_t s = 0; s < sides; ++s) {
      made.curve[s] = curved[s] ? std::int64_t(points_.size() / 3) : -1;
      if (!curved[s]) continue;
      allowance_.take(std::size_t(points), 3 * sizeof(double));
      const auto name = [] { return std::string("a point of a curved side"); };
      for (std::int64_t k = 0; k < 3 * points; ++k)
        points_.push_back(scan_.finite(scan_.text_number("a point of a curved side"), name));
    }
    scan_.line();
    const std::vector<std::string_view> names = words_of(scan_.line());
    if (names.size() != sides) {
      if (names.empty() && scan_.at_end()) scan_.fail_truncated("the names of an element's sides");
      scan_.fail("an element has " + std::to_string(names.size()) + " names of sides; it has " + std::to_string(sides) +
                 " sides");
    }
    for (std::size_t s = 0; s < sides; ++s) made.name[s] = tag(mesh_.dimension - 1, names[s]);
    elements_.push_back(made);
  }

  // === The mesh ==========================================================================================

  Shape shape() const { return mesh_.dimension == 2 ? Shape::Quadrilateral : Shape::Hexahedron; }
  std::span<const std::int32_t> vertices_of(const Element& element) const {
    return {element.vertices.data(), std::size_t(reference::info(shape()).vertices)};
  }
  std::array<std::int32_t, 4> vertices_of(const Element& element, const reference::Facet& side) const {
    std::array<std::int32_t, 4> own{};
    for (std::size_t v = 0; v < std::size_t(reference::info(side.shape).vertices); ++v)
      own[v] = element.vertices[std::size_t(side.vertices[v])];
    return own;
  }
  Eigen::Map<Eigen::RowVector3d> at(std::int32_t node) {
    return Eigen::Map<Eigen::RowVector3d>(mesh_.coordinates.data() + 3 * std::ptrdiff_t(node));
  }

  void place() {
    if (elements_.empty()) scan_.fail("it has no elements");
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      std::vector<std::int32_t> sorted(vertices_of(elements_[e]).begin(), vertices_of(elements_[e]).end());
      std::sort(sorted.begin(), sorted.end());
      if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
        scan_.fail("element " + std::to_string(e + 1) + " has the same node twice");
    }
    allowance_.take(elements_.size(), 500);  // the topology
    const auto visit = [&](std::size_t begin, std::size_t end, const TopologyCells::Body& body) {
      for (std::size_t e = begin; e < end; ++e) body(e, shape(), vertices_of(elements_[e]));
    };
    const MfemTopology topology(mesh_.dimension, mesh_.order, std::int32_t(vertices_), {elements_.size(), visit},
                                Team(1));
    const std::int64_t inner = inner_node_count(shape(), mesh_.order);
    const std::int64_t nodes = topology.interior_first() + inner * count_;
    if (nodes > kMostNodes) scan_.fail("it has " + std::to_string(nodes) + " nodes, more than VariMesh takes");
    const int per_element = reference::node_count(shape(), mesh_.order);
    allowance_.take(std::size_t(nodes), 3 * sizeof(double) + sizeof(std::int64_t) + 1);
    allowance_.take(elements_.size() * std::size_t(per_element), 2 * sizeof(std::int32_t));
    mesh_.coordinates = std::move(corners_);
    mesh_.coordinates.resize(3 * std::size_t(nodes));
    placed_.assign(std::size_t(nodes), false);
    for (std::int64_t node = 0; node < nodes; ++node) mesh_.node_numbers.push_back(node + 1);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(nodes)}};
    place_curved_sides(topology);
    place_the_rest(topology);
    make_blocks(topology);
  }

  void place_curved_sides(const MfemTopology& topology) {
    const Shape side_shape = mesh_.dimension == 2 ? Shape::Line : Shape::Quadrilateral;
    const std::vector<int>& order = gmsh_nodes(NodeOrder::Rows, side_shape, mesh_.order);
    const Eigen::MatrixXd line = from_chebyshev(mesh_.order);
    Eigen::MatrixXd matrix(Eigen::Index(order.size()), Eigen::Index(order.size()));
    const Eigen::Index n = mesh_.order + 1;
    for (Eigen::Index i = 0; i < matrix.rows(); ++i)
      for (Eigen::Index j = 0; j < matrix.cols(); ++j)
        matrix(order[std::size_t(i)], j) = mesh_.dimension == 2 ? line(i, j) : line(i % n, j % n) * line(i / n, j / n);
    std::vector<std::int32_t> nodes(order.size());
    for (std::size_t e = 0; e < elements_.size(); ++e)
      for (std::size_t s = 0; s < faces_of(Sides::Ism, shape()).size(); ++s) {
        if (elements_[e].curve[s] < 0) continue;
        const auto own = vertices_of(elements_[e], faces_of(Sides::Ism, shape())[s]);
        (void)topology.find_nodes(side_shape, {own.data(), std::size_t(reference::info(side_shape).vertices)}, 0,
                                  nodes);
        place_side(matrix, nodes, elements_[e].curve[s], e, s);
      }
  }

  void place_side(const Eigen::MatrixXd& matrix, const std::vector<std::int32_t>& nodes, std::int64_t first,
                  std::size_t element, std::size_t side) {
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> points(points_.data() + 3 * first,
                                                                                             matrix.cols(), 3);
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> found = matrix * points;
    // Files have at least six digits, of the coordinate and not of the side's size.
    constexpr double kOfSize = 1e-5, kOfCoordinate = 2e-6;
    const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
    const double most = std::max(kOfSize * size, kOfCoordinate * points.lpNorm<Eigen::Infinity>());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const auto node = std::size_t(nodes[i]);
      const bool known = placed_[node] || node < std::size_t(vertices_);
      if (known && !((found.row(Eigen::Index(i)) - at(nodes[i])).lpNorm<Eigen::Infinity>() <= most))
        scan_.fail("side " + std::to_string(side + 1) + " of element " + std::to_string(element + 1) +
                   " does not meet its nodes, or an element with which it shares an edge or face is elsewhere");
      if (!known) at(nodes[i]) = found.row(Eigen::Index(i));
      placed_[node] = true;
    }
  }

  /// Edges that are on no curved side are straight; faces and cells follow from their edges and faces.
  void place_the_rest(const MfemTopology& topology) {
    const int order = mesh_.order;
    std::vector<std::int32_t> nodes, part(std::size_t(order) + 1);
    std::int64_t interior = topology.interior_first();
    for (const Element& element : elements_) {
      for (const auto& [a, b] : reference::info(shape()).edges) {
        const std::array own = {element.vertices[std::size_t(a)], element.vertices[std::size_t(b)]};
        part.resize(std::size_t(order) + 1);
        (void)topology.find_nodes(Shape::Line, own, 0, part);
        if (order == 1 || placed_[std::size_t(part[2])]) continue;
        for (int k = 1; k < order; ++k) {
          at(part[std::size_t(k) + 1]) = at(own[0]) + (at(own[1]) - at(own[0])) * k / order;
          placed_[std::size_t(part[std::size_t(k) + 1])] = true;
        }
      }
      if (mesh_.dimension == 3)
        for (const reference::Facet& side : faces_of(Sides::Ism, shape())) {
          part.resize(std::size_t(reference::node_count(side.shape, order)));
          (void)topology.find_nodes(side.shape, vertices_of(element, side), 0, part);
          if (order > 1 && !placed_[std::size_t(part.back())]) blend(Shape::Quadrilateral, part);
        }
      nodes.resize(std::size_t(reference::node_count(shape(), order)));
      (void)topology.find_nodes(shape(), vertices_of(element), std::int32_t(interior), nodes);
      interior += inner_node_count(shape(), order);
      if (order > 1) blend(shape(), nodes);
    }
  }

  /// Transfinite interpolation.
  void blend(Shape of, const std::vector<std::int32_t>& nodes) {
    const Eigen::MatrixXd& inside = nektar_blending(of, mesh_.order).inside;
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> known(inside.cols(), 3);
    for (Eigen::Index i = 0; i < known.rows(); ++i) known.row(i) = at(nodes[std::size_t(i)]);
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> found = inside * known;
    for (Eigen::Index i = 0; i < found.rows(); ++i) {
      const std::int32_t node = nodes[std::size_t(known.rows() + i)];
      at(node) = found.row(i);
      placed_[std::size_t(node)] = true;
    }
  }

  void make_blocks(const MfemTopology& topology) {
    std::int64_t number = 0, interior = topology.interior_first();
    for (const Element& element : elements_) {
      add(topology, shape(), vertices_of(element), std::int32_t(interior), element.material, ++number);
      interior += inner_node_count(shape(), mesh_.order);
    }
    // Sides group by group, so that each group is one block. An inner side that has a name twice is one element.
    std::map<int, std::vector<std::pair<std::size_t, std::size_t>>> named;
    for (std::size_t e = 0; e < elements_.size(); ++e)
      for (std::size_t s = 0; s < faces_of(Sides::Ism, shape()).size(); ++s)
        if (elements_[e].name[s] != 0) named[elements_[e].name[s]].emplace_back(e, s);
    std::map<std::array<std::int32_t, 4>, int> seen;
    for (const auto& [tag, list] : named)
      for (const auto& [e, s] : list) {
        const reference::Facet& side = faces_of(Sides::Ism, shape())[s];
        const auto own = vertices_of(elements_[e], side);
        auto sorted = own;
        std::sort(sorted.begin(), sorted.end());
        allowance_.take(1, 100);
        if (!seen.try_emplace(sorted, tag).second) continue;
        add(topology, side.shape, {own.data(), std::size_t(reference::info(side.shape).vertices)}, 0, tag, ++number);
      }
  }

  void add(const MfemTopology& topology, Shape of, std::span<const std::int32_t> vertices, std::int32_t interior,
           int tag, std::int64_t number) {
    const int entity = std::max(tag, 1);
    const std::vector<int> groups = tag == 0 ? std::vector<int>() : std::vector<int>{tag};
    if (mesh_.blocks.empty() || mesh_.blocks.back().shape != of || mesh_.blocks.back().physical != groups) {
      allowance_.take(1, sizeof(ElementBlock));
      mesh_.blocks.push_back({of, mesh_.order, entity, groups, {}, {}, {}, {}});
    }
    ElementBlock& block = mesh_.blocks.back();
    block.numbers.push_back(number);
    const std::size_t first = block.nodes.size(), count = std::size_t(reference::node_count(of, mesh_.order));
    block.nodes.resize(first + count);
    (void)topology.find_nodes(of, vertices, interior, {block.nodes.data() + first, count});
  }

  Scanner scan_;
  FileAllowance allowance_;
  HighOrderMesh mesh_;
  std::int64_t vertices_ = 0, edges_ = 0, count_ = 0;
  std::vector<double> corners_, points_;
  std::vector<Element> elements_;
  std::map<std::pair<int, std::string>, int> tags_;
  std::vector<bool> placed_;
};

}  // namespace

bool begins_like_ism(std::string_view bytes) {
  if (bytes.starts_with("ISM")) return true;
  Scanner scan(bytes.substr(0, 1024));
  const std::vector<std::string_view> counts = words_of(scan.line()), node = words_of(scan.line());
  return counts.size() == 3 && std::all_of(counts.begin(), counts.end(), is_count) && node.size() == 3 &&
         std::all_of(node.begin(), node.end(), is_number);
}

Expected<MeshFile> read_ism(std::string_view bytes, const Team& team) {
  return MeshFile{Reading(bytes, team.stop()).take(), Format::Ism};
}

}  // namespace varimesh::formats
