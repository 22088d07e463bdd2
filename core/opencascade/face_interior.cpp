#include "core/opencascade/face_interior.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRep_Tool.hxx>
#include <Standard_Failure.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <algorithm>
#include <cmath>

namespace varimesh::cad {
namespace {

constexpr int kFewQuestions = 500;    // as long as there are no more, a grid is not worth it
constexpr std::int32_t kCells = 256;  // per direction
constexpr std::int32_t kMostMargin = kCells / 4;
constexpr int kFirstPieces = 32;   // of a curve, so that a closed one is not taken for a point
constexpr int kMostHalvings = 12;  // of a piece

}  // namespace

FaceInterior::FaceInterior(const TopoDS_Face& face, const geometry::Range& u, const geometry::Range& v, double u_period,
                           double v_period)
    : face_(face), ranges_{u, v}, periods_{u_period, v_period}, classifier_(face, BRep_Tool::Tolerance(face)) {}

bool FaceInterior::ask(double u, double v) const {
  const std::scoped_lock lock(mutex_);
  try {
    return classifier_.Perform(gp_Pnt2d(u, v)) != TopAbs_OUT;  // moves periodic parameters into the face's range itself
  } catch (const Standard_Failure&) {
    return false;
  }
}

bool FaceInterior::contains(double u, double v) const {
  if (questions_.load(std::memory_order_relaxed) < kFewQuestions) {
    questions_.fetch_add(1, std::memory_order_relaxed);
    return ask(u, v);
  }
  std::call_once(made_, [&] { make_grid(); });
  const std::int32_t i = place(0, u), j = place(1, v);
  if (states_.empty() || i < 0 || j < 0) return ask(u, v);
  std::atomic<std::uint8_t>& state = states_[static_cast<std::size_t>(i * kCells + j)];
  std::uint8_t known = state.load(std::memory_order_relaxed);
  if (known == Near) return ask(u, v);
  if (known == Unknown) {
    const auto middle = [&](int direction, std::int32_t cell) {
      const geometry::Range& range = ranges_[static_cast<std::size_t>(direction)];
      return range.first + (cell + 0.5) / kCells * range.length();
    };
    known = ask(middle(0, i), middle(1, j)) ? Inside : Outside;
    state.store(known, std::memory_order_relaxed);
  }
  return known == Inside;
}

std::int32_t FaceInterior::place(int direction, double parameter) const {
  const auto d = static_cast<std::size_t>(direction);
  const geometry::Range& range = ranges_[d];
  if (periods_[d] > 0) parameter -= periods_[d] * std::floor((parameter - range.first) / periods_[d]);
  const double cell = std::floor((parameter - range.first) / range.length() * kCells);
  return cell >= 0 && cell < kCells ? static_cast<std::int32_t>(cell) : -1;
}

void FaceInterior::make_grid() const {
  std::vector<std::atomic<std::uint8_t>> states(kCells * kCells);
  states_.swap(states);
  bool is_complete = true;
  try {
    is_complete = set_margins();
    const TopoDS_Face forward = TopoDS::Face(face_.Oriented(TopAbs_FORWARD));
    for (TopExp_Explorer edges(forward, TopAbs_EDGE); edges.More(); edges.Next()) {
      double first = 0, last = 0;
      const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(TopoDS::Edge(edges.Current()), forward, first, last);
      is_complete = is_complete && !curve.IsNull() && mark(*curve, first, last);
    }
  } catch (const Standard_Failure&) {
    is_complete = false;
  }
  if (!is_complete) states_.clear();
}

bool FaceInterior::set_margins() const {
  const double tolerance = std::max(BRep_Tool::Tolerance(face_), BRep_Tool::MaxTolerance(face_, TopAbs_EDGE));
  const BRepAdaptor_Surface surface(face_, false);
  const std::array<double, 2> reach = {surface.UResolution(tolerance), surface.VResolution(tolerance)};
  for (std::size_t d = 0; d < 2; ++d) {
    const double cells = std::max(tolerance, reach[d]) / ranges_[d].length() * kCells;
    if (!(cells < kMostMargin)) return false;
    margins_[d] = 1 + static_cast<std::int32_t>(std::ceil(cells));
  }
  return true;
}

void FaceInterior::mark_around(const gp_Pnt2d& point) const {
  // The boundary lies in the bounds up to rounding.
  const auto cell = [&](std::size_t d, double parameter) {
    const double at = std::floor((parameter - ranges_[d].first) / ranges_[d].length() * kCells);
    return static_cast<std::int32_t>(std::clamp(at, 0.0, kCells - 1.0));
  };
  const std::int32_t i = cell(0, point.X()), j = cell(1, point.Y());
  for (std::int32_t a = std::max(i - margins_[0], 0); a <= std::min(i + margins_[0], kCells - 1); ++a)
    for (std::int32_t b = std::max(j - margins_[1], 0); b <= std::min(j + margins_[1], kCells - 1); ++b)
      states_[static_cast<std::size_t>(a * kCells + b)] = Near;
}

bool FaceInterior::mark(const Geom2d_Curve& curve, double first, double last) const {
  struct Piece {
    double first, last;
    gp_Pnt2d from, to;
    int halvings;
  };
  const auto is_short = [&](const Piece& piece) {
    return std::abs(piece.to.X() - piece.from.X()) * kCells <= 0.5 * ranges_[0].length() &&
           std::abs(piece.to.Y() - piece.from.Y()) * kCells <= 0.5 * ranges_[1].length();
  };
  std::vector<Piece> pieces;
  for (int k = 0; k < kFirstPieces; ++k) {
    const double begin = first + (last - first) * k / kFirstPieces;
    const double end = first + (last - first) * (k + 1) / kFirstPieces;
    pieces.push_back({begin, end, curve.Value(begin), curve.Value(end), 0});
  }
  while (!pieces.empty()) {
    const Piece piece = pieces.back();
    pieces.pop_back();
    if (is_short(piece)) {
      mark_around(piece.from);
      mark_around(piece.to);
      continue;
    }
    if (piece.halvings == kMostHalvings ||
        !std::isfinite(piece.from.X() + piece.from.Y() + piece.to.X() + piece.to.Y()))
      return false;
    const double middle = 0.5 * (piece.first + piece.last);
    const gp_Pnt2d at = curve.Value(middle);
    pieces.push_back({piece.first, middle, piece.from, at, piece.halvings + 1});
    pieces.push_back({middle, piece.last, at, piece.to, piece.halvings + 1});
  }
  return true;
}

}  // namespace varimesh::cad
