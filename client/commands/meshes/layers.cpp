// varimesh layers: splits thick cells at a wall into thin layers, in this process.
#include <charconv>
#include <cmath>
#include <iostream>
#include <sstream>

#include "client/cli/common_flags.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/inputs.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/io/summary.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"
#include "core/layers/split/split_layers.h"
#include "core/mesh/changes/to_simplices.h"
#include "core/mesh/checked_mesh.h"
#include "core/optimise/marks/marks.h"
#include "core/optimise/optimiser.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string input, output, report, heights, spacing;
  Repairs repairs;
  LayerSplit split;
  int threads = 0;
  bool simplices = false;
  double reynolds = 0, length = 0, y_plus = 1;
};

/// The height at which y⁺ has this value in the turbulent layer on a flat plate, with the skin friction
/// C_f = 0.026 Re^(−1/7) (F. M. White, Viscous Fluid Flow).
/// @param length  the distance from the beginning of the plate, to which the Reynolds number belongs
double height_at(double y_plus, double reynolds, double length) {
  const double friction = 0.026 * std::pow(reynolds, -1.0 / 7);
  return y_plus * length / (reynolds * std::sqrt(friction / 2));
}

/// The numbers of a list such as "1e-5,2e-5". Errors: BadOption.
Expected<std::vector<double>> heights_of(const std::string& text) {
  std::vector<double> heights;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    double height = 0;
    const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), height);
    if (fault != std::errc() || end != word.data() + word.size())
      return bad_option("--heights has '" + word + "', which is no number. Give heights such as 1e-5,2e-5,4e-5.");
    heights.push_back(height);
  }
  return heights;
}

Expected<formats::Format> check_files(const Arguments& arguments, formats::Format of_input) {
  const auto format = formats::for_output(arguments.output, formats::Format::Auto, of_input);
  if (!format) return format;
  if (const auto writable = formats::check_writable(arguments.output); !writable)
    return tl::unexpected(writable.error());
  const auto distinct = check_distinct({{arguments.output}}, {arguments.report}, arguments.common.json);
  return distinct ? format : tl::unexpected(distinct.error());
}

std::string range_text(const std::array<double, 2>& range) {
  std::ostringstream text;
  text.precision(4);
  text << range[0];
  if (range[1] > range[0] * 1.0001) text << " to " << range[1];
  return text.str();
}

std::string text_of(const LayerSplitReport& report) {
  std::ostringstream text;
  text << "layers     " << report.layers << " above " << report.wall_elements << " wall elements, first height "
       << range_text(report.first);
  if (report.layers > 1) text << ", growth " << range_text(report.growth) << ", highest " << range_text(report.last);
  if (report.leaves_cells) text << "; what was left of the thick cells is one more cell";
  text << "\nelements   " << report.cells_before << " before, " << report.cells_after << " after";
  if (report.beside > 0)
    text << "; " << report.beside << " of the " << report.split
         << " that were split lie beside the wall and were split so that the mesh conforms";
  if (report.same_shares)
    text << "\nheights    are the same share of every thick element; with the same heights everywhere, elements would "
            "be "
            "invalid";
  if (report.stretched > 0.01) {
    text.precision(2);
    text << "\nheights    differ by up to " << 100 * report.stretched
         << " % from those asked for, because layers begin and end where rows do";
  }
  return text.str() + "\n";
}

Json document_of(const LayerSplitReport& report) {
  return {{"wall_elements", report.wall_elements},
          {"columns", report.columns},
          {"layers", report.layers},
          {"leaves_cells", report.leaves_cells},
          {"split", report.split},
          {"split_beside", report.beside},
          {"elements_before", report.cells_before},
          {"elements_after", report.cells_after},
          {"first_height", report.first},
          {"last_height", report.last},
          {"growth", report.growth},
          {"same_shares", report.same_shares},
          {"stretched", report.stretched}};
}

/// Writes the mesh, the report page, and what is printed. Returns the exit status.
int deliver(const Arguments& arguments, formats::MeshFile& file, formats::Format format,
            const LayerSplitReport& split) {
  Options options;
  options.threads = arguments.threads;
  const auto mesh = summarise(file.mesh, options);
  if (!mesh) return print_error(mesh.error());
  const QualityReport found = varimesh::quality(file.mesh, 0, arguments.threads);
  const WhatIsLeft left = what_is_left(file.mesh, uncertified_numbers(found), {}, {});
  if (const std::string lost = formats::left_out(file.mesh, format); !lost.empty())
    std::cerr << "varimesh: " << lost << "\n";
  std::vector<formats::CellField> fields;
  if (format == formats::Format::Vtu) fields = CellMarks(file.mesh, {}, arguments.threads).fields();
  if (const auto written = formats::write_file(file.mesh, format, arguments.output, fields, arguments.threads);
      !written)
    return print_error(written.error());
  if (arguments.common.json) {
    Json whole = document(*mesh, found, {}, left);
    whole["layers"] = document_of(split);
    print(whole);
  } else {
    std::ostream& out = any_is_standard_output({{arguments.output}}) ? std::cerr : std::cout;
    out << text_of(split) << summary(*mesh, found);
  }
  if (!arguments.report.empty())
    if (const auto written =
            write_quality_report(arguments.report, arguments.input, std::move(file.mesh), *mesh, found, {}, left);
        !written)
      return print_error(written.error());
  if (!found.uncertified.empty())
    std::cerr
        << "varimesh: layers are valid if the cells from which they are made are; make the mesh valid first, with "
           "varimesh optimise\n";
  return print_uncertified(found.certified.invalid, found.certified.undecided);
}

