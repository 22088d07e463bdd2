// Reads MFEM's meshes: the sections. read_nodes.cpp converts the nodes.
#include "core/formats/mfem/read.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/formats/common/format.h"
#include "core/formats/mfem/attributes.h"
#include "core/formats/mfem/mfem.h"

namespace varimesh::formats {

namespace {

constexpr std::array kShapeOfGeometry = {Shape::Point,       Shape::Line,       Shape::Triangle, Shape::Quadrilateral,
                                         Shape::Tetrahedron, Shape::Hexahedron, Shape::Prism,    Shape::Pyramid};

/// Skips white space and comments, which go from # to the end of the line.
void skip_comments(Scanner& scan) {
  for (scan.skip_space(); scan.peek() == '#'; scan.skip_space()) scan.line();
}

/// The next word; empty at the end of the file.
std::string_view peek_word(Scanner& scan) {
  skip_comments(scan);
  const std::string_view rest = scan.rest();
  std::size_t length = 0;
  while (length < rest.size() && static_cast<unsigned char>(rest[length]) > ' ') ++length;
  return rest.substr(0, length);
}

/// Reads the word if it comes next.
bool accept(Scanner& scan, std::string_view word) {
  if (peek_word(scan) != word) return false;
  scan.go_to(scan.offset() + word.size());
  return true;
}

void expect(Scanner& scan, const char* word) {
  if (accept(scan, word)) return;
  if (scan.at_end()) scan.fail_truncated(word);
  scan.fail("'" + std::string(word) + "' was expected");
}

// === Elements ============================================================================================

// Reads the elements of one dimension, with their vertices only.
void read_elements(MfemReading& reading, int dimension, const char* what) {
  Scanner& scan = reading.scanner;
  const std::int64_t n = scan.count(what, 4);
  std::vector<ElementBlock>& blocks = reading.mesh.blocks;
  const std::size_t own = blocks.size();
  std::int64_t number = 0;
  for (const ElementBlock& block : blocks) number += std::int64_t(block.size());
  for (std::int64_t e = 0; e < n; ++e) {
    scan.look();
    const std::int64_t attribute = scan.text_integer("an element's attribute");
    const std::int64_t geometry = scan.text_integer("an element's geometry type");
    if (attribute < 1 || attribute > kMostAttribute)
      scan.fail("the attribute " + std::to_string(attribute) + " of an element is not from 1 to " +
                std::to_string(kMostAttribute));
    if (geometry < 0 || geometry >= std::ssize(kShapeOfGeometry))
      scan.fail("geometry type " + std::to_string(geometry) + " is not one of MFEM's, which go from 0 to 7");
    const Shape shape = kShapeOfGeometry[std::size_t(geometry)];
    if (reference::info(shape).dimension != dimension)
      scan.fail("an element of geometry type " + std::to_string(geometry) + " does not have dimension " +
                std::to_string(dimension));
    if (blocks.size() == own || blocks.back().shape != shape || blocks.back().entity != int(attribute)) {
      scan.take_memory(kAllocation + sizeof(int));
      scan.add(blocks, ElementBlock{shape, 1, int(attribute), {int(attribute)}, {}, {}, {}, {}});
    }
    ElementBlock& block = blocks.back();
    scan.add(block.numbers, ++number);
    for (int v = 0; v < reference::info(shape).vertices; ++v)
      scan.add(block.nodes, scan.integer("an element's vertex"));
  }
}

// Checks the vertices of all elements, now that their number is known.
void check_vertices(const MfemReading& reading) {
  for (const ElementBlock& block : reading.mesh.blocks) {
    const auto per_element = std::size_t(reference::info(block.shape).vertices);
    for (std::size_t i = 0; i < block.nodes.size(); ++i)
      if (block.nodes[i] < 0 || block.nodes[i] >= reading.vertices)
        reading.scanner.fail("element " + std::to_string(block.numbers[i / per_element]) +
                             " (counted from 1, boundary elements last) refers to vertex " +
                             std::to_string(block.nodes[i]) + ", but the vertices are 0 to " +
                             std::to_string(reading.vertices - 1));
  }
}

// === Attribute sets ======================================================================================

struct AttributeSet {
  std::string name;
  std::vector<int> attributes;
};

std::vector<AttributeSet> read_sets(Scanner& scan) {
  const std::int64_t n = scan.count("the number of attribute sets", 4);
  std::vector<AttributeSet> sets;
  for (std::int64_t i = 0; i < n; ++i) {
    scan.look();
    AttributeSet set;
    skip_comments(scan);
    const std::string_view rest = scan.rest();
    const std::size_t end = rest.find('"', 1);
    if (scan.at_end()) scan.fail_truncated("an attribute set");
    if (rest.front() != '"' || end == std::string_view::npos)
      scan.fail("the name of an attribute set in quotation marks was expected");
    scan.take_memory(end + kAllocation);
    set.name = rest.substr(1, end - 1);
    scan.go_to(scan.offset() + end + 1);
    const std::int64_t size = scan.count("the number of attributes in a set", 2);
    for (std::int64_t k = 0; k < size; ++k) {
      scan.look();
      scan.add(set.attributes, scan.integer("an attribute of a set"));
      if (set.attributes.back() < 1 || set.attributes.back() > kMostAttribute)
        scan.fail("the attribute " + std::to_string(set.attributes.back()) + " of a set is not from 1 to " +
                  std::to_string(kMostAttribute));
    }
    scan.add(sets, std::move(set));
  }
  return sets;
}

// A set of one attribute names the group of the attribute. Any other set becomes a group with a tag of its own, and the
// elements are in this group too.
void name_groups(MfemReading& reading, int dimension, const std::vector<AttributeSet>& sets) {
  if (sets.empty()) return;
  HighOrderMesh& mesh = reading.mesh;
  const Scanner& scan = reading.scanner;
  std::map<int, std::vector<ElementBlock*>> blocks;  // by attribute
  for (ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != dimension) continue;
    scan.take_memory(kTreeNode);
    scan.add(blocks[block.entity], &block);
  }
  std::set<int> tags, named;
  for (const auto& [attribute, own] : blocks) tags.insert(attribute);
  for (const AttributeSet& set : sets) {
    scan.take_memory(3 * set.attributes.size() * kTreeNode);  // tags, named and the set below
    tags.insert(set.attributes.begin(), set.attributes.end());
  }
  for (const AttributeSet& set : sets) {
    const bool names_one = set.attributes.size() == 1 && named.insert(set.attributes[0]).second;
    scan.take_memory(set.name.size() + kAllocation + kTreeNode);
    if (names_one) {
      scan.add(mesh.physical_groups, PhysicalGroup{dimension, set.attributes[0], set.name});
      continue;
    }
    const int tag = tags.empty() ? 1 : *tags.rbegin() + 1;
    tags.insert(tag);
    scan.add(mesh.physical_groups, PhysicalGroup{dimension, tag, set.name});
    for (const int attribute : std::set<int>(set.attributes.begin(), set.attributes.end())) {
      const auto found = blocks.find(attribute);
      if (found == blocks.end()) continue;
      for (ElementBlock* block : found->second) {
        scan.look();
        scan.add(block->physical, tag);
      }
    }
  }
}

// === Sections ============================================================================================

// Returns ten times the version.
int read_version(Scanner& scan) {
  const std::string_view line = scan.line();
  constexpr std::string_view kMesh = "MFEM mesh v1.";
  if (line.starts_with("MFEM NURBS"))
    scan.fail("the mesh is made of NURBS; convert it in MFEM with Mesh::SetCurvature(order) and save it again");
  if (line.starts_with("MFEM INLINE")) scan.fail("the file describes a grid; save the mesh that MFEM makes of it");
  if (line.starts_with("MFEM NC"))
    scan.fail("the mesh is non-conforming (it has hanging nodes), and VariMesh optimises conforming meshes only");
  if (!line.starts_with(kMesh) || line.size() != kMesh.size() + 1 || line.back() < '0' || line.back() > '3')
    scan.fail("the version is not one of 1.0 to 1.3; save the mesh again with Mesh::Save");
  return 10 + (line.back() - '0');
}

// The names of the space's parts, in either of the two headers of a GridFunction.
void read_space(MfemReading& reading) {
  Scanner& scan = reading.scanner;
  const bool versioned = accept(scan, "MFEM");
  if (versioned) scan.line();
  if (!versioned) expect(scan, "FiniteElementSpace");
  expect(scan, "FiniteElementCollection:");
  const std::string_view name = peek_word(scan);
  auto space = mfem_space(name);
  if (!space) scan.fail(space.error().sentence.substr(0, space.error().sentence.size() - 1));
  reading.nodes.space = std::move(*space);
  scan.go_to(scan.offset() + name.size());
  expect(scan, "VDim:");
  reading.nodes.components = scan.integer("the number of components");
  expect(scan, "Ordering:");
  const int ordering = scan.integer("the ordering (0 or 1)");
  if (reading.nodes.components != 2 && reading.nodes.components != 3)
    scan.fail("the nodes have " + std::to_string(reading.nodes.components) + " components; they must have 2 or 3");
  if (reading.nodes.components < reading.mesh.dimension) scan.fail("the nodes have fewer components than dimensions");
  if (ordering != 0 && ordering != 1) scan.fail("the ordering must be 0 (by nodes) or 1 (by components)");
  reading.nodes.by_nodes = ordering == 0;
  // Every vertex of a cell has coordinates of its own, of at least two bytes each.
  if (std::size_t(reading.vertices) * std::size_t(reading.nodes.components) > scan.left())
    scan.fail_truncated("the coordinates of all vertices");
  if (!versioned) return;
  if (peek_word(scan).starts_with("NURBS")) scan.fail("it is a NURBS mesh; save it after Mesh::SetCurvature(order)");
  expect(scan, "End:");
  scan.line();
}

// The nodes of a mesh with straight sides.
void read_vertex_coordinates(MfemReading& reading) {
  Scanner& scan = reading.scanner;
  const int components = scan.integer("the number of components of a vertex");
  if (components < reading.mesh.dimension || components > 3)
    scan.fail("vertices have " + std::to_string(components) + " components in a mesh of dimension " +
              std::to_string(reading.mesh.dimension));
  if (std::size_t(reading.vertices) * std::size_t(components) > scan.left())
    scan.fail_truncated("the vertices' coordinates");
  scan.reserve(reading.mesh.coordinates, 3 * std::size_t(reading.vertices));
  reading.mesh.coordinates.assign(3 * std::size_t(reading.vertices), 0.0);
  for (std::size_t v = 0; v < std::size_t(reading.vertices); ++v, scan.look()) {
    const auto name = [&] { return "vertex " + std::to_string(v) + " (counted from 0)"; };
    for (std::size_t c = 0; c < std::size_t(components); ++c)
      reading.mesh.coordinates[3 * v + c] = scan.finite(scan.number("a vertex's coordinate"), name);
  }
  reading.nodes.components = components;
}

}  // namespace

