#include "client/io/inputs.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>

#include "client/cli/option_flags.h"
#include "client/library/failures.h"
#include "client/library/input_file.h"
#include "client/local/local.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/formats/reordering.h"
#include "core/mesh/changes/displacements.h"
#include "core/mesh/changes/merge_nodes.h"
#include "core/mesh/check.h"
#include "core/slide/on_file/slide_on_file.h"

namespace varimesh::client {
namespace {

constexpr const char *kInputGroup = "Input", *kGeometryGroup = "Geometry";

tl::unexpected<Failure> refused(const std::string& path, const Error& error) {
  return refusal("BAD_INPUT", path + ": " + error.sentence);
}

Outcome<void> move_boundary(HighOrderMesh& mesh, const Input& input) {
  if (!input.boundary.empty()) {
    const auto boundary = formats::read_file(input.boundary);
    if (!boundary) return refusal("BAD_INPUT", boundary.error().sentence);
    if (const auto done = replace_boundary(mesh, boundary->mesh); !done) return refused(input.boundary, done.error());
  }
  if (!input.displacements.empty()) {
    const auto text = read_whole(input.displacements, interrupt_ends_calls);
    if (!text) return tl::unexpected(text.error());
    const auto displacements = read_displacements(*text, mesh.dimension);
    if (!displacements) return refused(input.displacements, displacements.error());
    if (const auto done = displace_boundary(mesh, *displacements); !done)
      return refused(input.displacements, done.error());
  }
  return {};
}

void add_boundary_flags(Command command, Input* input) {
  command
      .add("--displacements", &input->displacements,
           "First move boundary nodes of a straight mesh; the file has one line 'number dx dy dz' per node")
      .value("FILE")
      .group(kInputGroup);
  command
      .add("--boundary", &input->boundary,
           "First move each boundary node to the position that the node of the same number has in this mesh, which "
           "contains only the boundary")
      .value("MESH")
      .group(kInputGroup);
  add_repair_flags(command, &input->repairs);
}

void print_sentence(const std::string& sentence) { std::cerr << "varimesh: " << sentence << std::endl; }

}  // namespace

void add_repair_flags(Command command, Repairs* repairs) {
  command
      .add("--node-order", &repairs->node_order,
           "The program whose order the nodes of elements have in an MSH file, if it is not Gmsh's: gmsh, vtk, cgns, "
           "exodus or abaqus")
      .value("NAME")
      .group(kInputGroup);
  command
      .add("--merge-nodes", &repairs->merge,
           "Before all else, join nodes that are at most this far apart, in the mesh's unit of length. Use this for a "
           "mesh that was put together from parts, whose nodes coincide where the parts touch")
      .value("TOLERANCE")
      .from(0.0, 1e300)
      .group(kInputGroup);
}

Expected<void> repair(const Repairs& repairs, formats::MeshFile& file,
                      const std::function<void(const std::string&)>& on_sentence) {
  if (std::isnan(repairs.merge)) return bad_option("--merge-nodes takes a distance, 0 or more, not 'nan'.");
  if (!repairs.node_order.empty())
    if (const auto taken = formats::take_node_order(file.mesh, file.format, repairs.node_order); !taken) return taken;
  if (repairs.merge < 0) return {};
  const std::size_t joined = merge_nodes(file.mesh, repairs.merge);
  on_sentence(std::to_string(joined) + (joined == 1 ? " node was" : " nodes were") + " joined to others.");
  if (const auto whole = check_judgeable(file.mesh); joined > 0 && !whole)
    return bad_input(
        "With nodes joined, the mesh cannot be used: " + whole.error().sentence +
        " Give --merge-nodes a tolerance well below the shortest edge, and above the distances of all nodes "
        "that belong together.");
  return {};
}

std::string fitting_orders_text(const formats::MeshFile& file) {
  const std::vector<std::string> fitting = formats::fitting_node_orders(file.mesh, file.format);
  if (fitting.empty()) return {};
  std::string names;
  for (std::size_t i = 0; i < fitting.size(); ++i)
    names += (i == 0 ? "" : i + 1 == fitting.size() ? " and " : ", ") + fitting[i];
  return "The elements fit together if their nodes are in the order of " + names + "; give --node-order " + fitting[0] +
         ".";
}

Error with_fitting_orders(Error error, const formats::MeshFile& file) {
  if (const std::string fitting = fitting_orders_text(file); !fitting.empty()) error.sentence += " " + fitting;
  return error;
}

void add_input(Command command, Input* input) {
  command.add("input", &input->mesh, "The mesh file to read").required().value("IN");
  add_boundary_flags(command, input);
}

void add_inputs(Command command, std::vector<std::string>* meshes, Input* input) {
  command.add("input", meshes, "The mesh files to read, one job for each").required().value("IN");
  add_boundary_flags(command, input);
}

void add_geometry_flags(Command command, Input* input, bool has_slide_on) {
  command
      .add("--geometry", &input->model,
           "Let boundary nodes slide on the model in this STEP, IGES or BREP file before the mesh is optimised")
      .value("FILE")
      .group(kGeometryGroup);
  add_geometry_options(command, &input->geometry, has_slide_on);
  command["--snap"].needs("--geometry");
  command["--smooth-angle"].needs("--geometry");
}

void add_file_label(const std::string& path, google::protobuf::Map<std::string, std::string>* labels) {
  constexpr std::size_t kMostBytes = 128;  // the contract's limit for a label's value
  std::string name = as_utf8(std::filesystem::path(path).filename().string());
  if (name.empty()) return;
  if (name.size() > kMostBytes) {
    std::size_t from = name.size() - kMostBytes;
    while (from < name.size() && (static_cast<unsigned char>(name[from]) & 0xC0) == 0x80) ++from;
    name = name.substr(from);
  }
  labels->insert({"file", name});
}

Expected<void> check_geometry(const Input& input, const v1::Options& options) {
  const v1::Geometry& geometry = input.geometry;
  if (options.repair() == v1::REPAIR_REFINE && input.model.empty())
    return bad_option(
        "--repair refine needs a model for its new nodes; give it with --geometry, or give --repair split.");
  if (!input.slides()) {
    if (geometry.slide_on() == v1::Geometry::SLIDE_ON_MODEL)
      return bad_option("--slide-on model needs a model; give it with --geometry, or give --slide-on boundary.");
    if (geometry.slide() == v1::Geometry::SLIDE_UNSPECIFIED) return {};
    return bad_option("--slide says which nodes slide; also say on what they slide, with --geometry or --slide-on.");
  }
  const std::string flag = input.model.empty() ? "--slide-on" : "--geometry";
  if (flag == "--geometry" && geometry.slide_on() == v1::Geometry::SLIDE_ON_BOUNDARY)
    return bad_option(
        "--slide-on boundary excludes --geometry, because nodes slide either on a model or on the boundary; leave one "
        "out.");
  if (options.order() > 0)
    return bad_option("--order does not go with " + flag +
                      ", because the new boundary nodes would not lie on the geometry.");
  if (options.free_size() > 0 || options.free_nodes_size() > 0 || options.fix_nodes_size() > 0 ||
      options.region_below() > 0)
    return bad_option(flag + " goes only with --fix, not with other options that fix or free nodes.");
  return {};
}

Outcome<std::optional<v1::Geometry>> hand_over_geometry(Client& client, Input* input) {
  if (!input->slides()) return std::optional<v1::Geometry>();
  v1::Geometry geometry = input->geometry;
  if (!input->model.empty()) {
    std::error_code failed;
    if (!std::filesystem::exists(input->model, failed) || std::filesystem::is_directory(input->model, failed))
      return refusal("BAD_INPUT",
                     "The geometry '" + input->model + "' cannot be read, because it is not a file; check the name.");
    const auto server = client.info();
    if (!server) return tl::unexpected(server.error());
    if (!server->takes_geometries()) return std::optional<v1::Geometry>();
    const auto stored = client.upload_model(input->model);
    if (!stored) return tl::unexpected(stored.error());
    geometry.set_digest(stored->digest());
  }
  input->model.clear();
  input->geometry.Clear();
  return std::optional(std::move(geometry));
}

Outcome<formats::MeshFile> read_moved(const Input& input) {
  auto file = formats::read_file(input.mesh);
  if (!file) return refusal("BAD_INPUT", file.error().sentence);
  if (const auto done = repair(input.repairs, *file, print_sentence); !done)
    return refusal(done.error().kind == Error::Kind::BadOption ? "BAD_OPTION" : "BAD_INPUT", done.error().sentence);
  if (const auto moved = move_boundary(file->mesh, input); !moved) return tl::unexpected(moved.error());
  if (input.keep_orders) formats::keep_orders(file->mesh);  // the job learns from the file which they are
  return std::move(*file);
}

Outcome<void> slide_here(const Input& input, const v1::Options& options, HighOrderMesh& mesh,
                         const std::function<void(const std::string&)>& on_sentence) {
  const EndAtInterrupt ends;
  auto geometry = geometry_options(input.geometry);
  if (!geometry) return refusal("BAD_OPTION", geometry.error().sentence);
  geometry->file = input.model;
  geometry->fix.assign(options.fix().begin(), options.fix().end());
  geometry->threads = options.threads();
  geometry->coupled_seconds = options.time_limit() / 2;
  const auto slid = slide_on_file(mesh, *geometry);
  if (!slid)
    return refusal(slid.error().kind == Error::Kind::BadOption ? "BAD_OPTION" : "BAD_INPUT", slid.error().sentence);
  for (const std::string& sentence : *slid) on_sentence(sentence);
  return {};
}

Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::optional<formats::MeshFile>& moved,
                               const std::function<void()>& on_read) {
  if (!moved) {
    const auto whole = InputFile::open(input.mesh, interrupt_ends_calls);
    if (!whole) return tl::unexpected(whole.error());
    if (on_read) on_read();
    return client.upload(*whole);
  }
  if (on_read) on_read();
  auto curved = InputFile::temporary(input.mesh);
  if (!curved) return tl::unexpected(curved.error());
  // What can only be read is sent as MSH.
  const auto format = formats::for_output("mesh.msh", formats::Format::Auto, moved->format);
  const bool is_written = std::ranges::any_of(
      formats::all(), [&](const auto& info) { return info.format == moved->format && info.writable; });
  const auto written = formats::write(moved->mesh, is_written ? moved->format : *format,
                                      [&](std::string_view bytes) { return curved->append(bytes); });
  if (!written) return file_failure(written.error().sentence);
  return client.upload(*curved);
}

Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::function<void()>& on_read) {
  if (!input.changes_mesh()) return upload(client, input, std::nullopt, on_read);
  auto moved = read_moved(input);
  if (!moved) return tl::unexpected(moved.error());
  return upload(client, input, std::optional(std::move(*moved)), on_read);
}

}  // namespace varimesh::client
