#include "core/formats/vtu/read.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "core/base/io/scanner.h"
#include "core/formats/common/format.h"
#include "core/formats/vtu/arrays.h"
#include "core/formats/vtu/boundary.h"
#include "core/formats/vtu/cells.h"
#include "core/formats/vtu/declared.h"
#include "core/formats/vtu/write.h"
#include "core/formats/xml/xml.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

class Reading {
 public:
  Reading(VtkDeclared declared, FileAllowance& allowance, const Team& team)
      : declared_(std::move(declared)), allowance_(allowance), team_(team) {}

  HighOrderMesh take() {
    check_encoding();
    const auto points = std::size_t(declared_.points);
    if (declared_.coordinates.size() != 1 || declared_.coordinates[0].components != 3)
      fail("it has no points with three coordinates");
    mesh_.coordinates = values<double>(declared_.coordinates[0], 3 * points);
    check_coordinates();
    read_cells();
    read_groups();
    read_nodes();
    drop_added_points();
    for (const ElementBlock& block : mesh_.blocks)
      mesh_.dimension = std::max(mesh_.dimension, reference::info(block.shape).dimension);
    curve_lines(mesh_, allowance_);
    for (const ElementBlock& block : mesh_.blocks)
      if (reference::info(block.shape).dimension == mesh_.dimension) mesh_.order = block.order;
    allowance_.take(mesh_.node_count(), sizeof(std::int64_t));
    reserve_large(mesh_.node_numbers, mesh_.node_count());
    for (std::size_t node = 0; node < mesh_.node_count(); ++node) mesh_.node_numbers.push_back(std::int64_t(node) + 1);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(mesh_.node_count())}};
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(declared_.encoding.file).fail(what); }

  void check_coordinates() const {
    const std::vector<double>& x = mesh_.coordinates;
    const auto wrong = std::find_if(x.begin(), x.end(), [](double each) { return !std::isfinite(each); });
    if (wrong == x.end()) return;
    const VtkArray& array = declared_.coordinates[0];
    Scanner scan(declared_.encoding.file);
    scan.go_to(array.place == VtkPlace::Appended ? declared_.encoding.appended + array.offset : array.text.begin);
    scan.fail("point " + std::to_string((wrong - x.begin()) / 3) + " (counted from 0) of the array that begins here" +
              kNotFinite);
  }

  void check_encoding() const {
    for (const auto* list : {&declared_.coordinates, &declared_.topology, &declared_.cell_data, &declared_.field_data})
      for (const VtkArray& array : *list)
        if (array.place == VtkPlace::Appended && declared_.encoding.appended == 0)
          fail("the array '" + array.name.substr(0, 40) + "' is appended, but the file has no AppendedData");
  }

  static const VtkArray* find(const std::vector<VtkArray>& list, std::string_view name) {
    const auto found =
        std::find_if(list.begin(), list.end(), [&](const VtkArray& array) { return array.name == name; });
    return found == list.end() ? nullptr : &*found;
  }

  template <class T>
  std::vector<T> values(const VtkArray& array, std::optional<std::size_t> count) {
    return vtk_values<T>(array, count, declared_.encoding, allowance_, team_);
  }

  const VtkArray& topology(const char* name) const {
    const VtkArray* array = find(declared_.topology, name);
    if (array == nullptr) fail("the cells have no array '" + std::string(name) + "'");
    return *array;
  }

  void read_cells() {
    const auto cells = std::size_t(declared_.cells);
    offsets_ = values<std::int64_t>(topology("offsets"), cells);
    types_ = values<std::uint8_t>(topology("types"), cells);
    std::int64_t before = 0;
    for (const std::int64_t offset : offsets_) {
      if (offset < before) fail("the offsets of the cells do not rise");
      before = offset;
    }
  }

  /// The largest tag, and the largest number, which has 18 digits as in the other formats.
  template <class T>
  static constexpr T kMost = sizeof(T) == 4 ? std::numeric_limits<T>::max() : T(999'999'999'999'999'999);

  /// The values of an array of whole numbers; nothing if one is beyond ±kMost.
  template <class T>
  std::optional<std::vector<T>> fitting(const VtkArray& array, std::optional<std::size_t> count) {
    const bool unsigned32 = array.type == "UInt32", unsigned64 = array.type == "UInt64";
    const bool is_wider = unsigned64 || (sizeof(T) == 4 && (unsigned32 || array.type == "Int64"));
    if (is_wider || array.place == VtkPlace::Text) {
      const auto rounded = values<double>(array, count);
      allowance_.give_back(rounded.size() * sizeof rounded[0]);
      if (!std::all_of(rounded.begin(), rounded.end(), [](double x) { return std::abs(x) < double(kMost<T>) + 0.5; }))
        return std::nullopt;
    }
    auto exact = values<T>(array, count);
    if (std::all_of(exact.begin(), exact.end(), [](T x) { return x >= -kMost<T> && x <= kMost<T>; })) return exact;
    allowance_.give_back(exact.size() * sizeof exact[0]);
    return std::nullopt;
  }

  /// The first of these arrays of whole numbers that the cells have; empty if they have none. An array with larger
  /// values than tags or numbers have is somebody else's, and is left out.
  template <class T>
  std::vector<T> of_cells(std::initializer_list<const char*> names) {
    for (const char* name : names) {
      const VtkArray* array = find(declared_.cell_data, name);
      if (array == nullptr || array->components > 1 || array->type.starts_with("Float")) continue;
      if (auto found = fitting<T>(*array, std::size_t(declared_.cells))) return std::move(*found);
    }
    return {};
  }

  void read_groups() {
    physical_ = of_cells<std::int32_t>({"gmsh:physical", "physical", "material", "attribute"});
    entities_ = of_cells<std::int32_t>({"gmsh:geometrical"});
    numbers_ = of_cells<std::int64_t>({"element"});
    if (!are_unique(numbers_)) numbers_.clear();
    for (const VtkArray& array : declared_.field_data) {
      if (array.type.starts_with("Float") || array.components > 2) continue;
      if (array.name == kVtkPyramids) {
        read_pyramids(array);
        continue;
      }
      const auto group = fitting<std::int32_t>(array, std::nullopt);
      if (!group || group->size() != 2 || (*group)[0] < 1 || (*group)[1] < 0 || (*group)[1] > 3) continue;
      mesh_.physical_groups.push_back({(*group)[1], (*group)[0], array.name});
    }
  }

  bool are_unique(const std::vector<std::int64_t>& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (numbers[i] <= 0 && (numbers[i] != kNextPiece || i == 0 || types_[i] != kLine || types_[i - 1] != kLine))
        return false;
    if (std::is_sorted(numbers.begin(), numbers.end(), std::less_equal<>())) return true;
    allowance_.take(numbers.size(), sizeof numbers[0]);
    std::vector<std::int64_t> sorted = numbers;
    std::sort(sorted.begin(), sorted.end());
    const auto same = [](auto one, auto other) { return one == other && one != kNextPiece; };
    const bool unique = std::adjacent_find(sorted.begin(), sorted.end(), same) == sorted.end();
    allowance_.give_back(sorted.size() * sizeof sorted[0]);
    return unique;
  }

  void read_pyramids(const VtkArray& array) {
    pyramids_ = values<std::int32_t>(array, std::nullopt);
    for (const std::int32_t node : pyramids_)
      if (node < 0 || node >= declared_.points)
        fail("a pyramid refers to point " + std::to_string(node) + ", but the points are 0 to " +
             std::to_string(declared_.points - 1));
  }

  // === Blocks ============================================================================================

  std::size_t size_of(std::size_t cell) const {
    return std::size_t(offsets_[cell] - (cell == 0 ? 0 : offsets_[cell - 1]));
  }
  int physical(std::size_t cell) const { return physical_.empty() ? 0 : physical_[cell]; }
  int entity(std::size_t cell) const {
    const int own = entities_.empty() ? 0 : entities_[cell];
    return own != 0 ? own : physical(cell) == 0 ? 1 : std::abs(physical(cell));
  }
  /// Whether a cell with these nodes, if it is a hexahedron, is a pyramid.
  static bool has_tip(std::span<const std::int32_t> nodes) {
    return nodes.size() > 8 && nodes[4] == nodes[5] && nodes[5] == nodes[6] && nodes[6] == nodes[7];
  }

  /// Reads the nodes of all cells, and adds each cell as soon as its nodes are there.
  void read_nodes() {
    std::size_t cell = 0;
    std::vector<std::int32_t> part;  // the first nodes of a cell whose others come with the next values
    const auto finish_empty = [&] {
      for (; cell < types_.size() && size_of(cell) == 0; ++cell) add(cell, {});
    };
    const std::size_t count = offsets_.empty() ? 0 : std::size_t(offsets_.back());
    const auto begin = [&](std::size_t nodes) {
      if (nodes != count)
        fail("the offsets of the cells end with " + std::to_string(count) + ", but the cells have " +
             std::to_string(nodes) + " nodes");
    };
    for_vtk_values(topology("connectivity"), declared_.encoding, allowance_, team_, begin,
                   [&](std::span<const std::int32_t> values) {
                     check_points(values);
                     while (!values.empty()) {
                       finish_empty();
                       const std::size_t size = size_of(cell);
                       if (const std::size_t many = part.empty() ? plain_cells(cell, values.size() / size) : 0) {
                         add_plain(cell, values.first(many * size));
                         values = values.subspan(many * size);
                         cell += many;
                         continue;
                       }
                       const std::size_t got = std::min(size - part.size(), values.size());
                       const std::span<const std::int32_t> own = values.first(got);
                       values = values.subspan(got);
                       if (got == size) {
                         add(cell++, own);
                         continue;
                       }
                       allowance_.take(got, 2 * sizeof(std::int32_t));
                       part.insert(part.end(), own.begin(), own.end());
                       if (part.size() < size) continue;
                       add(cell++, part);
                       allowance_.give_back(part.size() * 2 * sizeof(std::int32_t));
                       part.clear();
                     }
                   });
    finish_empty();
  }

  void check_points(std::span<const std::int32_t> nodes) const {
    bool is_wrong = false;
    for (const std::int32_t node : nodes) is_wrong |= std::int64_t(std::uint32_t(node)) >= declared_.points;
    if (!is_wrong) return;
    for (const std::int32_t node : nodes)
      if (node < 0 || node >= declared_.points)
        fail("a cell refers to point " + std::to_string(node) + ", but the points are 0 to " +
             std::to_string(declared_.points - 1));
  }

  /// How many of the next cells, at most `most`, are like the one before them and no pyramids.
  std::size_t plain_cells(std::size_t cell, std::size_t most) const {
    if (cell >= alike_end_ || kind_.shape == Shape::Hexahedron || is_pyramid_) return 0;
    return std::min(most, alike_end_ - cell);
  }

  /// Adds such cells. `own`: their nodes.
  void add_plain(std::size_t cell, std::span<const std::int32_t> own) {
    ElementBlock& block = mesh_.blocks.back();
    const std::vector<int>& places = *kind_.places;
    const std::size_t each = places.size(), count = own.size() / each, begin = block.nodes.size();
    allowance_.make_room(block.numbers, count);
    allowance_.make_room(block.nodes, own.size());
    block.nodes.resize(begin + own.size());
    std::int32_t* to = block.nodes.data() + begin;
    for (std::size_t i = 0; i < count; ++i, to += each) {
      block.numbers.push_back(numbers_.empty() ? std::int64_t(cell + i) + 1 : numbers_[cell + i]);
      for (std::size_t k = 0; k < each; ++k) to[k] = own[i * each + std::size_t(places[k])];
    }
  }

  /// How many cells from this one on are alike, as far as their lists of nodes need not be known.
  std::size_t alike(std::size_t begin) const {
    std::size_t end = begin;
    while (end < types_.size() && types_[end] == types_[begin] && size_of(end) == size_of(begin) &&
           physical(end) == physical(begin) && entity(end) == entity(begin))
      ++end;
    return end - begin;
  }

  void add(std::size_t cell, std::span<const std::int32_t> own) {
    allowance_.look();
    const bool new_order = declared_.version >= 21, tip = has_tip(own);
    if (cell >= alike_end_ || tip != last_tip_) {
      auto kind = vtk_kind(types_[cell], own.size(), new_order);
      if (!kind) fail(kind.error().sentence + " (cell " + std::to_string(cell) + ", counted from 0)");
      is_pyramid_ = kind->shape == Shape::Hexahedron && kind->order > 1 && types_[cell] != kHexahedron20 && tip;
      kind_ = is_pyramid_ ? vtk_pyramid(kind->order, new_order || types_[cell] == 29) : *kind;
      const bool starts = cell >= alike_end_;
      if (starts) alike_end_ = cell + alike(cell);
      last_tip_ = tip;
      ElementBlock& block = block_for(kind_, cell);
      // Hexahedra and pyramids may alternate, so only once for all that are alike.
      const std::size_t run = starts && !tip ? alike_end_ - cell : 1;
      allowance_.make_room(block.numbers, run);
      allowance_.make_room(block.nodes, run * kind_.places->size());
    }
    ElementBlock& block = mesh_.blocks.back();
    const std::size_t each = kind_.places->size();
    allowance_.make_room(block.numbers, 1);
    allowance_.make_room(block.nodes, each);
    block.numbers.push_back(numbers_.empty() ? std::int64_t(cell) + 1 : numbers_[cell]);
    if (is_pyramid_ && kind_.order > 2)
      add_listed_pyramid(block.nodes, each, cell);
    else
      for (const int place : *kind_.places) block.nodes.push_back(own[std::size_t(place)]);
    if (is_pyramid_) check_pyramid(kind_.order, {block.nodes.data() + block.nodes.size() - each, each}, own, cell);
  }

  ElementBlock& block_for(const VtkKind& kind, std::size_t cell) {
    std::vector<int> groups;
    if (physical(cell) != 0) groups.push_back(physical(cell));
    std::vector<ElementBlock>& blocks = mesh_.blocks;
    if (blocks.empty() || blocks.back().shape != kind.shape || blocks.back().order != kind.order ||
        nodes_per_element(blocks.back()) != kind.places->size() || blocks.back().physical != groups ||
        blocks.back().entity != entity(cell)) {
      allowance_.take(1, sizeof(ElementBlock));
      blocks.push_back({kind.shape, kind.order, entity(cell), groups, {}, {}, {}, {}});
    }
    return blocks.back();
  }

  /// VTK's type of hexahedra that have no nodes inside their faces.
  static constexpr std::uint8_t kLine = 3, kHexahedron20 = 25;

  /// VTK's cell has not all nodes of a pyramid of order 3 and above. VariMesh's files list them.
  void add_listed_pyramid(std::vector<std::int32_t>& nodes, std::size_t each, std::size_t cell) {
    if (pyramids_.size() - listed_ < each)
      fail(
          "cell " + std::to_string(cell) +
          " (counted from 0) is a pyramid of order 3 or above, whose inner nodes VTK's cells do not have, and the file "
          "does not list them as VariMesh does; give VariMesh the MSH file from which it was made");
    nodes.insert(nodes.end(), pyramids_.begin() + std::ptrdiff_t(listed_),
                 pyramids_.begin() + std::ptrdiff_t(listed_ + each));
    listed_ += each;
  }

  /// A hexahedron that is a pyramid has points that follow from the pyramid's nodes. If they are elsewhere, it is none.
  /// `own`: the pyramid's nodes; `nodes`: those of the hexahedron.
  void check_pyramid(int order, std::span<const std::int32_t> own, std::span<const std::int32_t> nodes,
                     std::size_t cell) {
    const Eigen::MatrixXd& added = vtk_added_points(order);
    Eigen::Matrix<double, Eigen::Dynamic, 3> x(added.cols(), 3);
    double size = 0;
    for (Eigen::Index i = 0; i < x.rows(); ++i)
      for (Eigen::Index k = 0; k < 3; ++k) {
        x(i, k) = mesh_.coordinates[3 * std::size_t(own[std::size_t(i)]) + std::size_t(k)];
        size = std::max(size, std::abs(x(i, k) - x(0, k)));
      }
    const Eigen::Matrix<double, Eigen::Dynamic, 3> wanted = added * x;
    const std::vector<int> places = vtk_cell(Shape::Pyramid, order).nodes;
    Eigen::Index row = 0;
    if (added_.empty()) added_.assign(mesh_.node_count(), false);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i] >= 0) continue;
      const auto point = std::size_t(nodes[i]);
      for (Eigen::Index k = 0; k < 3; ++k)
        if (!(std::abs(mesh_.coordinates[3 * point + std::size_t(k)] - wanted(row, k)) <= 1e-5 * size))
          fail("cell " + std::to_string(cell) +
               " (counted from 0) is a hexahedron whose top face is a point, and no pyramid of VariMesh's");
      added_[point] = true;
      ++row;
    }
  }

  /// Removes the points that only such pyramids have.
  void drop_added_points() {
    if (added_.empty()) return;
    for (const ElementBlock& block : mesh_.blocks)
      for (const std::int32_t node : block.nodes) added_[std::size_t(node)] = false;
    std::vector<std::int32_t> place(added_.size(), -1);
    std::int32_t next = 0;
    for (std::size_t node = 0; node < added_.size(); ++node) {
      if (added_[node]) continue;
      for (std::size_t k = 0; k < 3; ++k)
        mesh_.coordinates[3 * std::size_t(next) + k] = mesh_.coordinates[3 * node + k];
      place[node] = next++;
    }
    mesh_.coordinates.resize(3 * std::size_t(next));
    for (ElementBlock& block : mesh_.blocks)
      for (std::int32_t& node : block.nodes) node = place[std::size_t(node)];
  }

  VtkDeclared declared_;
  FileAllowance& allowance_;
  const Team& team_;
  HighOrderMesh mesh_;
  std::vector<std::int32_t> physical_, entities_, pyramids_;  // empty if the file has none
  std::vector<std::int64_t> offsets_, numbers_;
  std::vector<std::uint8_t> types_;
  VtkKind kind_;  // of the cells that are being read
  bool is_pyramid_ = false, last_tip_ = false;
  std::size_t alike_end_ = 0;  // the first cell that may be of another kind
  std::size_t listed_ = 0;     // entries of pyramids_ that were read
  std::vector<bool> added_;    // points that only the hexahedra of pyramids have; empty if there are none
};

}  // namespace

bool begins_like_vtk(std::string_view bytes) { return begins_with_element(bytes, "VTKFile"); }

Expected<MeshFile> read_vtu(std::string_view bytes, const Team& team) {
  FileAllowance allowance(bytes.size(), team.stop());
  const std::string plain = without_comments(bytes, "AppendedData", allowance);
  allowance.take(plain.size(), 1);
  if (!plain.empty()) bytes = plain;
  return MeshFile{Reading(vtk_declared(bytes, allowance), allowance, team).take(), Format::Vtu};
}

}  // namespace varimesh::formats
