// The source files of the live page, which are embedded when the program is built.
#pragma once

#include <string_view>

namespace varimesh::server::page {

extern const std::string_view watch_html, watch_css, theme_css;
extern const std::string_view dom_js, numbers_js, axes_js, charts_js, curves_js, watch_js;

}  // namespace varimesh::server::page
