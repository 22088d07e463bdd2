// The table of formats, and the choice of a format by content, by name and by file name.
#include "core/formats/formats.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <filesystem>
#include <optional>

#include "core/formats/abaqus/abaqus.h"
#include "core/formats/common/reading_notes.h"
#include "core/formats/format_table.h"
#include "core/formats/gmf/gmf.h"
#include "core/formats/gmsh/read.h"
#include "core/formats/gmsh/write.h"
#include "core/formats/hdf5/hdf5.h"
#include "core/formats/hdf5/process.h"
#include "core/formats/ism/ism.h"
#include "core/formats/mfem/mfem.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/numbering/cgns_order.h"
#include "core/formats/other_files.h"
#include "core/formats/stoppable_write.h"
#include "core/formats/su2/su2.h"
#include "core/formats/vtu/read.h"
#include "core/formats/vtu/write.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

// The format that is written if nothing else decides.
constexpr Format kDefaultFormat = Format::Msh41Binary;
constexpr std::string_view kDefaultExtension = ".msh";

template <class... Functions>
constexpr FormatEntry row(Format format, std::string_view extension, Functions... functions) {
  return {format, format_name(format), extension, functions...};
}

// One row per format.
constexpr std::array kTable = {
    row(Format::Msh22, ".msh", begins_like_gmsh, read_gmsh, write_gmsh, nullptr, nullptr, kMaxOrder, true),
    row(Format::Msh22Binary, ".msh", begins_like_gmsh, read_gmsh, write_gmsh, nullptr, nullptr, kMaxOrder, true),
    row(Format::Msh41, ".msh", begins_like_gmsh, read_gmsh, write_gmsh, nullptr, nullptr, kMaxOrder, true),
    row(Format::Msh41Binary, ".msh", begins_like_gmsh, read_gmsh, write_gmsh, nullptr, nullptr, kMaxOrder, true),
    row(Format::Vtu, ".vtu", begins_like_vtk, read_vtu, write_vtu, not_in_vtu, nullptr, 2, true),
    row(Format::Mfem, ".mesh", begins_like_mfem, read_mfem, write_mfem, not_in_mfem, check_mfem_sides),
    row(Format::Nektar, ".xml", begins_like_nektar, read_nektar, write_nektar, not_in_nektar, check_nektar_sides),
    row(Format::Su2, ".su2", nullptr, nullptr, write_su2, not_in_su2),
    row(Format::Ism, ".ism", begins_like_ism, read_ism),
    row(Format::Hopr, ".h5", begins_like_hdf5, read_hdf5, write_hdf5, not_in_hopr, check_hopr_sides),
    row(Format::Cgns, ".cgns", begins_like_hdf5, read_hdf5, write_hdf5, not_in_cgns, nullptr, 4, true),
    row(Format::Pyfr, ".pyfrm", nullptr, nullptr, write_hdf5, not_in_pyfr, check_pyfr_sides),
    row(Format::Abaqus, ".inp", begins_like_abaqus, read_abaqus),
    row(Format::Gmf, ".meshb", begins_like_gmf, read_gmf),
    row(Format::Exodus, ".exo", begins_like_hdf5, read_hdf5),
};

constexpr std::array kInfos = [] {
  std::array<FormatInfo, kTable.size()> infos{};
  for (std::size_t i = 0; i < kTable.size(); ++i)
    infos[i] = {kTable[i].format, kTable[i].name, kTable[i].extension, kTable[i].read != nullptr,
                kTable[i].write != nullptr};
  return infos;
}();

const FormatEntry* find(std::span<const FormatEntry> table, Format format) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const auto& entry) { return entry.format == format; });
  return found == table.end() ? nullptr : &*found;
}

// The format to write to a file with this extension: `read_as` if it has the extension, otherwise the last in the table
// that has. Null if no format has the extension.
const FormatEntry* find_by_extension(std::span<const FormatEntry> table, std::string_view extension, Format read_as) {
  const FormatEntry* found = nullptr;
  for (const FormatEntry& entry : table) {
    if (entry.extension != extension || entry.write == nullptr) continue;
    if (entry.format == read_as) return &entry;
    found = &entry;
  }
  return found;
}

// The extension of a path that a format of the table has, in lower case; empty if there is none.
std::string_view known_extension(std::span<const FormatEntry> table, std::string_view path) {
  std::string lower(path);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  for (const FormatEntry& entry : table)
    if (lower.ends_with(entry.extension)) return entry.extension;
  return {};
}

// The names of the formats that can be written, with commas between them.
std::string written_names(std::span<const FormatEntry> table) {
  std::string names = "auto";
  for (const FormatEntry& entry : table)
    if (entry.write != nullptr) names += ", " + std::string(entry.name);
  return names;
}

tl::unexpected<Error> only_read(std::span<const FormatEntry> table, const FormatEntry& entry) {
  return bad_option("The format " + std::string(entry.name) +
                    " can only be read; the formats that can be written are " + written_names(table) + ".");
}

