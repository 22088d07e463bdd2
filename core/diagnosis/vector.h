// Vectors in space with three components. Internal to the library.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace varimesh::detail {

using Vector = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double determinant(const Vector& a, const Vector& b, const Vector& c) { return dot(a, cross(b, c)); }
inline Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vector plus(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

/// Scales a vector to length one; false if it has none.
inline bool normalise(Vector& x) {
  const double length = std::sqrt(dot(x, x));
  if (!(length > 0)) return false;
  for (double& component : x) component /= length;
  return true;
}

/// The smallest n · x over these vectors n, or 1 if that is smaller.
inline double smallest_product(const std::vector<Vector>& normals, const Vector& x) {
  double result = 1;
  for (const Vector& n : normals) result = std::min(result, dot(n, x));
  return result;
}

/// Calls attempt(x) for candidates x of any length. One of them has the direction in which the smallest n · x is
/// largest. By duality that direction points to the point of the vectors' convex hull nearest to the origin, so it
/// depends on one, two or three of the vectors. between(a, b) gives the candidate for two of them.
template <class Between, class Attempt>
void for_each_widest_candidate(const std::vector<Vector>& normals, Between&& between, Attempt&& attempt) {
  for (std::size_t i = 0; i < normals.size(); ++i) {
    attempt(normals[i]);
    for (std::size_t j = 0; j < i; ++j) {
      attempt(between(normals[i], normals[j]));
      for (std::size_t k = 0; k < j; ++k) {
        const Vector x = cross(minus(normals[j], normals[i]), minus(normals[k], normals[i]));
        attempt(x);
        attempt({-x[0], -x[1], -x[2]});
      }
    }
  }
}

}  // namespace varimesh::detail
