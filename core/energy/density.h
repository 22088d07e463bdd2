// W(F), P = dW/dF and d²W/dF² of an energy at one point, in doubles. This plain code is easy to compare with the paper;
// the vectorised kernels must agree with it.
#pragma once

#include <Eigen/Core>

#include "core/energy/material.h"

namespace varimesh {

/// The energy density and its derivatives with respect to F. F_ij has the index i·d + j.
template <int d>
struct Density {
  double W = 0;
  Eigen::Matrix<double, d * d, 1> P;
  Eigen::Matrix<double, d * d, d * d> H;
};

/// W, P and H at F. `delta_squared` is the regularisation δ².
template <int d>
Density<d> density(const Material& material, const Eigen::Matrix<double, d, d>& F, double delta_squared);

/// Only W.
template <int d>
double energy_density(const Material& material, const Eigen::Matrix<double, d, d>& F, double delta_squared);

}  // namespace varimesh
