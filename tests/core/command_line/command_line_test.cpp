// A made-up program: its help, manual page and completion. The programs themselves are tested in tests/client.
#include <gtest/gtest.h>

#include "core/command_line/completion.h"
#include "core/command_line/help.h"
#include "core/command_line/manual.h"

namespace varimesh {
namespace {

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

FlagFacts flag(const std::string& name, const std::string& value, const std::string& help) {
  FlagFacts facts;
  facts.names = {name};
  facts.value = value;
  facts.help = help;
  facts.group = "Options";
  return facts;
}

/// A program with flags of its own, and a command whose argument is a job.
ProgramFacts sailor() {
  ProgramFacts program;
  program.name = "sailor";
  program.itself.purpose = "Sail";
  program.itself.examples = {{"", "sail home", "sailor --to HOME"}};
  program.itself.flags = {flag("--to", "PORT", "Where to"), flag("--fast", "", "Hurry. It costs more")};
  program.itself.flags[0].choices = {"home", "away"};
  CommandFacts command;
  command.name = "moor";
  command.purpose = "Moor a job";
  command.flags = {flag("JOB", "JOB", "What to moor"), flag("--rope", "FILE", "The rope; a long one")};
  command.flags[0].argument = command.flags[0].required = true;
  command.flags[1].file = true;
  program.commands = {command};
  return program;
}

TEST(CommandLine, JoinsWords) {
  EXPECT_EQ(joined({"a", "b", "c"}, ", "), "a, b, c");
  EXPECT_EQ(joined({}, ", "), "");
}

TEST(CommandLine, HelpHasExamplesUsageCommandsAndFlags) {
  const ProgramFacts program = sailor();
  const std::string help = help_text(program, program.itself, 80);
  EXPECT_TRUE(has(help, "Sail\n\nExamples:\n  # sail home\n  sailor --to HOME\n\nUsage: sailor [OPTIONS] [COMMAND]\n"))
      << help;
  EXPECT_TRUE(has(help, "\n  moor                    Moor a job\n")) << help;
  EXPECT_TRUE(has(help, "\nOptions:\n  --to PORT               Where to\n")) << help;
  EXPECT_TRUE(has(help_text(program, program.commands[0], 80), "Usage: sailor moor [OPTIONS] JOB\n\nArguments:\n"));
  const auto few = [](const FlagFacts& one) { return one.argument; };
  EXPECT_TRUE(has(help_text(program, program.commands[0], 80, few), "\n1 more options: sailor moor --help-all\n"));
}

TEST(CommandLine, APageOfTheManualHasTheSame) {
  const ProgramFacts program = sailor();
  const std::string page = manual_page(program, program.itself);
  EXPECT_TRUE(has(page, ".TH SAILOR 1 ")) << page;
  EXPECT_TRUE(has(page, "[\\fIOPTIONS\\fR] [\\fICOMMAND\\fR]")) << page;
  EXPECT_TRUE(has(page, ".SH COMMANDS\n.TP\n\\fBmoor\\fR\nMoor a job\n")) << page;
  EXPECT_TRUE(has(page, "\\fB\\-\\-to\\fR \\fIPORT\\fR")) << page;
  EXPECT_TRUE(has(manual_page(program, program.commands[0]), ".SH SEE ALSO\n\\fBsailor\\fR(1)\n"));
}

TEST(CommandLine, CompletionKnowsTheProgramsOwnFlagsAndAsksItForJobs) {
  const ProgramFacts program = sailor();
  const std::string bash = bash_completion(program), zsh = zsh_completion(program), fish = fish_completion(program);
  EXPECT_TRUE(has(bash, "' --to') words='home away' ;;\n")) << bash;
  EXPECT_TRUE(has(bash, "'moor --rope') _sailor_files; return ;;\n")) << bash;
  EXPECT_TRUE(has(bash, "      moor) _sailor_jobs ;;\n")) << bash;
  EXPECT_TRUE(has(zsh, "'--to=[Where to]:value:(home away)'")) << zsh;
  EXPECT_TRUE(has(zsh, "'1:JOB:_sailor_jobs'")) << zsh;
  EXPECT_TRUE(has(fish, "complete -c sailor -n __fish_use_subcommand -l fast -d 'Hurry'\n")) << fish;
  EXPECT_TRUE(has(fish, "-l rope -r -F -d 'The rope'\n")) << fish;
  for (const std::string& script : {bash, zsh, fish}) EXPECT_FALSE(has(script, "PROGRAM")) << script;
}

TEST(CommandLine, CompletionAsksForNoJobsIfNoCommandTakesThem) {
  ProgramFacts program = sailor();
  program.commands.clear();
  for (const std::string& script : {bash_completion(program), zsh_completion(program), fish_completion(program)})
    EXPECT_FALSE(has(script, "jobs")) << script;
}

}  // namespace
}  // namespace varimesh
