#include "client/io/inputs.h"

#include <filesystem>

#include "client/library/failures.h"
#include "client/library/input_file.h"
#include "client/local/local.h"
#include "client/process/interrupts.h"
#include "core/base/stopwatch.h"
#include "core/base/utf8.h"
#include "core/formats/formats.h"
#include "core/mesh/changes/displacements.h"
#include "core/slide/distance/slide_and_measure.h"

namespace varimesh::client {
namespace {

constexpr const char* kGeometryGroup = "Geometry";

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
      .value("FILE");
  command
      .add("--boundary", &input->boundary,
           "First move each boundary node to the position that the node of the same number has in this mesh, which "
           "contains only the boundary")
      .value("MESH");
}

}  // namespace

void add_input(Command command, Input* input) {
  command.add("input", &input->mesh, "The mesh file to read").required().value("IN");
  add_boundary_flags(command, input);
}

void add_inputs(Command command, std::vector<std::string>* meshes, Input* input) {
  command.add("input", meshes, "The mesh files to read, one job for each").required().value("IN");
  add_boundary_flags(command, input);
}

void add_slide_flags(Command command, GeometryOptions* geometry) {
  command
      .add("--slide", &geometry->slide,
           "Which boundary nodes slide: none, surfaces, all (on curves and surfaces), or coupled (the same, and "
           "then all nodes of the mesh together); default: all")
      .value("WHICH")
      .one_of({"none", "surfaces", "all", "coupled"})
      .group(kGeometryGroup);
  command
      .add("--geometry-tolerance", &geometry->tolerance,
           "With --slide coupled: how far the boundary may lie from the geometry, in the mesh's unit of length; "
           "default: twice as far as it does")
      .value("LENGTH")
      .positive()
      .group(kGeometryGroup);
  command
      .add("--snap", &geometry->snap,
           "First move boundary nodes that are off the geometry onto it, if they are farther from it than 1e-6 of "
           "the mesh's size")
      .group(kGeometryGroup);
  command
      .add("--smooth-angle", &geometry->smooth_angle,
           "Boundary nodes cross joints at which surfaces or curves of the model meet at no more than this angle, "
           "in degrees; default: 0, none")
      .value("ANGLE")
      .from(0.0, 45.0)
      .group(kGeometryGroup);
}

void add_geometry_flags(Command command, GeometryOptions* geometry) {
  command
      .add("--geometry", &geometry->file,
           "Let boundary nodes slide on the model in this STEP, IGES or BREP file before the mesh is "
           "optimised")
      .value("FILE")
      .group(kGeometryGroup);
  add_slide_flags(command, geometry);
  command["--snap"].needs("--geometry");
  command["--smooth-angle"].needs("--geometry");
}

