// The files in a folder that the results of several jobs are written to.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/client.h"
#include "core/base/error.h"

namespace varimesh::client {

/// One result of a job and the file for it.
struct ResultFile {
  const v1::Job* job = nullptr;
  v1::StoredMesh mesh;
  std::filesystem::path path;
};

/// A file for every result of the jobs. A file has the name of the job's input, from the label "file", with the ending
/// of the result's format. If two results would have one name, both have the identifier of their job in it, and if they
/// are of one job, the name of the format. A label that is no plain name of a file stands back for the identifier.
/// `jobs` must outlive the files.
std::vector<ResultFile> result_files(const std::vector<v1::Job>& jobs, const std::filesystem::path& folder);

/// Makes the folder for results if it is not there. Errors: Output.
Expected<void> make_folder(const std::string& path);

/// What is at the path of a result.
enum class AtPath { Nothing, TheResult, Another };

/// Compares the digest of the file. Errors: BadInput, if it cannot be read.
Expected<AtPath> what_is_at(const ResultFile& file);

}  // namespace varimesh::client
