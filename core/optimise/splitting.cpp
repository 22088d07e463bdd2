// Rounds of splitting and optimising; the best mesh is kept.
#include "core/optimise/splitting.h"

#include <Eigen/LU>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/run_sequence.h"
#include "core/reference/basis.h"
#include "core/repair/split_passes.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr int kMostRounds = 4;

std::set<std::int64_t> uncertified_set(const Result& result) {
  const std::vector<std::int64_t> numbers = uncertified_numbers(result.after);
  return {numbers.begin(), numbers.end()};
}

/// Corners with J ≤ 0 of the tetrahedra that are not certified in the optimised mesh. If a tetrahedron has no such
/// corner, all its corners.
std::vector<CellCorner> bad_corners(const Result& result) {
  const HighOrderMesh& mesh = result.mesh;
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  reference::Points vertices(4, 3);
  for (int v = 0; v < 4; ++v)
    for (int c = 0; c < 3; ++c) vertices(v, c) = reference::info(Shape::Tetrahedron).vertex[at(v)][at(c)];
  const auto gradients =
      reference::basis_gradients(Shape::Tetrahedron, mesh.order, reference::NodeSet::Equispaced, 3, vertices);
  const std::set<std::int64_t> uncertified = uncertified_set(result);
  std::vector<CellCorner> corners;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    if (cells.shape(c) != Shape::Tetrahedron || !uncertified.contains(cells.number(c))) continue;
    const auto nodes = cells.nodes(c);
    const Eigen::MatrixXd x = detail::node_positions(mesh.coordinates, nodes);
    std::vector<CellCorner> bad;
    for (int v = 0; v < 4; ++v) {
      Eigen::Matrix3d jacobian;
      for (int k = 0; k < 3; ++k) jacobian.row(k) = gradients[at(k)].row(v) * x;
      if (!(sign * jacobian.determinant() > 0)) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    }
    if (bad.empty())
      for (int v = 0; v < 4; ++v) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    corners.insert(corners.end(), bad.begin(), bad.end());
  }
  return corners;
}

/// Fewer uncertified elements; with as many, a higher minimum.
bool is_better(const Result& a, const Result& b) {
  const std::size_t left_a = a.after.uncertified.size(), left_b = b.after.uncertified.size();
  return left_a != left_b ? left_a < left_b : a.after.min_scaled_jacobian > b.after.min_scaled_jacobian;
}

/// Splits and optimises in rounds; the best result. Nothing if there was nothing to split, or if a stop was asked for
/// before the first run.
std::optional<Result> optimise_in_rounds(const HighOrderMesh& mesh, const Options& options, RunSequence& runs) {
  HighOrderMesh start = mesh;
  std::vector<RepairStep> steps;
  std::optional<Result> best;
  std::vector<CellCorner> marked;
  for (int round = 0; round < kMostRounds; ++round) {
    const std::size_t had = steps.size();
    start = split_in_passes(std::move(start), options, std::move(marked), steps, [&] { return runs.stop_asked(); });
    if (steps.size() == had || runs.stop_asked()) break;
    std::optional<Result> result = runs.run(start);
    if (!result) break;
    marked = bad_corners(*result);
    result->repairs = steps;
    if (!best || is_better(*result, *best)) best = std::move(result);
    if (best->after.uncertified.empty() || !runs.may_go_on()) break;
  }
  return best;
}

RepairStep left_unsplit(const Result& split, const Result& unsplit) {
  RepairStep step;
  step.sentence = "The mesh was left unsplit: with " + std::to_string(split.repairs.size()) + " splits, " +
                  std::to_string(split.after.uncertified.size()) +
                  " elements would not be certified valid; without them, " +
                  std::to_string(unsplit.after.uncertified.size()) + " are not.";
  return step;
}

/// Adds steps about the uncertified elements that splitting is not offered for, or for which it found nothing to split.
void say_what_is_left(Result& result) {
  const Cells cells(result.mesh, result.mesh.dimension);
  const std::set<std::int64_t> uncertified = uncertified_set(result);
  RepairStep other, nothing;
  for (std::size_t c = 0; c < cells.count() && !uncertified.empty(); ++c) {
    if (!uncertified.contains(cells.number(c))) continue;
    (cells.shape(c) == Shape::Tetrahedron ? nothing : other).elements.push_back(cells.number(c));
  }
  if (!other.elements.empty()) {
    other.sentence = "Only tetrahedra can be split: " + elements_text(other.elements, "element", "elements") +
                     " stay as the optimisation left them.";
    result.repairs.push_back(std::move(other));
  }
  if (!nothing.elements.empty()) {
    nothing.sentence = "No interior edge or face could be split to help " +
                       elements_text(nothing.elements, "tetrahedron", "tetrahedra") +
                       ": a boundary face folds over itself, or the edges and faces in question are fixed or flat.";
    result.repairs.push_back(std::move(nothing));
  }
}

}  // namespace

Result optimise_by_splitting(const HighOrderMesh& mesh, const Options& options, const OnIteration& on_iteration,
                             const RunControl& control) {
  RunSequence runs(options, on_iteration, control);
  QualityReport before = quality(mesh, 0, options.threads);
  std::optional<Result> best;
  if (!before.uncertified.empty()) best = optimise_in_rounds(mesh, options, runs);
  if (!best || !best->after.uncertified.empty()) {
    const bool optimises = runs.may_go_on();
    std::optional<Result> unsplit = optimises ? runs.run(mesh) : runs.judge(mesh);
    // As few uncertified elements are enough for a mesh that was optimised. The mesh as it came in must have fewer.
    const std::size_t limit = best ? best->after.uncertified.size() + (optimises ? 1 : 0) : 0;
    if (!best || (unsplit && unsplit->after.uncertified.size() < limit)) {
      if (best) unsplit->repairs.push_back(left_unsplit(*best, *unsplit));
      best = std::move(unsplit);
    }
  }
  best->before = std::move(before);
  say_what_is_left(*best);
  runs.finish(*best);
  return std::move(*best);
}

}  // namespace varimesh
