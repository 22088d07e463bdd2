#include "core/layers/split/layer_cuts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <map>
#include <numeric>
#include <span>
#include <sstream>
#include <string>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/spacing.h"
#include "core/layers/split/layer_heights.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// A column is filled if less than this share of its height is left.
constexpr double kFilled = 1e-6;
/// A layer that is lower, relative to its column, is a rounding error.
constexpr double kLeastHeight = 1e-15;
/// What is left of a column above the layers must be at least this high, relative to the highest layer.
constexpr double kLeastLeft = 0.01;
/// In a row that was grown, an edge at the wall may lean as much as a column may: the cosine of 89°.
constexpr double kLeastSeen = 0.017;

std::string four_digits(double number) {
  std::ostringstream text;
  text << std::setprecision(4) << number;
  return text.str();
}

/// The nodes on edges of cells, from the vertex with the lower number to the other one.
std::vector<std::vector<std::int32_t>> nodes_of_edges(const HighOrderMesh& mesh, const Topology& topology,
                                                      const std::vector<char>& wanted) {
  std::vector<std::vector<std::int32_t>> nodes(at(topology.edge_count()));
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const Shape shape = cells.shape(cell);
    const auto of_cell = cells.nodes(cell);
    const auto& places = reference::node_places(shape, mesh.order);
    const reference::ShapeInfo& info = reference::info(shape);
    for (std::size_t e = 0; e < info.edges.size(); ++e) {
      const std::int32_t a = of_cell[at(info.edges[e][0])], b = of_cell[at(info.edges[e][1])];
      const std::int32_t edge = topology.edge(a, b);
      if (wanted[at(edge)] == 0 || !nodes[at(edge)].empty()) continue;
      auto& list = nodes[at(edge)];
      list.push_back(a);
      for (std::size_t n = 0; n < places.size(); ++n)
        if (places[n].dimension == 1 && places[n].index == static_cast<int>(e)) list.push_back(of_cell[n]);
      list.push_back(b);
      if (a > b) std::ranges::reverse(list);
    }
  }
  return nodes;
}

/// A column with the heights of its edges and layers.
struct Column {
  const WallColumn* wall = nullptr;
  std::vector<DirectedEdge> edges;  ///< One per row, from the wall.
  std::vector<EdgeHeight> heights;
  double total = 0;            ///< From the wall to the top of the last row.
  bool is_between = false;     ///< Whether its one edge rises from a wall at its other end too.
  std::vector<double> layers;  ///< Their heights, from the wall, without what is left.
  double room() const { return is_between ? total / 2 : total; }
};

class Cutter {
 public:
  Cutter(const HighOrderMesh& mesh, const Topology& topology, const Sheets& sheets, const WallColumns& wall,
         const LayerOptions& wanted, LayerSplitReport& report)
      : mesh_(mesh),
        topology_(topology),
        sheets_(sheets),
        wall_(wall),
        wanted_(wanted),
        report_(report),
        spacing_(wanted.spacing == LayerSpacing::Graded && !report.same_shares ? LayerSpacing::Graded
                                                                               : LayerSpacing::Even),
        cuts_(at(topology.edge_count())) {}

  Expected<LayerCuts> cut() {
    find_columns();
    if (const auto checked = find_sides(); !checked) return tl::unexpected(checked.error());
    if (const auto done = choose_heights(); !done) return tl::unexpected(done.error());
    if (report_.same_shares) take_same_shares();
    for (const Column& column : columns_) cut_column(column);
    spread();
    describe();
    return std::move(cuts_);
  }

 private:
  DirectedEdge directed(std::int32_t from, std::int32_t to) const { return {topology_.edge(from, to), from < to}; }
  bool begins_low(const DirectedEdge& edge) const { return sheets_.begins_low(edge.edge) == edge.is_forward; }

