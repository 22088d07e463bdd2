// varimesh layers: splits thick cells at a wall into thin layers, in this process.
#include <iostream>
#include <optional>

#include "client/cli/common_flags.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/inputs.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/io/summary.h"
#include "client/local/local.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "client/runs/layer_flags.h"
#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/layers/grow/grow_layer.h"
#include "core/layers/split/split_layers.h"
#include "core/layers/thickness_shares.h"
#include "core/mesh/checked_mesh.h"
#include "core/optimise/marks/marks.h"
#include "core/optimise/optimiser.h"
#include "core/quality/certified_quality.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string input, output, report;
  Repairs repairs;
  LayerFlags layers;
  int threads = 0;
};

Expected<formats::Format> check_files(const Arguments& arguments, formats::Format of_input) {
  const auto format = formats::for_output(arguments.output, formats::Format::Auto, of_input);
  if (!format) return format;
  if (const auto writable = formats::check_writable(arguments.output); !writable)
    return tl::unexpected(writable.error());
  const auto distinct = check_distinct({{arguments.output}}, {arguments.report}, arguments.common.json);
  return distinct ? format : tl::unexpected(distinct.error());
}

/// What came of the layers, and what is known of the cells with them.
struct Made {
  v1::LayersReport report;
  std::vector<double> thickness;  ///< As for thickness_field().
  std::vector<Certificate> certificates;
};

/// The fields that a file of this format gets.
std::vector<formats::CellField> fields_of(const CellMarks* marks, const Made& made) {
  if (marks != nullptr) return marks->fields();
  if (made.thickness.empty()) return {};
  return {thickness_field(made.thickness)};
}

/// Writes the mesh, the report page, and what is printed. Returns the exit status.
int deliver(const Arguments& arguments, formats::MeshFile& file, formats::Format format, Made made) {
  Options options;
  options.threads = arguments.threads;
  const auto mesh = summarise(file.mesh, options);
  if (!mesh) return print_error(mesh.error());
  const QualityReport found = varimesh::quality(file.mesh, std::move(made.certificates), Team(arguments.threads));
  const WhatIsLeft left = what_is_left(file.mesh, uncertified_numbers(found), {}, {});
  if (const std::string lost = formats::left_out(file.mesh, format); !lost.empty())
    std::cerr << "varimesh: " << lost << "\n";
  std::optional<CellMarks> marks;
  if (format == formats::Format::Vtu)
    marks.emplace(file.mesh, std::span<const UnrepairableGroup>(), arguments.threads, made.thickness);
  const std::vector<formats::CellField> fields = fields_of(marks ? &*marks : nullptr, made);
  if (const auto written = formats::write_file(file.mesh, format, arguments.output, fields, arguments.threads);
      !written)
    return print_error(written.error());
  if (arguments.common.json) {
    Json whole = document(*mesh, found, {}, left);
    whole["layers"] = document(made.report);
    print(whole);
  } else {
    std::ostream& out = any_is_standard_output({{arguments.output}, {arguments.report}}) ? std::cerr : std::cout;
    out << layers_text(made.report) << summary(*mesh, found);
  }
  if (!arguments.report.empty())
    if (const auto written = write_quality_report(arguments.report, arguments.input, std::move(file.mesh), *mesh, found,
                                                  {}, left, &made.report);
        !written)
      return print_error(written.error());
  if (!found.uncertified.empty())
    std::cerr << "varimesh: 'varimesh optimise' takes the same flags, and makes the mesh valid before it splits it\n";
  return print_uncertified(found.certified.invalid, found.certified.undecided);
}

/// Grows thick cells on the walls, if that is wanted. `made` gets the report, and how thick each cell is.
Expected<void> grow(CheckedMesh& mesh, const LayerOptions& wanted, const Team& team, Made& made) {
  if (wanted.grow == 0) return {};
  auto grown = grow_layer(mesh, wanted.walls, wanted.grow, team);
  if (!grown) return tl::unexpected(grown.error());
  std::cerr << "varimesh: " << grown->sentence << "\n";
  made.report = layers_message(*grown);
  auto checked = check_mesh(std::move(grown->mesh), CheckFor::Optimising, team);
  if (!checked) return tl::unexpected(checked.error());
  mesh = std::move(*checked);
  auto thickness = thickness_of_cells(mesh, wanted.walls, grown->shares);
  if (!thickness) return tl::unexpected(thickness.error());
  made.thickness = std::move(*thickness);
  return {};
}

int layers(Arguments arguments) {
  end_at_first_interrupt();
  std::string sentence;
  const auto asked = layers_of(arguments.layers, &sentence);
  if (!sentence.empty()) std::cerr << "varimesh: " << sentence << "\n";
  const auto wanted = layer_options(*asked);
  if (!wanted) return print_error(wanted.error());
  if (const auto checked = check(*wanted); !checked) return print_error(checked.error());
  if (const auto checked = check_files(arguments, formats::Format::Auto); !checked) return print_error(checked.error());
  auto file = formats::read_file(arguments.input, machine_memory(), arguments.threads);
  if (!file) return print_error(file.error());
  for (const std::string& note : formats::reading_notes(file->mesh)) std::cerr << "varimesh: " << note << "\n";
  const auto say = [](const std::string& sentence) { std::cerr << "varimesh: " << sentence << "\n"; };
  if (const auto done = repair(arguments.repairs, *file, say); !done) return print_error(done.error());
  const auto format = check_files(arguments, file->format);
  if (!format) return print_error(format.error());
  const Team team(arguments.threads);
  auto checked = check_mesh(file->mesh, CheckFor::Optimising, team);
  if (!checked) return print_error(with_fitting_orders(checked.error(), *file));
  Made made;
  if (const auto done = grow(*checked, *wanted, team, made); !done) return print_error(done.error());
  auto split = split_layers(*checked, *wanted, team);
  if (!split) return print_error(split.error());
  file->mesh = std::move(split->mesh);
  made.report.MergeFrom(layers_message(split->report));
  made.thickness = thickness_of_parts(made.thickness, split->parents);
  made.certificates = std::move(split->certificates);
  return deliver(arguments, *file, *format, std::move(made));
}

}  // namespace

Action add_layers(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command =
      program.add_command("layers", "Split thick cells at a wall into thin boundary layers, or grow such cells first");
  command.add("input", &arguments->input, "The mesh file to read").required().or_standard_input().value("IN");
  command.add("-o,--output", &arguments->output, "The file to write").required().or_standard_output().value("OUT");
  add_layer_flags(command, &arguments->layers, true);
  command["--wall"].required();
  command.add("--threads", &arguments->threads, "Number of threads; 0: all").from(0, 4096);
  add_repair_flags(command, &arguments->repairs);
  add_report_flag(command, &arguments->report);
  add_json_flag(command, &arguments->common);
  return [arguments] { return layers(*arguments); };
}

}  // namespace varimesh::client
