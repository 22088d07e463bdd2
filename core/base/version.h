// The version of the library, and the vector instructions that it uses on this machine.
#pragma once

#include <string_view>

namespace varimesh {

/// "major.minor.patch"
std::string_view version();

/// The widest vector instructions that the kernels use on this machine, by Highway's name, for example "AVX2".
std::string_view vector_instructions();

}  // namespace varimesh