  void find_columns() {
    std::vector<char> rises(at(topology_.edge_count()), 0);
    for (const WallColumn& wall : wall_.columns)
      for (std::size_t row = 0; row + 1 < wall.vertices.size(); ++row)
        rises[at(directed(wall.vertices[row], wall.vertices[row + 1]).edge)] = 1;
    const auto nodes = nodes_of_edges(mesh_, topology_, rises);
    for (const WallColumn& wall : wall_.columns) {
      Column column;
      column.wall = &wall;
      for (std::size_t row = 0; row + 1 < wall.vertices.size(); ++row) {
        column.edges.push_back(directed(wall.vertices[row], wall.vertices[row + 1]));
        std::vector<Vector> points;
        for (const std::int32_t node : nodes[at(column.edges.back().edge)]) points.push_back(point(mesh_, node));
        if (!column.edges.back().is_forward) std::ranges::reverse(points);
        if (wanted_.grow > 0)
          column.heights.emplace_back(points, wall.normal_seen_least(points.back() - points.front()), kLeastSeen);
        else
          column.heights.emplace_back(points, wall.normal);
        column.total += column.heights.back().total();
      }
      columns_.push_back(std::move(column));
    }
  }

  std::string at_node(const Column& column) const {
    return "at node " + std::to_string(mesh_.node_numbers[at(column.wall->vertices.front())]) + " of the wall";
  }

  /// Finds from which sides layers cut each sheet, and in which row it is from there.
  Expected<void> find_sides() {
    for (const Column& column : columns_)
      for (std::size_t row = 0; row < column.edges.size(); ++row) {
        const DirectedEdge& edge = column.edges[row];
        const std::int32_t sheet = sheets_.sheet(edge.edge);
        if (sheets_.is_twisted(sheet))
          return bad_input("The layers " + at_node(column) +
                           " would meet themselves upside down: the rows of cells form a Möbius strip.");
        int& known = rows_.try_emplace(sheet, std::array{-1, -1}).first->second[begins_low(edge) ? 0 : 1];
        if (known >= 0 && known != static_cast<int>(row)) return overlap(column);
        known = static_cast<int>(row);
      }
    for (Column& column : columns_) {
      for (const DirectedEdge& edge : column.edges) {
        const auto& sides = rows_.at(sheets_.sheet(edge.edge));
        if (sides[0] < 0 || sides[1] < 0) continue;
        if (column.edges.size() > 1) return overlap(column);
        column.is_between = true;
      }
    }
    return {};
  }

  tl::unexpected<Error> overlap(const Column& column) const {
    return bad_input("The layers " + at_node(column) +
                     " reach cells that other layers of the wall reach in another row. Ask for fewer rows, or "
                     "split the walls one after another.");
  }

  Expected<void> choose_heights() {
    std::vector<double> rooms;
    for (const Column& column : columns_) rooms.push_back(column.room());
    std::ranges::nth_element(rooms, rooms.begin() + std::ptrdiff_t(rooms.size() / 2));
    report_.layers = number_of_layers(wanted_, rooms[rooms.size() / 2]);
    if (report_.layers > kMostLayers)
      return bad_option("More than " + std::to_string(kMostLayers) +
                        " layers would fit into the cells at the wall. Ask for a larger first height or growth.");
    std::map<std::int32_t, std::array<bool, 2>> found;  // by sheet: a column that is filled, one that is not
    for (Column& column : columns_) {
      column.layers = heights_in_column(wanted_, report_.layers, column.room());
      if (column.layers.empty()) return too_low(column);
      if (column.layers.front() < kLeastHeight * column.room())
        return bad_input("The first layer " + at_node(column) + " would be " + four_digits(column.layers.front()) +
                         " high, which is below rounding in cells that are " + four_digits(column.room()) +
                         " high. Ask for a larger first height.");
      const double left = column.room() - std::accumulate(column.layers.begin(), column.layers.end(), 0.0);
      const bool is_filled = left <= kFilled * column.room();
      found[sheets_.sheet(column.edges.back().edge)][is_filled ? 0 : 1] = true;
      if (!is_filled && left < kLeastLeft * column.layers.back()) return too_low(column);
    }
    for (Column& column : columns_) {
      const auto& [filled, left] = found.at(sheets_.sheet(column.edges.back().edge));
      if (filled && left) return too_low(*lowest_in(sheets_.sheet(column.edges.back().edge)));
      report_.leaves_cells = report_.leaves_cells || left;
      if (filled)
        column.layers.back() += column.room() - std::accumulate(column.layers.begin(), column.layers.end(), 0.0);
    }
    if (wanted_.rows > 1) return fit_rows();
    return {};
  }

