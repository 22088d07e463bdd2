// The subcommand "varimeshd token", which makes tokens.
#pragma once

namespace CLI {
class App;
}

namespace varimesh::server {

/// Adds the subcommand. When it is parsed, it makes a token, appends its line to the file of tokens, prints the token
/// and sets `exit_status`.
CLI::App& add_token_command(CLI::App& app, int* exit_status);

}  // namespace varimesh::server
