// Recognises files of other programs that people take for meshes which VariMesh reads. Internal to core/formats.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::formats {

/// Why the bytes are not a mesh that can be read, as far as their beginning shows, and what to run instead.
std::string why_not_a_mesh(std::string_view bytes);

}  // namespace varimesh::formats
