// Checks and converts text to UTF-8. Mesh files may contain names in any encoding; messages of the service and JSON
// documents may contain only UTF-8.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace varimesh {

/// Whether the bytes are well-formed UTF-8: no surrogates, no overlong forms, nothing above U+10FFFF.
bool is_utf8(std::string_view bytes);

/// The text as UTF-8: every byte that is not part of a well-formed sequence becomes \xNN.
std::string as_utf8(std::string_view bytes);

/// The largest text that the service sends to people or writes to its log, in bytes.
inline constexpr std::size_t kMostTextBytes = 1024;

/// The text as one line of UTF-8 that a terminal or a log only shows: every byte that is not part of a well-formed
/// sequence becomes \xNN, and so do control characters; those above U+007F, and the characters that break lines or
/// change the direction of writing, become \uNNNN. A text of more than `most` bytes, which must be at least 16, keeps
/// its beginning and its end, with " ... " between them. Such a text stays as it is if it is converted again.
std::string as_plain_text(std::string_view bytes, std::size_t most = kMostTextBytes);

}  // namespace varimesh
