// Conversion between the structs of the library and the messages of the contract.
#pragma once

#include "core/base/error.h"
#include "core/base/work_meter.h"
#include "core/formats/formats.h"
#include "core/optimise/result.h"
#include "core/options/options.h"
#include "server/engine/option_messages.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// How many invalid cells, unrepairable groups, repair steps and substitute targets a message lists at most, so that it
/// stays small.
inline constexpr int kMaxInvalidNamed = 1000;

v1::Iteration to_proto(const Iteration& iteration);
Iteration iteration_from(const v1::Iteration& message);
v1::Work to_proto(const Work& work);
v1::MeshSummary to_proto(const MeshSummary& summary);
v1::QualityReport to_proto(const QualityReport& report);
v1::UnrepairableGroup to_proto(const UnrepairableGroup& group);
v1::WhatIsLeft to_proto(const WhatIsLeft& left);
v1::RepairStep to_proto(const RepairStep& step);
/// Everything except what add_options() adds.
v1::Metrics to_proto(const RunSummary& summary);
/// Adds what the metrics repeat of the options.
void add_options(const Options& options, v1::Metrics& metrics);
v1::JobError to_proto(const Error& error);

/// Returns the format of the library; Auto if the message is not a file format.
formats::Format format_from(v1::MeshFormat message);
v1::MeshFormat to_proto(formats::Format format);

/// Returns whether a mesh can be read in this format. Unspecified means a file that is recognised by its content.
bool is_readable(v1::MeshFormat format);
/// Whether it can be written.
bool is_writable(v1::MeshFormat format);

}  // namespace varimesh::server
