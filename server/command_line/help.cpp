#include "server/command_line/help.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/version.h"
#include "core/options/help_text.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kNoHeading = "Options";  // CLI11's

/// A command line to copy.
struct Example {
  std::string_view what, line;
};
constexpr std::array kExamples{
    Example{"serve the programs of this user on this machine", "varimeshd"},
    Example{"the same, with jobs and results that outlive the server", "varimeshd --state DIR"},
    Example{"serve this machine on a port, with a page that shows the jobs",
            "varimeshd --listen 127.0.0.1:50051 --admin 127.0.0.1:8080"},
    Example{"make a token for ann, and let only those call that have a token",
            "varimeshd token ann --tokens FILE && varimeshd --tokens FILE"},
    Example{"serve other machines, encrypted ('varimesh certificates' makes certificates to try this)",
            "varimeshd --listen 0.0.0.0:50051 --tls-certificate server.pem --tls-key server.key --tokens FILE"},
    Example{"print all settings and where they come from", "varimeshd --print-config"},
};

/// The names of an option as people write them, those with two dashes last.
std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  if (option.get_positional()) names.push_back(option.get_name(true));
  return names;
}

/// What stands for the value: N for a number; empty if there is none.
std::string value_of(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return "";
  const std::string type = option.get_type_name();
  return type.starts_with("INT") || type.starts_with("FLOAT") || type.starts_with("UINT") ? "N" : "VALUE";
}

std::string meaning_of(const CLI::Option& option) {
  std::string text = option.get_description();
  if (option.get_required()) text += " (required)";
  if (const std::string usual = option.get_default_str(); !usual.empty()) text += " (default: " + usual + ")";
  return text;
}

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : ", ") + word;
  return out;
}

/// The headings and their options, in the order of the program.
std::vector<std::pair<std::string, std::vector<const CLI::Option*>>> groups_of(const CLI::App& app) {
  std::vector<std::pair<std::string, std::vector<const CLI::Option*>>> groups;
  for (const CLI::Option* option : app.get_options()) {
    const auto same = [&](const auto& one) { return one.first == option->get_group(); };
    auto group = std::ranges::find_if(groups, same);
    if (group == groups.end()) group = groups.insert(groups.end(), {option->get_group(), {}});
    group->second.push_back(option);
  }
  return groups;
}

class Help : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const override {
    const std::size_t width = help_width();
    const bool is_program = app->get_parent() == nullptr;
    std::string out = wrapped(app->get_description(), 0, 0, width);
    if (is_program) {
      out += "\nExamples:\n";
      for (const auto& [what, line] : kExamples) out += "  # " + std::string(what) + "\n  " + std::string(line) + "\n";
    }
    const auto commands = app->get_subcommands({});
    out += "\nUsage: varimeshd " + (is_program ? "" : app->get_name() + " ") + "[OPTIONS]" +
           (commands.empty() ? "" : " [COMMAND]") + "\n";
    if (!commands.empty()) out += "\nCommands, whose --help says more:\n";
    for (const CLI::App* command : commands) out += help_entry(command->get_name(), command->get_description(), width);
    for (const auto& [heading, options] : groups_of(*app)) {
      out += "\n" + heading + ":\n";
      for (const CLI::Option* option : options) {
        const std::string value = option->get_positional() ? "" : value_of(*option);
        out += help_entry(joined(names_of(*option)) + (value.empty() ? "" : " " + value), meaning_of(*option), width);
      }
    }
    return out;
  }
};

// ===== the manual page and completion =====

