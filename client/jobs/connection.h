// The connection of a command to a server, or to the service in this process.
#pragma once

#include <memory>
#include <tl/expected.hpp>

#include "client/cli/common_flags.h"
#include "client/client.h"
#include "client/local/local.h"
#include "client/process/temporary_folder.h"

namespace varimesh::client {

/// A client, and the service that it talks to if that runs in this process.
struct Connection {
  std::unique_ptr<TemporaryFolder> folder;  ///< Where the local service keeps its meshes; null with a server.
  std::unique_ptr<LocalService> local;      ///< Null with a server.
  std::unique_ptr<Client> client;
};

/// Connects to the server, or starts the service in this process if no server is given. An interrupt ends calls. Unless
/// `flags.quiet`, messages on standard error say when the server stops answering and when it answers again. The error
/// is the exit status; its message has been printed.
tl::expected<Connection, int> connect(const CommonFlags& flags);

}  // namespace varimesh::client
