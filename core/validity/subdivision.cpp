// Bisects the Bernstein coefficients of one cell by de Casteljau's algorithm, the most doubtful part first.
#include "core/validity/subdivision.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "core/reference/cache.h"
#include "core/validity/rounding.h"

namespace varimesh::detail {
namespace {

// ---------------------------------------------------------------------------------------------------------------------
// Which coefficients a bisection mixes
// ---------------------------------------------------------------------------------------------------------------------

/// An edge of a factor, between its barycentric coordinates in slots a and b. A line holds the coefficients whose other
/// exponents are the same, by growing exponent of b. Along the edge they are those of a univariate polynomial of degree
/// length − 1. A bisection of the edge mixes only the coefficients of one line.
struct Edge {
  std::size_t a = 0, b = 0;
  std::vector<std::uint16_t> coefficients;
  std::vector<std::uint32_t> start;
};

std::vector<Edge> make_edges(const BernsteinSpace& space) {
  std::vector<Edge> edges;
  for (std::size_t f = 0; f < space.factors().size(); ++f) {
    if (space.factors()[f].degree == 0) continue;
    const auto offset = static_cast<std::size_t>(space.offset(static_cast<int>(f)));
    const std::size_t end = offset + static_cast<std::size_t>(space.factors()[f].dimension);
    for (std::size_t a = offset; a <= end; ++a) {
      for (std::size_t b = a + 1; b <= end; ++b) {
        Edge edge{a, b, {}, {0}};
        for (const Exponents& first : space.exponents()) {
          if (first[b] != 0) continue;
          for (Exponents e = first;; --e[a], ++e[b]) {
            edge.coefficients.push_back(static_cast<std::uint16_t>(space.index(e)));
            if (e[a] == 0) break;
          }
          edge.start.push_back(static_cast<std::uint32_t>(edge.coefficients.size()));
        }
        edges.push_back(std::move(edge));
      }
    }
  }
  return edges;
}

const std::vector<Edge>& edges_of(const JacobianTable& table) {
  static reference::Cache<std::pair<Shape, int>, std::vector<Edge>> cache;
  return cache.get(std::pair(table.shape, table.order), [&] { return make_edges(table.jacobian); });
}

// ---------------------------------------------------------------------------------------------------------------------
// The search
// ---------------------------------------------------------------------------------------------------------------------

/// A part of the cell, with its coefficients and its corners. corners[slot] is the corner of the factor that the slot
/// belongs to, in barycentric coordinates of that factor (from its first slot on).
template <class Real>
struct Part {
  std::vector<Real> values;
  std::array<std::array<double, 6>, 6> corners{};
  Real error = 0;  // no coefficient is further from the exact one
  Real least = 0, greatest = 0;
  int depth = 0;

  Real lower() const { return least - error; }
  Real upper() const { return greatest + error; }

  void measure() {
    const auto [low, high] = std::ranges::minmax_element(values);
    least = *low;
    greatest = *high;
  }
};

template <class Real>
class Search {
 public:
  Search(const CellToCertify& cell, const CertificateOptions& options, const StopToken* stop)
      : table_(*cell.table), options_(options), edges_(edges_of(*cell.table)), stop_(stop) {}

  /// Cuts parts until the answer is known to within the gap or the budget is spent.
  void search(Coefficients<Real> root) {
    Part<Real> whole;
    whole.values = std::move(root.values);
    whole.error = root.error;
    for (std::size_t slot = 0; slot < 6; ++slot) whole.corners[slot][slot] = 1;
    whole.measure();
    if (!(whole.error < std::numeric_limits<Real>::max())) return;  // a coordinate is not finite
    finite_ = true;
    push(std::move(whole));
    int parts = 1;
    while (!done()) {
      look(stop_);
      if (parts >= options_.max_cells || open_.lowest().depth >= options_.max_depth) break;
      bisect(take());
      ++parts;
    }
    if (answer_ != Certificate::Answer::Invalid && lower() > 0) answer_ = Certificate::Answer::Valid;
    if (answer_ == Certificate::Answer::Undecided) place_ = lowest_corner(open_.lowest()).second;
    limited_by_rounding_ = answer_ == Certificate::Answer::Undecided
                               ? touches_zero_ || std::abs(open_.lowest().least) <= 64 * open_.lowest().error
                               : answer_ == Certificate::Answer::Valid && is_blunt(open_.lowest().error, lower());
  }

