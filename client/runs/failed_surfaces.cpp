#include "client/runs/failed_surfaces.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <vector>

#include "core/formats/formats.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/quality/quality.h"

namespace varimesh::client {
namespace {

constexpr int kAllThreads = 0;

/// By node: the tags of the surfaces whose elements have it.
std::map<std::int32_t, std::set<int>> surfaces_of_nodes(const HighOrderMesh& mesh) {
  std::map<std::int32_t, std::set<int>> tags;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 2)
      for (const std::int32_t node : block.nodes) tags[node].insert(block.entity);
  return tags;
}

/// By tag of the mesh: the name of the surface of the model, in quotation marks after a space.
std::map<int, std::string> names_of(const v1::GeometryReport& geometry) {
  std::map<int, std::string> names;
  for (const v1::SurfaceDistance& surface : geometry.surfaces())
    for (const int tag : surface.tags())
      if (!surface.name().empty()) names[tag] = " '" + surface.name() + "'";
  return names;
}

}  // namespace

std::string failed_surfaces(const std::string& path, const v1::GeometryReport& geometry) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return "";
  const auto file = formats::read_file(path);
  if (!file || file->mesh.dimension != 3 || !check_judgeable(file->mesh)) return "";
  const std::vector<std::int64_t> failed = uncertified_numbers(quality(file->mesh, 0, kAllThreads));
  if (failed.empty()) return "";
  const auto tags = surfaces_of_nodes(file->mesh);
  const Cells cells(file->mesh, 3);
  const std::set<std::int64_t> numbers(failed.begin(), failed.end());
  std::map<int, std::size_t> counts;
  std::size_t inside = 0;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    if (!numbers.contains(cells.number(cell))) continue;
    std::set<int> of_cell;
    for (const std::int32_t node : cells.nodes(cell))
      if (const auto at = tags.find(node); at != tags.end()) of_cell.insert(at->second.begin(), at->second.end());
    for (const int tag : of_cell) ++counts[tag];
    inside += of_cell.empty() ? 1 : 0;
  }
  std::vector<std::pair<std::size_t, int>> order;
  for (const auto& [tag, count] : counts) order.emplace_back(count, tag);
  std::ranges::sort(order, [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a < b; });
  constexpr std::size_t kShown = 10;
  std::map<int, std::string> names = names_of(geometry);
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, order.size()); ++i)
    text += (i > 0 ? ", " : "") + std::to_string(order[i].second) + names[order[i].second] + " (" +
            std::to_string(order[i].first) + ")";
  if (order.size() > kShown) text += " and " + std::to_string(order.size() - kShown) + " more";
  std::string sentence = "The elements that are not certified valid";
  sentence += order.empty() ? " touch no surface" : " touch these surfaces (in brackets, how many do): " + text;
  if (inside > 0 && !order.empty()) sentence += "; " + std::to_string(inside) + " touch none";
  return sentence + ". Smaller elements there may help, unless the model has a cusp there.";
}

}  // namespace varimesh::client
