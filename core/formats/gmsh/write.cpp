// Writes Gmsh's MSH files: the sections that are the same in both versions.
// Format: Gmsh reference manual, "MSH file format" (4.1) and "MSH file format version 2" (2.2).
#include "core/formats/gmsh/write.h"

#include <algorithm>
#include <limits>

#include "core/formats/common/format.h"
#include "core/formats/gmsh/types.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

const ForeignSection* kept_section(const HighOrderMesh& mesh, Format format, std::string_view name) {
  for (const ForeignSection& section : mesh.foreign)
    if (section.name == name && section.format == format_name(format)) return &section;
  return nullptr;
}

namespace {

// Checks that the format has a type for every element, and that the numbers fit.
Expected<void> check_writable_as(const HighOrderMesh& mesh, Format format) {
  for (const ElementBlock& block : mesh.blocks)
    if (gmsh_type_number(block.shape, block.order) == 0)
      return bad_option("MSH has no element type for " + std::string(reference::info(block.shape).plural) +
                        " of order " + std::to_string(block.order) +
                        "; write another format, such as vtu, or lower the order.");
  if (format != Format::Msh22Binary) return {};
  constexpr std::int64_t kLargest = std::numeric_limits<std::int32_t>::max();
  if (largest_number_22(mesh) > kLargest || std::any_of(mesh.node_numbers.begin(), mesh.node_numbers.end(),
                                                        [](std::int64_t number) { return number > kLargest; }))
    return bad_option(
        "Binary MSH 2.2 cannot contain node or element numbers above 2147483647; write msh41-binary instead.");
  return {};
}

void write_header(bool version22, BufferedOutput& out) {
  out.text(version22 ? "$MeshFormat\n2.2 " : "$MeshFormat\n4.1 ");
  out.text(out.binary ? "1 8\n" : "0 8\n");
  if (out.binary) {
    out.integer(1);
    out.text("\n");
  }
  out.text("$EndMeshFormat\n");
}

// A name as it can stand between quotation marks on one line. Other formats may have names of several lines.
std::string on_one_line(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return name;
}

void write_physical_names(const HighOrderMesh& mesh, BufferedOutput& out) {
  if (mesh.physical_groups.empty()) return;
  out.text("$PhysicalNames\n");
  out.text_integer(std::int64_t(mesh.physical_groups.size()));
  for (const PhysicalGroup& group : mesh.physical_groups) {
    out.text("\n");
    out.text_integer(group.dimension);
    out.text(" ");
    out.text_integer(group.tag);
    out.text(" \"");
    out.text(on_one_line(group.name));
    out.text("\"");
  }
  out.text("\n$EndPhysicalNames\n");
}

// Writes the sections that were read from this format. write_body_41() writes $PartitionedEntities.
void write_foreign(const HighOrderMesh& mesh, Format format, BufferedOutput& out) {
  for (const ForeignSection& section : mesh.foreign) {
    if (section.format != format_name(format) || section.name == "PartitionedEntities") continue;
    out.text("$");
    out.text(section.name);
    out.text("\n");
    out.text(section.bytes);
    out.text("$End");
    out.text(section.name);
    out.text("\n");
  }
}

// A field as $ElementData, without cells whose value is 0. The element numbers are those of 32 bits in binary files of
// both versions.
void write_field(const HighOrderMesh& mesh, const CellField& field, BufferedOutput& out) {
  const Cells cells(mesh, mesh.dimension);
  std::vector<std::size_t> with_value;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    if (field.values[cell] == 0) continue;
    if (cells.number(cell) > std::numeric_limits<std::int32_t>::max()) return;
    with_value.push_back(cell);
  }
  if (with_value.empty()) return;
  out.text("$ElementData\n1\n\"");
  out.text(on_one_line(field.name));
  out.text("\"\n1\n0\n3\n0\n1\n");  // the time; the time step, one component
  out.text_integer(std::ssize(with_value));
  out.text("\n");
  for (const std::size_t cell : with_value) {
    out.integer(static_cast<int>(cells.number(cell)));
    if (out.binary)
      out.number(field.values[cell]);
    else
      out.text_number(field.values[cell]);
    out.end_line();
  }
  out.text(out.binary ? "\n$EndElementData\n" : "$EndElementData\n");
}

}  // namespace

Expected<void> write_gmsh(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team) {
  if (auto possible = check_writable_as(mesh, format); !possible) return possible;
  const bool version22 = format == Format::Msh22 || format == Format::Msh22Binary;
  BufferedOutput out(sink, format == Format::Msh22Binary || format == Format::Msh41Binary, team);
  write_header(version22, out);
  write_physical_names(mesh, out);
  if (version22)
    write_body_22(mesh, out);
  else
    write_body_41(mesh, format, out);
  write_foreign(mesh, format, out);
  for (const CellField& field : fields) write_field(mesh, field, out);
  return out.finish();
}

}  // namespace varimesh::formats
