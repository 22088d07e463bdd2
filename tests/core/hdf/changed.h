// Changes HDF5 files with h5py, in tests.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "tests/core/support/samples.h"

namespace varimesh::testing {

/// Changes a file with Python code that has it as f, and h5py and np. Returns its bytes.
inline std::string changed(const std::string& bytes, const std::string& code) {
  const test::Folder folder;
  const std::string file = folder.file("changed.h5");
  std::ofstream(file, std::ios::binary) << bytes;
  const std::string command = "/usr/bin/python3 -c 'import h5py, numpy as np; f = h5py.File(\"" + file +
                              "\", \"r+\"); " + code + "; f.close()' >/dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << code;
  return test::slurp(file);
}

inline bool has_h5py() { return std::system("/usr/bin/python3 -c 'import h5py' >/dev/null 2>&1") == 0; }

}  // namespace varimesh::testing
