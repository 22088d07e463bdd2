// Between the library's structs and the contract's messages.
#pragma once

#include "core/formats/formats.h"
#include "core/optimise/optimiser.h"
#include "server/failure.h"
#include "server/jobs/engine.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Invalid cells, unrepairable groups, and steps of repair, a report names at most, so that a message stays small.
inline constexpr int kMaxInvalidNamed = 1000;

/// INVALID_ARGUMENT for a value that this server does not know. Ranges are the library's to check.
Answer<Options> options_from(const v1::Options& message);
v1::Options to_proto(const Options& options);

v1::Iteration to_proto(const Iteration& iteration);
v1::MeshSummary to_proto(const MeshSummary& summary);
v1::QualityReport to_proto(const QualityReport& report);
v1::UnrepairableGroup to_proto(const UnrepairableGroup& group);
v1::RepairStep to_proto(const RepairStep& step);
v1::Metrics metrics(const RunOutcome& outcome, const Options& options);
v1::JobError to_proto(const Error& error);

/// The library's format; `message` must be one of a file.
formats::Format format_from(v1::MeshFormat message);
v1::MeshFormat to_proto(formats::Format format);

}  // namespace varimesh::server