int layers(Arguments arguments) {
  end_at_first_interrupt();
  if (!arguments.heights.empty()) {
    auto heights = heights_of(arguments.heights);
    if (!heights) return print_error(heights.error());
    arguments.split.heights.heights = std::move(*heights);
  }
  if (arguments.reynolds != 0) {
    arguments.split.heights.first = height_at(arguments.y_plus, arguments.reynolds, arguments.length);
    std::cerr << "varimesh: y+ is " << arguments.y_plus << " at the height " << arguments.split.heights.first
              << ", which is that of the first layer\n";
  }
  if (const auto checked = check(arguments.split.heights); !checked) return print_error(checked.error());
  if (arguments.spacing == "even") arguments.split.spacing = LayerSpacing::Even;
  if (const auto checked = check_files(arguments, formats::Format::Auto); !checked) return print_error(checked.error());
  auto file = formats::read_file(arguments.input, machine_memory(), arguments.threads);
  if (!file) return print_error(file.error());
  for (const std::string& note : formats::reading_notes(file->mesh)) std::cerr << "varimesh: " << note << "\n";
  const auto say = [](const std::string& sentence) { std::cerr << "varimesh: " << sentence << "\n"; };
  if (const auto done = repair(arguments.repairs, *file, say); !done) return print_error(done.error());
  const auto format = check_files(arguments, file->format);
  if (!format) return print_error(format.error());
  const Team team(arguments.threads);
  const auto checked = check_mesh(file->mesh, CheckFor::Optimising, team);
  if (!checked) return print_error(with_fitting_orders(checked.error(), *file));
  auto split = split_layers(*checked, arguments.split, team);
  if (!split) return print_error(split.error());
  file->mesh = std::move(split->mesh);
  if (arguments.simplices) {
    auto cut = to_simplices(file->mesh);
    if (!cut) return print_error(cut.error());
    file->mesh = std::move(*cut);
  }
  return deliver(arguments, *file, *format, split->report);
}

}  // namespace

Action add_layers(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = program.add_command("layers", "Split thick cells at a wall into thin boundary layers");
  command.add("input", &arguments->input, "The mesh file to read").required().or_standard_input().value("IN");
  command.add("-o,--output", &arguments->output, "The file to write").required().value("OUT");
  command.add("--wall", &arguments->split.walls, "A group of boundary elements, by name or tag; may be repeated")
      .required()
      .one_value_each()
      .value("GROUP");
  command.add("--layers", &arguments->split.heights.layers, "Number of layers").from(1, kMostLayers);
  command
      .add("--first", &arguments->split.heights.first, "Height of the layer at the wall, in the mesh's unit of length")
      .positive();
  command.add("--growth", &arguments->split.heights.growth, "Height of each layer over the height of the one below")
      .from(1.0, 10.0);
  command
      .add("--reynolds", &arguments->reynolds, "Instead of --first: the Reynolds number of --length, on a flat plate")
      .positive()
      .excludes("--first")
      .value("RE");
  command.add("--length", &arguments->length, "The distance from the beginning of the plate, in the mesh's unit")
      .positive()
      .needs("--reynolds")
      .value("L");
  command["--reynolds"].needs("--length");
  command.add("--y-plus", &arguments->y_plus, "The y+ of the first layer with --reynolds; default: 1")
      .positive()
      .needs("--reynolds");
  command
      .add("--heights", &arguments->heights, "Heights of all layers from the wall, with commas, instead of the above")
      .value("LIST");
  command.add("--rows", &arguments->split.rows, "How many rows of cells above the wall to split; default: 1")
      .from(1, 1000);
  command
      .add("--layer-spacing", &arguments->spacing,
           "Spacing of nodes across a layer: graded as the layers grow (default), or even")
      .one_of({"graded", "even"});
  command.add("--simplices", &arguments->simplices, "Cut all elements of the result into triangles or tetrahedra");
  command.add("--threads", &arguments->threads, "Number of threads; 0: all").from(0, 4096);
  add_repair_flags(command, &arguments->repairs);
  add_report_flag(command, &arguments->report);
  add_json_flag(command, &arguments->common);
  return [arguments] { return layers(*arguments); };
}

}  // namespace varimesh::client
