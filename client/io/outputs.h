// The files that a result is written to, and their formats.
#pragma once

#include <string>
#include <vector>

#include "client/client.h"
#include "core/base/error.h"

namespace varimesh::client {

/// One file that a result is written to.
struct Output {
  std::string path;
  v1::MeshFormat format = v1::MESH_FORMAT_UNSPECIFIED;  ///< UNSPECIFIED: the format of the input.
};

/// The outputs for `paths`. A path that ends in .vtu, .mesh, .xml, .su2, .h5, .cgns or .pyfrm has the
/// format VTU, MFEM, Nektar++, SU2, HOPR, CGNS or PyFR;
/// the others have the format named `format`, or, if that is empty, the format of the input; a .msh file has a format
/// of Gmsh if the file `input` has another. Checks that each file can be written, so that this is known before any work
/// is done. Errors: BadOption, Output.
Expected<std::vector<Output>> check_outputs(const std::vector<std::string>& paths, const std::string& format,
                                            const std::string& input = {});

/// Checks that no two of the outputs and the other files (a history, a report) are the same file, that the other files
/// can be written, and that none of them is standard output if the JSON document goes there. Names of other files may
/// be empty. Errors: BadOption, Output.
Expected<void> check_distinct(const std::vector<Output>& outputs, const std::vector<std::string>& others, bool json);

/// Whether one of the outputs is standard output. Their paths may be empty. It is not if standard output is a device
/// that discards everything.
bool any_is_standard_output(const std::vector<Output>& outputs);

/// The formats of the outputs, each once.
std::vector<v1::MeshFormat> formats_of(const std::vector<Output>& outputs);

/// How an interrupt ended a run, and where its result is: "interrupted after 3 iterations; the best mesh so far is in
/// wing.msh". `was_cut_short`: false if it came when the run had ended.
std::string interruption_text(const v1::Metrics& metrics, bool was_cut_short, const std::vector<Output>& outputs);

/// Fetches the job's results to the outputs.
Outcome<void> fetch(Client& client, const v1::Job& job, const std::vector<Output>& outputs);

}  // namespace varimesh::client
