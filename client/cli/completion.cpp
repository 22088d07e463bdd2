#include "client/cli/completion.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/cli/names.h"

namespace varimesh::client {
namespace {

/// The text up to the first full stop or semicolon, because a shell shows a single line.
std::string brief(const std::string& help) { return help.substr(0, std::min(help.find(';'), help.find(". "))); }

/// Whether a command takes the names of jobs. They are on a server, which the shell asks by `varimesh jobs`.
bool takes_jobs(const CommandFacts& command) {
  return std::ranges::any_of(command.flags,
                             [](const FlagFacts& flag) { return flag.argument && flag.names[0] == "JOB"; });
}

/// For sed -n: the names of jobs without their "jobs/". A server could send anything in place of a name, and shells run
/// what is in some words.
constexpr char kPlainNames[] = "s,^jobs/\\([0-9a-z]*\\)$,\\1,p";

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

// ===== bash =====

/// What may follow in a bash command line, as words and as lines of `case` statements.
struct BashWords {
  std::string commands;  ///< The commands and the flags of the program.
  std::string flags;     ///< For each command: its flags.
  std::string values;    ///< For each command and flag: its values.
  std::string of_jobs;   ///< The commands that take the names of jobs, as a pattern.
};

BashWords bash_words(const CommandFacts& program, const std::vector<CommandFacts>& commands) {
  BashWords words;
  for (const CommandFacts& command : commands) {
    words.commands += command.name + " ";
    if (takes_jobs(command)) words.of_jobs += (words.of_jobs.empty() ? "" : "|") + command.name;
    std::string flags;
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) continue;
      flags += joined(flag.names, " ") + " ";
      if (flag.value.empty()) continue;
      std::string pattern;
      for (const std::string& name : flag.names)
        pattern += (pattern.empty() ? "'" : "|'") + command.name + " " + name + "'";
      // If the possible values are not known, nothing is offered, and no flags either.
      const std::string action = flag.file              ? "_varimesh_files; return"
                                 : flag.choices.empty() ? "return"
                                                        : "words='" + joined(flag.choices, " ") + "'";
      words.values += fmt::format("    {}) {} ;;\n", pattern, action);
    }
    words.flags += "      " + command.name + ") words='" + flags + "' ;;\n";
  }
  for (const FlagFacts& flag : program.flags) words.commands += joined(flag.names, " ") + " ";
  return words;
}

}  // namespace

std::string bash_completion(const CommandFacts& program, const std::vector<CommandFacts>& commands) {
  const BashWords words = bash_words(program, commands);
  return R"(# Completion of varimesh for bash; made by `varimesh completion bash`.
_varimesh_files() {
  compopt -o filenames
  mapfile -t COMPREPLY < <(compgen -f -- "$cur")
}
# The names of jobs on the server that the line names, or on the usual one, without their "jobs/". What is no plain name is
# left out, because compgen -W would run what is in it.
_varimesh_jobs() {
  # Up to the cursor, after --server and a space or an equals sign: the address. bash splits addresses in COMP_WORDS.
  local line=${COMP_LINE:0:COMP_POINT} server=() given names variable='^\$\{?([A-Za-z_][A-Za-z_0-9]*)\}?$'
  if [[ $line =~ [[:space:]]--server(=|[[:space:]]+)[^[:space:]]*$ ]]; then return; fi
  if [[ $line =~ [[:space:]]--server(=|[[:space:]]+)([^[:space:]]+)[[:space:]] ]]; then
    given=${BASH_REMATCH[2]//[\"\']/}
    if [[ $given =~ $variable ]]; then given=${!BASH_REMATCH[1]}; fi
    server=(--server "$given")
  fi
  names=$(timeout 2 varimesh jobs --names "${server[@]}" 2>/dev/null | sed -n ')" +
         std::string(kPlainNames) + R"(')
  mapfile -t COMPREPLY < <(compgen -W "$names" -- "$cur")
}
_varimesh() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} words=
  COMPREPLY=()
  # bash splits --energy=win into three words.
  if [ "$cur" = = ]; then cur=; elif [ "$prev" = = ]; then prev=${COMP_WORDS[COMP_CWORD - 2]}; fi
  if [ "$COMP_CWORD" = 1 ]; then
    mapfile -t COMPREPLY < <(compgen -W ')" +
         words.commands + R"(' -- "$cur")
    return
  fi
  case "$command $prev" in
)" + words.values +
         R"(  esac
  if [ -z "$words" ] && [[ $cur == -* ]]; then
    case $command in
)" + words.flags +
         R"(    esac
  fi
  if [ -n "$words" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
  else
    case $command in
      man) mapfile -t COMPREPLY < <(compgen -W ')" +
         words.commands + R"(' -- "$cur") ;;
      completion) mapfile -t COMPREPLY < <(compgen -W 'bash zsh fish' -- "$cur") ;;
      )" +
         words.of_jobs +
         R"() _varimesh_jobs ;;
      *) _varimesh_files ;;
    esac
  fi
}
complete -F _varimesh varimesh
)";
}

