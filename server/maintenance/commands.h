// The commands of varimeshd that do not serve: check and backup.
#pragma once

#include <optional>

namespace varimesh::server {

/// What --help says about the commands.
inline constexpr const char* kCommands =
    "Commands:\n"
    "  varimeshd check --state DIR           compares everything in DIR with its digests, while no server uses it\n"
    "  varimeshd backup --state DIR COPY     copies DIR, also while a server uses it; COPY is a state directory\n"
    "varimeshd check --help and varimeshd backup --help say more.";

/// Runs the command that the first word names and returns the exit status; nothing if it names none.
std::optional<int> run_command(int argc, char** argv);

}  // namespace varimesh::server
