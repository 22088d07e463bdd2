#include "core/opencascade/face_interior.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRep_Tool.hxx>
#include <Geom2dAdaptor_Curve.hxx>
#include <Geom2d_Curve.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <algorithm>
#include <cmath>

namespace varimesh::cad {
namespace {

using Point = Outline::Point;

constexpr int kFewQuestions = 64;    // as long as there are no more, an outline is not worth it
constexpr double kMostBand = 0.05;   // relative to the bounds of the face, as all lengths here
constexpr double kDeviation = 1e-5;  // of a polygon from the boundary
constexpr double kFar = 2;           // a curve that goes farther beyond the bounds has no polygon
constexpr int kPerSpan = 8;          // sides of a polygon between two knots of a curve, at least
constexpr int kMostHalvings = 12;    // of a side
constexpr std::size_t kMostEdges = 2000, kMostWires = 200, kMostPoints = 100'000;  // of a face
constexpr int kSamples = 32;             // all over the face, at which outline and classifier are compared,
constexpr std::size_t kMostBeside = 32;  // and edges with four samples each
constexpr double kBeside = 1e-3;         // how far these lie from the edge, at least

/// Makes a polygon of a part of a curve. Returns false if it stays far from the curve.
/// @param at    the point for a parameter of the curve
/// @param line  ends with the point of `first`; the points after it are added
template <class At>
bool follow(const At& at, double first, double last, int halvings, std::vector<Point>& line) {
  const Point from = line.back(), to = at(last);
  const double middle = 0.5 * (first + last);
  const Point half = at(middle);
  double off = 0;
  for (const Point& between : {at(0.5 * (first + middle)), half, at(0.5 * (middle + last))}) {
    const double here = distance_to_side(between, from, to);
    if (!(here < kFar) || !(std::abs(between[0]) < 1 + kFar && std::abs(between[1]) < 1 + kFar)) return false;
    off = std::max(off, here);
  }
  if (line.size() > kMostPoints) return false;
  if (off <= kDeviation) {
    line.push_back(half);
    line.push_back(to);
    return true;
  }
  return halvings < kMostHalvings && follow(at, first, middle, halvings + 1, line) &&
         follow(at, middle, last, halvings + 1, line);
}

/// The polygon of a whole curve; empty if there is none that is near to it.
template <class At>
std::vector<Point> polygon(const Handle(Geom2d_Curve) & curve, double first, double last, const At& at) {
  // A spline may turn anywhere between two knots.
  const Geom2dAdaptor_Curve spans(curve, first, last);
  TColStd_Array1OfReal knots(1, spans.NbIntervals(GeomAbs_CN) + 1);
  spans.Intervals(knots, GeomAbs_CN);
  std::vector<Point> line{at(first)};
  for (int span = knots.Lower(); span < knots.Upper(); ++span)
    for (int k = 0; k < kPerSpan; ++k) {
      const double length = knots(span + 1) - knots(span);
      const double begin = knots(span) + length * k / kPerSpan, end = knots(span) + length * (k + 1) / kPerSpan;
      if (!follow(at, begin, end, 0, line)) return {};
    }
  return line;
}

using Lines = std::vector<std::vector<Point>>;

/// A wire of a face.
struct Loop {
  std::vector<Point> points;
  Outline outline;
  Point low, high;

  Loop(const Lines& lines, const Point& band) : outline(band), low(lines[0][0]), high(low) {
    for (const std::vector<Point>& line : lines) {
      outline.add(line);
      points.insert(points.end(), line.begin(), line.end());
    }
    for (const Point& point : points)
      for (std::size_t d = 0; d < 2; ++d) {
        low[d] = std::min(low[d], point[d]);
        high[d] = std::max(high[d], point[d]);
      }
  }

