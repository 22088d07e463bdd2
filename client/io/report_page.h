// The content of a report page, from a job or from a mesh whose quality was computed in this process.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "client/client.h"
#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"

namespace varimesh::client {

/// The formats to request so that a report can show the mesh. If none of `formats` can be read, the format of the input
/// is added. `report` is the path of the report; empty: there is no report, and nothing is added.
std::vector<v1::MeshFormat> formats_with_report(std::vector<v1::MeshFormat> formats, const std::string& report);

/// Fetches the meshes before and after, the history and the server's version, and writes the page to `path`. The
/// service turns meshes from arrays into files, whose elements have numbers from 1. If the meshes are in other formats
/// that cannot be read here, the page says so and has no picture.
/// @param input  the name of the mesh; empty: not known
/// Failures: those of the client; File if the page cannot be written.
Outcome<void> write_job_report(Client* client, const v1::Job& job, const std::string& input, const std::string& path);

/// Whether this program can read files of the format. Unspecified: a file that is recognised by its content.
bool readable(v1::MeshFormat format);

/// A run that this process has made without a service.
struct ReportedRun {
  const v1::Metrics& metrics;
  const v1::Options& options;
  const std::vector<v1::Iteration>& history;
  std::string_view before, after;  ///< The bytes of the mesh and of the result, in formats that are readable().
};

/// Writes the page about a run to `path`. `input` is the name of the mesh. Errors: Output, BadInput.
Expected<void> write_run_report(const std::string& path, const std::string& input, const ReportedRun& run);

/// Writes the page about the quality of `mesh` to `path`. `input` is the name of the mesh. Errors: Output, BadInput.
/// @param layers  what came of layers that were made; may be null
Expected<void> write_quality_report(const std::string& path, const std::string& input, HighOrderMesh mesh,
                                    const MeshSummary& summary, const QualityReport& quality,
                                    const std::vector<UnrepairableGroup>& groups, const WhatIsLeft& left,
                                    const v1::LayersReport* layers = nullptr);

}  // namespace varimesh::client
