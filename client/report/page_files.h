// The source files of the page, which the build embeds in the program.
#pragma once

#include <string_view>

namespace varimesh::client::page {

extern const std::string_view page_html;
extern const std::string_view theme_css, page_css;
extern const std::string_view three_min_js;
extern const std::string_view dom_js, numbers_js, axes_js, charts_js;
extern const std::string_view colours_js, distance_js, unpack_js, cells_js, overlay_js, paths_2d_js, viewport_2d_js,
    view_2d_js, lattices_js, camera_3d_js, surface_3d_js, cut_js, view_3d_js, pictures_js, quality_js, convergence_js,
    main_js;

}  // namespace varimesh::client::page
