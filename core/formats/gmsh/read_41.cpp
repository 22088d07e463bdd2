// Reads the sections of MSH 4.1, ASCII and binary.
#include "core/formats/common/pieces.h"
#include "core/formats/gmsh/read.h"

namespace varimesh::formats {

namespace {

std::vector<int> read_tags(Scanner& scan, const char* how_many, const char* what) {
  const std::int64_t n = scan.count(how_many, scan.binary ? 4 : 2);
  std::vector<int> tags;
  scan.reserve(tags, static_cast<std::size_t>(n));
  tags.resize(static_cast<std::size_t>(n));
  for (int& tag : tags) tag = scan.integer(what);
  return tags;
}

// A point has one position; in version 4.0 it has a box like the others.
void read_box(Scanner& scan, Entity& entity, int version) {
  const int n = entity.dimension == 0 && version > 40 ? 3 : 6;
  for (int k = 0; k < n; ++k) entity.box[std::size_t(k)] = scan.number("an entity's extent");
  if (n == 3)
    for (std::size_t k = 0; k < 3; ++k) entity.box[k + 3] = entity.box[k];
}

void read_groups_and_boundary(Scanner& scan, Entity& entity) {
  entity.physical = read_tags(scan, "an entity's number of physical groups", "an entity's physical group");
  if (entity.dimension > 0)
    entity.boundary = read_tags(scan, "an entity's number of bounding entities", "a bounding entity");
}

// === Long lists, in pieces ===============================================================================

// Appends `count` node numbers to the mesh's.
void read_node_numbers(GmshReading& reading, std::int64_t count) {
  Scanner& scan = reading.scanner;
  std::vector<std::int64_t>& numbers = reading.mesh.node_numbers;
  const std::size_t end = numbers.size() + std::size_t(count);
  const auto parse = [](const BytesPiece&, Scanner& from) {
    std::vector<std::int64_t> read;
    for (from.skip_space_of_text(); !from.at_end(); from.skip_space_of_text())
      from.add(read, from.size("a node's number"));
    return read;
  };
  const auto take = [&](const BytesPiece&, const std::vector<std::int64_t>& read) {
    if (read.size() > end - numbers.size()) return false;
    numbers.insert(numbers.end(), read.begin(), read.end());
    return true;
  };
  read_in_pieces(scan, reading.team, RecordCutter(scan, count, 8), parse, take);
  for (; numbers.size() < end; scan.look()) scan.add(numbers, scan.size("a node's number"));
}

struct PlacesRead {
  std::vector<double> coordinates, parameters;
};

// Appends the coordinates of the block's nodes to the mesh's, and reads `parameters` numbers for each. Those of a
// volume are its coordinates again, so they are not kept.
void read_coordinates(GmshReading& reading, int parameters, NodeBlock& block) {
  Scanner& scan = reading.scanner;
  std::vector<double>& coordinates = reading.mesh.coordinates;
  const std::vector<std::int64_t>& numbers = reading.mesh.node_numbers;
  const std::size_t end = coordinates.size() + 3 * std::size_t(block.count);
  const bool keeps = parameters > 0 && parameters < 3;
  if (keeps) scan.reserve(block.parameters, std::size_t(parameters) * std::size_t(block.count));
  const auto node = [&](Scanner& from, std::vector<double>& to, std::vector<double>& to_parameters) {
    from.look();
    // Only of the mesh's own coordinates it is known whose they are. A piece that fails is read again for them.
    const auto name = [&] { return &to == &coordinates ? "node " + std::to_string(numbers[to.size() / 3]) : "a node"; };
    for (int k = 0; k < 3; ++k) from.add(to, from.finite(from.number("a node's coordinate"), name));
    for (int k = 0; k < parameters; ++k) {
      const double parameter = from.number("a node's parameter");
      if (keeps) from.add(to_parameters, parameter);
    }
  };
  const auto parse = [&](const BytesPiece&, Scanner& from) {
    PlacesRead read;
    for (from.skip_space_of_text(); !from.at_end(); from.skip_space_of_text())
      node(from, read.coordinates, read.parameters);
    return read;
  };
  const auto take = [&](const BytesPiece&, const PlacesRead& read) {
    if (read.coordinates.size() > end - coordinates.size()) return false;
    coordinates.insert(coordinates.end(), read.coordinates.begin(), read.coordinates.end());
    block.parameters.insert(block.parameters.end(), read.parameters.begin(), read.parameters.end());
    return true;
  };
  read_in_pieces(scan, reading.team, RecordCutter(scan, block.count, 8 * (3 + std::size_t(parameters))), parse, take);
  while (coordinates.size() < end) node(scan, coordinates, block.parameters);
}

struct ElementsRead {
  std::vector<std::int64_t> numbers;
  std::vector<std::int32_t> nodes;
};

// Appends one element.
void read_element(const GmshReading& reading, Scanner& from, std::size_t per_element,
                  std::vector<std::int64_t>& numbers, std::vector<std::int32_t>& nodes) {
  from.look();
  const std::int64_t number = element_number(from, from.size("an element's number"));
  from.add(numbers, number);
  for (std::size_t k = 0; k < per_element; ++k)
    from.add(nodes, reading.node(from, from.size("an element's node"), "element", number));
}

// Reads the `count` elements of a block.
void read_block_elements(GmshReading& reading, std::int64_t count, std::size_t per_element, ElementBlock& block) {
  Scanner& scan = reading.scanner;
  scan.reserve(block.numbers, std::size_t(count));
  scan.reserve(block.nodes, std::size_t(count) * per_element);
  const auto parse = [&](const BytesPiece&, Scanner& from) {
    ElementsRead read;
    for (from.skip_space_of_text(); !from.at_end(); from.skip_space_of_text())
      read_element(reading, from, per_element, read.numbers, read.nodes);
    return read;
  };
  const auto take = [&](const BytesPiece&, const ElementsRead& read) {
    if (read.numbers.size() > std::size_t(count) - block.numbers.size()) return false;
    block.numbers.insert(block.numbers.end(), read.numbers.begin(), read.numbers.end());
    block.nodes.insert(block.nodes.end(), read.nodes.begin(), read.nodes.end());
    return true;
  };
  read_in_pieces(scan, reading.team, RecordCutter(scan, count, 8 * (per_element + 1)), parse, take);
  while (block.numbers.size() < std::size_t(count))
    read_element(reading, scan, per_element, block.numbers, block.nodes);
}

// Keeps the groups of an entity for the elements that follow.
void note_groups(GmshReading& reading, const Entity& entity) {
  if (entity.physical.empty()) return;
  reading.scanner.take_memory(kTreeNode + kAllocation + entity.physical.size() * sizeof(int));
  reading.entity_groups[{entity.dimension, entity.tag}] = entity.physical;
}

}  // namespace

void take_groups(GmshReading& reading, int dimension, ElementBlock& block) {
  const auto at = reading.entity_groups.find({dimension, block.entity});
  if (at == reading.entity_groups.end()) return;
  reading.scanner.reserve(block.physical, at->second.size());
  block.physical = at->second;
}

void read_entities_41(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  std::array<std::int64_t, 4> counts{};
  for (std::int64_t& n : counts) n = scan.count("the number of entities", 8);
  for (int d = 0; d < 4; ++d)
    for (std::int64_t i = 0; i < counts[std::size_t(d)]; ++i) {
      scan.look();
      Entity entity;
      entity.dimension = d;
      entity.tag = scan.integer("an entity's tag");
      read_box(scan, entity, reading.version);
      read_groups_and_boundary(scan, entity);
      note_groups(reading, entity);
      scan.add(reading.mesh.entities, std::move(entity));
    }
}

void read_partitioned_entities_41(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  scan.size("the number of partitions");
  const std::int64_t ghosts = scan.count("the number of ghost entities", scan.binary ? 8 : 4);
  for (std::int64_t i = 0; i < 2 * ghosts; ++i) scan.integer("a ghost entity");
  std::array<std::int64_t, 4> counts{};
  for (std::int64_t& n : counts) n = scan.count("the number of partitioned entities", 8);
  for (int d = 0; d < 4; ++d)
    for (std::int64_t i = 0; i < counts[std::size_t(d)]; ++i) {
      scan.look();
      Entity entity;
      entity.dimension = d;
      entity.tag = scan.integer("a partitioned entity's tag");
      scan.integer("a partitioned entity's parent dimension");
      scan.integer("a partitioned entity's parent");
      read_tags(scan, "a partitioned entity's number of partitions", "a partition");
      read_box(scan, entity, reading.version);
      read_groups_and_boundary(scan, entity);
      note_groups(reading, entity);
    }
}

void read_nodes_41(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  HighOrderMesh& mesh = reading.mesh;
  const std::int64_t blocks = scan.count("the number of node blocks", 8);
  const std::int64_t total = scan.count("the number of nodes", 8);
  scan.size("the smallest node number");
  scan.size("the largest node number");
  scan.reserve(mesh.node_numbers, std::size_t(total));
  scan.reserve(mesh.coordinates, std::size_t(3 * total));
  for (std::int64_t b = 0; b < blocks; ++b) {
    NodeBlock block;
    block.dimension = scan.integer("a node block's dimension");
    block.entity = scan.integer("a node block's entity");
    const int parametric = scan.integer("a node block's parametric flag");
    const std::int64_t n = scan.count("a node block's number of nodes", 8);
    if (block.dimension < 0 || block.dimension > 3) scan.fail("a node block's dimension must be 0 to 3");
    if (n > total - std::int64_t(mesh.node_numbers.size())) scan.fail("the node blocks have more nodes than announced");
    block.first = std::int32_t(mesh.node_numbers.size());
    block.count = std::int32_t(n);
    read_node_numbers(reading, n);
    read_coordinates(reading, parametric != 0 ? block.dimension : 0, block);
    scan.look();
    scan.add(mesh.node_blocks, std::move(block));
  }
  if (std::int64_t(mesh.node_numbers.size()) != total) scan.fail("the node blocks have fewer nodes than announced");
  reading.index.build(mesh.node_numbers, scan);
}

void read_elements_41(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t blocks = scan.count("the number of element blocks", 8);
  std::int64_t left = scan.count("the number of elements", 4);
  scan.size("the smallest element number");
  scan.size("the largest element number");
  for (std::int64_t b = 0; b < blocks; ++b) {
    const int dimension = scan.integer("an element block's dimension");
    ElementBlock block;
    block.entity = scan.integer("an element block's entity");
    const GmshType type = type_of_block(scan, dimension, block);
    const auto per_element = std::size_t(node_count(type));
    const std::int64_t n =
        scan.count("an element block's number of elements", (per_element + 1) * (scan.binary ? 8 : 2));
    if (n > left) scan.fail("the element blocks have more elements than announced");
    left -= n;
    scan.look();
    take_groups(reading, dimension, block);
    read_block_elements(reading, n, per_element, block);
    scan.add(reading.mesh.blocks, std::move(block));
  }
  if (left != 0) scan.fail("the element blocks have fewer elements than announced");
}

void read_periodic_41(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t links = scan.count("the number of periodic links", 8);
  for (std::int64_t i = 0; i < links; ++i) {
    scan.look();
    PeriodicLink link;
    link.dimension = scan.integer("a periodic entity's dimension");
    link.entity = scan.integer("a periodic entity");
    link.master = scan.integer("a periodic entity's master");
    const std::int64_t affine = scan.count("the length of a periodic link's affine map", 2);
    scan.reserve(link.affine, std::size_t(affine));
    link.affine.resize(std::size_t(affine));
    for (double& value : link.affine) value = scan.number("a periodic link's affine map");
    const std::int64_t n = scan.count("the number of periodic nodes", scan.binary ? 16 : 3);
    scan.reserve(link.nodes, std::size_t(n));
    for (std::int64_t k = 0; k < n; ++k) {
      scan.look();
      const std::int64_t slave = scan.size("a periodic node");
      const std::int64_t master = scan.size("a periodic node's master");
      link.nodes.emplace_back(reading.node(slave, "periodic entity", link.entity),
                              reading.node(master, "periodic entity", link.entity));
    }
    scan.add(reading.mesh.periodic, std::move(link));
  }
}

}  // namespace varimesh::formats
