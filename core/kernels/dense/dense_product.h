// Products of the small dense matrices of one element, compiled for every vector unit.
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "core/base/stop_token.h"

namespace varimesh::detail {

/// Which entries of a product are computed.
enum class Entries : unsigned char {
  All,
  Lower,  ///< Those on and below the diagonal. Some above it are computed too.
};

/// Floating-point operations of a product between two looks at a token: less than a tenth of a second.
inline constexpr std::size_t kOperationsPerLook = 1'000'000'000;

/// C += A Bᵀ, with A of size rows × depth and B of size columns × depth. The sums of an entry run over the depth in
/// ascending order, in parts of fixed length. The result therefore depends on the machine's vector unit only by its
/// fused multiplications, and on nothing else. Looks at the token, which may be null.
///
/// @param stride numbers from one column of C to the next
void add_product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double* C, Eigen::Index stride, Entries entries,
                 const StopToken* stop = nullptr);

}  // namespace varimesh::detail
