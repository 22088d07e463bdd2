#include "server/http/page.h"

#include "web/files.h"

namespace varimesh::server {

/// The source files that only this page has, which the build embeds (server/http/page/).
namespace mesh_page {
extern const std::string_view page_html, page_css;
extern const std::string_view wire_js, shapes_js, mesh_cells_js, scene_js, scene_2d_js, scene_3d_js, service_js,
    picture_js, moving_js, options_js, layers_js, geometry_js, keeping_js, commands_js, facts_js, model_view_js,
    model_page_js, jobs_js, job_page_js, page_js;
}  // namespace mesh_page

std::span<const PageFile> page_files() {
  static const std::vector<PageFile> files = [] {
    using namespace mesh_page;
    std::vector<const std::string_view*> script(web::kView.begin(), web::kView.end());
    script.insert(script.end(),
                  {&wire_js,    &shapes_js,     &mesh_cells_js, &scene_js,  &scene_2d_js, &scene_3d_js, &service_js,
                   &picture_js, &moving_js,     &options_js,    &layers_js, &geometry_js, &commands_js, &facts_js,
                   &keeping_js, &model_view_js, &model_page_js, &jobs_js,   &job_page_js, &page_js});
    return std::vector<PageFile>{{"/", kHtmlType, {&page_html}},
                                 {"/page.css", kStyleType, {&web::theme_css, &web::view_css, &page_css}},
                                 {"/three.js", kScriptType, {&web::three_min_js}},
                                 {"/page.js", kScriptType, script}};
  }();
  return files;
}

}  // namespace varimesh::server
