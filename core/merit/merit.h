// Which of two meshes is better. Everything that keeps, compares or hands out a mesh asks here, and nothing else
// decides it (docs/method.md, "Which mesh is better").
//
// How to use it: describe each mesh by a Merit, with the fields that are known in both (merit_of() takes them from a
// quality report), say what is asked for, and compare.
//
//     const Merit one = merit_of(first.after), other = merit_of(second.after);
//     if (is_better(other, one, kAskForMinimum)) first = std::move(second);
//
// If neither is better than the other, the one that came first stays.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "core/merit/thresholds.h"
#include "core/options/options.h"
#include "core/quality/certified_quality.h"

namespace varimesh {

/// What is known about a mesh, or about a patch of one. Fields that are left as they are do not decide. The smallest
/// scaled Jacobians of two meshes that are compared must be of one kind: proved or sampled, on the same lattice.
struct Merit {
  std::int64_t lost = 0;         ///< Cells that were certified valid and no longer are.
  std::int64_t uncertified = 0;  ///< Cells that are not certified valid, the lost ones included.
  /// The uncertified cells and those whose scaled Jacobian is below threshold::kWeak. Set it for a mesh that other
  /// steps still change: to them, a cell that is hardly valid is as much work as an invalid one.
  std::optional<std::int64_t> weak = std::nullopt;
  double smallest = -std::numeric_limits<double>::infinity();  ///< Of the cells' scaled Jacobians.
  double mean = -std::numeric_limits<double>::infinity();      ///< The same.
  double loss = std::numeric_limits<double>::infinity();       ///< Of accuracy (core/quality/accuracy/accuracy.h).
  /// It costs_shape() of the mesh as it came, which was valid.
  bool lower_than_it_came = false;

  /// Worse than every mesh: the best one so far, before there is any.
  static Merit of_nothing();
};

/// The merit of a mesh with this report. `smallest` is the sampled value.
Merit merit_of(const QualityReport& report);
/// The merit of a mesh with such certificates. `smallest` is the proved value.
Merit merit_of(const CertificateSummary& summary);
Merit merit_of(const ScaledJacobians& sampled);

/// What decides between two meshes that leave the same cells.
struct Asked {
  enum class What : std::uint8_t {
    Validity,  ///< Nothing else: neither is better.
    Minimum,   ///< The higher smallest scaled Jacobian: Objective::Worst, until_js, the choice among whole runs.
    Loss,      ///< The lower loss of accuracy, within the bound on the scaled Jacobian: Objective::Accuracy.
  };
  What what = What::Validity;

  // The rest is for What::Loss.

  double bound = 0;  ///< Options::min_js.
  /// The loss of the mesh as it came if it was valid. Then a mesh with a higher loss is not better, nor a mesh that
  /// gains next to nothing.
  std::optional<double> loss_as_it_came = std::nullopt;
  /// Of all meshes among which the choice is, so far. The two that are compared count too.
  double highest_minimum = -1;                                  ///< Of those with the fewest uncertified cells.
  double least_loss = std::numeric_limits<double>::infinity();  ///< Of the valid ones that reach the bound.
};

inline constexpr Asked kAskForMinimum{.what = Asked::What::Minimum};

/// What these options ask for. Their objective is one that was resolved (objective_of()).
Asked asked_by(const Options& options);

/// Whether `a` is better than `b`. The first of these that differs decides:
/// 1. fewer cells that have lost their certificate,
/// 2. fewer weak cells, if they are known,
/// 3. fewer uncertified cells,
/// 4. not lower than the mesh as it came (lower_than_it_came),
/// 5. what is asked for.
///
/// What::Loss: if cells are uncertified, the mesh with the lower loss. If only one mesh reaches the bound, this mesh.
/// If no mesh reaches it, the mesh with at least threshold::kShareOfHighest of the highest minimum; if both or neither
/// have that share, the mesh whose loss is lower by more than threshold::kLossGivenForMinimum. If both meshes reach the
/// bound, the mesh with the lower loss; but if both losses are within threshold::kLossGivenForMinimum of the least
/// loss, the mesh with the higher minimum up to threshold::kWanted, and then the one with the lower loss. If all that
/// is equal, the mesh with the higher minimum.
bool is_better(const Merit& a, const Merit& b, const Asked& asked = {});

/// Whether both the smallest, by more than `margin`, and the mean scaled Jacobian of `a` are below those of `b`. A mesh
/// that came in valid does not leave lower than it came.
bool is_lower(const Merit& a, const Merit& b, double margin = 0);

/// The same with the objective accuracy: whether `a` is lower than `b`, by more than threshold::kHigher, and has
/// elements that are worth some accuracy, below threshold::kWanted.
bool costs_shape(const Merit& a, const Merit& b);

/// Whether a mesh that came in valid has as low a loss of accuracy now as when it came.
inline bool keeps_loss(const Merit& now, const Merit& as_it_came) { return now.loss <= as_it_came.loss; }

/// Whether the spacing of layers is to stay, and a mesh that was valid as it came holds less of what decays from a
/// wall: its error in layers is not known any more, or is above `may_rise` times what it was for one of the profiles
/// (core/layers/error/layer_error.h).
bool loses_layers(const QualityReport& as_it_came, const QualityReport& now, const Options& options,
                  double may_rise = threshold::kRisesInLayers);

/// Whether a mesh with a lower loss loses nothing else of one that came in valid: no shape (costs_shape()) if elements
/// aim at their straight-sided shapes, and in its layers at most threshold::kRoundingInLayers.
bool gains_without_loss(const QualityReport& as_it_came, const QualityReport& now, const Options& options);

/// Whether the minimum of `a` is higher by more than threshold::kHigher.
bool has_higher_minimum(const Merit& a, const Merit& b);

}  // namespace varimesh
