// Long arrays of a run, for which the system is asked for large pages.
#pragma once

#include <cstddef>

#include "core/base/io/allowance.h"

namespace varimesh {

/// values.resize(size), with large pages for a long array (prefer_large_pages()).
template <class Vector>
void resize_large(Vector& values, std::size_t size) {
  reserve_large(values, size);
  values.resize(size);
}

}  // namespace varimesh
