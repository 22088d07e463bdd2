#include "core/command_line/completion.h"

#include <algorithm>

namespace varimesh {
namespace {

/// The text up to the first full stop or semicolon, because a shell shows a single line.
std::string brief(const std::string& help) { return help.substr(0, std::min(help.find(';'), help.find(". "))); }

/// Whether a command takes the names of jobs. They are on a server, which the shell asks by `varimesh jobs`.
bool takes_jobs(const CommandFacts& command) {
  return std::ranges::any_of(command.flags,
                             [](const FlagFacts& flag) { return flag.argument && flag.names[0] == "JOB"; });
}

bool takes_jobs(const ProgramFacts& program) {
  return std::ranges::any_of(program.commands, [](const CommandFacts& one) { return takes_jobs(one); });
}

/// The text with the name of the program in place of each PROGRAM.
std::string named(std::string text, const ProgramFacts& program) {
  const std::string_view place = "PROGRAM";
  for (std::size_t at = text.find(place); at != text.npos; at = text.find(place, at + program.name.size()))
    text.replace(at, place.size(), program.name);
  return text;
}

/// The commands, and before them the program itself, whose flags stand where a command could.
std::vector<CommandFacts> with_itself(const ProgramFacts& program) {
  std::vector<CommandFacts> all = {program.itself};
  all.insert(all.end(), program.commands.begin(), program.commands.end());
  return all;
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

/// What may follow in a bash command line, as words and as lines of `case` statements. The program itself is a command
/// without a name.
struct BashWords {
  std::string commands;  ///< The commands and the flags of the program.
  std::string flags;     ///< For each command: its flags.
  std::string values;    ///< For each command and flag: its values.
  std::string of_jobs;   ///< The commands that take the names of jobs, as a pattern.
};

/// What bash does at the value of a flag, as a line of a `case` statement.
std::string bash_value(const CommandFacts& command, const FlagFacts& flag) {
  std::string pattern;
  for (const std::string& name : flag.names)
    pattern += (pattern.empty() ? "'" : "|'") + command.name + " " + name + "'";
  // If the possible values are not known, nothing is offered, and no flags either.
  const std::string action = flag.file              ? "_PROGRAM_files; return"
                             : flag.choices.empty() ? "return"
                                                    : "words='" + joined(flag.choices, " ") + "'";
  return "    " + pattern + ") " + action + " ;;\n";
}

BashWords bash_words(const ProgramFacts& program) {
  BashWords words;
  for (const CommandFacts& command : with_itself(program)) {
    if (!command.name.empty()) words.commands += command.name + " ";
    if (takes_jobs(command)) words.of_jobs += (words.of_jobs.empty() ? "" : "|") + command.name;
    std::string flags;
    for (const FlagFacts& flag : command.flags) {
      if (flag.argument) continue;
      flags += joined(flag.names, " ") + " ";
      if (!flag.value.empty()) words.values += bash_value(command, flag);
    }
    words.flags += "      '" + command.name + "') words='" + flags + "' ;;\n";
  }
  for (const FlagFacts& flag : program.itself.flags)
    if (!flag.argument) words.commands += joined(flag.names, " ") + " ";
  return words;
}

/// A function that sets COMPREPLY to the names of jobs.
constexpr char kBashJobs[] =
    R"(# The names of jobs on the server that the line names, or on the usual one, without their "jobs/". What is no plain name is
# left out, because compgen -W would run what is in it.
_PROGRAM_jobs() {
  # Up to the cursor, after --server and a space or an equals sign: the address. bash splits addresses in COMP_WORDS.
  local line=${COMP_LINE:0:COMP_POINT} server=() given names variable='^\$\{?([A-Za-z_][A-Za-z_0-9]*)\}?$'
  if [[ $line =~ [[:space:]]--server(=|[[:space:]]+)[^[:space:]]*$ ]]; then return; fi
  if [[ $line =~ [[:space:]]--server(=|[[:space:]]+)([^[:space:]]+)[[:space:]] ]]; then
    given=${BASH_REMATCH[2]//[\"\']/}
    if [[ $given =~ $variable ]]; then given=${!BASH_REMATCH[1]}; fi
    server=(--server "$given")
  fi
  names=$(timeout 2 PROGRAM jobs --names "${server[@]}" 2>/dev/null | sed -n ')";

}  // namespace

std::string bash_completion(const ProgramFacts& program) {
  const BashWords words = bash_words(program);
  const std::string jobs = words.of_jobs.empty() ? "" : kBashJobs + std::string(kPlainNames) + R"(')
  mapfile -t COMPREPLY < <(compgen -W "$names" -- "$cur")
}
)";
  return named(R"(# Completion of PROGRAM for bash; made by `PROGRAM completion bash`.
_PROGRAM_files() {
  compopt -o filenames
  mapfile -t COMPREPLY < <(compgen -f -- "$cur")
}
)" + jobs + R"(_PROGRAM() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} words=
  COMPREPLY=()
  # bash splits --energy=win into three words.
  if [ "$cur" = = ]; then cur=; elif [ "$prev" = = ]; then prev=${COMP_WORDS[COMP_CWORD - 2]}; fi
  if [ "$COMP_CWORD" = 1 ]; then
    mapfile -t COMPREPLY < <(compgen -W ')" +
                   words.commands + R"(' -- "$cur")
    return
  fi
  if [[ $command == -* ]]; then command=; fi  # flags of the program itself
  case "$command $prev" in
)" + words.values + R"(  esac
  if [ -z "$words" ] && [[ $cur == -* ]]; then
    case $command in
)" + words.flags + R"(    esac
  fi
  if [ -n "$words" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
  else
    case $command in
      man) mapfile -t COMPREPLY < <(compgen -W ')" +
                   words.commands + R"(' -- "$cur") ;;
      completion) mapfile -t COMPREPLY < <(compgen -W 'bash zsh fish' -- "$cur") ;;
)" + (words.of_jobs.empty() ? "" : "      " + words.of_jobs + ") _PROGRAM_jobs ;;\n") +
                   R"(      *) _PROGRAM_files ;;
    esac
  fi
}
complete -F _PROGRAM PROGRAM
)",
               program);
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
  if (flag.argument && flag.names[0] == "JOB") return "_PROGRAM_jobs";
  return flag.file ? "_files" : flag.choices.empty() ? " " : "(" + joined(flag.choices, " ") + ")";
}

