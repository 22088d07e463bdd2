// What the command says about a wrong command line.
#include "client/cli/refusals.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "client/commands/commands.h"

namespace varimesh::client {
namespace {

std::string refusal(const std::string& line) {
  CLI::App app;
  const auto commands = add_commands(app);
  try {
    app.parse(line);
  } catch (const CLI::ParseError& error) {
    return refusal_text(app, error);
  }
  return "";
}

TEST(Refusals, SayWhichNumberIsWanted) {
  EXPECT_EQ(refusal("optimise a.msh -o b.msh --tolerance abc"),
            "--tolerance is 'abc'; give a number: 1e-15 or more, such as 1e-3.");
  EXPECT_EQ(refusal("optimise a.msh -o b.msh --order 2.5"),
            "--order is '2.5'; give a whole number: 1 to 10, or 0 for the mesh's own order.");
}

TEST(Refusals, NameARangeInShortNumbers) {
  EXPECT_EQ(refusal("mesh a.step -o b.msh --order 3 --size 0"), "--size is 0; give a number above 0.");
  EXPECT_EQ(refusal("quality a.msh --lattice 1001"), "--lattice is 1001; give a number from 0 to 1000.");
}

TEST(Refusals, SayWhatIsMissing) {
  EXPECT_EQ(refusal(""), "a command is missing, such as 'varimesh optimise IN -o OUT'.");
  EXPECT_EQ(refusal("optimise"), "IN is missing: The mesh file to read; with --into, several.");
  EXPECT_TRUE(refusal("optimise a.msh").starts_with("--output is required; name the file")) << refusal("optimise a");
  EXPECT_EQ(refusal("optimise a.msh -o"), "--output has no value; write --output OUT.");
}

TEST(Refusals, SuggestAWordOrListAll) {
  EXPECT_EQ(refusal("optimise a.msh -o b.msh --geometry c.step --slide surface"),
            "--slide: there is no 'surface'; did you mean 'surfaces'? The choices are none, surfaces, all, coupled, "
            "auto.");
  EXPECT_EQ(refusal("optimise a.msh -o b.msh --geometry c.step --slide everything"),
            "--slide: there is no 'everything'; choose one of none, surfaces, all, coupled, auto.");
}

TEST(Refusals, TakeStandardInput) {
  for (const char* line : {"optimise - -o b.msh", "quality -", "quality ./-", "convert - b.msh"})
    EXPECT_EQ(refusal(line), "") << line;
}

TEST(Refusals, AskForAnOrderThatCanBeCurved) {
  EXPECT_NE(refusal("curve a.msh --geometry a.step -o b.msh --order 0").find("a number from 2 to 10"),
            std::string::npos);
  EXPECT_NE(refusal("mesh a.step --size 1 -o b.msh --order 12").find("a number from 2 to 10"), std::string::npos);
}

}  // namespace
}  // namespace varimesh::client
