// The program for HDF5 files in tests.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/formats/formats.h"

namespace varimesh::testing {

/// Lets the formats find the program that this build made. Returns whether there is one.
inline bool use_hdf5() {
#ifdef VARIMESH_HDF5_PROGRAM
  ::setenv("VARIMESH_HDF5", VARIMESH_HDF5_PROGRAM, 0);
#endif
  return formats::has_hdf5();
}

#define NEEDS_HDF5() \
  if (!testing::use_hdf5()) GTEST_SKIP() << "SKIPPED: VariMesh is built without HDF5 (libhdf5-dev)"

}  // namespace varimesh::testing
