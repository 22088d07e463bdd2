// varimesh completion: prints a completion script for a shell.
#include "core/command_line/completion.h"

#include <iostream>

#include "client/cli/command_facts.h"
#include "client/commands/commands.h"
#include "client/process/exit_status.h"

namespace varimesh::client {

Action add_completion(Command program) {
  auto shell = std::make_shared<std::string>();
  Command command = program.add_command("completion", "Print the completion script for a shell");
  command.add("shell", shell.get(), "The shell").required().one_of({"bash", "zsh", "fish"}).value("bash|zsh|fish");
  return [shell, program] {
    const ProgramFacts facts = program_facts(program.app());
    std::cout << (*shell == "bash"  ? bash_completion(facts)
                  : *shell == "zsh" ? zsh_completion(facts)
                                    : fish_completion(facts));
    return kDone;
  };
}

}  // namespace varimesh::client
