#include "core/hdf/cgns/tree.h"

#include <cmath>

#include "core/base/io/scanner.h"

namespace varimesh::formats {

namespace {

std::string label_of(const Hdf5Group& node) {
  if (node.find("label", true) == nullptr) return {};
  const auto texts = node.texts("label", true);
  return texts.empty() ? std::string() : texts.front();
}

}  // namespace

std::string cgns_text(const Hdf5Group& node) {
  std::string text;
  for (const std::int64_t c : node.integers(kCgnsData)) text += c >= 0 && c < ' ' ? ' ' : char(c);
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

std::vector<std::pair<std::string, Hdf5Group>> cgns_children(const Hdf5Group& node, std::string_view label) {
  std::vector<std::pair<std::string, Hdf5Group>> found;
  for (const Hdf5Item& item : node.items()) {
    if (item.attribute || item.kind != hdf5::Kind::Group) continue;
    Hdf5Group child = node.group(item.name);
    if (label_of(child) == label) found.emplace_back(item.name, std::move(child));
  }
  return found;
}

void check_cgns_coordinate(const Hdf5Group& grid, const char* axis, std::int64_t node, double coordinate) {
  if (std::isfinite(coordinate)) return;
  grid.group(axis).fail(kCgnsData, "has a row in which node " + std::to_string(node + 1) + kNotFinite, node);
}

std::string cgns_location(const Hdf5Group& node) {
  return node.find("GridLocation") == nullptr ? "Vertex" : cgns_text(node.group("GridLocation"));
}

}  // namespace varimesh::formats
