#include "client/cli/command_facts.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "client/commands/commands.h"

namespace varimesh::client {
namespace {

/// The parser with all commands.
struct Program {
  CLI::App app;
  const std::vector<std::pair<std::string, Action>> actions = add_commands(app);
};

const FlagFacts& flag_of(const CommandFacts& command, const std::string& name) {
  const auto found = std::find_if(command.flags.begin(), command.flags.end(), [&](const FlagFacts& flag) {
    return std::count(flag.names.begin(), flag.names.end(), name) > 0;
  });
  EXPECT_NE(found, command.flags.end()) << name;
  return *found;
}

TEST(CommandFacts, AreThoseOfAllCommandsInOrder) {
  const Program program;
  std::vector<std::string> names, added;
  for (const CommandFacts& command : subcommand_facts(program.app)) names.push_back(command.name);
  for (const auto& [name, action] : program.actions) added.push_back(name);
  EXPECT_EQ(names, added);
  EXPECT_EQ(facts_of(program.app).name, "");
}

TEST(CommandFacts, EachCommandHasExamplesAndAPurpose) {
  const Program program;
  for (const CommandFacts& command : subcommand_facts(program.app)) {
    EXPECT_FALSE(command.examples.empty()) << command.name;
    EXPECT_FALSE(command.purpose.empty()) << command.name;
    for (const FlagFacts& flag : command.flags) EXPECT_FALSE(flag.help.empty()) << command.name << " " << flag.names[0];
  }
}

/// CLI11 refuses such names from version 2.4 on, when the program starts.
TEST(CommandFacts, NoArgumentHasTheNameOfAFlag) {
  const Program program;
  for (const CLI::App* command : program.app.get_subcommands({}))
    for (const CLI::Option* argument : command->get_options())
      for (const CLI::Option* flag : command->get_options())
        EXPECT_FALSE(argument->get_positional() && flag->check_lname(argument->get_name(true)))
            << command->get_name() << " " << argument->get_name(true);
}

TEST(CommandFacts, ExamplesBelongToCommands) {
  const Program program;
  for (const Example& example : all_examples())
    EXPECT_NO_THROW(example.command.empty() ? &program.app : program.app.get_subcommand(std::string(example.command)))
        << example.line;
}

TEST(CommandFacts, FlagsAreReadFromTheParser) {
  const Program program;
  const CommandFacts command = facts_of(*program.app.get_subcommand("optimise"));
  const FlagFacts& output = flag_of(command, "--output");
  EXPECT_EQ(output.names, (std::vector<std::string>{"-o", "--output"}));
  EXPECT_TRUE(output.file && output.repeated && !output.argument);
  EXPECT_FALSE(output.required) << "--into does without";
  EXPECT_TRUE(flag_of(facts_of(*program.app.get_subcommand("curve")), "--output").required);
  const FlagFacts& input = flag_of(command, "IN");
  EXPECT_TRUE(input.argument && input.file && input.required);
  const FlagFacts& method = flag_of(command, "--method");
  EXPECT_EQ(method.choices, (std::vector<std::string>{"auto", "sweeps", "newton"}));
  EXPECT_EQ(method.group, "Optimisation");
  EXPECT_TRUE(flag_of(command, "--json").value.empty());
}

TEST(CommandFacts, FormatsAndStatesHaveChoices) {
  const Program program;
  const auto formats = flag_of(facts_of(*program.app.get_subcommand("submit")), "--output-format").choices;
  EXPECT_NE(std::find(formats.begin(), formats.end(), "msh41-binary"), formats.end());
  const auto states = flag_of(facts_of(*program.app.get_subcommand("jobs")), "--state").choices;
  EXPECT_NE(std::find(states.begin(), states.end(), "running"), states.end());
}

}  // namespace
}  // namespace varimesh::client