bool begins_like_mfem(std::string_view bytes) { return bytes.starts_with("MFEM "); }

Expected<MeshFile> read_mfem(std::string_view bytes, const Team& team) {
  Allowance allowance(most_mesh_memory(std::int64_t(bytes.size())), team.stop(), WithheldMemory::current());
  MfemReading reading{team, Scanner(bytes), {}, {}, 0};
  Scanner& scan = reading.scanner;
  scan.allowance = &allowance;
  HighOrderMesh& mesh = reading.mesh;
  const int version = read_version(scan);
  expect(scan, "dimension");
  mesh.dimension = scan.integer("the dimension");
  if (mesh.dimension != 2 && mesh.dimension != 3)
    scan.fail("the mesh has dimension " + std::to_string(mesh.dimension) + "; VariMesh takes dimensions 2 and 3");
  expect(scan, "elements");
  read_elements(reading, mesh.dimension, "the number of elements");
  std::vector<AttributeSet> sets, boundary_sets;
  if (accept(scan, "attribute_sets")) sets = read_sets(scan);
  expect(scan, "boundary");
  read_elements(reading, mesh.dimension - 1, "the number of boundary elements");
  if (accept(scan, "bdr_attribute_sets")) boundary_sets = read_sets(scan);
  if (accept(scan, "vertex_parents")) {
    if (scan.text_integer("the number of hanging vertices") > 0)
      scan.fail("the mesh is non-conforming (it has hanging nodes), and VariMesh optimises conforming meshes only");
    if (accept(scan, "coarse_elements")) scan.fail("the mesh has a tree of refinements; save it as a conforming mesh");
  }
  expect(scan, "vertices");
  reading.vertices = std::int32_t(scan.count("the number of vertices", 1));
  check_vertices(reading);
  name_groups(reading, mesh.dimension, sets);
  name_groups(reading, mesh.dimension - 1, boundary_sets);
  if (accept(scan, "nodes")) {
    read_space(reading);
    read_mfem_nodes(reading);
    remember_mfem_nodes(mesh, reading.nodes);
  } else {
    read_vertex_coordinates(reading);
    mesh.order = 1;
  }
  if (version >= 12) {
    const std::string_view next = peek_word(scan);
    if (next == "communication_groups")
      scan.fail("the file is one part of a distributed mesh; save the whole mesh with ParMesh::SaveAsOne");
    expect(scan, "mfem_mesh_end");
  } else {
    skip_comments(scan);
    if (!scan.at_end())
      scan.fail("something follows the last number: the sections have other sizes than they announce");
  }
  const std::size_t nodes = mesh.node_count();
  scan.reserve(mesh.node_numbers, nodes);
  mesh.node_numbers.resize(nodes);
  for (std::size_t i = 0; i < nodes; ++i) mesh.node_numbers[i] = std::int64_t(i) + 1;
  mesh.node_blocks.push_back({-1, 0, 0, std::int32_t(nodes)});
  return MeshFile{std::move(mesh), Format::Mfem};
}

}  // namespace varimesh::formats
