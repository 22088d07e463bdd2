// varimesh man: prints a manual page, or writes all of them.
#include <filesystem>
#include <fstream>
#include <iostream>

#include "client/cli/command_facts.h"
#include "client/commands/commands.h"
#include "client/process/exit_status.h"
#include "core/command_line/manual.h"

namespace varimesh::client {
namespace {

int write_pages(const std::filesystem::path& folder, const ProgramFacts& program) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream file(folder / (name + ".1"));
    file << text;
    return static_cast<bool>(file.flush());
  };
  bool written = write(program.name, manual_page(program, program.itself));
  for (const CommandFacts& one : program.commands)
    written = written && write(program.name + "-" + one.name, manual_page(program, one));
  if (written) return kDone;
  std::cerr << "varimesh: the pages cannot be written into '" << folder.string() << "'; name a folder that exists."
            << std::endl;
  return kInputRefused;
}

}  // namespace

Action add_man(Command program) {
  struct Arguments {
    std::string command, folder;
  };
  auto arguments = std::make_shared<Arguments>();
  Command command = program.add_command("man", "Print the manual page of a command or of the program");
  command.add("command", &arguments->command, "The command; without one, the page of the program").value("COMMAND");
  command.add("--all", &arguments->folder, "Write all pages into this folder, which must exist").value("DIR");
  return [arguments, program]() -> int {
    const ProgramFacts facts = program_facts(program.app());
    if (!arguments->folder.empty()) return write_pages(arguments->folder, facts);
    if (arguments->command.empty()) {
      std::cout << manual_page(facts, facts.itself);
      return kDone;
    }
    for (const CommandFacts& one : facts.commands)
      if (one.name == arguments->command) {
        std::cout << manual_page(facts, one);
        return kDone;
      }
    std::cerr << "varimesh: there is no command '" << arguments->command << "'; varimesh --help lists them."
              << std::endl;
    return kUsage;
  };
}

}  // namespace varimesh::client
