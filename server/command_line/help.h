// What is made from the options of varimeshd themselves: the help, the manual page and completion.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace varimesh::server {

/// Puts the options that the program has by now, and that have no heading yet, under this one in the help.
void put_under(CLI::App& app, const char* heading);

/// Gives the program and its subcommands help with examples and headings, and adds the subcommands man and completion.
void add_help(CLI::App& app);

/// What the subcommand man or completion prints, if one was given; empty: none was.
std::string asked_text(const CLI::App& app);

}  // namespace varimesh::server
