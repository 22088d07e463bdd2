// Summaries of results and of the quality of meshes, as text for people.
#pragma once

#include <string>

#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::client {

/// The result of an optimisation: the mesh, how it went, the quality before and after, and what cannot be repaired.
/// `asked`: the options of the job, which say why it had its objective.
std::string summary(const v1::Metrics& metrics, const v1::Options& asked);
/// What was done, for a report: how many nodes could move, and how the run ended.
std::string done_text(const v1::Metrics& metrics);
/// The objective, why a run that was not told had it, and its figure before and after: "objective: accuracy; loss of
/// accuracy 0.00648 -> 0.00579". `asked`: the options of the job. Empty if the server is older and names no objective.
std::string objective_text(const v1::Metrics& metrics, const v1::Options& asked);

/// Why it is right that the mean scaled Jacobian fell or that the loss of accuracy rose; empty if neither did.
std::string worse_text(const v1::Metrics& metrics);
/// What came of layers, in lines: how many there are and how high, how many elements, and what differs from what was
/// asked for.
std::string layers_text(const v1::LayersReport& report);
/// The elements that are not certified valid, and what to try next; empty if there are none.
std::string way_out(const WhatIsLeft& left);
/// The quality of a mesh, with its histogram and its first invalid elements.
std::string summary(const MeshSummary& mesh, const QualityReport& quality);

}  // namespace varimesh::client
