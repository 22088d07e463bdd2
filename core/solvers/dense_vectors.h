// The vectors of a Newton step where the unknowns are few: dense vectors in the memory of one thread.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/solvers/minimised.h"

namespace varimesh {

/// The part of an objective that does not depend on what is minimised. An objective calls start() in linearise().
class DenseVectors : public Minimised {
 public:
  void advance(double alpha) final {
    step_ += alpha * direction_;
    residual_ -= alpha * product_;
  }
  void turn(double beta) final {
    if (beta == 0)
      direction_ = product_;
    else
      direction_ = product_ + beta * direction_;
  }
  void take_direction() final { step_ = direction_; }
  double preconditioned_norm(double rq) const final { return std::sqrt(std::max(0.0, rq)); }

 protected:
  /// r ← −g, x ← 0
  void start(const Eigen::VectorXd& gradient) {
    residual_ = -gradient;
    step_.setZero(gradient.size());
    product_.resize(gradient.size());
  }

  Eigen::VectorXd step_, residual_, direction_, product_;  ///< x, r, p and q of Minimised.
};

}  // namespace varimesh
