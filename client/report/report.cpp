#include "client/report/report.h"

#include <map>
#include <string_view>
#include <tuple>

#include "client/report/page_files.h"
#include "core/base/io/output_file.h"
#include "web/files.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

/// JSON for a script element. Without the character <, nothing in it can end the element or begin a comment.
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

/// Writes the template `page`, with `parts.at(name)` in place of {{name}}.
Expected<void> fill(std::string_view page, const std::map<std::string_view, std::vector<std::string_view>>& parts,
                    OutputFile* file) {
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
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  Json all = {{"title", report.title},
              {"document", report.document},
              {"histograms", report.histograms},
              {"history", report.history},
              {"options", report.options},
              {"origin", report.origin},
              {"picture_note", report.picture_note}};
  std::string arrays, more_arrays;
  if (report.before != nullptr) {
    auto snapshots = Snapshots::create(report.before, report.after);
    Marks marks = report.marks;
    BoundaryDistanceArrays distances = report.distances;
    if (!snapshots && report.after != nullptr) {
      // The repair may have split elements, and then the two meshes cannot be compared element by element.
      snapshots = Snapshots::create(report.after, nullptr);
      marks.uncertified[0] = marks.uncertified[1];
      distances.distances[0] = distances.distances[1];
      all["picture_note"] = "The result does not have the same elements as the input, so only the result is shown.";
    }
    if (!snapshots) return tl::unexpected(snapshots.error());
    Packing packing, more;
    all["scene"] = pack_scene(*snapshots, marks, distances, &packing, &more);
    for (const auto& [name, pack, text] :
         {std::tuple("arrays", &packing, &arrays), std::tuple("more", &more, &more_arrays)}) {
      all["scene"][name] = pack->directory();
      auto packed = pack->base64();
      if (!packed) return tl::unexpected(packed.error());
      *text = std::move(*packed);
    }
  }
  const std::string embedded_all = embedded(all);
  // Only 3-D views need the library, which is larger than the rest of the page.
  const bool needs_library = report.before != nullptr && report.before->dimension == 3;
  std::vector<std::string_view> script;
  for (const std::string_view* part : web::kView) script.push_back(*part);
  script.insert(script.end(), {page::quality_js, page::main_js});
  if (auto filled = fill(page::page_html,
                         {{"style", {web::theme_css, web::view_css}},
                          {"report", {embedded_all}},
                          {"arrays", {arrays}},
                          {"more", {more_arrays}},
                          {"library", {needs_library ? web::three_min_js : std::string_view()}},
                          {"script", script}},
                         &*file);
      !filled)
    return filled;
  return file->commit();
}

}  // namespace varimesh::client