  const Column* lowest_in(std::int32_t sheet) const {
    const Column* lowest = nullptr;
    for (const Column& column : columns_)
      if (sheets_.sheet(column.edges.back().edge) == sheet && (lowest == nullptr || column.room() < lowest->room()))
        lowest = &column;
    return lowest;
  }

  tl::unexpected<Error> too_low(const Column& column) const {
    return bad_input("The layers do not fit " + at_node(column) + ": the cells are " + four_digits(column.room()) +
                     " high there" + (column.is_between ? ", halfway to the wall on the other side" : "") +
                     ". Give fewer or lower layers, or a thicker row of cells.");
  }

  /// Layers begin and end where rows do: for each row a number of layers, the same everywhere.
  Expected<void> fit_rows() {
    std::vector<const Column*> by_height;
    for (const Column& column : columns_) by_height.push_back(&column);
    const auto middle = by_height.begin() + std::ptrdiff_t(by_height.size() / 2);
    std::ranges::nth_element(by_height, middle, {}, [](const Column* column) { return column->total; });
    const Column& typical = **middle;
    double top = 0;
    int from = 0;
    for (std::size_t row = 0; row < typical.edges.size(); ++row) {
      top += typical.heights[row].total();
      double below = 0, nearest = INFINITY;
      int best = from + 1;
      for (int layer = 0; layer < report_.layers; ++layer) {
        below += typical.layers[at(layer)];
        if (layer < from || std::abs(below - top) >= nearest) continue;
        nearest = std::abs(below - top);
        best = layer + 1;
      }
      const bool is_last = row + 1 == typical.edges.size();
      ends_.push_back(is_last ? report_.layers : best);
      from = best;
      if (is_last || best < report_.layers) continue;
      return bad_input("The layers end in row " + std::to_string(row + 1) +
                       " above the wall. Ask for more layers, or for this number of rows: " + std::to_string(row + 1) +
                       ".");
    }
    return {};
  }

  /// The heights of the parts of one edge of a column.
  std::vector<double> parts_of(const Column& column, std::size_t row) {
    if (column.edges.size() == 1) {
      std::vector<double> parts = column.layers;
      const double left = column.total - (column.is_between ? 2 : 1) * std::accumulate(parts.begin(), parts.end(), 0.0);
      if (left > kFilled * column.total) parts.push_back(left);
      if (column.is_between) parts.insert(parts.end(), column.layers.rbegin(), column.layers.rend());
      return parts;
    }
    const int first = row == 0 ? 0 : ends_[row - 1];
    std::vector<double> parts(column.layers.begin() + first, column.layers.begin() + ends_[row]);
    double low = 0;
    for (std::size_t r = 0; r < row; ++r) low += column.heights[r].total();
    const double height = column.heights[row].total();
    const double left = column.total - std::accumulate(column.layers.begin(), column.layers.end(), 0.0);
    if (row + 1 == column.edges.size() && left > kFilled * column.total) parts.push_back(left);
    const double factor = height / std::accumulate(parts.begin(), parts.end(), 0.0);
    report_.stretched = std::max(report_.stretched, std::abs(factor - 1));
    for (double& part : parts) part *= factor;
    return parts;
  }