  Certificate::Answer answer() const { return answer_; }
  bool finite() const { return finite_; }
  bool limited_by_rounding() const { return limited_by_rounding_; }
  Real lower() const { return open_.lowest().lower(); }
  Real upper() const { return open_.upper(); }
  /// A lower bound of max J.
  Real greatest_seen() const { return greatest_seen_; }
  const std::array<double, 6>& place() const { return place_; }

 private:
  bool done() const {
    const Part<Real>& worst = open_.lowest();
    // The lowest part can be proved neither positive nor negative.
    const bool hopeless = touches_zero_ && worst.least >= -worst.error;
    const bool answered = answer_ == Certificate::Answer::Invalid || lower() > 0 || hopeless;
    return answered && (hopeless || !std::isfinite(options_.gap) || greatest_seen_ <= 0 ||
                        slack_below() + slack_above() <= Real(options_.gap));
  }

  /// How much of the scaled Jacobian's uncertainty is due to min J, and how much to max J.
  Real slack_below() const { return (least_seen_ - lower()) / greatest_seen_; }
  Real slack_above() const { return lower() > 0 ? lower() * (1 / greatest_seen_ - 1 / upper()) : 0; }

  /// The part to cut next: the lowest one, or the highest one if mainly max J is in doubt.
  Part<Real> take() {
    const bool max_in_doubt =
        std::isfinite(options_.gap) && lower() > 0 && greatest_seen_ > 0 && slack_above() > slack_below();
    return max_in_doubt ? open_.take_highest() : open_.take_lowest();
  }

  void push(Part<Real> part) {
    for (const auto index : table_.corners) {
      const Real value = part.values[index];
      greatest_seen_ = std::max(greatest_seen_, value - part.error);
      least_seen_ = std::min(least_seen_, value + part.error);
      touches_zero_ |= std::abs(value) <= part.error;
    }
    if (answer_ != Certificate::Answer::Invalid) {
      const auto [value, place] = lowest_corner(part);
      if (value + part.error <= 0) {
        answer_ = Certificate::Answer::Invalid;
        place_ = place;
      }
    }
    open_.push(std::move(part));
  }

  /// The corner of a part with the smallest J, and where it is.
  std::pair<Real, std::array<double, 6>> lowest_corner(const Part<Real>& part) const {
    const auto lowest = std::ranges::min_element(table_.corners, {}, [&](auto index) { return part.values[index]; });
    const std::array<double, 6>& slots = table_.corner_at[static_cast<std::size_t>(lowest - table_.corners.begin())];
    std::array<double, 6> place{};
    for (std::size_t slot = 0; slot < 6; ++slot)
      for (std::size_t k = 0; k < 6; ++k) place[k] += slots[slot] * part.corners[slot][k];
    return {part.values[*lowest], place};
  }

  /// How much the coefficients bend along an edge.
  static Real bend(const Edge& edge, const std::vector<Real>& values) {
    Real most = 0;
    for (std::size_t line = 0; line + 1 < edge.start.size(); ++line)
      for (std::uint32_t i = edge.start[line]; i + 2 < edge.start[line + 1]; ++i)
        most = std::max(most, std::abs(values[edge.coefficients[i]] - 2 * values[edge.coefficients[i + 1]] +
                                       values[edge.coefficients[i + 2]]));
    return most;
  }

  void bisect(Part<Real> part) {
    const Edge* best = &edges_.front();
    Real most = -1;
    for (const Edge& edge : edges_) {
      const Real b = bend(edge, part.values);
      if (b > most) {
        most = b;
        best = &edge;
      }
    }
    Part<Real> second = part;
    de_casteljau(*best, part.values, second.values);
    std::array<double, 6> middle;
    for (std::size_t k = 0; k < 6; ++k) middle[k] = (part.corners[best->a][k] + part.corners[best->b][k]) / 2;
    part.corners[best->b] = middle;
    second.corners[best->a] = middle;
    const Real size = std::max(std::abs(part.least), std::abs(part.greatest));
    const Real added = Real(table_.degree() + 2) * std::numeric_limits<Real>::epsilon() / 2 * size;
    for (Part<Real>* half : {&part, &second}) {
      half->error = (half->error + added) * (1 + 4 * std::numeric_limits<Real>::epsilon());
      ++half->depth;
      half->measure();
    }
    push(std::move(part));
    push(std::move(second));
  }