void add_slide_on_flag(Command command, GeometryOptions* geometry) {
  const auto set = [geometry](const std::string&) { geometry->on_boundary = true; };
  command
      .add("--slide-on", set,
           "Without a CAD model: let boundary nodes slide on the mesh's own curved boundary as it came")
      .value("WHAT")
      .one_of({"boundary"})
      .excludes("--geometry")
      .group(kGeometryGroup);
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

Expected<Input> with_options(Input input, const v1::Options& options) {
  if (!input.geometry.any()) {
    if (input.geometry.slide.empty()) return input;
    return bad_option("--slide says which nodes slide on what --geometry or --slide-on names; give one of them.");
  }
  const std::string flag = input.geometry.on_boundary ? "--slide-on" : "--geometry";
  if (options.order() > 0)
    return bad_option("--order does not go with " + flag + ", because new boundary nodes would not lie on it.");
  if (options.free_size() > 0 || options.free_nodes_size() > 0 || options.fix_nodes_size() > 0 ||
      options.region_below() > 0)
    return bad_option(flag + " goes only with --fix, not with other options that fix or free nodes.");
  input.geometry.fix.assign(options.fix().begin(), options.fix().end());
  input.geometry.threads = options.threads();
  input.geometry.coupled_seconds = options.time_limit() / 2;
  input.time_limit = options.time_limit();
  return input;
}

Outcome<std::optional<v1::Geometry>> hand_over_geometry(Client& client, Input* input,
                                                        const std::function<void(const std::string&)>& on_sentence) {
  GeometryOptions& options = input->geometry;
  if (options.file.empty() || options.order > 0) return std::optional<v1::Geometry>();
  const auto server = client.info();
  if (!server) return tl::unexpected(server.error());
  if (!server->takes_geometries()) {
    on_sentence("The server takes no geometries, so the boundary nodes slide in this process.");
    return std::optional<v1::Geometry>();
  }
  const auto stored = client.upload_file(options.file);
  if (!stored) return tl::unexpected(stored.error());
  v1::Geometry geometry;
  geometry.set_digest(stored->digest());
  geometry.set_slide(options.slide == "none"       ? v1::Geometry::SLIDE_NONE
                     : options.slide == "surfaces" ? v1::Geometry::SLIDE_SURFACES
                     : options.slide == "coupled"  ? v1::Geometry::SLIDE_COUPLED
                                                   : v1::Geometry::SLIDE_ALL);
  geometry.set_tolerance(options.tolerance);
  geometry.set_snap(options.snap);
  geometry.set_smooth_angle(options.smooth_angle);
  options = {};
  return std::optional(std::move(geometry));
}

namespace {

/// Slides the nodes of the mesh, and returns the sentences about it.
Expected<std::vector<std::string>> slide(const Input& input, MovedMesh& moved) {
  if (input.geometry.on_boundary) return slide_on_file(moved.file.mesh, input.geometry);
  if (input.keeps_as_it_came && input.geometry.order == 0)
    moved.as_it_came = std::make_shared<const HighOrderMesh>(moved.file.mesh);
  GeometryOptions options = input.geometry;
  StopToken stop;
  if (input.time_limit > 0) stop.stop_after(input.time_limit);
  if (options.order == 0) options.stop = &stop;  // a mesh that is being curved cannot go back
  try {
    auto slid = slide_and_measure(moved.file.mesh, options);
    if (!slid) return tl::unexpected(slid.error());
    moved.geometry = geometry_report(*slid);
    return std::move(slid->slid.sentences);
  } catch (const Interrupted&) {
    return std::vector<std::string>{"The time limit passed while boundary nodes slid, so they are where they came."};
  }
}

}  // namespace

Outcome<std::optional<MovedMesh>> moved_mesh(const Input& input,
                                             const std::function<void(const std::string&)>& on_sentence) {
  if (input.displacements.empty() && input.boundary.empty() && !input.geometry.any()) return std::optional<MovedMesh>();
  auto file = formats::read_file(input.mesh);
  if (!file) return refusal("BAD_INPUT", file.error().sentence);
  MovedMesh result{std::move(*file), nullptr, {}};
  if (const auto moved = move_boundary(result.file.mesh, input); !moved) return tl::unexpected(moved.error());
  if (input.geometry.any()) {
    const EndAtInterrupt ends;
    const Stopwatch watch;
    const auto slid = slide(input, result);
    result.seconds = watch.seconds();
    if (!slid)
      return refusal(slid.error().kind == Error::Kind::BadOption ? "BAD_OPTION" : "BAD_INPUT", slid.error().sentence);
    for (const std::string& sentence : *slid)
      if (on_sentence) on_sentence(sentence);
  }
  return std::optional(std::move(result));
}

Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::optional<MovedMesh>& moved,
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
  const auto written = formats::write(moved->file.mesh, moved->file.format,
                                      [&](std::string_view bytes) { return curved->append(bytes); });
  if (!written) return file_failure(written.error().sentence);
  return client.upload(*curved);
}

Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::function<void()>& on_read,
                               const std::function<void(const std::string&)>& on_sentence) {
  const auto moved = moved_mesh(input, on_sentence);
  if (!moved) return tl::unexpected(moved.error());
  return upload(client, input, *moved, on_read);
}

}  // namespace varimesh::client
