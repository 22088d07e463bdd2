// The source files that only the live page has, which are embedded when the program is built.
#pragma once

#include <string_view>

namespace varimesh::server::page {

extern const std::string_view watch_html, watch_css;
extern const std::string_view curves_js, watch_js;

}  // namespace varimesh::server::page
