#include "client/cli/help.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "core/options/nearest_word.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

TEST(Suggestions, AreWordsWithASmallDifference) {
  const std::vector<std::string> known{"--energy", "--method", "--max-iterations", "-o", "--output"};
  EXPECT_EQ(nearest_word("--enrgy", known), "--energy");
  EXPECT_EQ(nearest_word("--mehtod", known), "--method");
  EXPECT_EQ(nearest_word("--max", known), "--max-iterations");
  EXPECT_EQ(nearest_word("--colour", known), "");
}

TEST(Suggestions, AreMadeForTheFirstUnknownWord) {
  CLI::App app;
  const auto commands = add_commands(app);
  EXPECT_NE(unknown_word(app, {"optimize", "a.msh"}).find("'optimise'"), std::string::npos);
  EXPECT_NE(unknown_word(app, {"optimise", "a.msh", "--toleranse=1"}).find("'--tolerance'"), std::string::npos);
  EXPECT_EQ(unknown_word(app, {"optimise", "a.msh", "-o", "b.msh", "--energy", "winslow"}), "");
  EXPECT_EQ(unknown_word(app, {"--version"}), "");
}

TEST(Help, BeginsWithExamplesAndIsWrapped) {
  CLI::App app;
  const auto commands = add_commands(app);
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    const std::string help = Help(80).make_help(command, "", CLI::AppFormatMode::Normal);
    const auto at = help.find("\nExamples:\n  # ");
    EXPECT_LT(at, help.find("\nUsage: varimesh " + command->get_name())) << command->get_name();
    std::size_t begin = help.find("\nOptions:");
    while (begin < help.size()) {
      const std::size_t end = std::min(help.find('\n', begin + 1), help.size());
      const std::string line = help.substr(begin + 1, end - begin - 1);
      begin = end;
      // The names of flags and their values are not wrapped.
      if (line.rfind("  -", 0) != 0) {
        EXPECT_LE(line.size(), 84U) << line;  // These are bytes, and some letters have two.
      }
    }
  }
}

TEST(Help, ListsAllOptionsOfTheTable) {
  CLI::App app;
  const auto commands = add_commands(app);
  const std::string help = Help(100).make_help(app.get_subcommand("optimise"), "", CLI::AppFormatMode::All);
  for (const OptionInfo& option : option_table()) {
    const std::string flag = "\n  --" + dashed(std::string(option.name));
    const std::string end = option.opposite.empty() ? " " : ", --" + dashed(std::string(option.opposite)) + "\n";
    EXPECT_NE(help.find(flag + end), std::string::npos) << option.name;
  }
}

TEST(Help, ShowsFewFlagsAtFirstAndSaysWhereTheOthersAre) {
  CLI::App app;
  const auto commands = add_commands(app);
  const auto flags = [](const std::string& help) {
    std::size_t count = 0;
    for (std::size_t at = help.find("\n  -"); at != std::string::npos; at = help.find("\n  -", at + 1)) ++count;
    return count;
  };
  for (const std::string name : {"optimise", "curve", "submit"}) {
    const CLI::App* command = app.get_subcommand(name);
    const std::string few = Help(80).make_help(command, "", CLI::AppFormatMode::Normal),
                      all = Help(80).make_help(command, "", CLI::AppFormatMode::All);
    EXPECT_LE(flags(few), 20U) << name;
    EXPECT_NE(few.find(std::to_string(flags(all) - flags(few)) + " more options: varimesh " + name + " --help-all\n"),
              std::string::npos)
        << few;
  }
  EXPECT_EQ(Help(80).make_help(app.get_subcommand("jobs"), "", CLI::AppFormatMode::Normal).find("--help-all"),
            std::string::npos);
}

}  // namespace
}  // namespace varimesh::client
