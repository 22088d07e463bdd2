// varimesh completion: prints a completion script for a shell.
#include "client/cli/completion.h"

#include <iostream>

#include "client/commands/commands.h"
#include "client/process/exit_status.h"

namespace varimesh::client {

Action add_completion(Command program) {
  auto shell = std::make_shared<std::string>();
  Command command = program.add_command("completion", "Print the completion script for a shell");
  command.add("shell", shell.get(), "The shell").required().one_of({"bash", "zsh", "fish"}).value("bash|zsh|fish");
  return [shell, program] {
    const auto commands = subcommand_facts(program.app());
    std::cout << (*shell == "bash"  ? bash_completion(facts_of(program.app()), commands)
                  : *shell == "zsh" ? zsh_completion(commands)
                                    : fish_completion(commands));
    return kDone;
  };
}

}  // namespace varimesh::client
