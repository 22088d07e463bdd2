// Sparse matrices by rows, as multigrid takes them and as it keeps its transfers between levels.
#pragma once

#include <cstdint>
#include <vector>

namespace varimesh {

/// A square sparse matrix in someone else's arrays.
struct CompressedRows {
  std::int32_t rows = 0;
  const std::int64_t* row_begin = nullptr;  ///< rows + 1
  const std::int32_t* column = nullptr;     ///< Each column at most once per row, in any order.
  const double* value = nullptr;
};

namespace multigrid {

/// A sparse matrix, not necessarily square. Columns ascend within a row.
struct FloatRows {
  std::int32_t rows = 0;
  std::int32_t columns = 0;
  std::vector<std::int64_t> begin;  ///< rows + 1
  std::vector<std::int32_t> column;
  std::vector<float> value;
};

}  // namespace multigrid
}  // namespace varimesh
