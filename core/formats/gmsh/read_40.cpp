// Reads the nodes and elements of MSH 4.0, ASCII and binary. Gmsh 4.0 wrote it for a few months.
#include "core/formats/gmsh/read.h"

namespace varimesh::formats {

namespace {

int entity_dimension(const Scanner& scan, int dimension) {
  if (dimension < 0 || dimension > 3) scan.fail("an entity's dimension must be 0 to 3");
  return dimension;
}

}  // namespace

void read_nodes_40(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  HighOrderMesh& mesh = reading.mesh;
  const std::int64_t blocks = scan.count("the number of node blocks", 8);
  const std::int64_t total = scan.count("the number of nodes", 8);
  scan.reserve(mesh.node_numbers, std::size_t(total));
  scan.reserve(mesh.coordinates, std::size_t(3 * total));
  for (std::int64_t b = 0; b < blocks; ++b) {
    NodeBlock block;
    block.entity = scan.integer("a node block's entity");
    block.dimension = entity_dimension(scan, scan.integer("a node block's dimension"));
    const bool parametric = scan.integer("a node block's parametric flag") != 0;
    const std::int64_t n = scan.count("a node block's number of nodes", 8);
    if (n > total - std::int64_t(mesh.node_numbers.size())) scan.fail("the node blocks have more nodes than announced");
    block.first = std::int32_t(mesh.node_numbers.size());
    block.count = std::int32_t(n);
    // Parameters on curves and surfaces are skipped, because they are wrong after the nodes have moved.
    const int parameters = parametric && block.dimension < 3 ? block.dimension : 0;
    for (std::int64_t i = 0; i < n; ++i) {
      scan.look();
      mesh.node_numbers.push_back(scan.integer("a node's number"));
      const auto name = [&] { return "node " + std::to_string(mesh.node_numbers.back()); };
      for (int k = 0; k < 3; ++k) mesh.coordinates.push_back(scan.finite(scan.number("a node's coordinate"), name));
      for (int k = 0; k < parameters; ++k) scan.number("a node's parameter");
    }
    scan.look();
    scan.add(mesh.node_blocks, block);
  }
  if (std::int64_t(mesh.node_numbers.size()) != total) scan.fail("the node blocks have fewer nodes than announced");
  reading.index.build(mesh.node_numbers, scan);
}

void read_elements_40(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t blocks = scan.count("the number of element blocks", 8);
  std::int64_t left = scan.count("the number of elements", 4);
  for (std::int64_t b = 0; b < blocks; ++b) {
    ElementBlock block;
    block.entity = scan.integer("an element block's entity");
    const int dimension = scan.integer("an element block's dimension");
    const GmshType type = type_of_block(scan, dimension, block);
    const auto per_element = std::size_t(node_count(type));
    const std::int64_t n =
        scan.count("an element block's number of elements", (per_element + 1) * (scan.binary ? 4 : 2));
    if (n > left) scan.fail("the element blocks have more elements than announced");
    left -= n;
    take_groups(reading, dimension, block);
    scan.look();
    scan.reserve(block.numbers, std::size_t(n));
    scan.reserve(block.nodes, std::size_t(n) * per_element);
    for (std::int64_t i = 0; i < n; ++i) {
      scan.look();
      const std::int64_t number = element_number(scan, scan.integer("an element's number"));
      block.numbers.push_back(number);
      for (std::size_t k = 0; k < per_element; ++k)
        block.nodes.push_back(reading.node(scan.integer("an element's node"), "element", number));
    }
    scan.add(reading.mesh.blocks, std::move(block));
  }
  if (left != 0) scan.fail("the element blocks have fewer elements than announced");
}

}  // namespace varimesh::formats