std::string zsh_flag(const FlagFacts& flag, const std::string& name) {
  const std::string equals = flag.value.empty() ? "" : name.rfind("--", 0) == 0 ? "=" : "+";
  const std::string value = flag.value.empty() ? "" : ":value:" + zsh_action(flag);
  return (flag.repeated ? "*" : "") + name + equals + "[" + zsh_text(flag.help) + "]" + value;
}

/// What _arguments of zsh gets for the flags and arguments of a command.
std::string zsh_arguments(const CommandFacts& command) {
  std::string out = "_arguments -s \\\n";
  int position = 0;
  for (const FlagFacts& flag : command.flags) {
    if (flag.argument)
      out += "      " + quoted(std::to_string(++position) + ":" + zsh_text(flag.names[0]) + ":" + zsh_action(flag)) +
             " \\\n";
    else
      for (const std::string& name : flag.names) out += "      " + quoted(zsh_flag(flag, name)) + " \\\n";
  }
  return out + "      && return\n";
}

/// A function that offers the names of jobs.
constexpr char kZshJobs[] = R"zsh(_PROGRAM_jobs() {
  local -a names server
  local given at=${words[(I)--server]}
  (( at )) && given=$words[at+1]
  (( at = ${words[(I)--server=*]} )) && given=${words[at]#--server=}
  given=${(Q)given}
  [[ $given =~ '^\$\{?([A-Za-z_][A-Za-z_0-9]*)\}?$' ]] && given=${(P)match[1]}
  [[ -n $given ]] && server=(--server $given)
  names=(${(f)"$(timeout 2 PROGRAM jobs --names $server 2>/dev/null | sed -n ')zsh";

}  // namespace

std::string zsh_completion(const ProgramFacts& program) {
  std::string list, cases;
  for (const CommandFacts& command : program.commands) {
    list += "  " + quoted(command.name + ":" + zsh_text(command.purpose)) + "\n";
    cases += "  " + command.name + ")\n    " + zsh_arguments(command) + "    ;;\n";
  }
  const std::string jobs =
      takes_jobs(program) ? kZshJobs + std::string(kPlainNames) + "')\"})\n  compadd -a names\n}\n" : "";
  return named("#compdef PROGRAM\n# Completion of PROGRAM for zsh; made by `PROGRAM completion zsh`.\n" + jobs +
                   "if [[ $words[2] == -* ]]; then\n    " + zsh_arguments(program.itself) +
                   "fi\nlocal -a commands\ncommands=(\n" + list +
                   ")\nif (( CURRENT == 2 )); then\n  _describe command commands\n  return\nfi\n"
                   "local command=$words[2]\nshift words\n(( CURRENT-- ))\ncase $command in\n" +
                   cases + "esac\n",
               program);
}

// ===== fish =====

namespace {

/// A function that prints the names of jobs on the server that the line names, or on the usual one.
constexpr char kFishJobs[] = R"(function __PROGRAM_jobs
  set -l server
  set -l given (commandline -pc | string replace -rf '^.*\s--server(?:=|\s+)(\S+)\s.*$' '$1' | string trim -c '"\'')
  if test -n "$given"
    set -l variable (string replace -rf '^\$([A-Za-z_][A-Za-z_0-9]*)$' '$1' -- $given)
    and set given $$variable
    set server --server $given
  end
  timeout 2 PROGRAM jobs --names $server 2>/dev/null | string replace -rf '^jobs/([0-9a-z]*)$' '$1'
end
)";

/// The lines for a flag or an argument; `when` is how they begin.
std::string fish_flag(const FlagFacts& flag, const std::string& when) {
  std::string out;
  if (flag.argument) {
    if (flag.file) out += when + " -F\n";
    if (flag.names[0] == "JOB") out += when + " -a '(__PROGRAM_jobs)'\n";
    if (!flag.choices.empty()) out += when + " -a " + quoted(joined(flag.choices, " ")) + "\n";
    return out;
  }
  out += when;
  for (const std::string& name : flag.names)
    out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  if (flag.file)
    out += " -r -F";
  else if (!flag.value.empty())
    out += " -x";
  if (!flag.choices.empty()) out += " -a " + quoted(joined(flag.choices, " "));
  return out + " -d " + quoted(brief(flag.help)) + "\n";
}

}  // namespace

std::string fish_completion(const ProgramFacts& program) {
  std::string out = "# Completion of PROGRAM for fish; made by `PROGRAM completion fish`.\n" +
                    std::string(takes_jobs(program) ? kFishJobs : "") + "complete -c PROGRAM -f\n";
  const std::string first = "complete -c PROGRAM -n __fish_use_subcommand";
  for (const FlagFacts& flag : program.itself.flags) out += fish_flag(flag, first);
  for (const CommandFacts& command : program.commands) {
    out += first + " -a " + command.name + " -d " + quoted(command.purpose) + "\n";
    const std::string when = "complete -c PROGRAM -n '__fish_seen_subcommand_from " + command.name + "'";
    for (const FlagFacts& flag : command.flags) out += fish_flag(flag, when);
  }
  return named(out, program);
}

}  // namespace varimesh
