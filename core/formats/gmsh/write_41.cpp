// Writes the sections of MSH 4.1, ASCII and binary.
#include <algorithm>
#include <limits>

#include "core/formats/gmsh/entities.h"
#include "core/formats/gmsh/types.h"
#include "core/formats/gmsh/write.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/node_parameters.h"

namespace varimesh::formats {

namespace {

void begin(BufferedOutput& out, std::string_view name) {
  out.text("$");
  out.text(name);
  out.text("\n");
}

// A binary section still needs a line break. An ASCII section already ends with one.
void end(BufferedOutput& out, std::string_view name) {
  out.text(out.binary ? "\n$End" : "$End");
  out.text(name);
  out.text("\n");
}

void write_tags(BufferedOutput& out, const std::vector<int>& tags) {
  out.size(std::int64_t(tags.size()));
  for (int tag : tags) out.integer(tag);
}

void write_entities(const std::vector<Entity>& entities, BufferedOutput& out) {
  if (entities.empty()) return;
  begin(out, "Entities");
  for (int d = 0; d < 4; ++d)
    out.size(std::count_if(entities.begin(), entities.end(), [&](const Entity& e) { return e.dimension == d; }));
  out.end_line();
  for (int d = 0; d < 4; ++d)
    for (const Entity& entity : entities) {
      if (entity.dimension != d) continue;
      out.integer(entity.tag);
      for (std::size_t k = 0; k < (d == 0 ? 3 : 6); ++k) out.number(entity.box[k]);
      write_tags(out, entity.physical);
      if (d > 0) write_tags(out, entity.boundary);
      out.end_line();
    }
  end(out, "Entities");
}

void write_nodes(const HighOrderMesh& mesh, const Classification& where, BufferedOutput& out) {
  const auto node = [&](std::size_t i) { return where.node_order.empty() ? i : std::size_t(where.node_order[i]); };
  const auto [least, most] = std::minmax_element(mesh.node_numbers.begin(), mesh.node_numbers.end());
  const bool any = !mesh.node_numbers.empty();
  begin(out, "Nodes");
  for (std::int64_t value :
       {std::int64_t(where.node_blocks.size()), std::int64_t(mesh.node_count()), any ? *least : 0, any ? *most : 0})
    out.size(value);
  out.end_line();
  for (const NodeBlock& block : where.node_blocks) {
    // Gmsh reads three parameters of a node in a volume, which nobody has.
    const std::size_t parameters = has_parameters(block) ? parameters_per_node(block.dimension) : 0;
    for (int value : {block.dimension, block.entity, parameters > 0 ? 1 : 0}) out.integer(value);
    out.size(block.count);
    out.end_line();
    const auto first = std::size_t(block.first), count = std::size_t(block.count);
    out.shared(count, kNodesPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
      for (std::size_t i = first + begin; i < first + end; ++i) {
        piece.size(mesh.node_numbers[node(i)]);
        piece.end_line();
      }
    });
    out.shared(count, kNodesPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
      for (std::size_t i = first + begin; i < first + end; ++i) {
        for (std::size_t k = 0; k < 3; ++k) piece.number(mesh.coordinates[3 * node(i) + k]);
        for (std::size_t k = 0; k < parameters; ++k) piece.number(block.parameters[parameters * (i - first) + k]);
        piece.end_line();
      }
    });
  }
  end(out, "Nodes");
}

void write_elements(const HighOrderMesh& mesh, const Classification& where, BufferedOutput& out) {
  std::int64_t count = 0, least = std::numeric_limits<std::int64_t>::max(), most = 0;
  for (const ElementBlock& block : mesh.blocks)
    for (std::int64_t number : block.numbers) {
      ++count;
      least = std::min(least, number);
      most = std::max(most, number);
    }
  begin(out, "Elements");
  for (std::int64_t value : {std::int64_t(mesh.blocks.size()), count, count > 0 ? least : 0, most}) out.size(value);
  out.end_line();
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const std::size_t per_element = nodes_per_element(block);
    for (int value : {reference::info(block.shape).dimension, where.block_entity[b], gmsh_type_number(block)})
      out.integer(value);
    out.size(std::int64_t(block.size()));
    out.end_line();
    out.shared(block.size(), elements_per_piece(per_element),
               [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
                 const std::int32_t* node = block.nodes.data() + begin * per_element;
                 for (std::size_t e = begin; e < end; ++e) {
                   piece.size(block.numbers[e]);
                   for (std::size_t k = 0; k < per_element; ++k) piece.size(mesh.node_numbers[std::size_t(*node++)]);
                   piece.end_line();
                 }
               });
  }
  end(out, "Elements");
}

void write_periodic(const HighOrderMesh& mesh, BufferedOutput& out) {
  if (mesh.periodic.empty()) return;
  begin(out, "Periodic");
  out.size(std::int64_t(mesh.periodic.size()));
  out.end_line();
  for (const PeriodicLink& link : mesh.periodic) {
    for (int value : {link.dimension, link.entity, link.master}) out.integer(value);
    out.end_line();
    out.size(std::int64_t(link.affine.size()));
    for (double value : link.affine) out.number(value);
    out.end_line();
    out.size(std::int64_t(link.nodes.size()));
    out.end_line();
    for (const auto& [node, master] : link.nodes) {
      out.size(mesh.node_numbers[std::size_t(node)]);
      out.size(mesh.node_numbers[std::size_t(master)]);
      out.end_line();
    }
  }
  end(out, "Periodic");
}

}  // namespace

void write_body_41(const HighOrderMesh& mesh, Format format, BufferedOutput& out) {
  const ForeignSection* partitioned = kept_section(mesh, format, "PartitionedEntities");
  const Classification where = classify_on_entities(mesh, partitioned != nullptr, out.team());
  write_entities(where.entities, out);
  if (partitioned != nullptr) {
    begin(out, "PartitionedEntities");
    out.text(partitioned->bytes);
    out.text("$EndPartitionedEntities\n");
  }
  write_nodes(mesh, where, out);
  write_elements(mesh, where, out);
  write_periodic(mesh, out);
}

}  // namespace varimesh::formats
