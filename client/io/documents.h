// The JSON documents that the command prints; their keys are in snake_case.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::client {

using Json = nlohmann::ordered_json;

/// The result of an optimisation: {"mesh", "energy", "method", "iterations", "seconds", "residual", "converged",
/// "stop_reason", "before", "after", "unrepairable", "repairs"}, and, if there is something to say,
/// "substitute_targets", "geometry", "slide_trials", "layers", "left" and "kept_as_it_came".
Json document(const v1::Metrics& metrics);
/// The quality of a mesh: {"mesh", "quality", "unrepairable", "left"}.
Json document(const MeshSummary& mesh, const QualityReport& quality, const std::vector<UnrepairableGroup>& groups,
              const WhatIsLeft& left);
/// A job as submit, cancel and jobs print it: {"job", "state", …}.
Json document(const v1::Job& job);
/// A server's version, its limits and what it accepts: {"version", "threads", …}.
Json document(const v1::GetServerInfoResponse& info);

/// What came of layers: {"wall_elements", "columns", "layers", …}.
Json document(const v1::LayersReport& layers);

/// Prints the document on standard output.
void print(const Json& document);

}  // namespace varimesh::client
