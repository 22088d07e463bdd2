#include "client/local/local_meshes.h"

#include <utility>

#include "client/library/failures.h"
#include "client/local/bytes.h"
#include "core/base/sha256.h"

namespace varimesh::client {
std::string LocalMeshes::add(std::shared_ptr<InputFile> file) {
  const std::lock_guard lock(mutex_);
  std::string name = "mesh " + std::to_string(files_.size() + 1) + " of this process";
  files_.emplace(sha256(name), std::move(file));
  return name;
}

Outcome<InputFile> LocalMeshes::keep(const InputFile& file) {
  auto own = file.again();
  if (!own) return own;
  auto stands_for_it = InputFile::temporary("mesh");
  if (stands_for_it && !stands_for_it->append(add(std::make_shared<InputFile>(std::move(*own)))))
    return file_failure("No temporary file can be written; set TMPDIR to a folder where files can be made.");
  return stands_for_it;
}

std::shared_ptr<const InputFile> LocalMeshes::find(const std::string& digest) const {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(digest);
  return found == files_.end() ? nullptr : found->second;
}

server::Engine LocalMeshes::engine(server::Engine inner) {
  server::Engine engine = inner;
  engine.run = [this, inner = std::move(inner)](server::RunRequest request, const server::RunHooks& hooks) {
    return run(inner, std::move(request), hooks);
  };
  return engine;
}

Expected<server::RunOutcome> LocalMeshes::run(const server::Engine& inner, server::RunRequest request,
                                              const server::RunHooks& hooks) {
  const auto kept = find(sha256(request.input->bytes()));
  if (kept == nullptr) return inner.run(std::move(request), hooks);  // it came through the calls
  auto bytes = kept->read_all();
  if (!bytes) return bad_input(bytes.error().sentence);
  request.input = std::make_shared<Bytes>(std::move(*bytes));
  server::RunHooks own = hooks;
  own.open_output = [&](v1::MeshFormat format) -> Sink {
    const Sink stored = hooks.open_output(format);
    auto made = InputFile::temporary("result");
    if (!made) return [](std::string_view) { return false; };
    auto file = std::make_shared<InputFile>(std::move(*made));
    if (!stored(add(file))) return stored;
    return [file](std::string_view bytes) { return file->append(bytes); };
  };
  return inner.run(std::move(request), own);
}

}  // namespace varimesh::client
