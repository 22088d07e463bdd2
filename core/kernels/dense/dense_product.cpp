// C is computed in tiles that stay in registers: three vectors of rows by four columns. A and B are copied first, so
// that a tile reads both of them in order.
#include "core/kernels/dense/dense_product.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/base/index.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/dense/dense_product.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#ifndef VARIMESH_DENSE_PRODUCT_SIZES
#define VARIMESH_DENSE_PRODUCT_SIZES
namespace varimesh::detail::dense {

constexpr std::size_t kVectors = 3, kColumns = 4, kMostLanes = 8;
/// Terms of a sum that are added up in registers. A panel of A of this depth stays in the first cache.
constexpr std::size_t kDepth = 128;

/// A and B in panels of as many rows as a tile has rows or columns, padded with zeros.
struct Panels {
  const double* a = nullptr;  ///< [panel][depth][row of the tile]
  const double* b = nullptr;  ///< [panel][depth][column of the tile]
  std::size_t rows = 0, columns = 0, depth = 0;
};

}  // namespace varimesh::detail::dense
#endif

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::dense::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kMostLanes>;
using V = hn::Vec<D>;

std::size_t TileRows() { return kVectors * hn::Lanes(D()); }

/// Adds the rows x, y and z times a number to a column of a tile.
HWY_INLINE void AddToColumn(V x, V y, V z, double number, V& p, V& q, V& r) {
  const V w = hn::Set(D(), number);
  p = hn::MulAdd(x, w, p);
  q = hn::MulAdd(y, w, q);
  r = hn::MulAdd(z, w, r);
}

/// One tile of A Bᵀ, column by column.
HWY_INLINE void Tile(const double* HWY_RESTRICT a, const double* HWY_RESTRICT b, std::size_t depth,
                     double* HWY_RESTRICT out) {
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V p0 = hn::Zero(d), p1 = p0, p2 = p0, p3 = p0, q0 = p0, q1 = p0, q2 = p0, q3 = p0, r0 = p0, r1 = p0, r2 = p0, r3 = p0;
  for (std::size_t k = 0; k < depth; ++k, a += kVectors * lanes, b += kColumns) {
    const V x = hn::LoadU(d, a), y = hn::LoadU(d, a + lanes), z = hn::LoadU(d, a + 2 * lanes);
    AddToColumn(x, y, z, b[0], p0, q0, r0);
    AddToColumn(x, y, z, b[1], p1, q1, r1);
    AddToColumn(x, y, z, b[2], p2, q2, r2);
    AddToColumn(x, y, z, b[3], p3, q3, r3);
  }
  const V sums[] = {p0, q0, r0, p1, q1, r1, p2, q2, r2, p3, q3, r3};
  for (std::size_t i = 0; i < kVectors * kColumns; ++i) hn::StoreU(sums[i], d, out + i * lanes);
}

/// The rows `begin` to `end` − 1 of C; `begin` is the first row of a panel.
void Product(const Panels& of, std::size_t begin, std::size_t end, double* c, std::size_t stride, bool lower) {
  const std::size_t tile_rows = TileRows();
  HWY_ALIGN double tile[kVectors * kMostLanes * kColumns];
  for (std::size_t i = begin; i < end; i += tile_rows) {
    const double* a = of.a + i * of.depth;
    const std::size_t rows = std::min(tile_rows, of.rows - i);
    for (std::size_t j = 0; j < of.columns && (!lower || j < i + rows); j += kColumns) {
      Tile(a, of.b + j * of.depth, of.depth, tile);
      const std::size_t columns = std::min(kColumns, of.columns - j);
      for (std::size_t n = 0; n < columns; ++n) {
        double* HWY_RESTRICT to = c + (j + n) * stride + i;
        for (std::size_t m = 0; m < rows; ++m) to[m] += tile[n * tile_rows + m];
      }
    }
  }
}

}  // namespace varimesh::detail::dense::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {
namespace dense {
HWY_EXPORT(TileRows);
HWY_EXPORT(Product);

/// Copies these columns of a matrix into panels of this many rows.
void pack(const Eigen::MatrixXd& from, std::size_t first, std::size_t depth, std::size_t panel,
          std::vector<double>& to) {
  const std::size_t rows = at(from.rows()), panels = (rows + panel - 1) / panel;
  to.assign(panels * panel * depth, 0);
  for (std::size_t k = 0; k < depth; ++k) {
    const double* column = from.data() + (first + k) * rows;
    for (std::size_t p = 0; p < panels; ++p)
      std::copy_n(column + p * panel, std::min(panel, rows - p * panel), to.data() + (p * depth + k) * panel);
  }
}

}  // namespace dense

void add_product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double* C, Eigen::Index stride, Entries entries,
                 const StopToken* stop) {
  const std::size_t tile_rows = HWY_DYNAMIC_DISPATCH(dense::TileRows)(), whole = at(A.cols()), rows = at(A.rows());
  const std::size_t panels_per_look = 1 + kOperationsPerLook / (2 * dense::kDepth * tile_rows * at(B.rows() + 1));
  std::vector<double> a, b;
  for (std::size_t first = 0; first < whole; first += dense::kDepth) {
    const std::size_t depth = std::min(dense::kDepth, whole - first);
    dense::pack(A, first, depth, tile_rows, a);
    dense::pack(B, first, depth, dense::kColumns, b);
    const dense::Panels panels{a.data(), b.data(), rows, at(B.rows()), depth};
    for (std::size_t begin = 0; begin < rows; begin += panels_per_look * tile_rows) {
      look(stop);
      const std::size_t end = std::min(rows, begin + panels_per_look * tile_rows);
      HWY_DYNAMIC_DISPATCH(dense::Product)(panels, begin, end, C, at(stride), entries == Entries::Lower);
    }
  }
}

}  // namespace varimesh::detail
#endif
