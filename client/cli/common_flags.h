// Flags that several subcommands have.
#pragma once

#include <string>

#include "client/cli/parser.h"
#include "client/client.h"

namespace varimesh::client {

struct CommonFlags {
  std::string server;  ///< Empty: run the service in this process.
  bool json = false;
  bool quiet = false;
  bool compress = false;  ///< Send and fetch meshes compressed.
  Credentials credentials = credentials_from_environment();
};

/// Adds --server and what belongs to it, and returns it.
Flag add_server_flag(Command command, CommonFlags* flags);
void add_json_flag(Command command, CommonFlags* flags);
void add_quiet_flag(Command command, CommonFlags* flags);
/// Adds --compress, for commands that send or fetch meshes.
void add_compress_flag(Command command, CommonFlags* flags);
/// Adds --history; `path` stays empty if it is not given.
void add_history_flag(Command command, std::string* path);
/// Adds --report; `path` stays empty if it is not given.
void add_report_flag(Command command, std::string* path);
/// Adds --keep-orders.
void add_keep_orders_flag(Command command, bool* keep_orders);
/// Adds --request-id; `id` stays empty if it is not given.
void add_request_id_flag(Command command, std::string* id);

}  // namespace varimesh::client
