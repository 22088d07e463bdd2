#include "client/io/gmsh_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <string_view>
#include <system_error>
#include <vector>

#include "client/process/child_program.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

/// Whether this is a line of the footer that gmsh prints after errors: "1 error", for example, between dashes.
bool is_footer(std::string_view line) {
  std::string_view text = line.substr(std::min(line.find(':') + 1, line.size()));
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  const std::string_view word = text.substr(std::min(text.find_first_not_of("0123456789 "), text.size()));
  const bool counts = word != text && (word.starts_with("error") || word.starts_with("warning"));
  return counts || text.starts_with("-----") || text.find("error summary") != text.npos ||
         text.starts_with("Check the full log");
}

/// The lines of the log without spaces around them.
std::vector<std::string> lines_of(const std::filesystem::path& log) {
  std::vector<std::string> lines;
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    line.erase(0, line.find_first_not_of(" \t"));
    line.erase(line.find_last_not_of(" \t\r") + 1);
    if (!line.empty()) lines.push_back(as_utf8(line));
  }
  return lines;
}

/// What gmsh reads and writes, and what the user calls it.
struct Names {
  std::filesystem::path link, script, pieces;
  std::string model;
};

/// The text with the user's name for what gmsh read.
std::string as_named(std::string text, const Names& names) {
  for (const std::string& path : {names.link.string(), names.script.string(), names.link.filename().string()})
    for (std::size_t at = text.find(path); at != text.npos; at = text.find(path, at + names.model.size()))
      text.replace(at, path.size(), names.model);
  return text;
}

/// The first errors that gmsh printed, or else its last lines, in one line.
std::string said(const std::filesystem::path& log, const Names& names) {
  constexpr std::size_t kShown = 4;
  std::vector<std::string> errors, lines = lines_of(log);
  for (const std::string& line : lines) {
    const bool is_error = line.starts_with("Error") || line.find(" Error:") != line.npos;
    if (is_error && !is_footer(line) && std::ranges::find(errors, line) == errors.end()) errors.push_back(line);
  }
  if (errors.empty() && lines.size() > kShown) lines.erase(lines.begin(), lines.end() - kShown);
  if (errors.size() > kShown) errors.resize(kShown);
  std::string text;
  for (const std::string& line : errors.empty() ? lines : errors) text += (text.empty() ? "" : " | ") + line;
  return text.empty() ? " It printed nothing." : " It printed: " + as_named(text, names);
}

/// What the script says of a model that has only curves and points.
constexpr std::string_view kNoFaces = "has neither bodies nor faces";

/// What the script says before it writes the pieces of the bodies.
constexpr std::string_view kCut = "The bodies of the model were cut where they touch";

/// What to do after gmsh has failed, by what it printed.
std::string_view advice(std::string_view printed) {
  struct Advice {
    std::string_view word, text;
  };
  constexpr std::string_view kCrossing =
      " The mesh of its surfaces crosses itself. Try half the --size or a larger --per-turn; if that does not help, "
      "mend the model at the surfaces that gmsh names, and export it again.";
  constexpr std::array<Advice, 8> kKnown{{
      {"Could not read", " The file is damaged or cut off, or not what its name says; export it again."},
      {kNoFaces, " Export the model as solids or surfaces."},
      {"overlapping facets", kCrossing},
      {"ntersect", kCrossing},  // "Self-intersecting", "intersect"
      {"oolean", " Cutting its bodies where they touch has failed; try '--bodies separate'."},
      {"closed loop",
       " The edges of a surface do not close; close it in the program that made the model, and export it again."},
      {"recover",
       " Try another --size or a larger --per-turn; if that does not help, look for slivers and gaps in the model."},
      {"", " Try another --size or --per-turn; if that does not help, check the model and export it again."},
  }};
  return std::ranges::find_if(kKnown, [&](const Advice& known) { return printed.find(known.word) != printed.npos; })
      ->text;
}

/// What gmsh printed, and what to do.
std::string reason(const std::filesystem::path& log, const Names& names) {
  const Names unnamed{names.link, names.script, names.pieces, "the model"};  // the user's name has no say in the advice
  return std::string(advice(said(log, unnamed))) + said(log, names);
}

/// What gmsh does now: "Meshing surface 3 (Cylinder, Frontal-Delaunay)".
std::string doing(const std::filesystem::path& log) {
  const std::vector<std::string> lines = lines_of(log);
  for (auto line = lines.rbegin(); line != lines.rend(); ++line)
    if (const std::size_t at = line->find("Meshing"); line->starts_with("Info") && at != line->npos)
      return line->substr(at);
  return "";
}

/// Where gmsh was when its time was over, and what to do.
std::string where_it_hangs(const std::filesystem::path& log) {
  const std::string last = doing(log), advice = " Take a larger --size, or a longer --time-limit";
  if (last.empty()) return advice + ".";
  return " It was still at: " + last + "." + advice +
         "; if that does not help, look whether the model crosses itself there, mend it, and export it again.";
}

/// The ending by which gmsh knows the format of a model: that of the path if gmsh has it, or else STEP's. Nothing else
/// of the path may stand in a script, where a name can be a command.
std::string ending_of(const std::filesystem::path& model) {
  std::string ending = model.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 5> kKnown{".step", ".stp", ".iges", ".igs", ".brep"};
  return std::ranges::find(kKnown, ending) == kKnown.end() ? ".step" : ending;
}

/// A link to the model, or a copy where links cannot be made.
bool link_or_copy(const std::filesystem::path& model, const std::filesystem::path& link) {
  std::error_code failed;
  std::filesystem::create_symlink(model, link, failed);
  return !failed || std::filesystem::copy_file(model, link, failed);
}

