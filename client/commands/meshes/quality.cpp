// varimesh quality: computes and certifies the quality of a mesh, in this process.
#include <iostream>

#include "client/commands/commands.h"
#include "client/io/inputs.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/mesh/check.h"
#include "core/mesh/loose_parts.h"
#include "core/mesh/plane.h"
#include "core/optimise/marks/marks.h"
#include "core/optimise/optimiser.h"

namespace varimesh::client {
namespace {

/// Checks that the output and the report can be written, before the work starts.
Expected<void> check_files(const QualityArguments& arguments) {
  std::vector<Output> outputs;
  if (!arguments.output.empty()) {
    if (const auto known = formats::for_output(arguments.output, formats::Format::Auto, formats::Format::Auto); !known)
      return tl::unexpected(known.error());
    if (auto writable = formats::check_writable(arguments.output); !writable) return writable;
    outputs.push_back({arguments.output});
  }
  return check_distinct(outputs, {arguments.report}, arguments.common.json);
}

/// Writes the mesh with marks on its elements: cell arrays in VTU, a physical group in MSH.
Expected<void> write_marked(const QualityArguments& arguments, formats::MeshFile& file,
                            const std::vector<UnrepairableGroup>& groups) {
  const auto format = formats::for_output(arguments.output, formats::Format::Auto, file.format);
  if (!format) return tl::unexpected(format.error());
  const CellMarks marks(file.mesh, groups, arguments.threads);
  std::vector<formats::CellField> fields;
  if (*format == formats::Format::Vtu)
    fields = marks.fields();
  else
    mark_unrepairable(file.mesh, groups);
  return formats::write_file(file.mesh, *format, arguments.output, fields, arguments.threads);
}

/// The groups of uncertified elements that no movement of nodes can repair, if any of the outputs shows them.
std::vector<UnrepairableGroup> find_unrepairable(const QualityArguments& arguments, const HighOrderMesh& mesh,
                                                 const QualityReport& quality) {
  if (quality.uncertified.empty() || !arguments.shows_groups()) return {};
  return with_any_of(diagnose(mesh, arguments.threads), uncertified_numbers(quality));
}

/// What does not hang together in a mesh. A surface in space is judged element by element.
std::vector<std::string> loose_parts(const HighOrderMesh& mesh, int threads) {
  std::vector<std::string> sentences;
  const Team team(threads);
  team.run([&] {
    if (!is_surface(mesh, team)) sentences = varimesh::loose_parts(mesh, facets(mesh, team), team);
  });
  return sentences;
}

/// Adds the error in layers, or says why there is none.
void judge_layers(const HighOrderMesh& mesh, int threads, QualityReport& found) {
  const Team team(threads);
  Facets all;
  team.run([&] { all = facets(mesh, team); });
  found.in_layers = layer_error(mesh, all, team);
  if (found.in_layers) return;
  std::cerr << "varimesh: The error in layers cannot be computed, because "
            << (found.uncertified.empty() ? "the mesh has no layers of thin elements at a wall"
                                          : "the mesh has no layers of thin elements at a wall that are all valid")
            << ".\n";
}

/// The mesh in the plane in which it lies, if this is no plane z = constant. It has passed summarise().
std::optional<HighOrderMesh> in_its_plane(const HighOrderMesh& mesh, int threads) {
  const Team team(threads);
  std::optional<HighOrderMesh> flat;
  team.run([&] {
    std::optional<Plane> plane = Plane::of(mesh, team);
    if (!plane) return;
    flat = mesh;
    plane->flatten(*flat);
  });
  return flat;
}

}  // namespace

int quality_of_file(const QualityArguments& arguments) {
  end_at_first_interrupt();
  if (const auto checked = check_files(arguments); !checked) return print_error(checked.error());
  auto file = formats::read_file(arguments.input, machine_memory(), arguments.threads);
  if (!file) return print_error(file.error());
  for (const std::string& note : formats::reading_notes(file->mesh)) std::cerr << "varimesh: " << note << "\n";
  const auto say = [](const std::string& sentence) { std::cerr << "varimesh: " << sentence << "\n"; };
  if (const auto done = repair(arguments.repairs, *file, say); !done) return print_error(done.error());
  Options options;
  options.threads = arguments.threads;
  auto mesh = summarise(file->mesh, options);
  if (!mesh) return print_error(with_fitting_orders(mesh.error(), *file));
  std::optional<HighOrderMesh> flat = in_its_plane(file->mesh, arguments.threads);
  if (flat) mesh = summarise(*flat, options);
  if (!mesh) return print_error(mesh.error());
  HighOrderMesh& judged = flat ? *flat : file->mesh;
  if (!arguments.report.empty() && is_surface(judged))
    return print_error(
        {Error::Kind::BadInput,
         "A report page cannot show a surface in space. Leave out --report; -o OUT.vtu writes the figures of each "
         "element, for a viewer such as ParaView."});
  if (arguments.layers && is_surface(judged))
    return print_error(
        {Error::Kind::BadOption, "A surface in space has no layers of elements at a wall. Leave out --layers."});
  QualityReport found = varimesh::quality(judged, arguments.lattice, arguments.threads);
  if (arguments.layers) judge_layers(judged, arguments.threads, found);
  const auto groups = find_unrepairable(arguments, judged, found);
  const WhatIsLeft left = what_is_left(judged, uncertified_numbers(found), groups, {});
  for (const std::string& sentence : loose_parts(judged, arguments.threads))
    std::cerr << "varimesh: " << sentence << "\n";
  if (!arguments.output.empty())
    if (const auto written = write_marked(arguments, *file, groups); !written) return print_error(written.error());
  if (!arguments.report.empty())
    if (const auto written =
            write_quality_report(arguments.report, arguments.input, std::move(judged), *mesh, found, groups, left);
        !written)
      return print_error(written.error());
  return print_quality(arguments, {*mesh, found, groups, left});
}

Action add_quality(Command program, const QualityRun& run) {
  auto arguments = std::make_shared<QualityArguments>();
  Command command = program.add_command("quality", "Show how good a mesh is and which elements are proved valid");
  command.add("input", &arguments->input, "The mesh file to read").required().or_standard_input().value("IN");
  command
      .add("--lattice", &arguments->lattice,
           "Sample each element on a lattice with this many intervals per edge; 0: the default")
      .from(0, 1000);
  command.add("--threads", &arguments->threads, "Number of threads; 0: all").from(0, 4096);
  command.add("--certify", &arguments->certify, "Exit with status 4 if an element is not certified valid");
  command.add("--diagnose", &arguments->diagnose,
              "Say which elements no movement of interior nodes can repair, and why");
  command.add("--layers", &arguments->layers,
              "Also say how well thin elements at walls hold solutions that decay from the wall");
  command
      .add("-o,--output", &arguments->output,
           "Write the mesh with marks on its elements (.vtu: cell arrays, .msh: a physical group)")
      .value("OUT")
      .or_standard_output();
  add_repair_flags(command, &arguments->repairs);
  add_report_flag(command, &arguments->report);
  add_json_flag(command, &arguments->common);
  return [arguments, run] { return run(*arguments); };
}

}  // namespace varimesh::client
