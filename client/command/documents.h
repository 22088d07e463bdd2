// What the command prints: JSON documents in snake_case, tables for people, the history as CSV.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::client {

using Json = nlohmann::ordered_json;

/// {"mesh", "energy", "method", "iterations", "seconds", "residual", "converged", "before", "after"}
Json document(const v1::Metrics& metrics);
/// {"mesh", "quality"}
Json document(const MeshSummary& mesh, const QualityReport& quality, const std::vector<UnrepairableGroup>& groups);
/// {"job", "state", …}: what a list or a cancel says of a job.
Json document(const v1::Job& job);
Json document(const v1::GetServerInfoResponse& info);

/// Prints the document on standard output.
void print(const Json& document);

/// Before and after, for people.
std::string summary(const v1::Metrics& metrics);
std::string summary(const MeshSummary& mesh, const QualityReport& quality);

/// Writes the history with a header line (formats::OutputFile).
Expected<void> write_history(const std::string& path, const std::vector<v1::Iteration>& history);

}  // namespace varimesh::client
