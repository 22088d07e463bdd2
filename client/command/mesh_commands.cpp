// varimesh quality and convert: what needs no server at all.
#include <iostream>

#include "client/command/command.h"
#include "client/command/documents.h"
#include "core/formats/formats.h"
#include "core/mesh/check.h"
#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string input, output, format;
  int lattice = 0;
  int threads = 0;
};

int quality(const Arguments& arguments) {
  const auto file = formats::read_file(arguments.input);
  if (!file) return report(file.error());
  if (const auto checked = check(file->mesh); !checked) return report(checked.error());
  const auto mesh = summarise(file->mesh);
  if (!mesh) return report(mesh.error());
  const QualityReport found = varimesh::quality(file->mesh, arguments.lattice, arguments.threads);
  if (arguments.common.json)
    print(document(*mesh, found));
  else
    std::cout << summary(*mesh, found) << std::flush;
  return kDone;
}

int convert(const Arguments& arguments) {
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

  std::vector<formats::CellField> fields;
  CellQuality cells;
  if (*format == formats::Format::Vtu && check(file->mesh)) {
    // A mesh that cannot be judged can still be looked at.
    cells = cell_quality(file->mesh, 0, arguments.threads);
    fields = {{"scaled_jacobian", cells.scaled_jacobian}, {"distortion_jacobian", cells.distortion_jacobian}};
  }
  const auto written = formats::write_file(file->mesh, *format, arguments.output, fields);
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
