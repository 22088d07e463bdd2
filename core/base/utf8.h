// Text that others have to read: mesh files hold names in any encoding, messages and JSON documents UTF-8 alone.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::formats {

/// Whether the bytes are UTF-8 (without surrogates, overlong forms, or anything above U+10FFFF).
bool is_utf8(std::string_view bytes);

/// The text with each byte that is not part of UTF-8 written as \xNN.
std::string as_utf8(std::string_view bytes);

}  // namespace varimesh::formats
