// varimesh quality and convert: what needs no server at all.
#include <iostream>
#include <optional>

#include "client/command/command.h"
#include "client/command/documents.h"
#include "client/command/outputs.h"
#include "client/command/report_command.h"
#include "core/formats/formats.h"
#include "core/mesh/check.h"
#include "core/optimise/optimiser.h"
#include "core/diagnosis/diagnosis.h"
#include "core/marks/marks.h"
#include "core/quality/quality.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string input, output, format, report;
  int lattice = 0;
  int threads = 0;
  bool certify = false, diagnose = false;
};

/// The mesh with what was found out about its elements, for a viewer.
int write_marked(const Arguments& arguments, formats::MeshFile& file, const std::vector<UnrepairableGroup>& groups) {
  const auto format = formats::for_output(arguments.output, formats::Format::Auto, file.format);
  if (!format) return report(format.error());
  const CellMarks marks(file.mesh, groups, arguments.threads);
  std::vector<formats::CellField> fields;
  if (*format == formats::Format::Vtu)
    fields = marks.fields();
  else
    mark_unrepairable(file.mesh, groups);
  const auto written = formats::write_file(file.mesh, *format, arguments.output, fields);
  return written ? kDone : report(written.error());
}

int quality(const Arguments& arguments) {
  end_at_first_interrupt();
  if (!arguments.output.empty()) {
    if (const auto known = formats::for_output(arguments.output, formats::Format::Auto, formats::Format::Auto); !known)
      return report(known.error());
    if (const auto writable = formats::check_writable(arguments.output); !writable) return report(writable.error());
    if (const auto apart = check_apart({{arguments.output}}, {arguments.report}, arguments.common.json); !apart)
      return report(apart.error());
  }
  if (const auto apart = check_apart({}, {arguments.report}, arguments.common.json); !apart)
    return report(apart.error());
  auto file = formats::read_file(arguments.input);
  if (!file) return report(file.error());
  if (const auto checked = check_structure(file->mesh); !checked) return report(checked.error());
  const auto mesh = summarise(file->mesh);
  if (!mesh) return report(mesh.error());
  const QualityReport found = varimesh::quality(file->mesh, arguments.lattice, arguments.threads);
  // Where every element is valid there is nothing to repair.
  std::vector<UnrepairableGroup> groups;
  const bool wanted =
      arguments.diagnose || arguments.common.json || !arguments.output.empty() || !arguments.report.empty();
  if (!found.uncertified.empty() && wanted)
    groups = with_any_of(diagnose(file->mesh, arguments.threads), uncertified_numbers(found));
  if (!arguments.output.empty())
    if (const int failed = write_marked(arguments, *file, groups); failed != kDone) return failed;
  if (!arguments.report.empty())
    if (const auto written =
            write_quality_report(arguments.report, arguments.input, std::move(file->mesh), *mesh, found, groups);
        !written)
      return report(written.error());
  if (arguments.common.json) {
    print(document(*mesh, found, groups));
  } else {
    std::ostream& out = take_standard_output({{arguments.output}}) ? std::cerr : std::cout;
    out << summary(*mesh, found);
    if (arguments.diagnose && groups.empty()) out << "nothing that moving nodes could not repair\n";
    for (const UnrepairableGroup& group : groups)
      if (arguments.diagnose) out << group.sentence << "\n";
  }
  return arguments.certify ? report_uncertified(found.certified.invalid, found.certified.undecided) : kDone;
}

int convert(const Arguments& arguments) {
  end_at_first_interrupt();
  formats::Format requested = formats::Format::Auto;
  if (!arguments.format.empty()) {
    const auto found = formats::from_name(arguments.format);
    if (!found) return report(found.error());
    requested = *found;
  }
  if (const auto known = formats::for_output(arguments.output, requested, formats::Format::Auto); !known)
    return report(known.error());
  if (const auto writable = formats::check_writable(arguments.output); !writable) return report(writable.error());
  const auto file = formats::read_file(arguments.input);
  if (!file) return report(file.error());
  const auto format = formats::for_output(arguments.output, requested, file->format);
  if (!format) return report(format.error());

  // A mesh that cannot be judged can still be looked at.
  std::optional<CellMarks> marks;
  if (*format == formats::Format::Vtu && check_structure(file->mesh))
    marks.emplace(file->mesh, std::span<const UnrepairableGroup>{}, arguments.threads);
  const auto written = formats::write_file(file->mesh, *format, arguments.output,
                                           marks ? marks->fields() : std::vector<formats::CellField>{});
  return written ? kDone : report(written.error());
}

}  // namespace

Run add_quality(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("quality", "Say how good a mesh is");
  command.add_option("input", arguments->input, "The mesh")->required()->type_name("IN");
  command.add_option("--lattice", arguments->lattice, "Sample with this many intervals an edge; 0: the default")
      ->check(CLI::Range(0, 1000));
  command.add_option("--threads", arguments->threads, "Threads to use; 0: all")->check(CLI::Range(0, 4096));
  command.add_flag("--certify", arguments->certify, "Exit with status 4 where an element is not certified valid");
  command.add_flag("--diagnose", arguments->diagnose, "Name the elements that no movement of interior nodes repairs");
  command
      .add_option("-o,--output", arguments->output, "Write the mesh with its marks (.vtu: cell arrays, .msh: a group)")
      ->type_name("OUT");
  add_report_flag(command, &arguments->report);
  add_json_flag(command, &arguments->common);
  return [arguments] { return quality(*arguments); };
}

Run add_convert(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("convert", "Write a mesh in another format");
  command.add_option("input", arguments->input, "The mesh")->required()->type_name("IN");
  command.add_option("output", arguments->output, "Where it goes (.msh, .vtu)")->required()->type_name("OUT");
  command.add_option("--format", arguments->format, "Format by name; default by the ending of OUT");
  return [arguments] { return convert(*arguments); };
}

}  // namespace varimesh::client
