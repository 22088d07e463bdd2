// Base64 and zlib, as XML files of meshes contain binary numbers. Internal to core/formats.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "core/formats/common/file_allowance.h"

namespace varimesh::formats {

/// The bytes that base64 text stands for; white space is skipped. Returns false if the text is not base64. Padding ends
/// a group, and more groups may follow.
bool decode_base64(std::string_view text, std::string& bytes);

/// Appends the text of the bytes.
void encode_base64(std::string_view bytes, std::string& text);

/// What became of base64 text that contains a zlib stream.
enum class Unpacked { Whole, NotBase64, Damaged };

/// Calls body(bytes, done) for the content of the stream in pieces, which consist of records of this size; `done`: how
/// many bytes of the text these pieces come from. The last piece may end within a record. Nothing else of the content
/// is ever in memory.
Unpacked unpack_base64_zlib(std::string_view text, std::size_t record,
                            const std::function<void(std::string_view bytes, std::size_t done)>& body);

/// Appends a zlib stream of the bytes.
void deflate_zlib(std::string_view bytes, std::string& stream, int level);

}  // namespace varimesh::formats
