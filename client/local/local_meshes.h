// The meshes and results of the service in this process. The server's store has a few bytes in place of each.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "client/client.h"
#include "client/library/input_file.h"
#include "server/engine/engine.h"

namespace varimesh::client {

/// Hands the command's files to the engine, and the engine's results to the command, without a copy in the server's
/// store and without digests of all their bytes.
class LocalMeshes : public MeshExchange {
 public:
  Outcome<InputFile> keep(const InputFile& file) override;
  std::shared_ptr<const InputFile> find(const std::string& digest) const override;

  /// An engine that reads the meshes that are kept here, and keeps their results here too. It must not outlive this
  /// object.
  server::Engine engine(server::Engine inner);

 private:
  /// The short bytes that stand for this file.
  std::string add(std::shared_ptr<InputFile> file);
  Expected<server::RunOutcome> run(const server::Engine& inner, server::RunRequest request,
                                   const server::RunHooks& hooks);

  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<InputFile>> files_;  ///< By the digest of the short bytes.
};

}  // namespace varimesh::client
