// Writes the sections of MSH 2.2, ASCII and binary.
#include <algorithm>
#include <cstdlib>
#include <limits>

#include "core/formats/gmsh/types.h"
#include "core/formats/gmsh/write.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

void write_node(const HighOrderMesh& mesh, std::size_t i, BufferedOutput& out) {
  const double* x = mesh.coordinates.data() + 3 * i;
  if (out.binary) {
    out.integer(int(mesh.node_numbers[i]));
    for (int k = 0; k < 3; ++k) out.number(x[k]);
    return;
  }
  out.text_integer(mesh.node_numbers[i]);
  for (int k = 0; k < 3; ++k) {
    out.text(" ");
    out.text_number(x[k]);
  }
  out.text("\n");
}

void write_nodes(const HighOrderMesh& mesh, BufferedOutput& out) {
  out.text("$Nodes\n");
  out.text_integer(std::int64_t(mesh.node_count()));
  out.text("\n");
  out.shared(mesh.node_count(), kNodesPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) write_node(mesh, i, piece);
  });
  out.text(out.binary ? "\n$EndNodes\n" : "$EndNodes\n");
}

// The data of an element that differ between its repetitions. In binary each element is a group of one, as in Gmsh's
// own files.
struct ElementLine {
  int type;
  std::int64_t number;
  int physical;
};

void write_element(const HighOrderMesh& mesh, const ElementBlock& block, ElementLine line,
                   std::span<const std::int32_t> nodes, BufferedOutput& out) {
  const int tags = block.partitions.empty() ? 2 : 3 + int(block.partitions.size());
  if (out.binary) {
    for (int value : {line.type, 1, tags, int(line.number)}) out.integer(value);
  } else {
    out.size(line.number);
    out.integer(line.type);
    out.integer(tags);
  }
  out.integer(line.physical);
  out.integer(block.entity);
  if (!block.partitions.empty()) out.integer(int(block.partitions.size()));
  for (int partition : block.partitions) out.integer(partition);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const std::int64_t number = mesh.node_numbers[std::size_t(nodes[k])];
    if (out.binary) {
      out.integer(int(number));
    } else {
      out.text_integer(number);
      out.text(k + 1 < nodes.size() ? " " : "\n");
    }
  }
}

// The tag of the group in MSH 2.2. A negative tag in MSH 4.1 means that the group reverses the entity. Gmsh's own 2.2
// files have no such sign.
int group_tag(const HighOrderMesh& mesh, int tag) {
  return mesh.entities.empty() || tag == std::numeric_limits<int>::min() ? tag : std::abs(tag);
}

// How often each element of the block is repeated.
std::size_t copies_of(const ElementBlock& block) { return block.physical.empty() ? 0 : block.physical.size() - 1; }

// Whether the repetitions of the block's elements have the numbers of a file.
bool has_repeat_numbers(const ElementBlock& block) {
  return block.repeat_numbers.size() == copies_of(block) * block.size();
}

// The largest number of an element of the mesh. New numbers follow it.
std::int64_t largest_number(const HighOrderMesh& mesh) {
  std::int64_t largest = 0;
  for (const ElementBlock& block : mesh.blocks) {
    for (std::int64_t number : block.numbers) largest = std::max(largest, number);
    for (std::int64_t number : block.repeat_numbers) largest = std::max(largest, number);
  }
  return largest;
}

// An element in several physical groups is repeated for each further group, directly after itself, as Gmsh does it. The
// repetition has the number that it had in an MSH 2.2 file, or a new number. The reader joins repetitions again.
void write_elements(const HighOrderMesh& mesh, BufferedOutput& out) {
  std::int64_t lines = 0, fresh = largest_number(mesh);
  for (const ElementBlock& block : mesh.blocks) lines += std::int64_t(block.size() * (1 + copies_of(block)));
  out.text("$Elements\n");
  out.text_integer(lines);
  out.text("\n");
  for (const ElementBlock& block : mesh.blocks) {
    const std::size_t per_element = nodes_per_element(block);
    const int type = gmsh_type_number(block);
    const std::size_t copies = copies_of(block);
    const bool known = has_repeat_numbers(block);
    // Tags of the groups. An element without a group has the tag 0.
    std::vector<int> tags;
    for (const int tag : block.physical) tags.push_back(group_tag(mesh, tag));
    if (tags.empty()) tags.push_back(0);
    out.shared(block.size(), elements_per_piece(per_element),
               [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
                 for (std::size_t e = begin; e < end; ++e) {
                   const std::span nodes(block.nodes.data() + e * per_element, per_element);
                   write_element(mesh, block, {type, block.numbers[e], tags[0]}, nodes, piece);
                   for (std::size_t k = 0; k < copies; ++k) {
                     const std::size_t copy = e * copies + k;
                     const std::int64_t number = known ? block.repeat_numbers[copy] : fresh + std::int64_t(copy) + 1;
                     write_element(mesh, block, {type, number, tags[k + 1]}, nodes, piece);
                   }
                 }
               });
    if (!known) fresh += std::int64_t(copies * block.size());
  }
  out.text(out.binary ? "\n$EndElements\n" : "$EndElements\n");
}

// The section is text, also in binary files.
void write_periodic(const HighOrderMesh& mesh, BufferedOutput& out) {
  if (mesh.periodic.empty()) return;
  const auto pair = [&](std::int64_t a, std::int64_t b) {
    out.text_integer(a);
    out.text(" ");
    out.text_integer(b);
    out.text("\n");
  };
  out.text("$Periodic\n");
  out.text_integer(std::int64_t(mesh.periodic.size()));
  out.text("\n");
  for (const PeriodicLink& link : mesh.periodic) {
    out.text_integer(link.dimension);
    out.text(" ");
    pair(link.entity, link.master);
    if (!link.affine.empty()) {
      out.text("Affine");
      for (double value : link.affine) {
        out.text(" ");
        out.text_number(value);
      }
      out.text("\n");
    }
    out.text_integer(std::int64_t(link.nodes.size()));
    out.text("\n");
    for (const auto& [node, master] : link.nodes)
      pair(mesh.node_numbers[std::size_t(node)], mesh.node_numbers[std::size_t(master)]);
  }
  out.text("$EndPeriodic\n");
}

}  // namespace

std::int64_t largest_number_22(const HighOrderMesh& mesh) {
  std::int64_t largest = largest_number(mesh);
  for (const ElementBlock& block : mesh.blocks)
    if (!has_repeat_numbers(block)) largest += std::int64_t(copies_of(block) * block.size());
  return largest;
}

void write_body_22(const HighOrderMesh& mesh, BufferedOutput& out) {
  write_nodes(mesh, out);
  write_elements(mesh, out);
  write_periodic(mesh, out);
}

}  // namespace varimesh::formats
