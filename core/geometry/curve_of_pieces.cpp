#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/geometry/element_map.h"
#include "core/geometry/pieces.h"

namespace varimesh::geometry {
namespace {

class Chain : public CurveShape {
 public:
  Chain(std::vector<ElementMap> pieces, bool closed) : pieces_(std::move(pieces)), closed_(closed) {
    begins_.push_back(0);
    for (const ElementMap& piece : pieces_)
      begins_.push_back(begins_.back() + (piece.nodes().col(1) - piece.nodes().col(0)).norm());
  }

  CurvePoint at(double t) const override {
    if (closed_) t -= begins_.back() * std::floor(t / begins_.back());
    const auto after = std::upper_bound(begins_.begin() + 1, begins_.end() - 1, t);
    const auto k = static_cast<std::size_t>(after - begins_.begin()) - 1;
    const double slope = 2 / (begins_[k + 1] - begins_[k]);
    const CurvePoint p = pieces_[k].at(slope * (t - begins_[k]) - 1);
    return {p.x, slope * p.dt, slope * slope * p.dtt};
  }
  Range range() const override { return {0, begins_.back(), closed_ ? begins_.back() : 0}; }
  int intervals() const override {
    constexpr int kEach = 3, kMost = 3000;
    return std::clamp(kEach * static_cast<int>(pieces_.size()), 16, kMost);
  }

  const std::vector<double>& begins() const { return begins_; }

  /// The error as the angles at the joints show it.
  InterpolationError error() const {
    const double factor = error_over_slope(pieces_.front().order()) / 2;  // each of two neighbours has half the angle
    const std::size_t count = pieces_.size();
    InterpolationError error;
    double squares = 0, samples = 0;
    for (std::size_t k = 0; k + 1 < count + (closed_ && count > 1 ? 1 : 0); ++k) {
      const std::size_t next = (k + 1) % count;
      const double sine = pieces_[k].at(1).dt.normalized().cross(pieces_[next].at(-1).dt.normalized()).norm();
      const double off = factor * sine * std::min(chord(k), chord(next));
      error.largest = std::max(error.largest, off);
      squares += off * off;
      samples += 1;
    }
    error.rms = samples > 0 ? std::sqrt(squares / samples) : 0;
    return error;
  }

 private:
  double chord(std::size_t k) const { return begins_[k + 1] - begins_[k]; }

  std::vector<ElementMap> pieces_;
  std::vector<double> begins_;
  bool closed_;
};

}  // namespace

PieceCurve curve_of_pieces(const std::vector<Eigen::Matrix3Xd>& pieces, bool closed) {
  assert(!pieces.empty());
  std::vector<ElementMap> maps;
  for (const Eigen::Matrix3Xd& x : pieces) maps.emplace_back(Shape::Line, static_cast<int>(x.cols()) - 1, x);
  const auto chain = std::make_shared<Chain>(std::move(maps), closed);
  return {chain, chain->error(), chain->begins()};
}

}  // namespace varimesh::geometry
