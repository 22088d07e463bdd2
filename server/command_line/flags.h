// The command line of varimeshd.
#pragma once

#include <optional>
#include <string>

#include "server/server.h"

namespace varimesh::server {

/// What the user asked for.
struct Flags {
  ServerOptions options;  ///< Without an engine.
  std::string port_file;  ///< The file for the address. Empty: standard output.
  std::string log_level = "info";
  std::string log_format = "text";
  std::string traces;             ///< The address of a collector of traces. Empty: none are sent.
  std::string traces_headers;     ///< A file with headers for that collector. Empty: none.
  std::string store;              ///< The address of the database of the jobs. Empty: they are in the state directory.
  bool runs_in_processes = true;  ///< Every job runs in a process of its own.
  int devices = 0;                ///< How many devices jobs may have.
  bool migrate = false;           ///< Only make or update the tables of that database.
  int drain_seconds = 30;         ///< How long the running jobs may take to end when the server stops.
};

/// Parses the command line. Returns nothing if the program is to end with `exit_status`: after --help, --version or an
/// error, which have been printed.
std::optional<Flags> parse_flags(int argc, char** argv, int* exit_status);

}  // namespace varimesh::server
