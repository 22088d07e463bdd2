// The library's version, and which of its kernels this machine runs.
#pragma once

#include <string_view>

namespace varimesh {

/// "major.minor.patch"
std::string_view version();

/// The widest vector instructions that the kernels use on this machine, as Highway names them: AVX2.
std::string_view vector_instructions();

}  // namespace varimesh
