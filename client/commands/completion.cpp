// varimesh completion: prints a completion script for a shell.
#include "client/cli/completion.h"

#include <iostream>

#include "client/commands/commands.h"
#include "client/process/exit_status.h"

namespace varimesh::client {

Action add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App& command = *app.add_subcommand("completion", "Print the completion script for a shell");
  command.add_option("shell", *shell, "The shell")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}))
      ->type_name("bash|zsh|fish");
  return [shell, &app] {
    const auto commands = subcommand_facts(app);
    std::cout << (*shell == "bash"  ? bash_completion(facts_of(app), commands)
                  : *shell == "zsh" ? zsh_completion(commands)
                                    : fish_completion(commands));
    return kDone;
  };
}

}  // namespace varimesh::client
