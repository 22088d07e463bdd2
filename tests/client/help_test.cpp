// What the command says of itself: suggestions, help, and how long a job may take.
#include "client/command/help.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/command/command.h"
#include "client/command/estimate.h"
#include "client/command/facts.h"
#include "client/command/names.h"
#include "client/command/options_table.h"
#include "core/base/nearest_word.h"

namespace varimesh::client {
namespace {

TEST(Suggestions, AreWhatIsASlipAway) {
  const std::vector<std::string> known{"--energy", "--method", "--max-iterations", "-o", "--output"};
  EXPECT_EQ(nearest_word("--enrgy", known), "--energy");
  EXPECT_EQ(nearest_word("--mehtod", known), "--method");
  EXPECT_EQ(nearest_word("--max", known), "--max-iterations");
  EXPECT_EQ(nearest_word("--colour", known), "");
}

TEST(Suggestions, NameTheFirstWordThatIsNotKnown) {
  CLI::App app;
  const auto commands = add_commands(app);
  EXPECT_NE(unknown_word(app, {"optimize", "a.msh"}).find("'optimise'"), std::string::npos);
  EXPECT_NE(unknown_word(app, {"optimise", "a.msh", "--toleranse=1"}).find("'--tolerance'"), std::string::npos);
  EXPECT_EQ(unknown_word(app, {"optimise", "a.msh", "-o", "b.msh", "--energy", "winslow"}), "");
  EXPECT_EQ(unknown_word(app, {"--version"}), "");
}

TEST(Help, BeginsWithExamplesAndKeepsToTheWidth) {
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
      // A name and its values stand as they are; text is wrapped.
      if (line.rfind("  -", 0) != 0) {
        EXPECT_LE(line.size(), 84U) << line;  // bytes: some letters have two
      }
    }
  }
}

TEST(Help, HasEachOptionOfTheTable) {
  CLI::App app;
  const auto commands = add_commands(app);
  const std::string help = Help(100).make_help(app.get_subcommand("optimise"), "", CLI::AppFormatMode::Normal);
  for (const OptionRow& row : option_rows())
    EXPECT_NE(help.find("\n  --" + dashed(std::string(row.field)) + " "), std::string::npos) << row.field;
}

TEST(Examples, BelongToCommands) {
  CLI::App app;
  const auto commands = add_commands(app);
  for (const Example& example : all_examples())
    EXPECT_NO_THROW(example.command.empty() ? &app : app.get_subcommand(std::string(example.command))) << example.line;
}

v1::Iteration iteration(int number, double seconds, double residual, v1::Phase phase = v1::PHASE_SWEEPS) {
  v1::Iteration made;
  made.set_number(number);
  made.set_seconds(seconds);
  made.set_residual(residual);
  made.set_phase(phase);
  return made;
}

TEST(Estimates, FollowTheResidualOfThePhase) {
  v1::Options options;
  options.set_tolerance(1e-6);
  Estimate estimate(options);
  for (int i = 1; i <= 4; ++i) {
    EXPECT_FALSE(i < 4 && estimate.seconds_left());
    estimate.add(iteration(i, i, std::pow(10.0, -i)));  // a decade a second
  }
  ASSERT_TRUE(estimate.seconds_left());
  EXPECT_NEAR(*estimate.seconds_left(), 2, 1e-9);
  estimate.add(iteration(5, 5, 1e-4, v1::PHASE_NEWTON));
  EXPECT_FALSE(estimate.seconds_left());
}

TEST(Estimates, SayNothingWhereStagesFollow) {
  v1::Options options;
  options.set_objective(v1::OBJECTIVE_WORST);
  Estimate estimate(options);
  for (int i = 1; i <= 8; ++i) estimate.add(iteration(i, i, std::pow(10.0, -i)));
  EXPECT_FALSE(estimate.seconds_left());
  options.set_time_limit(9);
  Estimate limited(options);
  for (int i = 1; i <= 8; ++i) limited.add(iteration(i, i, std::pow(10.0, -i)));
  EXPECT_NEAR(limited.seconds_left().value_or(-1), 1, 1e-9);
}

TEST(Estimates, KeepToTheLimits) {
  v1::Options options;
  options.set_max_iterations(10);
  Estimate standing(options);
  for (int i = 1; i <= 4; ++i) standing.add(iteration(i, 2.0 * i, 0.1));
  EXPECT_NEAR(standing.seconds_left().value_or(-1), 12, 1e-9);
  options.set_time_limit(9);
  Estimate limited(options);
  for (int i = 1; i <= 4; ++i) limited.add(iteration(i, 2.0 * i, 0.1));
  EXPECT_NEAR(limited.seconds_left().value_or(-1), 1, 1e-9);
}

}  // namespace
}  // namespace varimesh::client
