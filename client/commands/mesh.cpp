// varimesh mesh: makes a curved, optimised mesh from a CAD model. The program gmsh makes the straight mesh.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "client/cli/option_flags.h"
#include "client/commands/commands.h"
#include "client/io/gmsh_mesh.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "client/process/temporary_folder.h"
#include "client/runs/optimise_run.h"
#include "core/base/stopwatch.h"
#include "core/formats/formats.h"
#include "core/geometry/cad_reader.h"

namespace varimesh::client {
namespace {

struct Arguments {
  OptimiseArguments run;
  GmshOptions gmsh;
  std::string bodies;
};

/// A limit of time that is nearly over. 0 would mean no limit.
constexpr double kLeastSeconds = 0.1;

/// Whether the file is a mesh and not a model.
bool is_a_mesh(const std::string& path) {
  std::array<char, 4096> begin{};
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), std::ssize(begin));
  return formats::recognised({begin.data(), std::size_t(file.gcount())}) != formats::Format::Auto;
}

int mesh(Arguments arguments) {
  Input& input = arguments.run.input;
  input.model = arguments.gmsh.model;
  input.mesh = std::filesystem::path(arguments.gmsh.model).stem().string() + ".msh";
  arguments.run.name = arguments.gmsh.model;
  std::error_code failed;
  if (!std::filesystem::is_regular_file(arguments.gmsh.model, failed))
    return print_error(
        {Error::Kind::BadInput, "The model '" + arguments.gmsh.model + "' is not a file that can be read."});
  if (is_a_mesh(arguments.gmsh.model))
    return print_error({Error::Kind::BadInput, "'" + arguments.gmsh.model +
                                                   "' is a mesh already, not a model; 'varimesh curve IN --geometry "
                                                   "MODEL --order N' curves a mesh of order 1 by its model."});
  if (const int status = check_curve(arguments.run); status != kDone) return status;
  if (arguments.run.common.server.empty())
    if (const auto reads = geometry::check_plugin("The geometry '" + arguments.gmsh.model + "'"); !reads)
      return print_error(reads.error());
  const TemporaryFolder folder;
  if (folder.path().empty())
    return print_error({Error::Kind::Output, "No temporary folder can be made; check TMPDIR and its free space."});
  input.mesh = (folder.path() / input.mesh).string();
  if (!arguments.run.common.quiet) {
    std::cerr << "Gmsh makes the straight mesh." << std::endl;
    arguments.gmsh.on_progress = [](const std::string& text) { std::cerr << "Gmsh: " << text << std::endl; };
  }
  const double limit = arguments.run.options.time_limit();
  arguments.gmsh.most_seconds = limit;
  arguments.gmsh.joins_bodies = arguments.bodies != "separate";
  const Stopwatch watch;
  const auto made = mesh_with_gmsh(arguments.gmsh, folder.path(), input.mesh);
  if (interrupted()) {
    std::cerr << "varimesh: interrupted" << std::endl;
    return kInterrupted;
  }
  if (!made) return print_error(made.error());
  input.model = *made;
  if (limit > 0) arguments.run.options.set_time_limit(std::max(kLeastSeconds, limit - watch.seconds()));
  return curve(arguments.run);
}

}  // namespace

Action add_mesh(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command =
      program.add_command("mesh", "Make a curved mesh from a CAD model; the program gmsh makes the straight mesh");
  command.add("model", &arguments->gmsh.model, "The STEP, IGES or BREP file to read").required().value("FILE");
  command
      .add("--size", &arguments->gmsh.size,
           "The largest length of an edge, in the unit in which the model is read (STEP and IGES: millimetres)")
      .required()
      .positive()
      .value("LENGTH");
  command
      .add("--per-turn", &arguments->gmsh.elements_per_turn,
           "At least this many elements around a full turn of a curved surface; 0: no limit")
      .from(0, 1000)
      .value("N");
  command
      .add("--bodies", &arguments->bodies,
           "How bodies that touch are meshed: joined, with one mesh of the faces where they touch, or separate; "
           "default: joined")
      .value("HOW")
      .one_of({"joined", "separate"});
  add_geometry_options(command, &arguments->run.input.geometry, false);
  add_run_flags(command, &arguments->run);
  command["--output"].required();
  require_curved_order(command);
  return [arguments] { return mesh(*arguments); };
}

}  // namespace varimesh::client