// ===== zsh =====

namespace {

std::string zsh_text(const std::string& help) {
  std::string out;
  for (const char c : brief(help)) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_action(const FlagFacts& flag) {
  if (flag.argument && flag.names[0] == "JOB") return "_varimesh_jobs";
  return flag.file ? "_files" : flag.choices.empty() ? " " : "(" + joined(flag.choices, " ") + ")";
}

std::string zsh_flag(const FlagFacts& flag, const std::string& name) {
  const std::string equals = flag.value.empty() ? "" : name.rfind("--", 0) == 0 ? "=" : "+";
  const std::string value = flag.value.empty() ? "" : ":value:" + zsh_action(flag);
  return (flag.repeated ? "*" : "") + name + equals + "[" + zsh_text(flag.help) + "]" + value;
}

}  // namespace

std::string zsh_completion(const std::vector<CommandFacts>& commands) {
  std::string list, cases;
  for (const CommandFacts& command : commands) {
    list += "  " + quoted(command.name + ":" + zsh_text(command.purpose)) + "\n";
    cases += "  " + command.name + ")\n    _arguments -s \\\n";
    int position = 0;
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) {
        const std::string argument = fmt::format("{}:{}:{}", ++position, zsh_text(flag.names[0]), zsh_action(flag));
        cases += "      " + quoted(argument) + " \\\n";
        continue;
      }
      for (const std::string& name : flag.names) cases += "      " + quoted(zsh_flag(flag, name)) + " \\\n";
    }
    cases += "      && return\n    ;;\n";
  }
  return "#compdef varimesh\n# Completion of varimesh for zsh; made by `varimesh completion zsh`.\n"
         "_varimesh_jobs() {\n  local -a names server\n  local given at=${words[(I)--server]}\n"
         "  (( at )) && given=$words[at+1]\n"
         "  (( at = ${words[(I)--server=*]} )) && given=${words[at]#--server=}\n"
         "  given=${(Q)given}\n"
         "  [[ $given =~ '^\\$\\{?([A-Za-z_][A-Za-z_0-9]*)\\}?$' ]] && given=${(P)match[1]}\n"
         "  [[ -n $given ]] && server=(--server $given)\n"
         "  names=(${(f)\"$(timeout 2 varimesh jobs --names $server 2>/dev/null | sed -n '" +
         std::string(kPlainNames) +
         "')\"})\n"
         "  compadd -a names\n}\nlocal -a commands\ncommands=(\n" +
         list +
         ")\nif (( CURRENT == 2 )); then\n  _describe command commands\n  return\nfi\n"
         "local command=$words[2]\nshift words\n(( CURRENT-- ))\ncase $command in\n" +
         cases + "esac\n";
}

// ===== fish =====

namespace {

/// A function that prints the names of jobs on the server that the line names, or on the usual one.
constexpr char kFishJobs[] = R"(function __varimesh_jobs
  set -l server
  set -l given (commandline -pc | string replace -rf '^.*\s--server(?:=|\s+)(\S+)\s.*$' '$1' | string trim -c '"\'')
  if test -n "$given"
    set -l variable (string replace -rf '^\$([A-Za-z_][A-Za-z_0-9]*)$' '$1' -- $given)
    and set given $$variable
    set server --server $given
  end
  timeout 2 varimesh jobs --names $server 2>/dev/null | string replace -rf '^jobs/([0-9a-z]*)$' '$1'
end
)";

}  // namespace

std::string fish_completion(const std::vector<CommandFacts>& commands) {
  std::string out = "# Completion of varimesh for fish; made by `varimesh completion fish`.\n" +
                    std::string(kFishJobs) + "complete -c varimesh -f\n";
  for (const CommandFacts& command : commands) {
    out += "complete -c varimesh -n __fish_use_subcommand -a " + command.name + " -d " + quoted(command.purpose) + "\n";
    const std::string when = "complete -c varimesh -n '__fish_seen_subcommand_from " + command.name + "'";
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) {
        if (flag.file) out += when + " -F\n";
        if (flag.names[0] == "JOB") out += when + " -a '(__varimesh_jobs)'\n";
        if (!flag.choices.empty()) out += when + " -a " + quoted(joined(flag.choices, " ")) + "\n";
        continue;
      }
      out += when;
      for (const std::string& name : flag.names)
        out += name.rfind("--", 0) == 0 ? " -l " + name.substr(2) : " -s " + name.substr(1);
      if (flag.file)
        out += " -r -F";
      else if (!flag.value.empty())
        out += " -x";
      if (!flag.choices.empty()) out += " -a " + quoted(joined(flag.choices, " "));
      out += " -d " + quoted(brief(flag.help)) + "\n";
    }
  }
  return out;
}

}  // namespace varimesh::client