// Completes serendipity elements and those of lower order, and notes it.
Expected<void> complete(HighOrderMesh& mesh, std::int64_t file_bytes, int threads, const StopToken* stop) {
  std::int64_t taken = std::int64_t(mesh.node_count()) * std::int64_t(4 * sizeof(double));
  for (const ElementBlock& block : mesh.blocks)
    taken += std::int64_t(block.nodes.size() * sizeof(std::int32_t) + block.size() * sizeof(std::int64_t));
  Allowance allowance(most_memory_to_read(file_bytes, threads) - taken, stop, WithheldMemory::current());
  const auto done = complete_elements(mesh, allowance);
  if (!done) return tl::unexpected(done.error());
  note_reading(mesh, done->sentences);
  remember_serendipity(mesh, done->serendipity);
  remember_lower(mesh, done->lower);
  return {};
}

// Whether the format has such elements of these shapes.
bool has_serendipity(const FormatEntry& entry, const std::vector<Shape>& shapes, int order) {
  if (order > entry.serendipity_order) return false;
  return entry.format != Format::Cgns ||
         std::ranges::all_of(shapes, [&](Shape shape) { return cgns_serendipity_type(shape, order) != 0; });
}

// The mesh with the serendipity elements that it came with, if it still consists of such and the format has them.
std::optional<HighOrderMesh> with_serendipity(const HighOrderMesh& mesh, const FormatEntry& entry) {
  const std::vector<Shape> shapes = serendipity_of(mesh);
  if (shapes.empty() || !has_serendipity(entry, shapes, mesh.order)) return std::nullopt;
  return as_serendipity(mesh, shapes);
}

// The elements that are to have the orders at which they came, as far as the format has such elements.
std::vector<CameLower> wanted_lower(const HighOrderMesh& mesh, const FormatEntry& entry) {
  std::vector<CameLower> lower = lower_of(mesh);
  std::erase_if(lower, [&](const CameLower& run) {
    return !entry.several_orders || (run.serendipity && run.order > entry.serendipity_order);
  });
  return lower;
}

// The mesh as a file of the format has it, if that is not the mesh itself: with the serendipity elements and the orders
// that it came with.
std::optional<HighOrderMesh> as_it_came(const HighOrderMesh& mesh, const FormatEntry& entry) {
  std::optional<HighOrderMesh> came = with_serendipity(mesh, entry);
  const std::vector<CameLower> lower = wanted_lower(mesh, entry);
  if (lower.empty()) return came;
  OwnOrders own = at_own_orders(came ? *came : mesh, lower);
  if (own.lowered > 0) came = std::move(own.mesh);
  return came;
}

// Why elements that came as serendipity elements are not written so; empty if they are.
std::string no_serendipity(const HighOrderMesh& mesh, const FormatEntry& entry) {
  if (serendipity_of(mesh).empty() || with_serendipity(mesh, entry)) return {};
  const std::string complete =
      "The elements that came as serendipity elements are written as complete elements of order " +
      std::to_string(mesh.order) + ", because ";
  return complete + (!has_serendipity(entry, serendipity_of(mesh), mesh.order)
                         ? "the format has no others."
                         : "the nodes inside their faces are no longer where serendipity elements would have them.");
}

// What became of the elements that came at a lower order than others; empty if nobody asked for their orders.
std::string orders_text(const HighOrderMesh& mesh, const FormatEntry& entry) {
  if (lower_of(mesh).empty()) return {};
  const std::string order = std::to_string(mesh.order);
  const std::vector<CameLower> lower = wanted_lower(mesh, entry);
  if (lower.empty())
    return "The elements that came at lower orders are written at order " + order +
           ", because the format has no such elements beside others.";
  const OwnOrders own = at_own_orders(mesh, lower);
  const auto elements = [](std::int64_t count) {
    return std::to_string(count) + (count == 1 ? " element" : " elements");
  };
  std::string text;
  if (own.lowered > 0)
    text = elements(own.lowered) + (own.lowered == 1 ? " has its" : " have their") + " own lower order again.";
  if (own.raised > 0)
    text += (text.empty() ? "" : " ") + elements(own.raised) + " that came at a lower order" +
            (own.raised == 1 ? " stays" : " stay") + " at order " + order + ", because " +
            (own.raised == 1 ? "its" : "their") + " own order would lose some of the geometry.";
  return text;
}

// Standard output is a device of this name, also if it goes into a file. /dev/shm is a folder for files in memory.
bool is_device_or_pipe(std::string_view path) {
  std::error_code error;
  const auto status = std::filesystem::status(std::filesystem::path(path), error);
  return (!error && std::filesystem::is_other(status)) || (path.starts_with("/dev/") && !path.starts_with("/dev/shm/"));
}

}  // namespace

// === For any table =======================================================================================

Expected<Format> from_name(std::span<const FormatEntry> table, std::string_view name) {
  if (name == "auto" || name.empty()) return Format::Auto;
  for (const FormatEntry& entry : table)
    if (entry.name == name) return entry.format;
  return bad_option("There is no format '" + std::string(name) + "'; the formats that can be written are " +
                    written_names(table) + ".");
}

