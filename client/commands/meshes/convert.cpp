// varimesh convert: writes a mesh in another format.
#include <iostream>
#include <optional>
#include <span>

#include "client/commands/commands.h"
#include "client/io/inputs.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/mesh/changes/to_simplices.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/marks/marks.h"
#include "core/validity/orientation.h"

namespace varimesh::client {
namespace {

constexpr int kAllThreads = 0;

struct Arguments {
  std::string input, output, flag_output, format;
  bool orient = false, simplices = false, keep_orders = false;
  Repairs repairs;
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

/// The file to write, which is named by place or by -o. Errors: BadOption.
Expected<std::string> output_of(const Arguments& arguments) {
  if (arguments.output.empty() && arguments.flag_output.empty())
    return bad_option("Name the file to write: varimesh convert IN OUT, or varimesh convert IN -o OUT.");
  if (!arguments.output.empty() && !arguments.flag_output.empty())
    return bad_option("OUT and -o both name the file to write; give one of them.");
  return arguments.output + arguments.flag_output;
}

int convert(const Arguments& arguments) {
  end_at_first_interrupt();
  const auto output = output_of(arguments);
  if (!output) return print_error(output.error());
  formats::Format requested = formats::Format::Auto;
  if (!arguments.format.empty()) {
    const auto found = formats::from_name(arguments.format);
    if (!found) return print_error(found.error());
    requested = *found;
  }
  // A wrong format and an output that cannot be written are found before the work starts.
  if (const auto known = formats::for_output(*output, requested, formats::Format::Auto); !known)
    return print_error(known.error());
  if (const auto writable = formats::check_writable(*output); !writable) return print_error(writable.error());
  auto file = formats::read_file(arguments.input, machine_memory(), kAllThreads);
  if (!file) return print_error(file.error());
  for (const std::string& note : formats::reading_notes(file->mesh)) std::cerr << "varimesh: " << note << "\n";
  const auto format = formats::for_output(*output, requested, file->format);
  if (!format) return print_error(format.error());

  const auto say = [](const std::string& sentence) { std::cerr << "varimesh: " << sentence << "\n"; };
  if (const auto done = repair(arguments.repairs, *file, say); !done) return print_error(done.error());
  if (arguments.orient)
    if (const auto done = orient(file->mesh); !done) return print_error(done.error());
  if (arguments.simplices) {
    auto cut = to_simplices(file->mesh);
    if (!cut) return print_error(cut.error());
    file->mesh = std::move(*cut);
  }
  if (arguments.keep_orders) formats::keep_orders(file->mesh);
  // A mesh whose quality cannot be computed is written without marks.
  std::optional<CellMarks> marks;
  if (*format == formats::Format::Vtu && check_judgeable(file->mesh))
    marks.emplace(file->mesh, std::span<const UnrepairableGroup>{}, kAllThreads);
  if (const std::string lost = formats::left_out(file->mesh, *format); !lost.empty())
    std::cerr << "varimesh: " << lost << "\n";
  const auto written = formats::write_file(file->mesh, *format, *output,
                                           marks ? marks->fields() : std::vector<formats::CellField>{}, kAllThreads);
  return written ? kDone : print_error(written.error());
}

}  // namespace

Action add_convert(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = program.add_command("convert", "Write a mesh in another format");
  command.add("input", &arguments->input, "The mesh file to read").required().or_standard_input().value("IN");
  // CLI11 2.4 wants another name for it than "output".
  command.add("written", &arguments->output, "The file to write (.msh, .vtu, .mesh, .xml, .su2, .h5, .cgns, .pyfrm)")
      .or_standard_output()
      .value("OUT");
  command.add("-o,--output", &arguments->flag_output, "The same as OUT").or_standard_output().value("OUT");
  command.add("--format", &arguments->format, "Name of the format; default: by the ending of OUT").value("NAME");
  command.add("--orient", &arguments->orient, "Turn elements that are numbered clockwise");
  command.add("--simplices", &arguments->simplices, "Cut all elements into triangles or tetrahedra, without new nodes");
  add_keep_orders_flag(command, &arguments->keep_orders);
  add_repair_flags(command, &arguments->repairs);
  return [arguments] { return convert(*arguments); };
}

}  // namespace varimesh::client
