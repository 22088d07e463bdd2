#include "client/mpi/checkpoint_file.h"

#include <filesystem>
#include <system_error>

#include "client/mpi/read_everywhere.h"
#include "core/base/io/output_file.h"
#include "core/solvers/checkpoint.h"

namespace varimesh::client {

Expected<void> CheckpointFile::read(const Ranks& ranks) {
  std::error_code failed;
  if (!ranks.any(ranks.is_first() && std::filesystem::exists(path_, failed))) return {};
  auto bytes = read_everywhere(path_, ranks);
  if (!bytes) return tl::unexpected(bytes.error());
  if (!bytes->empty() && !is_checkpoint(*bytes))
    return bad_option("'" + path_ + "' is no checkpoint of VariMesh, and would be overwritten; name another file.");
  state_ = std::move(*bytes);
  return {};
}

Expected<void> CheckpointFile::save(const WriteCheckpoint& write) {
  since_last_ = Stopwatch();  // after a failure it is not tried again at once
  auto file = OutputFile::open(path_);
  if (!file) return tl::unexpected(file.error());
  write([&](std::string_view bytes) { return file->write(bytes); });
  return file->commit();
}

void CheckpointFile::remove() const {
  std::error_code failed;
  std::filesystem::remove(path_, failed);
}

}  // namespace varimesh::client
