#include "core/opencascade/face_interior.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRep_Tool.hxx>
#include <Geom2dAdaptor_Curve.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <algorithm>
#include <cmath>

namespace varimesh::cad {
namespace {

constexpr int kFewQuestions = 500;       // as long as there are no more, a grid is not worth it
constexpr std::int32_t kCells = 256;     // per direction
constexpr std::int32_t kMostMargin = 8;  // in cells; with a larger one most of them would be near the boundary
constexpr int kFirstPieces = 32;         // of a curve, so that a closed one is not taken for a point
constexpr int kLeastPerSpan = 8;         // pieces between two knots of a spline
constexpr int kMostHalvings = 12;        // of a piece

}  // namespace

FaceInterior::FaceInterior(const TopoDS_Face& face, const geometry::Range& u, const geometry::Range& v, double u_period,
                           double v_period)
    : face_(face), ranges_{u, v}, periods_{u_period, v_period}, classifier_(face, BRep_Tool::Tolerance(face)) {}

std::optional<bool> FaceInterior::ask(double u, double v) const {
  const std::scoped_lock lock(mutex_);
  try {
    return classifier_.Perform(gp_Pnt2d(u, v)) != TopAbs_OUT;  // moves periodic parameters into the face's range itself
  } catch (const Standard_Failure&) {
    return std::nullopt;
  }
}

bool FaceInterior::contains(double u, double v) const {
  if (questions_.load(std::memory_order_relaxed) < kFewQuestions) {
    questions_.fetch_add(1, std::memory_order_relaxed);
    return ask(u, v).value_or(false);
  }
  std::call_once(made_, [&] { make_grid(); });
  const std::int32_t i = place(0, u), j = place(1, v);
  if (states_.empty() || i < 0 || j < 0) return ask(u, v).value_or(false);
  std::atomic<std::uint8_t>& state = states_[static_cast<std::size_t>(i * kCells + j)];
  std::uint8_t known = state.load(std::memory_order_relaxed);
  if (known == Near) return ask(u, v).value_or(false);
  if (known == Unknown) {
    const auto middle = [&](int direction, std::int32_t cell) {
      const geometry::Range& range = ranges_[static_cast<std::size_t>(direction)];
      return range.first + (cell + 0.5) / kCells * range.length();
    };
    const std::optional<bool> answer = ask(middle(0, i), middle(1, j));
    if (!answer) return ask(u, v).value_or(false);
    known = *answer ? Inside : Outside;
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
      is_complete = is_complete && !curve.IsNull() && mark(curve, first, last);
    }
  } catch (const Standard_Failure&) {
    is_complete = false;
  }
  if (!is_complete) states_.clear();
}

bool FaceInterior::set_margins() const {
  // Curves of a boundary may miss each other by the tolerance of the vertex between them.
  const double tolerance = std::max({BRep_Tool::Tolerance(face_), BRep_Tool::MaxTolerance(face_, TopAbs_EDGE),
                                     BRep_Tool::MaxTolerance(face_, TopAbs_VERTEX)});
  const BRepAdaptor_Surface surface(face_, false);
  const std::array<double, 2> reach = {surface.UResolution(tolerance), surface.VResolution(tolerance)};
  for (std::size_t d = 0; d < 2; ++d) {
    if (periods_[d] > 0 && ranges_[d].length() > (1 + 1e-9) * periods_[d]) return false;
    const double cells = std::max(tolerance, reach[d]) / ranges_[d].length() * kCells;
    if (!(cells < kMostMargin)) return false;
    margins_[d] = 1 + static_cast<std::int32_t>(std::ceil(cells));
  }
  return true;
}

bool FaceInterior::mark_around(const gp_Pnt2d& point) const {
  const auto cell = [&](std::size_t d, double parameter) {
    return std::floor((parameter - ranges_[d].first) / ranges_[d].length() * kCells);
  };
  const double u = cell(0, point.X()), v = cell(1, point.Y());
  if (!(u >= -1 && u <= kCells && v >= -1 && v <= kCells)) return false;
  const std::int32_t i = static_cast<std::int32_t>(std::clamp(u, 0.0, kCells - 1.0));
  const std::int32_t j = static_cast<std::int32_t>(std::clamp(v, 0.0, kCells - 1.0));
  for (std::int32_t a = std::max(i - margins_[0], 0); a <= std::min(i + margins_[0], kCells - 1); ++a)
    for (std::int32_t b = std::max(j - margins_[1], 0); b <= std::min(j + margins_[1], kCells - 1); ++b)
      states_[static_cast<std::size_t>(a * kCells + b)].store(Near, std::memory_order_relaxed);
  return true;
}

bool FaceInterior::mark(const Handle(Geom2d_Curve) & curve, double first, double last) const {
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
  // A spline may turn anywhere between two knots.
  const Geom2dAdaptor_Curve spans(curve, first, last);
  TColStd_Array1OfReal knots(1, spans.NbIntervals(GeomAbs_CN) + 1);
  spans.Intervals(knots, GeomAbs_CN);
  const int per_span = std::max(kLeastPerSpan, kFirstPieces / (knots.Length() - 1));
  for (int span = knots.Lower(); span < knots.Upper(); ++span)
    for (int k = 0; k < per_span; ++k) {
      const double length = knots(span + 1) - knots(span);
      const double begin = knots(span) + length * k / per_span, end = knots(span) + length * (k + 1) / per_span;
      pieces.push_back({begin, end, curve->Value(begin), curve->Value(end), 0});
    }
  while (!pieces.empty()) {
    const Piece piece = pieces.back();
    pieces.pop_back();
    if (is_short(piece)) {
      if (!mark_around(piece.from) || !mark_around(piece.to)) return false;
      continue;
    }
    if (piece.halvings == kMostHalvings ||
        !std::isfinite(piece.from.X() + piece.from.Y() + piece.to.X() + piece.to.Y()))
      return false;
    const double middle = 0.5 * (piece.first + piece.last);
    const gp_Pnt2d at = curve->Value(middle);
    pieces.push_back({piece.first, middle, piece.from, at, piece.halvings + 1});
    pieces.push_back({middle, piece.last, at, piece.to, piece.halvings + 1});
  }
  return true;
}

}  // namespace varimesh::cad
