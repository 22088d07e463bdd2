// varimesh man: the manual, made from what the parser knows.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "client/command/command.h"
#include "client/command/facts.h"
#include "core/base/version.h"

namespace varimesh::client {
namespace {

/// Text as troff wants it: dashes that can be copied, no line that looks like a request.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  return !out.empty() && (out[0] == '.' || out[0] == '\'') ? "\\&" + out : out;
}

std::string item(const std::string& term, std::string_view meaning) {
  return ".TP\n" + term + "\n" + escaped(meaning) + "\n";
}

std::string flag_item(const FlagFacts& flag) {
  std::string term;
  for (const std::string& name : flag.names) term += (term.empty() ? "" : ", ") + ("\\fB" + escaped(name) + "\\fR");
  if (!flag.argument && !flag.value.empty()) term += " \\fI" + escaped(flag.value) + "\\fR";
  return item(term, flag.help + (flag.required && !flag.argument ? " (required)" : ""));
}

std::string examples(const CommandFacts& facts) {
  std::string out = ".SH EXAMPLES\n";
  for (const Example& example : facts.examples)
    out += ".PP\n" + escaped(example.what) + "\n.PP\n.RS\n.nf\n" + escaped(example.line) + "\n.fi\n.RE\n";
  return out;
}

std::string page(const CommandFacts& facts, const std::vector<CommandFacts>& commands) {
  const std::string name = facts.name.empty() ? "varimesh" : "varimesh-" + facts.name;
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(), ::toupper);
  std::string synopsis = "\\fBvarimesh\\fR";
  synopsis += facts.name.empty() ? " \\fICOMMAND\\fR" : " \\fB" + escaped(facts.name) + "\\fR [\\fIOPTIONS\\fR]";
  std::string arguments, options, group;
  for (const FlagFacts& flag : facts.flags) {
    if (flag.argument) {
      synopsis += flag.required ? " \\fI" + flag.names[0] + "\\fR" : " [\\fI" + flag.names[0] + "\\fR]";
      arguments += flag_item(flag);
      continue;
    }
    if (std::exchange(group, flag.group) != flag.group) options += ".SS " + flag.group + "\n";
    options += flag_item(flag);
  }
  std::string out =
      fmt::format(".TH {} 1 \"\" \"varimesh {}\" \"User Commands\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n{}\n",
                  escaped(title), version(), escaped(name), escaped(facts.purpose), synopsis);
  out += examples(facts);
  if (!commands.empty()) out += ".SH COMMANDS\n";
  for (const CommandFacts& one : commands) out += item("\\fB" + one.name + "\\fR", one.purpose);
  if (!arguments.empty()) out += ".SH ARGUMENTS\n" + arguments;
  out += ".SH OPTIONS\n" + options + ".SH EXIT STATUS\n";
  for (const std::string_view status : exit_statuses())
    out += item(std::string(status.substr(0, status.find(' '))), status.substr(status.find(' ') + 1));
  if (!facts.name.empty()) out += ".SH SEE ALSO\n\\fBvarimesh\\fR(1)\n";
  return out;
}

int write_all(const std::filesystem::path& folder, const CommandFacts& program,
              const std::vector<CommandFacts>& commands) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream file(folder / (name + ".1"));
    file << text;
    return static_cast<bool>(file.flush());
  };
  bool well = write("varimesh", page(program, commands));
  for (const CommandFacts& one : commands) well = well && write("varimesh-" + one.name, page(one, {}));
  if (well) return kDone;
  std::cerr << "varimesh: the pages cannot be written into '" << folder.string() << "'; name a folder that is there."
            << std::endl;
  return kInputRefused;
}

}  // namespace

Run add_man(CLI::App& app) {
  struct Arguments {
    std::string command, folder;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("man", "Print the manual page of a command, or of the program");
  command.add_option("command", arguments->command, "Which")->type_name("COMMAND");
  command.add_option("--all", arguments->folder, "Write all pages into this folder, which is there")->type_name("DIR");
  return [arguments, &app]() -> int {
    const auto commands = subcommand_facts(app);
    if (!arguments->folder.empty()) return write_all(arguments->folder, facts_of(app), commands);
    if (arguments->command.empty()) {
      std::cout << page(facts_of(app), commands);
      return kDone;
    }
    for (const CommandFacts& one : commands)
      if (one.name == arguments->command) {
        std::cout << page(one, {});
        return kDone;
      }
    std::cerr << "varimesh: there is no command '" << arguments->command << "'; varimesh --help lists them."
              << std::endl;
    return kUsage;
  };
}

}  // namespace varimesh::client
