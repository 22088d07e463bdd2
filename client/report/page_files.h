// The source files that only this page has, which the build embeds in the program.
#pragma once

#include <string_view>

namespace varimesh::client::page {

extern const std::string_view page_html;
extern const std::string_view quality_js, main_js;

}  // namespace varimesh::client::page
