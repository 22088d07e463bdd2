// docs/options.md says of each option what the library's table says: its flag, its words, its default.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/cli/names.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

/// The row of the page's table that begins with flags, this one among them; empty if there is none.
std::string row_of(const std::string& flag) {
  std::ifstream page(VARIMESH_SOURCE_DIR "/docs/options.md");
  for (std::string line; std::getline(page, line);) {
    const std::string flags = line.substr(0, line.find('|', 1));
    if (line.starts_with("| `--") && flags.find("`" + flag + "`") != std::string::npos) return line;
  }
  return {};
}

TEST(OptionPage, HasARowForEachOptionOfTheTable) {
  for (const OptionInfo& option : option_table())
    EXPECT_NE(row_of("--" + dashed(std::string(option.name))), "") << option.name;
}

TEST(OptionPage, NamesEveryWordAndTheDefaultOfAChoice) {
  for (const OptionInfo& option : option_table()) {
    const auto* choice = std::get_if<ChoiceMember>(&option.member);
    if (choice == nullptr) continue;
    std::istringstream cells(row_of("--" + dashed(std::string(option.name))));
    std::string flag, values, usual;
    for (std::string* cell : {&flag, &flag, &values, &usual}) std::getline(cells, *cell, '|');
    for (const std::string_view word : choice->words)
      EXPECT_NE(values.find("`" + std::string(word) + "`"), std::string::npos) << option.name << ' ' << word;
    EXPECT_EQ(usual, " `" + default_text(option) + "` ") << option.name;
  }
}

TEST(OptionPage, NamesTheDefaultOfANumberUnlessItMeansNone) {
  for (const OptionInfo& option : option_table()) {
    const std::string usual = default_text(option);
    if (!is_number(option) || usual == "0") continue;
    const std::string row = row_of("--" + dashed(std::string(option.name)));
    EXPECT_NE(row.find(usual), std::string::npos) << option.name << ": " << row;
  }
}

}  // namespace
}  // namespace varimesh::client
