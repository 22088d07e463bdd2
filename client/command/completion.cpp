// varimesh completion: what a shell needs to complete commands, flags and their values.
#include <fmt/format.h>

#include <iostream>

#include "client/command/command.h"
#include "client/command/facts.h"

namespace varimesh::client {
namespace {

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, " ")); }

/// Up to the first full stop or semicolon: a shell shows a line.
std::string brief(const std::string& help) { return help.substr(0, help.find_first_of(";.", help.find(' '))); }

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

// ===== bash =====

std::string bash(const CommandFacts& program, const std::vector<CommandFacts>& commands) {
  std::string names, flags, values;
  for (const CommandFacts& command : commands) {
    names += command.name + " ";
    std::string own;
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) continue;
      own += joined(flag.names) + " ";
      if (flag.value.empty()) continue;
      std::string pattern;
      for (const std::string& name : flag.names)
        pattern += (pattern.empty() ? "'" : "|'") + command.name + " " + name + "'";
      // A value of which nothing is known is completed by nothing, not by a flag.
      const std::string action = flag.file              ? "_varimesh_files; return"
                                 : flag.choices.empty() ? "return"
                                                        : "words='" + joined(flag.choices) + "'";
      values += "    " + pattern + ") " + action + " ;;\n";
    }
    flags += "      " + command.name + ") words='" + own + "' ;;\n";
  }
  for (const FlagFacts& flag : program.flags) names += joined(flag.names) + " ";
  return R"(# Completion of varimesh for bash; made by `varimesh completion bash`.
_varimesh_files() {
  compopt -o filenames
  mapfile -t COMPREPLY < <(compgen -f -- "$cur")
}
_varimesh() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} words=
  COMPREPLY=()
  # --energy=win comes as three words.
  if [ "$cur" = = ]; then cur=; elif [ "$prev" = = ]; then prev=${COMP_WORDS[COMP_CWORD - 2]}; fi
  if [ "$COMP_CWORD" = 1 ]; then
    mapfile -t COMPREPLY < <(compgen -W ')" +
         names + R"(' -- "$cur")
    return
  fi
  case "$command $prev" in
)" + values +
         R"(  esac
  if [ -z "$words" ] && [[ $cur == -* ]]; then
    case $command in
)" + flags +
         R"(    esac
  fi
  if [ -n "$words" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
  else
    case $command in
      man) mapfile -t COMPREPLY < <(compgen -W ')" +
         names + R"(' -- "$cur") ;;
      completion) mapfile -t COMPREPLY < <(compgen -W 'bash zsh fish' -- "$cur") ;;
      *) _varimesh_files ;;
    esac
  fi
}
complete -F _varimesh varimesh
)";
}

// ===== zsh =====

std::string zsh_text(const std::string& help) {
  std::string out;
  for (const char c : brief(help)) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_value(const FlagFacts& flag) {
  if (flag.value.empty()) return "";
  const std::string action = flag.file ? "_files" : flag.choices.empty() ? " " : "(" + joined(flag.choices) + ")";
  return ":value:" + action;
}

std::string zsh(const std::vector<CommandFacts>& commands) {
  std::string list, cases;
  for (const CommandFacts& command : commands) {
    list += "  " + quoted(command.name + ":" + zsh_text(command.purpose)) + "\n";
    cases += "  " + command.name + ")\n    _arguments -s \\\n";
    int position = 0;
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) {
        const std::string action = flag.file ? "_files" : flag.choices.empty() ? " " : "(" + joined(flag.choices) + ")";
        cases += "      " + quoted(fmt::format("{}:{}:{}", ++position, zsh_text(flag.names[0]), action)) + " \\\n";
        continue;
      }
      for (const std::string& name : flag.names) {
        const std::string equals = flag.value.empty() ? "" : name.rfind("--", 0) == 0 ? "=" : "+";
        cases +=
            "      " +
            quoted((flag.repeated ? "*" : "") + name + equals + "[" + zsh_text(flag.help) + "]" + zsh_value(flag)) +
            " \\\n";
      }
    }
    cases += "      && return\n    ;;\n";
  }
  return "#compdef varimesh\n# Completion of varimesh for zsh; made by `varimesh completion zsh`.\nlocal -a "
         "commands\ncommands=(\n" +
         list +
         ")\nif (( CURRENT == 2 )); then\n  _describe command commands\n  return\nfi\n"
         "local command=$words[2]\nshift words\n(( CURRENT-- ))\ncase $command in\n" +
         cases + "esac\n";
}

// ===== fish =====

std::string fish(const std::vector<CommandFacts>& commands) {
  std::string out = "# Completion of varimesh for fish; made by `varimesh completion fish`.\ncomplete -c varimesh -f\n";
  for (const CommandFacts& command : commands) {
    out += "complete -c varimesh -n __fish_use_subcommand -a " + command.name + " -d " + quoted(command.purpose) + "\n";
    const std::string when = "complete -c varimesh -n '__fish_seen_subcommand_from " + command.name + "'";
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) {
        if (flag.file) out += when + " -F\n";
        if (!flag.choices.empty()) out += when + " -a " + quoted(joined(flag.choices)) + "\n";
        continue;
      }
      out += when;
      for (const std::string& name : flag.names)
        out += name.rfind("--", 0) == 0 ? " -l " + name.substr(2) : " -s " + name.substr(1);
      if (flag.file)
        out += " -r -F";
      else if (!flag.value.empty())
        out += " -x";
      if (!flag.choices.empty()) out += " -a " + quoted(joined(flag.choices));
      out += " -d " + quoted(brief(flag.help)) + "\n";
    }
  }
  return out;
}

}  // namespace

Run add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App& command = *app.add_subcommand("completion", "Print what a shell needs to complete this command");
  command.add_option("shell", *shell, "Which shell")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}))
      ->type_name("bash|zsh|fish");
  return [shell, &app] {
    const auto commands = subcommand_facts(app);
    std::cout << (*shell == "bash" ? bash(facts_of(app), commands) : *shell == "zsh" ? zsh(commands) : fish(commands));
    return kDone;
  };
}

}  // namespace varimesh::client
