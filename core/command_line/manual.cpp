#include "core/command_line/manual.h"

#include <algorithm>
#include <utility>

#include "core/base/version.h"
#include "core/command_line/columns.h"

namespace varimesh {
namespace {

std::string flag_item(const FlagFacts& flag) {
  std::string term;
  for (const std::string& name : flag.names) term += (term.empty() ? "" : ", ") + ("\\fB" + troff_text(name) + "\\fR");
  if (!flag.argument && !flag.value.empty()) term += " \\fI" + troff_text(flag.value) + "\\fR";
  return troff_item(term, flag.help + (flag.required && !flag.argument ? " (required)" : ""));
}

/// What may follow the name of the program, as troff, but for the arguments.
std::string synopsis(const ProgramFacts& program, const CommandFacts& facts) {
  if (!facts.name.empty()) return " \\fB" + troff_text(facts.name) + "\\fR [\\fIOPTIONS\\fR]";
  return program.needs_command ? " \\fICOMMAND\\fR" : " [\\fIOPTIONS\\fR] [\\fICOMMAND\\fR]";
}

}  // namespace

std::string manual_page(const ProgramFacts& program, const CommandFacts& facts) {
  const bool is_program = facts.name.empty();
  const std::string name = is_program ? program.name : program.name + "-" + facts.name;
  std::string title = name;
  std::ranges::transform(title, title.begin(), ::toupper);
  std::string usage = "\\fB" + troff_text(program.name) + "\\fR" + synopsis(program, facts);
  std::string arguments, options;
  std::vector<std::pair<std::string, std::string>> groups;
  for (const FlagFacts& flag : facts.flags) {
    if (flag.argument) {
      usage += flag.required ? " \\fI" + flag.names[0] + "\\fR" : " [\\fI" + flag.names[0] + "\\fR]";
      arguments += flag_item(flag);
      continue;
    }
    auto group = std::ranges::find_if(groups, [&](const auto& one) { return one.first == flag.group; });
    if (group == groups.end()) group = groups.insert(groups.end(), {flag.group, ""});
    group->second += flag_item(flag);
  }
  for (const auto& [heading, items] : groups) options += ".SS " + troff_text(heading) + "\n" + items;
  std::string out = ".TH " + troff_text(title) + " " + std::to_string(program.section) + " \"\" \"varimesh " +
                    std::string(version()) + "\" \"" + std::string(program.section_title) + "\"\n.SH NAME\n" +
                    troff_text(name) + " \\- " + troff_text(facts.purpose) + "\n.SH SYNOPSIS\n" + usage +
                    "\n.SH EXAMPLES\n";
  for (const Example& example : facts.examples) out += troff_example(example.what, example.line);
  if (is_program && !program.commands.empty()) out += ".SH COMMANDS\n";
  if (is_program)
    for (const CommandFacts& one : program.commands) out += troff_item("\\fB" + one.name + "\\fR", one.purpose);
  if (!arguments.empty()) out += ".SH ARGUMENTS\n" + arguments;
  out += ".SH OPTIONS\n" + options;
  if (!program.exit_statuses.empty()) out += ".SH EXIT STATUS\n";
  for (const ExitStatusMeaning& one : program.exit_statuses) out += troff_item(std::to_string(one.status), one.meaning);
  const std::string own = "\\fB" + troff_text(program.name) + "\\fR(" + std::to_string(program.section) + ")";
  const std::string see = is_program ? std::string(program.see_also) : own;
  if (!see.empty()) out += ".SH SEE ALSO\n" + see + "\n";
  return out;
}

}  // namespace varimesh