  bool has_in_box(const Point& point) const {
    return point[0] >= low[0] && point[0] <= high[0] && point[1] >= low[1] && point[1] <= high[1];
  }
  /// Whether all points of the other loop lie inside, or all outside. Points near to this loop are neither.
  bool is_on_one_side(const Loop& other) const {
    std::optional<bool> side;
    for (const Point& point : other.points) {
      const std::optional<bool> here = has_in_box(point) ? outline.contains(point) : std::optional(false);
      if (!here || (side && side != here)) return false;
      side = here;
    }
    return true;
  }
};

/// Whether the wires are closed and do not touch or overlap each other.
bool are_sound(const std::vector<Lines>& wires, const Point& band) {
  std::vector<Loop> loops;
  for (const Lines& lines : wires)
    if (!loops.emplace_back(lines, band).outline.finish()) return false;
  for (std::size_t a = 0; a < loops.size(); ++a)
    for (std::size_t b = 0; b < loops.size(); ++b) {
      bool overlap = a != b;
      for (std::size_t d = 0; d < 2; ++d)
        overlap = overlap && loops[a].low[d] <= loops[b].high[d] && loops[b].low[d] <= loops[a].high[d];
      if (overlap && !loops[a].is_on_one_side(loops[b])) return false;
    }
  return true;
}

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
  std::call_once(made_, [&] {
    try {
      if (const std::optional<Point> near = band()) {
        band_ = *near;
        outline_ = make_outline(band_);
      }
    } catch (const Standard_Failure&) {  // then the classifier answers
    }
  });
  const std::optional<bool> known = outline_ ? look_up(*outline_, relative(gp_Pnt2d(u, v))) : std::nullopt;
  return known ? *known : ask(u, v).value_or(false);
}

Point FaceInterior::relative(const gp_Pnt2d& parameters) const {
  return {(parameters.X() - ranges_[0].first) / ranges_[0].length(),
          (parameters.Y() - ranges_[1].first) / ranges_[1].length()};
}

std::optional<bool> FaceInterior::look_up(const Outline& outline, Point at) const {
  for (std::size_t d = 0; d < 2; ++d) {
    if (!(periods_[d] > 0)) continue;
    const double period = periods_[d] / ranges_[d].length();
    at[d] -= period * std::floor(at[d] / period);  // from 0 to the period
    const bool is_just_before_0 = at[d] > 1 && at[d] - period > -4 * band_[d];
    if (is_just_before_0) return std::nullopt;
  }
  return outline.contains(at);
}

std::optional<Point> FaceInterior::band() const {
  // Curves of a boundary may miss each other by the tolerance of the vertex between them.
  const double tolerance = std::max({BRep_Tool::Tolerance(face_), BRep_Tool::MaxTolerance(face_, TopAbs_EDGE),
                                     BRep_Tool::MaxTolerance(face_, TopAbs_VERTEX)});
  const BRepAdaptor_Surface surface(face_, false);
  const Point reach = {surface.UResolution(tolerance), surface.VResolution(tolerance)};
  Point band;
  for (std::size_t d = 0; d < 2; ++d) {
    if (periods_[d] > 0 && ranges_[d].length() > (1 + 1e-9) * periods_[d]) return std::nullopt;
    band[d] = std::max(tolerance, reach[d]) / ranges_[d].length() + 2 * kDeviation;
    if (!(band[d] < kMostBand)) return std::nullopt;
  }
  return band;
}

std::optional<Outline> FaceInterior::make_outline(const Point& band) const {
  const std::vector<Lines> wires = polygons();
  if (wires.empty() || !are_sound(wires, band)) return std::nullopt;
  Outline outline(band);
  std::vector<Point> on_boundary;
  for (const Lines& lines : wires)
    for (const std::vector<Point>& line : lines) {
      outline.add(line);
      on_boundary.push_back(line[line.size() / 2]);
    }
  if (!outline.finish() || !agrees(outline, on_boundary)) return std::nullopt;
  return outline;
}

std::vector<Lines> FaceInterior::polygons() const {
  std::vector<Lines> wires;
  std::size_t edge_count = 0, point_count = 0;
  const TopoDS_Face forward = TopoDS::Face(face_.Oriented(TopAbs_FORWARD));
  for (TopExp_Explorer each(forward, TopAbs_WIRE); each.More(); each.Next()) {
    Lines lines;
    for (TopExp_Explorer edges(each.Current(), TopAbs_EDGE); edges.More(); edges.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(edges.Current());
      if (edge.Orientation() != TopAbs_FORWARD && edge.Orientation() != TopAbs_REVERSED) continue;  // inside the face
      double first = 0, last = 0;
      const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, forward, first, last);
      if (curve.IsNull() || ++edge_count > kMostEdges) return {};
      lines.push_back(polygon(curve, first, last, [&](double t) { return relative(curve->Value(t)); }));
      point_count += lines.back().size();
      if (lines.back().empty() || point_count > kMostPoints) return {};
    }
    if (!lines.empty()) wires.push_back(std::move(lines));
    if (wires.size() > kMostWires) return {};
  }
  return wires;
}

bool FaceInterior::agrees(const Outline& outline, const std::vector<Point>& on_boundary) const {
  std::vector<Point> samples = spread_points(kSamples);
  const std::size_t step = (on_boundary.size() + kMostBeside - 1) / kMostBeside;
  const Point off = {std::max(kBeside, 4 * band_[0]), std::max(kBeside, 4 * band_[1])};
  for (std::size_t k = 0; k < on_boundary.size(); k += step)
    for (const auto& [u, v] : {Point{-1, -1}, Point{-1, 1}, Point{1, -1}, Point{1, 1}})
      samples.push_back({on_boundary[k][0] + u * off[0], on_boundary[k][1] + v * off[1]});
  return std::ranges::all_of(samples, [&](const Point& at) {
    const std::optional<bool> ours = look_up(outline, at);
    const std::optional<bool> theirs =
        ask(ranges_[0].first + at[0] * ranges_[0].length(), ranges_[1].first + at[1] * ranges_[1].length());
    return !ours || ours == theirs;
  });
}

}  // namespace varimesh::cad
