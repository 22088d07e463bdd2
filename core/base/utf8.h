// Checks and converts text to UTF-8. Mesh files may contain names in any encoding; messages of the service and JSON
// documents may contain only UTF-8.
#pragma once

#include <string>
#include <string_view>

namespace varimesh {

/// Whether the bytes are well-formed UTF-8: no surrogates, no overlong forms, nothing above U+10FFFF.
bool is_utf8(std::string_view bytes);

/// The text as UTF-8: every byte that is not part of a well-formed sequence becomes \xNN.
std::string as_utf8(std::string_view bytes);

}  // namespace varimesh
