// Flags that several subcommands have.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

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
CLI::Option* add_server_flag(CLI::App& command, CommonFlags* flags);
void add_json_flag(CLI::App& command, CommonFlags* flags);
void add_quiet_flag(CLI::App& command, CommonFlags* flags);
/// Adds --compress, for commands that send or fetch meshes.
void add_compress_flag(CLI::App& command, CommonFlags* flags);
/// Adds --history; `path` stays empty if it is not given.
void add_history_flag(CLI::App& command, std::string* path);
/// Adds --report; `path` stays empty if it is not given.
void add_report_flag(CLI::App& command, std::string* path);
/// Adds --request-id; `id` stays empty if it is not given.
void add_request_id_flag(CLI::App& command, std::string* id);

/// Accepts a value only if it is UTF-8, because nothing else can be sent.
const CLI::Validator& is_text();

}  // namespace varimesh::client
