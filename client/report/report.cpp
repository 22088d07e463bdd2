// Putting the page together from its source files, the document and the packed arrays.
#include "client/report/report.h"

#include <map>
#include <string_view>

#include "client/report/page_files.h"
#include "core/formats/output_file.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

/// JSON as it may stand in a script element: nothing in it can end the element, or begin a comment.
std::string embedded(const Json& document) {
  std::string text;
  for (const char c : document.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<')
      text += "\\u003c";
    else
      text += c;
  }
  return text;
}

/// Fills the template: {{name}} becomes what `parts` has for it.
Expected<void> fill(std::string_view page, const std::map<std::string_view, std::vector<std::string_view>>& parts,
                    formats::OutputFile* file) {
  while (true) {
    const auto begin = page.find("{{");
    file->write(page.substr(0, begin));
    if (begin == std::string_view::npos) return {};
    const auto end = page.find("}}", begin);
    for (const std::string_view part : parts.at(page.substr(begin + 2, end - begin - 2))) file->write(part);
    page.remove_prefix(end + 2);
  }
}

}  // namespace

Expected<void> write_report(const std::string& path, const Report& report) {
  auto file = formats::OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  Json all = {{"title", report.title},          {"document", report.document}, {"histograms", report.histograms},
              {"history", report.history},      {"options", report.options},   {"origin", report.origin},
              {"no_picture", report.no_picture}};
  std::string arrays;
  if (report.before != nullptr) {
    auto stages = Stages::create(report.before, report.after);
    Marks marks = report.marks;
    if (!stages && report.after != nullptr) {
      // A repair may have split elements: then there is no saying which of them was which.
      stages = Stages::create(report.after, nullptr);
      marks.uncertified[0] = marks.uncertified[1];
      all["no_picture"] = "The result has other elements than the mesh that came in, so it is shown alone.";
    }
    if (!stages) return tl::unexpected(stages.error());
    Packing packing;
    all["scene"] = pack_scene(*stages, marks, &packing);
    all["scene"]["arrays"] = packing.directory();
    auto packed = packing.base64();
    if (!packed) return tl::unexpected(packed.error());
    arrays = std::move(*packed);
  }
  const std::string embedded_all = embedded(all);
  // Only what turns a 3-D view needs the library, which is larger than all the rest.
  const bool turns = report.before != nullptr && report.before->dimension == 3;
  if (auto filled = fill(page::page_html,
                         {{"style", {page::theme_css, page::page_css}},
                          {"report", {embedded_all}},
                          {"arrays", {arrays}},
                          {"library", {turns ? page::three_min_js : std::string_view()}},
                          {"script",
                           {page::dom_js, page::numbers_js, page::axes_js, page::charts_js, page::colours_js,
                            page::unpack_js, page::cells_js, page::overlay_js, page::paths_2d_js, page::viewport_2d_js,
                            page::view_2d_js, page::lattices_js, page::camera_3d_js, page::view_3d_js,
                            page::pictures_js, page::quality_js, page::convergence_js, page::main_js}}},
                         &*file);
      !filled)
    return filled;
  return file->commit();
}

}  // namespace varimesh::client
