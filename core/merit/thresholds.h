// The thresholds of quality: when a scaled Jacobian is low, and when a difference of two meshes counts.
#pragma once

namespace varimesh::threshold {

// ===== of the scaled Jacobian of a cell =====

/// A cell below this is hardly better than an invalid one. A solver can do little with it, its certificate may need
/// many bisections, and the next step easily costs it its validity.
inline constexpr double kWeak = 0.02;
/// Higher than this, the smallest scaled Jacobian of a mesh is worth no accuracy. Solvers lose to bad shapes far below
/// it (docs/accuracy.md).
inline constexpr double kWanted = 0.5;
/// At order 2 a valid mesh with this minimum needs no descent if its loss is below kLittleLoss.
inline constexpr double kGood = 0.3;
/// If no mesh of a run reaches the bound on the scaled Jacobian, the meshes count whose minimum is at least this share
/// of the highest minimum.
inline constexpr double kShareOfHighest = 0.5;
/// A mesh with this share of the bound may still reach it.
inline constexpr double kInReach = 0.5;

// ===== of differences between meshes =====

/// Minima of the scaled Jacobian that differ by less are equal, because they are proved to within kGapOfDescent.
inline constexpr double kHigher = 1e-3;
/// How much of the mean scaled Jacobian Objective::Worst gives up to raise the smallest.
inline constexpr double kMeanGivenForWorst = 0.01;
/// A rise of the minimum in a later stage of Objective::Worst counts if it is more than this share of the distance
/// from 1. Looser values end some stages up to .05 too low (an aerofoil, an annulus).
inline constexpr double kLeastRise = 0.001;
/// A mesh with a higher minimum, up to kWanted, may have a loss that is this much times the least one.
inline constexpr double kLossGivenForMinimum = 1.02;
/// A loss that falls by less than this has not fallen.
inline constexpr double kFalls = 0.99;
/// A round of the descent that raises the loss by more than this, and the minimum not at all, is taken back.
inline constexpr double kRises = 1.1;

/// A descent that begins with the weights of the descent before is to lower the loss by this share. Otherwise the
/// weights hold the loss up: with nine triangles and two that came tangled, they kept the loss at .047 in place of
/// .038.
inline constexpr double kGainWithWeights = 0.1;
/// A solver's error on what decays from a wall may rise by this factor in a mesh with layers that came in valid.
inline constexpr double kRisesInLayers = 1.02;
/// If it rises by less than this factor, that is rounding.
inline constexpr double kRoundingInLayers = 1 + 1e-9;
/// An error in layers that is lower than this is rounding.
inline constexpr double kNoErrorInLayers = 1e-9;

// ===== of the loss of accuracy =====

/// The loss of a cell is not worth a move if it is at most this share of h^P, h being the size of the cell relative to
/// that of the mesh. That is what a solver loses in a straight-sided cell of this size.
inline constexpr double kNoLoss = 1e-4;
/// At order 2 the size of the cells decides the error of a solver, not their curvature, as long as the loss of the mesh
/// is at most this share of the mean of h². A descent then lowers the mean H1 error over many solutions by less than
/// 1 %, and for a single solution it may raise it by a quarter (docs/accuracy.md).
inline constexpr double kLittleLoss = 0.45;

// ===== how closely minima are proved before they are compared =====

inline constexpr double kGapOfDescent = 1e-3;
/// Of Objective::Worst: the gap of a report would hide late steps.
inline constexpr double kGapOfWorst = 1e-4;
/// Of coupled sliding: of whole states, which are many, and of cells that may be weak.
inline constexpr double kGapOfStates = 0.01, kGapOfWeak = 0.002;

}  // namespace varimesh::threshold
