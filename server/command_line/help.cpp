#include "server/command_line/help.h"

#include <CLI/CLI.hpp>
#include <array>
#include <memory>
#include <string_view>

#include "core/command_line/columns.h"
#include "core/command_line/completion.h"
#include "core/command_line/help.h"
#include "core/command_line/manual.h"
#include "core/command_line/parsed_facts.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kNoHeading = "Options";  // CLI11's

constexpr std::array kExamples{
    Example{"", "serve the programs of this user on this machine", "varimeshd"},
    Example{"", "the same, with jobs and results that outlive the server", "varimeshd --state DIR"},
    Example{"", "serve this machine on a port, with a page that shows the jobs",
            "varimeshd --listen 127.0.0.1:50051 --admin 127.0.0.1:8080"},
    Example{"", "make a token for ann, and refuse callers without a token",
            "varimeshd token ann --tokens FILE && varimeshd --tokens FILE"},
    Example{"", "serve other machines, encrypted ('varimesh certificates' makes certificates to try this)",
            "varimeshd --listen 0.0.0.0:50051 --tls-certificate server.pem --tls-key server.key --tokens FILE"},
    Example{"", "print all settings and where they come from", "varimeshd --print-config"},
};

/// The facts of an option, with its default.
FlagFacts with_default(const CLI::Option& option) {
  FlagFacts facts = parsed_facts(option);
  if (option.get_items_expected_max() == 0) facts.value.clear();
  if (facts.value == "TEXT") {
    facts.value = "VALUE";
    facts.file = true;  // most are files and folders, so completion offers these
  }
  if (const std::string usual = option.get_default_str(); !usual.empty()) facts.help += " (default: " + usual + ")";
  return facts;
}

ProgramFacts program_facts(const CLI::App& app) {
  ProgramFacts facts{.name = "varimeshd",
                     .itself = parsed_facts(app, kExamples, with_default),
                     .commands = parsed_subcommands(app, kExamples, with_default)};
  facts.section = 8;
  facts.section_title = "System Administration";
  facts.see_also = "\\fBvarimesh\\fR(1)";
  return facts;
}

class Help : public CLI::FormatterBase {
 public:
  std::string make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const override {
    const CLI::App& program = app->get_parent() == nullptr ? *app : *app->get_parent();
    return help_text(program_facts(program), parsed_facts(*app, kExamples, with_default), help_width());
  }
};

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
  const bool wants_manual = app.got_subcommand("man");
  if (!wants_manual && !app.got_subcommand("completion")) return "";
  const ProgramFacts facts = program_facts(app);
  if (wants_manual) return manual_page(facts, facts.itself);
  const auto shell = app.get_subcommand("completion")->get_option("shell")->as<std::string>();
  return shell == "bash" ? bash_completion(facts) : shell == "zsh" ? zsh_completion(facts) : fish_completion(facts);
}

}  // namespace varimesh::server
