// Reads the sections of MSH 2.2, ASCII and binary.
#include "core/formats/common/pieces.h"
#include "core/formats/gmsh/read.h"

namespace varimesh::formats {

// === Nodes ===============================================================================================

namespace {

struct NodesRead {
  std::vector<std::int64_t> numbers;
  std::vector<double> coordinates;
};

// Appends one node.
void read_node(Scanner& from, bool parametric, std::vector<std::int64_t>& numbers, std::vector<double>& coordinates) {
  from.look();
  from.add<std::int64_t>(numbers, from.binary ? from.integer("a node's number") : from.text_integer("a node's number"));
  const auto name = [&] { return "node " + std::to_string(numbers.back()); };
  for (std::size_t k = 0; k < 3; ++k) from.add(coordinates, from.finite(from.number("a node's coordinate"), name));
  if (!parametric) return;
  // Parameters on the entity are skipped, because they are wrong after the nodes have moved.
  const int dimension = from.integer("a node's entity dimension");
  from.integer("a node's entity");
  const int parameters = dimension == 1 || dimension == 2 ? dimension : 0;
  for (int k = 0; k < parameters; ++k) from.number("a node's parameter");
}

}  // namespace

void read_nodes_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  HighOrderMesh& mesh = reading.mesh;
  const bool parametric = scan.section == "ParametricNodes";
  const std::int64_t n = scan.count("the number of nodes", 8, true);
  if (scan.binary) scan.line();
  scan.reserve(mesh.node_numbers, std::size_t(n));
  scan.reserve(mesh.coordinates, std::size_t(3 * n));
  constexpr std::size_t kNode = sizeof(std::int32_t) + 3 * sizeof(double);  // the bytes of one in binary
  const auto parse = [&](const BytesPiece& piece, Scanner& from) {
    NodesRead read;
    if (from.binary) {
      from.reserve(read.numbers, piece.bytes.size() / kNode);
      from.reserve(read.coordinates, 3 * (piece.bytes.size() / kNode));
    }
    for (from.skip_space_of_text(); !from.at_end(); from.skip_space_of_text())
      read_node(from, parametric, read.numbers, read.coordinates);
    return read;
  };
  const auto take = [&](const BytesPiece&, const NodesRead& read) {
    if (read.numbers.size() > std::size_t(n) - mesh.node_numbers.size()) return false;
    mesh.node_numbers.insert(mesh.node_numbers.end(), read.numbers.begin(), read.numbers.end());
    mesh.coordinates.insert(mesh.coordinates.end(), read.coordinates.begin(), read.coordinates.end());
    return true;
  };
  // In binary, nodes with parameters differ in size.
  if (!parametric || !scan.binary) read_in_pieces(scan, reading.team, RecordCutter(scan, n, kNode), parse, take);
  while (mesh.node_numbers.size() < std::size_t(n)) read_node(scan, parametric, mesh.node_numbers, mesh.coordinates);
  mesh.node_blocks.push_back({-1, 0, 0, std::int32_t(n)});
  reading.index.build(mesh.node_numbers, scan);
}

// The section is text, also in binary files.
void read_periodic_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t links = scan.count("the number of periodic links", 6, true);
  for (std::int64_t i = 0; i < links; ++i) {
    scan.look();
    PeriodicLink link;
    link.dimension = int(scan.text_integer("a periodic entity's dimension"));
    link.entity = int(scan.text_integer("a periodic entity"));
    link.master = int(scan.text_integer("a periodic entity's master"));
    scan.skip_space();
    if (scan.peek() == 'A') {
      constexpr std::string_view kAffine = "Affine";
      const std::string_view line = scan.line();
      if (!line.starts_with(kAffine))
        scan.fail("a periodic link's affine map was expected, which begins with 'Affine'");
      Scanner affine(line.substr(kAffine.size()));
      affine.section = scan.section;
      for (affine.skip_space(); !affine.at_end(); affine.skip_space())
        scan.add(link.affine, affine.text_number("a periodic link's affine map"));
    }
    const std::int64_t n = scan.count("the number of periodic nodes", 3, true);
    scan.reserve(link.nodes, std::size_t(n));
    for (std::int64_t k = 0; k < n; ++k) {
      scan.look();
      const std::int64_t slave = scan.text_integer("a periodic node");
      const std::int64_t master = scan.text_integer("a periodic node's master");
      link.nodes.emplace_back(reading.node(slave, "periodic entity", link.entity),
                              reading.node(master, "periodic entity", link.entity));
    }
    scan.add(reading.mesh.periodic, std::move(link));
  }
}

}  // namespace varimesh::formats