std::string manual(const CLI::App& app) {
  std::string out = ".TH VARIMESHD 8 \"\" \"varimesh " + std::string(version()) +
                    "\" \"System Administration\"\n.SH NAME\nvarimeshd \\- " + troff_text(app.get_description()) +
                    "\n.SH SYNOPSIS\n\\fBvarimeshd\\fR [\\fIOPTIONS\\fR] [\\fICOMMAND\\fR]\n.SH EXAMPLES\n";
  for (const auto& [what, line] : kExamples) out += troff_example(what, line);
  out += ".SH COMMANDS\n";
  for (const CLI::App* command : app.get_subcommands({}))
    out += troff_item("\\fB" + command->get_name() + "\\fR", command->get_description());
  out += ".SH OPTIONS\n";
  for (const auto& [heading, options] : groups_of(app)) {
    out += ".SS " + troff_text(heading) + "\n";
    for (const CLI::Option* option : options) {
      std::string term;
      for (const std::string& name : names_of(*option))
        term += (term.empty() ? "\\fB" : ", \\fB") + troff_text(name) + "\\fR";
      if (const std::string value = value_of(*option); !value.empty()) term += " \\fI" + value + "\\fR";
      out += troff_item(term, meaning_of(*option));
    }
  }
  return out + ".SH SEE ALSO\n\\fBvarimesh\\fR(1)\n";
}

/// The words that may follow the program's name: its commands and options.
std::vector<std::string> words_of(const CLI::App& app) {
  std::vector<std::string> words;
  for (const CLI::App* command : app.get_subcommands({})) words.push_back(command->get_name());
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : names_of(*option)) words.push_back(name);
  return words;
}

std::string bash_completion(const CLI::App& app) {
  std::string words;
  for (const std::string& word : words_of(app)) words += word + " ";
  return "# Completion of varimeshd for bash; made by `varimeshd completion bash`.\n_varimeshd() {\n"
         "  local cur=${COMP_WORDS[COMP_CWORD]}\n  COMPREPLY=()\n"
         "  if [[ $cur == -* || $COMP_CWORD = 1 ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W '" +
         words +
         "' -- \"$cur\")\n  else\n    compopt -o filenames\n    mapfile -t COMPREPLY < <(compgen -f -- \"$cur\")\n  "
         "fi\n"
         "}\ncomplete -F _varimeshd varimeshd\n";
}

std::string zsh_completion(const CLI::App& app) {
  std::string words;
  for (const std::string& word : words_of(app)) words += word + " ";
  return "#compdef varimeshd\n# Completion of varimeshd for zsh; made by `varimeshd completion zsh`.\n"
         "if [[ $words[CURRENT] == -* ]] || (( CURRENT == 2 )); then\n  compadd -- " +
         words + "\nelse\n  _files\nfi\n";
}

std::string fish_completion(const CLI::App& app) {
  std::string out = "# Completion of varimeshd for fish; made by `varimeshd completion fish`.\n";
  for (const CLI::App* command : app.get_subcommands({}))
    out += "complete -c varimeshd -n __fish_use_subcommand -a " + command->get_name() + "\n";
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames())
      out += "complete -c varimeshd -l " + name + (value_of(*option).empty() ? "" : " -r") + "\n";
  return out;
}

}  // namespace

void put_under(CLI::App& app, const char* heading) {
  for (CLI::Option* option : app.get_options(std::function<bool(CLI::Option*)>()))
    if (option->get_group() == kNoHeading) option->group(heading);
}

void add_help(CLI::App& app) {
  const auto help = std::make_shared<Help>();
  app.formatter(help);
  app.add_subcommand("man", "Print the manual page, as troff");
  app.add_subcommand("completion", "Print the completion script for a shell")
      ->add_option("shell", "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  for (CLI::App* command : app.get_subcommands(std::function<bool(CLI::App*)>())) command->formatter(help);
}

std::string asked_text(const CLI::App& app) {
  if (app.got_subcommand("man")) return manual(app);
  if (!app.got_subcommand("completion")) return "";
  const auto shell = app.get_subcommand("completion")->get_option("shell")->as<std::string>();
  return shell == "bash" ? bash_completion(app) : shell == "zsh" ? zsh_completion(app) : fish_completion(app);
}

}  // namespace varimesh::server