  /// Every column of a sheet gets the shares of the middle one. Heights are then counted as multiples of the parameter.
  void take_same_shares() {
    std::map<std::int32_t, std::vector<Column*>> by_sheet;
    for (Column& column : columns_) by_sheet[sheets_.sheet(column.edges.back().edge)].push_back(&column);
    for (auto& [sheet, columns] : by_sheet) {
      const auto middle = columns.begin() + std::ptrdiff_t(columns.size() / 2);
      std::ranges::nth_element(columns, middle, {}, [](const Column* column) { return column->total; });
      const Column typical = **middle;
      for (Column* column : columns) {
        column->heights.clear();
        for (const EdgeHeight& edge : typical.heights)
          column->heights.emplace_back(edge.total() / typical.total * column->total);
        column->layers = typical.layers;
        for (double& height : column->layers) height *= column->total / typical.total;
      }
    }
  }

  void cut_column(const Column& column) {
    std::vector<double> all;
    std::vector<std::vector<double>> by_row;
    for (std::size_t row = 0; row < column.edges.size(); ++row) {
      by_row.push_back(parts_of(column, row));
      all.insert(all.end(), by_row.back().begin(), by_row.back().end());
    }
    std::size_t part = 0;
    for (std::size_t row = 0; row < column.edges.size(); ++row) {
      std::vector<double> growth;
      for (std::size_t p = 0; p < by_row[row].size(); ++p) growth.push_back(growth_across(all, part++));
      if (!cuts_.is_cut(column.edges[row].edge))
        cuts_.add(column.edges[row],
                  EdgeCut(column.heights[row], by_row[row], growth, column.wall->size, mesh_.order, spacing_));
    }
  }

  /// Cuts the other edges of the sheets, each as the nearest edge that rises from the wall.
  void spread() {
    std::vector<std::int32_t> queue;
    for (const Column& column : columns_)
      for (const DirectedEdge& edge : column.edges) queue.push_back(edge.edge);
    std::ranges::sort(queue);
    for (std::size_t next = 0; next < queue.size(); ++next)
      for (const auto& [edge, same] : sheets_.opposite(queue[next])) {
        if (cuts_.is_cut(edge)) continue;
        cuts_.copy(edge, queue[next], same);
        queue.push_back(edge);
      }
  }

  void describe() {
    const auto widen = [](std::array<double, 2>& range, double value) {
      range =
          range[1] == 0 ? std::array{value, value} : std::array{std::min(range[0], value), std::max(range[1], value)};
    };
    for (const Column& column : columns_) {
      widen(report_.first, column.layers.front());
      widen(report_.last, column.layers.back());
      for (std::size_t layer = 1; layer < column.layers.size(); ++layer)
        widen(report_.growth, column.layers[layer] / column.layers[layer - 1]);
    }
    report_.columns = static_cast<std::int64_t>(columns_.size());
    report_.wall_elements = wall_.elements;
  }

  const HighOrderMesh& mesh_;
  const Topology& topology_;
  const Sheets& sheets_;
  const WallColumns& wall_;
  const LayerOptions& wanted_;
  LayerSplitReport& report_;
  LayerSpacing spacing_;
  LayerCuts cuts_;
  std::vector<Column> columns_;
  std::map<std::int32_t, std::array<int, 2>> rows_;  ///< By sheet: the row it is in from its low and its high side.
  std::vector<int> ends_;                            ///< By row: the layer after its last one.
};

}  // namespace

void LayerCuts::add(const DirectedEdge& edge, EdgeCut cut) {
  cut_[at(edge.edge)] = static_cast<std::int32_t>(cuts_.size());
  along_[at(edge.edge)] = edge.is_forward ? 1 : 0;
  cuts_.push_back(std::move(cut));
}

void LayerCuts::copy(std::int32_t to, std::int32_t from, bool same_direction) {
  cut_[at(to)] = cut_[at(from)];
  along_[at(to)] = (along_[at(from)] != 0) == same_direction ? 1 : 0;
}

Expected<LayerCuts> cut_layers(const HighOrderMesh& mesh, const Topology& topology, const Sheets& sheets,
                               const WallColumns& wall, const LayerOptions& wanted, LayerSplitReport& report) {
  return Cutter(mesh, topology, sheets, wall, wanted, report).cut();
}

}  // namespace varimesh::detail
