// The files a result goes to, and the formats they mean.
#pragma once

#include <string>
#include <vector>

#include "client/client.h"
#include "core/base/error.h"

namespace varimesh::client {

/// One -o of the command.
struct Output {
  std::string path;
  v1::MeshFormat format = v1::MESH_FORMAT_UNSPECIFIED;  ///< UNSPECIFIED: as it was read.
};

/// What the files mean: by `format` where it is said (for files that are not .vtu), by their endings otherwise. Finds
/// out whether each can be written, before any work is done.
Expected<std::vector<Output>> check_outputs(const std::vector<std::string>& paths, const std::string& format);

/// Refuses outputs that would spoil each other, and others (a history, a report) that cannot be written: two that name
/// the same file, and one on standard output where the document goes (`json`). Names may be empty.
Expected<void> check_apart(const std::vector<Output>& outputs, const std::vector<std::string>& others, bool json);

/// Whether one of them goes to standard output.
bool take_standard_output(const std::vector<Output>& outputs);

/// The formats to ask for, each once.
std::vector<v1::MeshFormat> formats_of(const std::vector<Output>& outputs);

/// Fetches each output from the job's results.
Outcome<void> fetch(Client& client, const v1::Job& job, const std::vector<Output>& outputs);

}  // namespace varimesh::client