Expected<Format> for_output(std::span<const FormatEntry> table, std::string_view path, Format requested,
                            Format read_as) {
  std::string_view extension = known_extension(table, path);
  if (const FormatEntry* entry = find(table, requested)) {
    if (entry->write == nullptr) return only_read(table, *entry);
    if (!extension.empty() && extension != entry->extension)
      return bad_option("The ending of '" + std::string(path) + "' contradicts the format " + std::string(entry->name) +
                        "; change one of them.");
    return requested;
  }
  if (extension.empty() && is_device_or_pipe(path)) extension = kDefaultExtension;
  if (const FormatEntry* entry = find_by_extension(table, extension, read_as)) return entry->format;
  for (const FormatEntry& entry : table)
    if (!extension.empty() && entry.extension == extension) return only_read(table, entry);
  return bad_option("The format of '" + std::string(path) +
                    "' cannot be determined from its ending; use the ending .msh, .vtu, .mesh, .xml, .su2, .h5, .cgns "
                    "or .pyfrm, or name the format.");
}

Expected<MeshFile> read(std::span<const FormatEntry> table, std::string_view bytes, int threads,
                        const StopToken* stop) {
  constexpr std::string_view kMarkOfUtf8 = "\xef\xbb\xbf";  // with which editors of Windows begin a text
  if (bytes.starts_with(kMarkOfUtf8)) bytes.remove_prefix(kMarkOfUtf8.size());
  const auto entry = std::find_if(table.begin(), table.end(), [&](const FormatEntry& each) {
    return each.recognises != nullptr && each.recognises(bytes);
  });
  if (entry == table.end()) return bad_input(why_not_a_mesh(bytes));
  try {
    Team team(threads);
    team.set_stop(stop);
    Expected<MeshFile> file;
    team.run([&] { file = entry->read(bytes, team); });
    if (file)
      if (const auto done = complete(file->mesh, std::int64_t(bytes.size()), threads, stop); !done)
        return tl::unexpected(done.error());
    return file;
  } catch (const ReadFailure& failure) {
    return bad_input(failure.sentence);
  } catch (const Interrupted&) {
    return bad_input("Reading the mesh file was stopped before its end.");
  } catch (const std::bad_alloc&) {
    return bad_input("The mesh file cannot be read: it needs more memory than is available.");
  }
}

Expected<void> write(std::span<const FormatEntry> table, const HighOrderMesh& mesh, Format format, const Sink& sink,
                     std::span<const CellField> fields, int threads, const StopToken* stop) {
  const FormatEntry* entry = find(table, format == Format::Auto ? kDefaultFormat : format);
  assert(entry != nullptr);
  if (entry->write == nullptr) return only_read(table, *entry);
  Team team(threads);
  team.set_stop(stop);
  const Sink stoppable = [&](std::string_view bytes) { return !(stop != nullptr && stop->stopped()) && sink(bytes); };
  Expected<void> written;
  const std::optional<HighOrderMesh> came = as_it_came(mesh, *entry);
  bool interrupted = false;
  try {
    team.run([&] { written = entry->write(came ? *came : mesh, entry->format, stoppable, fields, team); });
  } catch (const Interrupted&) {
    interrupted = true;
  }
  if (interrupted || (!written && stop != nullptr && stop->reason() != StopToken::Reason::None))
    return tl::unexpected(Error{Error::Kind::Output, "Writing the mesh file was stopped before its end."});
  return written;
}

// === For the formats of this library =====================================================================

std::span<const FormatEntry> format_table() { return kTable; }

std::span<const FormatInfo> all() { return kInfos; }

Expected<Format> from_name(std::string_view name) { return from_name(kTable, name); }

Expected<Format> for_output(std::string_view path, Format requested, Format read_as) {
  return for_output(kTable, path, requested, read_as);
}

bool has_hdf5() { return !hdf5_program().empty(); }

Format recognised(std::string_view bytes) {
  for (const FormatEntry& entry : kTable)
    if (entry.recognises != nullptr && entry.recognises(bytes)) return entry.format;
  return Format::Auto;
}

Expected<MeshFile> read(std::string_view bytes, int threads, const StopToken* stop) {
  return read(kTable, bytes, threads, stop);
}

std::string left_out(const HighOrderMesh& mesh, Format format) {
  const FormatEntry* entry = find(kTable, format == Format::Auto ? kDefaultFormat : format);
  assert(entry != nullptr);
  std::string text = entry->left_out == nullptr ? "" : entry->left_out(mesh);
  for (const std::string& more : {no_serendipity(mesh, *entry), orders_text(mesh, *entry)})
    text += (text.empty() || more.empty() ? "" : " ") + more;
  return text;
}

Expected<void> check_sides(const HighOrderMesh& mesh, Format format, int threads) {
  const FormatEntry* entry = find(kTable, format);
  if (entry == nullptr || entry->check_sides == nullptr) return {};
  const Team team(threads);
  Expected<void> checked;
  team.run([&] { checked = entry->check_sides(mesh, team); });
  return checked;
}

Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                     int threads) {
  return write(kTable, mesh, format, sink, fields, threads);
}

Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                     int threads, const StopToken* stop) {
  return write(kTable, mesh, format, sink, fields, threads, stop);
}

}  // namespace varimesh::formats
