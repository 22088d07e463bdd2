// varimesh, the command: it parses the command line and carries out the subcommand.
#include "client/commands/commands.h"

int main(int argc, char** argv) { return varimesh::client::run_program(argc, argv, varimesh::client::add_commands); }
