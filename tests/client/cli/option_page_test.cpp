// docs/options.md says of each option what the library's table says: its flag, its words, its default.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/cli/names.h"
#include "client/cli/option_flags.h"
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

template <class Of>
void expect_rows(std::span<const OptionOf<Of>> table) {
  for (const OptionOf<Of>& option : table) EXPECT_NE(row_of(flag_of(option)), "") << option.name;
}

TEST(OptionPage, HasARowForEachOptionOfTheTables) {
  expect_rows(option_table());
  expect_rows(geometry_option_table());
  expect_rows(layer_option_table());
}

template <class Of>
void expect_words(std::span<const OptionOf<Of>> table) {
  for (const OptionOf<Of>& option : table) {
    const auto* choice = std::get_if<ChoiceOf<Of>>(&option.member);
    if (choice == nullptr) continue;
    std::istringstream cells(row_of(flag_of(option)));
    std::string flag, values, usual;
    for (std::string* cell : {&flag, &flag, &values, &usual}) std::getline(cells, *cell, '|');
    for (const std::string_view word : choice->words)
      EXPECT_NE(values.find("`" + std::string(word) + "`"), std::string::npos) << option.name << ' ' << word;
    EXPECT_EQ(usual, " `" + default_text(option) + "` ") << option.name;
  }
}

TEST(OptionPage, NamesEveryWordAndTheDefaultOfAChoice) {
  expect_words(option_table());
  expect_words(geometry_option_table());
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
