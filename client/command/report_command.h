// --report FILE.html: what a report page is made of, from a job or from a mesh that was judged here.
#pragma once

#include <string>
#include <vector>

#include "client/client.h"
#include "client/command/documents.h"
#include "client/command/outputs.h"

namespace varimesh::client {

/// Adds --report to a command.
void add_report_flag(CLI::App& command, std::string* path);

/// What has to be asked for so that a report can show the mesh: the outputs' formats, and one that can be read here
/// where they have none.
std::vector<v1::MeshFormat> formats_with_report(std::vector<v1::MeshFormat> formats, const std::string& report);

/// Fetches the mesh before and after, the history and the server's version, and writes the page. `input` is what the
/// mesh is called; empty: not known. Where the meshes cannot be read here, the page says so and has no picture.
/// Failures: those of the client; File where the page cannot be written.
Outcome<void> write_job_report(Client* client, const v1::Job& job, const std::string& input, const std::string& path);

/// The page of a mesh that was judged here.
Expected<void> write_quality_report(const std::string& path, const std::string& input, HighOrderMesh mesh,
                                    const MeshSummary& summary, const QualityReport& quality,
                                    const std::vector<UnrepairableGroup>& groups);

}  // namespace varimesh::client
