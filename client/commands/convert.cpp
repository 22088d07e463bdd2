// varimesh convert: writes a mesh in another format.
#include <cmath>
#include <iostream>
#include <optional>
#include <span>

#include "client/commands/commands.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/mesh/changes/merge_nodes.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/marks/marks.h"
#include "core/validity/orientation.h"

namespace varimesh::client {
namespace {

constexpr int kAllThreads = 0;

struct Arguments {
  std::string input, output, format;
  bool orient = false;
  double merge = -1;  // negative: no nodes are merged
};

/// Turns the cells that are numbered clockwise, if the mesh tells which are. Errors: BadInput, as check_structure().
Expected<void> orient(HighOrderMesh& mesh) {
  const Team team(kAllThreads);
  Facets facets;
  Expected<void> checked;
  team.run([&] {
    checked = check_structure(mesh, team, &facets);
    if (!checked) return;
    const std::vector<char> clockwise = detail::clockwise_cells(mesh, facets, team);
    if (!clockwise.empty()) detail::turn_cells(mesh, clockwise, team);
  });
  return checked;
}

int convert(const Arguments& arguments) {
  end_at_first_interrupt();
  formats::Format requested = formats::Format::Auto;
  if (!arguments.format.empty()) {
    const auto found = formats::from_name(arguments.format);
    if (!found) return print_error(found.error());
    requested = *found;
  }
  // A wrong format and an output that cannot be written are found before the work starts.
  if (const auto known = formats::for_output(arguments.output, requested, formats::Format::Auto); !known)
    return print_error(known.error());
  if (const auto writable = formats::check_writable(arguments.output); !writable) return print_error(writable.error());
  if (std::isnan(arguments.merge))
    return print_error(bad_option("--merge-nodes takes a distance, 0 or more, not 'nan'.").value());
  auto file = formats::read_file(arguments.input, machine_memory(), kAllThreads);
  if (!file) return print_error(file.error());
  for (const std::string& note : formats::reading_notes(file->mesh)) std::cerr << "varimesh: " << note << "\n";
  const auto format = formats::for_output(arguments.output, requested, file->format);
  if (!format) return print_error(format.error());

  if (arguments.merge >= 0) {
    const std::size_t joined = merge_nodes(file->mesh, arguments.merge);
    std::cerr << "varimesh: " << joined << (joined == 1 ? " node was" : " nodes were") << " joined to others.\n";
    if (const auto whole = check_judgeable(file->mesh); joined > 0 && !whole)
      return print_error(bad_input("With nodes joined, the mesh cannot be used: " + whole.error().sentence +
                                   " Give --merge-nodes a tolerance well below the shortest edge, and above the "
                                   "distances of all nodes that belong together.")
                             .value());
  }
  if (arguments.orient)
    if (const auto done = orient(file->mesh); !done) return print_error(done.error());
  // A mesh whose quality cannot be computed is written without marks.
  std::optional<CellMarks> marks;
  if (*format == formats::Format::Vtu && check_judgeable(file->mesh))
    marks.emplace(file->mesh, std::span<const UnrepairableGroup>{}, kAllThreads);
  if (const std::string lost = formats::left_out(file->mesh, *format); !lost.empty())
    std::cerr << "varimesh: " << lost << "\n";
  const auto written = formats::write_file(file->mesh, *format, arguments.output,
                                           marks ? marks->fields() : std::vector<formats::CellField>{}, kAllThreads);
  return written ? kDone : print_error(written.error());
}

}  // namespace

Action add_convert(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = program.add_command("convert", "Write a mesh in another format");
  command.add("input", &arguments->input, "The mesh file to read").required().value("IN");
  command.add("output", &arguments->output, "The file to write (.msh, .vtu, .mesh, .xml, .su2, .h5, .cgns, .pyfrm)")
      .required()
      .value("OUT");
  command.add("--format", &arguments->format, "Name of the format; default: by the ending of OUT").value("NAME");
  command.add("--orient", &arguments->orient, "Turn elements that are numbered clockwise");
  command
      .add("--merge-nodes", &arguments->merge,
           "Join nodes that are at most this far apart, in the mesh's unit of length: of parts that were put together")
      .value("TOLERANCE")
      .from(0.0, 1e300);
  return [arguments] { return convert(*arguments); };
}

}  // namespace varimesh::client
