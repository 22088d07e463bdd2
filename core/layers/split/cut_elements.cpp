#include "core/layers/split/cut_elements.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/base/index.h"
#include "core/reference/basis.h"

namespace varimesh::detail {
namespace {

/// The number of a place on a quadrilateral that does not depend on the order of its vertices.
std::int32_t place_on_quadrilateral(const Vertices& v, std::array<int, 2> at, std::array<int, 2> steps) {
  const auto lowest = std::ranges::min_element(v) - v.begin();
  // From corner to corner round the quadrilateral, the old second direction becomes the first one.
  for (int turn = 0; turn < lowest; ++turn) {
    at = {at[1], steps[0] - at[0]};
    steps = {steps[1], steps[0]};
  }
  const auto next = varimesh::at((lowest + 1) % 4), previous = varimesh::at((lowest + 3) % 4);
  if (v[previous] < v[next]) {
    std::swap(at[0], at[1]);
    std::swap(steps[0], steps[1]);
  }
  return (at[1] - 1) * (steps[0] - 1) + at[0] - 1;
}

/// How many places there are inside a triangle in the rows before this one.
std::int32_t places_before_row(int row, int parts) { return parts * row * (row - 1) / 2 - (row - 1); }

std::string name_of(const ElementBlock& block, std::size_t element) {
  return "Element " + std::to_string(block.numbers[element]) + ", a " + std::string(reference::info(block.shape).name) +
         ",";
}

}  // namespace

std::int32_t NewNodes::first_of(const Vertices& sorted, std::int32_t nodes, bool make) {
  const auto found = first_.find(sorted);
  if (found != first_.end()) return found->second;
  if (!make) return kNoNode;
  first_.emplace(sorted, count_);
  return add(nodes);
}

std::int32_t NewNodes::find(const CutPattern& pattern, const CutPoint& point, const std::int32_t* vertices, bool make) {
  const reference::ShapeInfo& info = reference::info(pattern.shape);
  if (point.dimension == 1) {
    const auto& edge = info.edges[at(point.index)];
    const std::int32_t a = vertices[at(edge[0])], b = vertices[at(edge[1])];
    const int steps = pattern.edges[at(point.index)].steps[0];
    const std::int32_t first = first_of({std::min(a, b), std::max(a, b), kNoNode, kNoNode}, steps - 1, make);
    return first == kNoNode ? kNoNode : first + (a < b ? point.at[0] : steps - point.at[0]) - 1;
  }
  const CutFace& cut = pattern.faces[at(point.index)];
  const Vertices v = face_vertices(info.faces[at(point.index)], vertices);
  Vertices sorted = v;
  std::ranges::sort(sorted);
  if (v[3] >= 0) {
    const std::int32_t first = first_of(sorted, (cut.steps[0] - 1) * (cut.steps[1] - 1), make);
    return first == kNoNode ? kNoNode : first + place_on_quadrilateral(v, point.at, cut.steps);
  }
  const auto [parts, order] = cut.steps;
  const std::int32_t first = first_of(sorted, places_before_row(order, parts), make);
  if (first == kNoNode) return kNoNode;
  const auto [along, row] = point.at;
  const bool is_forward = vertices[at(cut.edge[0])] < vertices[at(cut.edge[1])];
  return first + places_before_row(row, parts) + (is_forward ? along : parts * row - along) - 1;
}

Expected<CutElement> ElementCutter::cut(const ElementBlock& block, std::size_t element) {
  const std::size_t stride = block.nodes.size() / block.size();
  const std::int32_t* nodes = block.nodes.data() + element * stride;
  const auto directed = [&](const std::array<std::int8_t, 2>& edge) {
    const std::int32_t a = nodes[at(edge[0])], b = nodes[at(edge[1])];
    return DirectedEdge{topology_.edge(a, b), a < b};
  };
  const auto is_cut = [&](const DirectedEdge& edge) { return edge.edge >= 0 && cuts_.is_cut(edge.edge); };
  CutElement cut;
  const auto edges = reference::info(block.shape).edges;
  const auto count = std::ranges::count_if(edges, [&](const auto& edge) { return is_cut(directed(edge)); });
  if (count == 0) return cut;
  std::vector<const CutAxis*> axes;
  Name name{block.shape, {}};
  std::ptrdiff_t covered = 0;
  const auto all = cut_axes(block.shape);
  for (const CutAxis& axis : all) {
    if (!is_cut(directed(axis.edges[0]))) continue;
    covered += axis.count;
    if (axes.size() < kMostAxes)
      for (int e = 0; e < axis.count; ++e) cut.edges[axes.size()][at(e)] = directed(axis.edges[at(e)]);
    axes.push_back(&axis);
    name.second.emplace_back(&axis - all.data(), cuts_.parts(directed(axis.edges[0]).edge));
  }
  if (covered != count || !can_cut(block.shape, axes))
    return bad_input(name_of(block, element) +
                     " lies at the end of the layers, and the layers would cut more of its edges than such an element "
                     "can be split along. Let the layers end at a boundary, or at quadrilaterals or hexahedra.");
  std::unique_ptr<CutPattern>& pattern = patterns_[name];
  if (!pattern) {
    std::vector<CutAxis> of_pattern;
    std::vector<int> parts;
    for (const CutAxis* axis : axes) of_pattern.push_back(*axis);
    for (const auto& [axis, number] : name.second) parts.push_back(number);
    pattern = std::make_unique<CutPattern>(make_pattern(block.shape, mesh_.order, of_pattern, parts));
  }
  cut.pattern = pattern.get();
  return cut;
}

double ElementCutter::parameter(const CutElement& cut, const CutPoint& point, std::size_t axis) const {
  double sum = 0;
  for (int e = 0; e < cut.pattern->axes[axis].count; ++e)
    if (const double weight = point.weight[axis][at(e)]; weight != 0)
      sum += weight * cuts_.parameter(cut.edges[axis][at(e)], point.part[axis], point.xi[axis]);
  return sum;
}

std::vector<double> ElementCutter::places(const CutElement& cut, std::span<const std::int32_t> nodes) const {
  return cut.pattern->lines.empty() ? places_by_basis(cut, nodes) : places_on_lines(cut, nodes);
}

std::vector<double> ElementCutter::places_on_lines(const CutElement& cut, std::span<const std::int32_t> nodes) const {
  const CutPattern& pattern = *cut.pattern;
  const int order = pattern.order;
  std::vector<double> places(3 * pattern.points.size());
  std::array<double, kMaxOrder + 1> value{};
  for (std::size_t p = 0; p < pattern.points.size(); ++p) {
    const double along = order * parameter(cut, pattern.points[p], 0);
    for (int i = 0; i <= order; ++i) {
      value[at(i)] = 1;
      for (int j = 0; j <= order; ++j)
        if (j != i) value[at(i)] *= (along - j) / (i - j);
    }
    for (int i = 0; i <= order; ++i) {
      const auto node = at(nodes[at(pattern.lines[p * at(order + 1) + at(i)])]);
      for (std::size_t c = 0; c < 3; ++c) places[3 * p + c] += value[at(i)] * mesh_.coordinates[3 * node + c];
    }
  }
  return places;
}

std::vector<double> ElementCutter::places_by_basis(const CutElement& cut, std::span<const std::int32_t> nodes) const {
  const CutPattern& pattern = *cut.pattern;
  const int dimension = reference::info(pattern.shape).dimension;
  reference::Points points(static_cast<Eigen::Index>(pattern.points.size()), dimension);
  for (std::size_t p = 0; p < pattern.points.size(); ++p) {
    std::array<double, 4> logical = pattern.points[p].logical;
    for (std::size_t axis = 0; axis < pattern.axes.size(); ++axis)
      set_share(pattern.shape, pattern.axes[axis], parameter(cut, pattern.points[p], axis), logical);
    const std::array<double, 3> reference = reference_of(pattern.shape, logical);
    for (int c = 0; c < dimension; ++c) points(static_cast<Eigen::Index>(p), c) = reference[at(c)];
  }
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> x(static_cast<Eigen::Index>(nodes.size()), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    for (int c = 0; c < 3; ++c) x(static_cast<Eigen::Index>(n), c) = mesh_.coordinates[3 * at(nodes[n]) + at(c)];
  const Eigen::MatrixXd values =
      reference::basis_values(pattern.shape, pattern.order, reference::NodeSet::Equispaced, mesh_.dimension, points);
  const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> places = values * x;
  return {places.data(), places.data() + places.size()};
}

}  // namespace varimesh::detail
