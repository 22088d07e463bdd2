// Products of dense matrices are those of Eigen, for sizes around those of tiles and of parts of a sum.
#include "core/kernels/dense/dense_product.h"

#include <gtest/gtest.h>

#include <string>

namespace varimesh {
namespace {

using detail::add_product;
using detail::Entries;

struct Sizes {
  int rows, columns, depth;
};

class DenseProduct : public ::testing::TestWithParam<Sizes> {};

INSTANTIATE_TEST_SUITE_P(Sizes, DenseProduct,
                         ::testing::Values(Sizes{1, 1, 1}, Sizes{5, 3, 2}, Sizes{24, 4, 128}, Sizes{25, 5, 129},
                                           Sizes{105, 105, 220}, Sizes{220, 35, 20}, Sizes{7, 50, 300}),
                         [](const auto& info) {
                           return std::to_string(info.param.rows) + "x" + std::to_string(info.param.columns) + "x" +
                                  std::to_string(info.param.depth);
                         });

TEST_P(DenseProduct, IsAddedToWhatIsThere) {
  const auto [rows, columns, depth] = GetParam();
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(rows, depth), B = Eigen::MatrixXd::Random(columns, depth);
  const Eigen::MatrixXd before = Eigen::MatrixXd::Random(rows, columns);
  Eigen::MatrixXd C = before;
  add_product(A, B, C.data(), rows, Entries::All);
  EXPECT_LT((C - before - A * B.transpose()).cwiseAbs().maxCoeff(), 1e-15 * (depth + 10));
}

TEST_P(DenseProduct, WritesOnlyToItsOwnColumns) {
  const auto [rows, columns, depth] = GetParam();
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(rows, depth), B = Eigen::MatrixXd::Random(columns, depth);
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(rows, 3 * columns);
  add_product(A, B, C.data() + rows, 3 * rows, Entries::All);
  for (int n = 0; n < columns; ++n) {
    EXPECT_LT((C.col(3 * n + 1) - A * B.row(n).transpose()).cwiseAbs().maxCoeff(), 1e-15 * (depth + 10));
    EXPECT_EQ(C.col(3 * n).cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(C.col(3 * n + 2).cwiseAbs().maxCoeff(), 0);
  }
}

TEST_P(DenseProduct, HasTheSameLowerTriangleIfOnlyThatIsAskedFor) {
  const auto [rows, columns, depth] = GetParam();
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(rows, depth), B = Eigen::MatrixXd::Random(rows, depth);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows, rows), lower = all;
  add_product(A, B, all.data(), rows, Entries::All);
  add_product(A, B, lower.data(), rows, Entries::Lower);
  for (int n = 0; n < rows; ++n) EXPECT_EQ(lower.col(n).tail(rows - n), all.col(n).tail(rows - n));
}

TEST(DenseProductStop, LooksAtItsToken) {
  const StopToken stop([] { return true; });
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(30, 10);
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(30, 30);
  EXPECT_THROW(add_product(A, A, C.data(), 30, Entries::All, &stop), Interrupted);
}

}  // namespace
}  // namespace varimesh
