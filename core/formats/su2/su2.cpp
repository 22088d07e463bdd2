#include "core/formats/su2/su2.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <span>

#include "core/base/io/buffered_output.h"
#include "core/formats/common/group_names.h"
#include "core/formats/common/left_out.h"
#include "core/formats/vtu/cells.h"
#include "core/formats/vtu/write.h"

namespace varimesh::formats {

namespace {

bool has_dimension(const ElementBlock& block, int dimension) {
  return reference::info(block.shape).dimension == dimension;
}

/// The points of the file: the vertices of cells, in the order of the nodes.
class Points {
 public:
  explicit Points(const HighOrderMesh& mesh) : number_(mesh.node_count(), -1) {
    for (const ElementBlock& block : mesh.blocks) {
      if (!has_dimension(block, mesh.dimension)) continue;
      const auto stride = std::size_t(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e)
        for (std::size_t v = 0; v < std::size_t(reference::info(block.shape).vertices); ++v)
          number_[std::size_t(block.nodes[e * stride + v])] = 0;
    }
    for (std::int64_t& number : number_)
      if (number == 0) number = count_++;
  }
  std::int64_t count() const { return count_; }
  std::int64_t of(std::int32_t node) const { return number_[std::size_t(node)]; }

 private:
  std::vector<std::int64_t> number_;
  std::int64_t count_ = 0;
};

std::span<const std::int32_t> vertices(const ElementBlock& block, std::size_t e) {
  const auto stride = std::size_t(reference::node_count(block.shape, block.order));
  return {block.nodes.data() + e * stride, std::size_t(reference::info(block.shape).vertices)};
}

/// Whether the vertices of an element belong to cells, so that they are points of the file.
bool has_points(const ElementBlock& block, std::size_t e, const Points& points) {
  const auto nodes = vertices(block, e);
  return std::all_of(nodes.begin(), nodes.end(), [&](std::int32_t node) { return points.of(node) >= 0; });
}

std::int64_t count_with_points(const ElementBlock& block, const Points& points) {
  std::int64_t count = 0;
  for (std::size_t e = 0; e < block.size(); ++e) count += has_points(block, e, points) ? 1 : 0;
  return count;
}

/// The blocks of each group of the boundary that has elements in the file, by tag.
std::map<int, std::vector<const ElementBlock*>> markers(const HighOrderMesh& mesh, const Points& points) {
  std::map<int, std::vector<const ElementBlock*>> found;
  for (const ElementBlock& block : mesh.blocks)
    if (has_dimension(block, mesh.dimension - 1) && !block.physical.empty() && count_with_points(block, points) > 0)
      found[std::abs(block.physical.front())].push_back(&block);
  return found;
}

/// The name of a group, in which SU2 takes no blanks. Names that become alike get the tag of their group.
std::string marker_name(const std::map<int, std::string_view>& names, int tag, std::set<std::string>& used) {
  const auto named = names.find(tag);
  std::string name = named == names.end() ? "group_" + std::to_string(tag) : std::string(named->second);
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c <= ' ' || c == '(' || c == ')' || c == ','; }, '_');
  while (!used.insert(name).second) name += "_" + std::to_string(tag);
  return name;
}

/// Writes the elements whose vertices are points of the file.
void write_elements(const ElementBlock& block, const Points& points, BufferedOutput& out) {
  const int type = vtk_cell(block.shape, 1).type;
  for (std::size_t e = 0; e < block.size(); ++e) {
    if (!has_points(block, e, points)) continue;
    out.text_integer(type);
    for (const std::int32_t node : vertices(block, e)) {
      out.text(" ");
      out.text_integer(points.of(node));
    }
    out.text("\n");
  }
}

void write_count(BufferedOutput& out, const char* name, std::int64_t count) {
  out.text(name);
  out.text("= ");
  out.text_integer(count);
  out.text("\n");
}

}  // namespace

std::string not_in_su2(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.add_if(mesh.order > 1, "curved sides (SU2's elements are straight between their vertices)");
  const auto any_block = [&](const auto& is) { return std::any_of(mesh.blocks.begin(), mesh.blocks.end(), is); };
  lost.add_if(
      any_block([&](const auto& block) { return has_dimension(block, mesh.dimension) && !block.physical.empty(); }),
      "groups of cells");
  std::int64_t ungrouped = 0, stray = 0;
  const Points points(mesh);
  for (const ElementBlock& block : mesh.blocks) {
    if (!has_dimension(block, mesh.dimension - 1)) continue;
    const auto all = std::int64_t(block.size());
    (block.physical.empty() ? ungrouped : stray) +=
        block.physical.empty() ? all : all - count_with_points(block, points);
  }
  lost.count(ungrouped, "boundary element without a group", "boundary elements without a group");
  lost.count(stray, "boundary element with vertices that belong to no cell",
             "boundary elements with vertices that belong to no cell");
  lost.add_if(any_block([&](const auto& block) {
                return has_dimension(block, mesh.dimension - 1) && block.physical.size() > 1;
              }),
              "the second group of boundary elements");
  lost.small_elements(mesh);
  lost.add_if(!mesh.periodic.empty(), "periodic links");
  lost.entities_and_partitions(mesh);
  return lost.sentence("SU2's format");
}

Expected<void> write_su2(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                         const Team& team) {
  bool flat = true;
  for (std::size_t i = 2; i < mesh.coordinates.size(); i += 3)
    flat = flat && mesh.coordinates[i] == mesh.coordinates[2];
  if (mesh.dimension < 2 || (mesh.dimension == 2 && !flat))
    return bad_option("SU2 takes meshes of a plane and of solids only; write vtu.");
  const Points points(mesh);
  BufferedOutput out(sink, false, team);
  write_count(out, "NDIME", mesh.dimension);
  write_count(out, "NELEM", std::int64_t(mesh.element_count(mesh.dimension)));
  for (const ElementBlock& block : mesh.blocks)
    if (has_dimension(block, mesh.dimension)) write_elements(block, points, out);
  write_count(out, "NPOIN", points.count());
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    if (points.of(std::int32_t(node)) < 0) continue;
    for (std::size_t k = 0; k < std::size_t(mesh.dimension); ++k) {
      out.text_number(mesh.coordinates[3 * node + k]);
      out.text(k + 1 < std::size_t(mesh.dimension) ? " " : "\n");
    }
  }
  const auto all = markers(mesh, points);
  const auto names = group_names(mesh, mesh.dimension - 1);
  std::set<std::string> used;
  write_count(out, "NMARK", std::int64_t(all.size()));
  for (const auto& [tag, blocks] : all) {
    out.text("MARKER_TAG= " + marker_name(names, tag, used) + "\n");
    std::int64_t count = 0;
    for (const ElementBlock* block : blocks) count += count_with_points(*block, points);
    write_count(out, "MARKER_ELEMS", count);
    for (const ElementBlock* block : blocks) write_elements(*block, points, out);
  }
  return out.finish();
}

}  // namespace varimesh::formats