/// A model that is longer than this along an axis is meshed in a unit that is a thousand times as large: gmsh 4.8 makes
/// triangles that are nearly flat of one whose coordinates are millions.
constexpr const char* kLargest = "1e5";

/// A script that makes gmsh read the model. If it is wanted, and there are several bodies, or faces that bound none, it
/// cuts them where they touch and writes the pieces.
bool write_script(const Names& names, bool joins_bodies) {
  const std::string merge = "Merge \"" + names.link.filename().string() + "\";\n";
  std::ofstream file(names.script);
  file << "SetFactory(\"OpenCASCADE\");\n"
       << merge
       << "bodies() = Volume{:};\nfaces() = Surface{:};\nIf (#bodies() == 0 && #faces() == 0)\n  Error(\"The model "
       << kNoFaces << "\");\n  Abort;\nEndIf\nparts = 1;\n";
  // Coherence fails if a face lies on a body without being one of its sides, and the other command takes longer.
  if (joins_bodies)
    file << "sides() = {};\nIf (#bodies() > 0)\n  sides() = Abs(Boundary{ Volume{:}; });\nEndIf\n"
            "faces() -= sides();\nparts = #bodies() + #faces();\nIf (parts > 1)\n  If (#faces() == 0)\n    Coherence;\n"
            "  Else\n    BooleanFragments{ Volume{:}; Delete; }{ Surface{:}; Delete; }\n  EndIf\n  Printf(\""
         << kCut << "\");\n  Save \"" << names.pieces.filename().string() << "\";\nEndIf\n";
  file << "BoundingBox;\nlength = Max(General.MaxX - General.MinX, Max(General.MaxY - General.MinY, General.MaxZ - "
          "General.MinZ));\nIf (parts == 1 && length > "
       << kLargest
       << ")\n  Delete Model;\n  Geometry.OCCScaling = 1e-3;\n  Mesh.ScalingFactor = 1e3;\n"
          "  Mesh.MeshSizeMax = Mesh.MeshSizeMax / 1e3;\n  "
       << merge << "EndIf\n";
  return file.flush().good();
}

std::string how(const ProgramEnd& end) {
  if (end.way == ProgramEnd::Way::Signalled) return fmt::format("was ended by signal {}", end.status);
  return fmt::format("ended with status {}", end.status);
}

}  // namespace

Expected<std::string> mesh_with_gmsh(const GmshOptions& options, const std::filesystem::path& folder,
                                     const std::filesystem::path& mesh) {
  const std::string gmsh = find_program("gmsh");
  if (gmsh.empty())
    return bad_option(
        "The program 'gmsh', which makes the straight mesh, is not in PATH. Install it (Debian: apt-get install gmsh), "
        "or make a mesh with another program and use 'varimesh curve'.");
  const std::filesystem::path log = folder / "gmsh.log", made = folder / "made.msh";
  std::error_code failed;
  // A link with an ending that gmsh knows. It never looks like an option, and no character of the model's path means
  // something in a script that names it.
  const std::filesystem::path model = std::filesystem::absolute(options.model, failed);
  const Names names{folder / ("model" + ending_of(model)), folder / "bodies.geo", folder / "pieces.brep",
                    options.model};
  if (!link_or_copy(model, names.link) || !write_script(names, options.joins_bodies))
    return tl::unexpected<Error>(
        {Error::Kind::Output, "No file can be written in '" + folder.string() + "'; make room."});
  std::vector<std::string> arguments{names.script.string(), "-3", "-order", "1", "-bin", "-save_all", "-nopopup"};
  const auto set = [&](const char* name, double value) {
    arguments.insert(arguments.end(), {"-setnumber", name, fmt::format("{}", value)});
  };
  set("Mesh.MshFileVersion", 4.1);  // with "-format msh41", Save would write a mesh
  set("Mesh.MeshSizeMax", options.size);
  if (options.elements_per_turn > 0) set("Mesh.MeshSizeFromCurvature", options.elements_per_turn);
  arguments.insert(arguments.end(), {"-o", made.string()});
  std::string last;
  const auto tell = [&] {
    if (const std::string now = doing(log); now != last) options.on_progress(last = now);
  };
  const ProgramEnd end =
      run_program(gmsh, arguments, log,
                  {options.most_seconds, options.on_progress ? std::function<void()>(tell) : std::function<void()>()});
  if (end.way == ProgramEnd::Way::Interrupted) return bad_input("");
  if (end.way == ProgramEnd::Way::TimeIsOver)
    return bad_input(fmt::format("{} had not meshed '{}' after {:.3g} s, the time limit.{}", gmsh, options.model,
                                 options.most_seconds, where_it_hangs(log)));
  if (end.way == ProgramEnd::Way::NotStarted)
    return bad_option("'" + gmsh + "' cannot be started (" + std::system_category().message(end.status) + ").");
  if (end.way != ProgramEnd::Way::Exited || end.status != 0)
    return bad_input(gmsh + " could not mesh '" + options.model + "': it " + how(end) + "." + reason(log, names));
  std::filesystem::rename(made, mesh, failed);
  if (failed) return bad_input(gmsh + " wrote no mesh of '" + options.model + "'." + reason(log, names));
  if (std::filesystem::is_regular_file(names.pieces, failed)) return names.pieces.string();
  if (std::ranges::none_of(lines_of(log), [](const auto& line) { return line.find(kCut) != line.npos; }))
    return options.model;
  std::filesystem::remove(mesh, failed);
  return tl::unexpected<Error>(
      {Error::Kind::Output, gmsh + " has cut the bodies of '" + options.model +
                                "' where they touch, but could not write the pieces in '" + folder.string() +
                                "'; make room, or take '--bodies separate'." + said(log, names)});
}

}  // namespace varimesh::client
