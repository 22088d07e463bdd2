#include "client/io/gmsh_mesh.h"

#include <fmt/format.h>

#include <cstring>
#include <deque>
#include <fstream>
#include <system_error>

#include "client/process/child_program.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

/// What gmsh printed about errors, or else its last lines, in one line.
std::string said(const std::filesystem::path& log) {
  constexpr std::size_t kShown = 4;
  std::ifstream file(log);
  std::deque<std::string> errors, lines;
  for (std::string line; std::getline(file, line);) {
    line.erase(0, line.find_first_not_of(" \t"));
    std::deque<std::string>& kind = line.starts_with("Error") ? errors : lines;
    kind.push_back(as_utf8(line));
    if (kind.size() > kShown) kind.pop_front();
  }
  std::string text;
  for (const std::string& line : errors.empty() ? lines : errors) text += (text.empty() ? "" : " | ") + line;
  return text.empty() ? " It printed nothing." : " It printed: " + text;
}

std::string how(const ProgramEnd& end) {
  if (end.way == ProgramEnd::Way::Signalled) return fmt::format("was ended by signal {}", end.status);
  return fmt::format("ended with status {}", end.status);
}

}  // namespace

Expected<void> mesh_with_gmsh(const GmshOptions& options, const std::filesystem::path& folder,
                              const std::filesystem::path& mesh) {
  const std::string gmsh = find_program("gmsh");
  if (gmsh.empty())
    return bad_option(
        "The program 'gmsh', which makes the straight mesh, is not in PATH. Install it (Debian: apt-get install gmsh), "
        "or make a mesh with another program and use 'varimesh curve'.");
  const std::filesystem::path log = folder / "gmsh.log", made = folder / "made.msh";
  std::error_code failed;
  // An absolute path never looks like an option.
  const std::string model = std::filesystem::absolute(options.model, failed).string();
  std::vector<std::string> arguments{model, "-3", "-order", "1", "-format", "msh41", "-bin", "-save_all", "-nopopup"};
  const auto set = [&](const char* name, double value) {
    arguments.insert(arguments.end(), {"-setnumber", name, fmt::format("{}", value)});
  };
  set("Mesh.MeshSizeMax", options.size);
  if (options.elements_per_turn > 0) set("Mesh.MeshSizeFromCurvature", options.elements_per_turn);
  arguments.insert(arguments.end(), {"-o", made.string()});
  const ProgramEnd end = run_program(gmsh, arguments, log);
  if (end.way == ProgramEnd::Way::Interrupted) return bad_input("");
  if (end.way == ProgramEnd::Way::NotStarted)
    return bad_option("'" + gmsh + "' cannot be started (" + std::system_category().message(end.status) + ").");
  if (end.way != ProgramEnd::Way::Exited || end.status != 0)
    return bad_input(gmsh + " could not mesh '" + options.model + "': it " + how(end) + "." + said(log));
  std::filesystem::rename(made, mesh, failed);
  if (failed) return bad_input(gmsh + " wrote no mesh of '" + options.model + "'." + said(log));
  return {};
}

}  // namespace varimesh::client