  /// Afterwards `near` holds the half at corner a and `far` the half at corner b. On entry both hold the whole part.
  static void de_casteljau(const Edge& edge, std::vector<Real>& near, std::vector<Real>& far) {
    std::array<Real, 32> row;
    for (std::size_t line = 0; line + 1 < edge.start.size(); ++line) {
      const std::uint16_t* index = edge.coefficients.data() + edge.start[line];
      const std::size_t length = edge.start[line + 1] - edge.start[line];
      for (std::size_t i = 0; i < length; ++i) row[i] = near[index[i]];
      for (std::size_t level = 0; level < length; ++level) {
        near[index[level]] = row[0];
        far[index[length - 1 - level]] = row[length - 1 - level];
        for (std::size_t i = 0; i + 1 < length - level; ++i) row[i] = (row[i] + row[i + 1]) / 2;
      }
    }
  }

  const JacobianTable& table_;
  const CertificateOptions& options_;
  const std::vector<Edge>& edges_;
  const StopToken* stop_;
  OpenParts<Part<Real>> open_;  // never empty once the whole cell is in
  Certificate::Answer answer_ = Certificate::Answer::Undecided;
  bool finite_ = false;
  bool touches_zero_ = false;  // within rounding, J is 0 at some corner: the cell can never be proved valid
  bool limited_by_rounding_ = false;
  Real greatest_seen_ = -std::numeric_limits<Real>::max(), least_seen_ = std::numeric_limits<Real>::max();
  std::array<double, 6> place_{};
};

/// One attempt; true if wider arithmetic may tell more.
template <class Real>
bool attempt(const CellToCertify& cell, const CertificateOptions& options, Coefficients<Real> coefficients,
             const StopToken* stop, Certificate& certificate) {
  Search<Real> search(cell, options, stop);
  search.search(std::move(coefficients));
  if (!search.finite()) return false;
  certificate.answer = search.answer();
  set_bounds(cell, static_cast<double>(search.lower()), static_cast<double>(search.upper()),
             static_cast<double>(search.greatest_seen()), certificate);
  if (!certificate.is_valid()) certificate.place = physical_place(cell, search.place());
  return search.limited_by_rounding();
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// Public functions
// ---------------------------------------------------------------------------------------------------------------------

Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, const StopToken* stop) {
  return subdivide(cell, options, plain_coefficients(cell), stop);
}

Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, Coefficients<double> coefficients,
                      const StopToken* stop) {
  Certificate certificate;
  if (attempt(cell, options, std::move(coefficients), stop, certificate))
    attempt(cell, options, extended_coefficients(cell, stop), stop, certificate);
  return certificate;
}

void set_bounds(const CellToCertify& cell, double lower, double upper, double greatest, Certificate& certificate) {
  // The arguments are rounded to nearest: one step outwards makes them bounds, and so does another after the quotient.
  lower = next_below(lower);
  upper = next_above(upper);
  greatest = next_below(greatest);
  // Powers of two, so this is exact. Multiplied one by one, no intermediate result overflows unless the last one does.
  const double inverse = 1 / cell.scale;
  double unit = inverse;
  for (int i = 1; i < cell.table->dimension; ++i) unit *= inverse;
  certificate.lower_bound = next_below(lower * unit);
  certificate.upper_bound = next_above(upper * unit);
  if (lower >= 0)
    certificate.scaled_jacobian_lower_bound = std::max(0.0, next_below(lower / upper));
  else if (greatest > 0)
    certificate.scaled_jacobian_lower_bound = next_below(lower / greatest);
  else if (upper <= 0)
    certificate.scaled_jacobian_lower_bound = -1;  // by definition, if J is nowhere positive
}

}  // namespace varimesh::detail
