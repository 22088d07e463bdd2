// The library's version.
#pragma once

#include <string_view>

namespace varimesh {

/// "major.minor.patch"
std::string_view version();

}  // namespace varimesh
