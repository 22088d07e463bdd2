// Certifies one cell by cutting it in two until the answer is clear. Internal to the library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/stop_token.h"
#include "core/validity/cell_coefficients.h"
#include "core/validity/certificate.h"

namespace varimesh::detail {

/// The parts that a cell is cut into, while the answer is open. The one with the least lower() comes first. That is not
/// always the one with the least coefficient: every cut adds to the error of a part, so errors differ between the
/// parts. J is at least lowest().lower() in all parts together.
///
/// @tparam Part has lower() and upper(), proved bounds of J in the part
template <class Part>
class OpenParts {
 public:
  OpenParts() { heap_.reserve(kUsualParts); }

  void push(Part part) {
    heap_.push_back(std::move(part));
    std::ranges::push_heap(heap_, later);
  }

  /// The next four may be called only if there is a part.
  const Part& lowest() const { return heap_.front(); }
  Part take_lowest() {
    std::ranges::pop_heap(heap_, later);
    Part part = std::move(heap_.back());
    heap_.pop_back();
    return part;
  }
  /// Takes the part with the greatest upper().
  Part take_highest() {
    const auto highest = std::ranges::max_element(heap_, {}, [](const Part& part) { return part.upper(); });
    Part part = std::move(*highest);
    *highest = std::move(heap_.back());
    heap_.pop_back();
    std::ranges::make_heap(heap_, later);
    return part;
  }
  /// J is nowhere greater.
  auto upper() const {
    auto most = heap_.front().upper();
    for (const Part& part : heap_) most = std::max(most, part.upper());
    return most;
  }

 private:
  static constexpr std::size_t kUsualParts = 16;

  static bool later(const Part& a, const Part& b) { return a.lower() > b.lower(); }

  std::vector<Part> heap_;
};

/// Certifies a cell by subdivision: in double, and in wider arithmetic if double cannot tell. Looks at the token, which
/// may be null: one cell of a high order may take seconds.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, const StopToken* stop = nullptr);

/// The same for a cell whose coefficients are known already.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, Coefficients<double> coefficients,
                      const StopToken* stop = nullptr);

/// Whether rounding weakens the lower bound of a valid cell so much that wider arithmetic gives a better one.
template <class Real>
bool is_blunt(Real error, Real lower) {
  return error > Real(1e-3) * lower;
}

/// Fills in a certificate's bounds from those of the scaled J: J lies in [lower, upper], and max J is at least
/// `greatest`.
void set_bounds(const CellToCertify& cell, double lower, double upper, double greatest, Certificate& certificate);

}  // namespace varimesh::detail
