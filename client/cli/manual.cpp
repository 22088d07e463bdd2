#include "client/cli/manual.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/process/exit_status.h"
#include "core/base/version.h"
#include "core/options/help_text.h"

namespace varimesh::client {
namespace {

std::string flag_item(const FlagFacts& flag) {
  std::string term;
  for (const std::string& name : flag.names) term += (term.empty() ? "" : ", ") + ("\\fB" + troff_text(name) + "\\fR");
  if (!flag.argument && !flag.value.empty()) term += " \\fI" + troff_text(flag.value) + "\\fR";
  return troff_item(term, flag.help + (flag.required && !flag.argument ? " (required)" : ""));
}

std::string examples(const CommandFacts& facts) {
  std::string out = ".SH EXAMPLES\n";
  for (const Example& example : facts.examples) out += troff_example(example.what, example.line);
  return out;
}

}  // namespace

std::string manual_page(const CommandFacts& facts, const std::vector<CommandFacts>& commands) {
  const std::string name = facts.name.empty() ? "varimesh" : "varimesh-" + facts.name;
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(), ::toupper);
  std::string synopsis = "\\fBvarimesh\\fR";
  synopsis += facts.name.empty() ? " \\fICOMMAND\\fR" : " \\fB" + troff_text(facts.name) + "\\fR [\\fIOPTIONS\\fR]";
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
                  troff_text(title), version(), troff_text(name), troff_text(facts.purpose), synopsis);
  out += examples(facts);
  if (!commands.empty()) out += ".SH COMMANDS\n";
  for (const CommandFacts& one : commands) out += troff_item("\\fB" + one.name + "\\fR", one.purpose);
  if (!arguments.empty()) out += ".SH ARGUMENTS\n" + arguments;
  out += ".SH OPTIONS\n" + options + ".SH EXIT STATUS\n";
  for (const ExitStatusMeaning& one : exit_statuses()) out += troff_item(std::to_string(one.status), one.meaning);
  if (!facts.name.empty()) out += ".SH SEE ALSO\n\\fBvarimesh\\fR(1)\n";
  return out;
}

}  // namespace varimesh::client
