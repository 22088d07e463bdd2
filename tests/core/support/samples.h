// Small meshes and helpers that the format tests share.
#pragma once

#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "core/formats/formats.h"
#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh::test {

inline std::string source_file(const std::string& name) { return std::string(VARIMESH_SOURCE_DIR) + "/" + name; }

inline std::string shared_case(const std::string& name) {
  const char* folder = std::getenv("VARIMESH_CASES");
  return (folder ? std::string(folder) : source_file("../shared/cases")) + "/meshes/" + name;
}

inline std::string slurp(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline std::string written(const HighOrderMesh& mesh, formats::Format format) {
  std::string bytes;
  const auto done = formats::write(mesh, format, [&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  return done ? bytes : "not written: " + done.error().sentence;
}

/// A temporary folder, removed at the end of the test.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "varimesh-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string file(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// One cell of that shape and order: the reference cell under a map of total degree `order`, which every shape's space
/// holds. The scripts check_msh.py and check_vtu.py use the same map.
inline HighOrderMesh one_cell(Shape shape, int order) {
  HighOrderMesh mesh;
  const int d = reference::info(shape).dimension;
  const reference::Points& points = reference::nodes(shape, order, reference::NodeSet::Equispaced, d);
  ElementBlock block{shape, order, 1, {5}, {7}, {}, {}, {}};
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double x = points(i, 0), y = points(i, 1), z = d == 3 ? points(i, 2) : 0;
    mesh.coordinates.insert(mesh.coordinates.end(),
                            {x + 0.2 * std::pow(y, order), y + 0.1 * std::pow(d == 3 ? z : x, order),
                             d == 3 ? z + 0.15 * std::pow(x, order) : 0.0});
    mesh.node_numbers.push_back(3 * i + 2);
    block.nodes.push_back(std::int32_t(i));
  }
  mesh.blocks.push_back(block);
  mesh.node_blocks.push_back({-1, 0, 0, std::int32_t(points.rows())});
  mesh.physical_groups.push_back({d, 5, "the cell"});
  mesh.dimension = d;
  mesh.order = order;
  return mesh;
}

}  // namespace varimesh::test
