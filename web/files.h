// The parts that pages share, which the build embeds once for all programs.
#pragma once

#include <array>
#include <string_view>

namespace varimesh::web {

extern const std::string_view theme_css, view_css;
extern const std::string_view three_min_js;
extern const std::string_view dom_js, numbers_js, axes_js, charts_js;
extern const std::string_view colours_js, distance_js, unpack_js, cells_js, overlay_js, paths_2d_js, viewport_2d_js,
    view_2d_js, lattices_js, camera_3d_js, surface_3d_js, cut_js, view_3d_js, pictures_js, convergence_js;

/// The scripts that show a mesh, in the order in which a page contains them. A 3-D mesh also needs three_min_js before.
inline constexpr std::array kView{&dom_js,         &numbers_js, &axes_js,     &charts_js,     &colours_js,
                                  &distance_js,    &unpack_js,  &cells_js,    &overlay_js,    &paths_2d_js,
                                  &viewport_2d_js, &view_2d_js, &lattices_js, &camera_3d_js,  &surface_3d_js,
                                  &cut_js,         &view_3d_js, &pictures_js, &convergence_js};

}  // namespace varimesh::web
