#include "client/jobs/certified_files.h"

#include <filesystem>

#include "core/formats/formats.h"
#include "core/validity/certificate.h"

namespace varimesh::client {

std::string uncertified_file(const std::vector<Output>& outputs) {
  for (const Output& output : outputs) {
    std::error_code ignored;
    if (output.format != v1::MESH_FORMAT_NEKTAR || !std::filesystem::is_regular_file(output.path, ignored)) continue;
    const auto file = formats::read_file(output.path);
    if (!file) return file.error().sentence;
    const CertificateSummary found = summarise(certify(file->mesh));
    if (const std::int64_t left = found.invalid + found.undecided; left > 0)
      return std::to_string(left) + (left == 1 ? " element of " : " elements of ") + output.path +
             " cannot be certified valid, because Nektar++ makes their interior from their edges and faces; make the "
             "mesh finer there, or of order 2.";
  }
  return {};
}

}  // namespace varimesh::client
