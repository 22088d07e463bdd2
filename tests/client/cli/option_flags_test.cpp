#include "client/cli/option_flags.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "client/cli/options_table.h"

namespace varimesh::client {
namespace {

TEST(OptionsTable, HasOneRowForEachFieldOfTheMessage) {
  const auto* options = v1::Options::descriptor();
  EXPECT_EQ(static_cast<std::size_t>(options->field_count()), option_rows().size());
  for (int i = 0; i < options->field_count(); ++i)
    EXPECT_EQ(std::count_if(option_rows().begin(), option_rows().end(),
                            [&](const OptionRow& row) { return row.field == options->field(i)->name(); }),
              1)
        << options->field(i)->name();
}

TEST(OptionFlags, SetOnlyTheFieldsThatAreGiven) {
  CLI::App app;
  v1::Options options;
  add_options(app, &options);
  app.parse("--energy linear-elastic --strain small --tolerance 1e-3 --max-iterations 0 --quadrature-degree 9");
  EXPECT_EQ(options.energy(), v1::ENERGY_LINEAR_ELASTIC);
  EXPECT_EQ(options.strain(), v1::STRAIN_SMALL);
  EXPECT_DOUBLE_EQ(options.tolerance(), 1e-3);
  EXPECT_TRUE(options.has_max_iterations());
  EXPECT_EQ(options.max_iterations(), 0);
  EXPECT_EQ(options.quadrature_degree(), 9);
  EXPECT_EQ(options.method(), v1::METHOD_UNSPECIFIED);
}

TEST(OptionFlags, AnUnknownValueIsAnsweredWithTheChoices) {
  CLI::App app;
  v1::Options options;
  add_options(app, &options);
  try {
    app.parse("--energy elastic");
    FAIL();
  } catch (const CLI::ParseError& error) {
    EXPECT_NE(std::string(error.what()).find("linear-elastic"), std::string::npos) << error.what();
  }
}

TEST(OptionFlags, ListsAreSeparatedByCommasOrRepeated) {
  CLI::App app;
  v1::Options options;
  add_options(app, &options);
  app.parse("--fix-nodes 3,5 --fix-nodes 8 --fix wall --fix 2:7");
  EXPECT_EQ(std::vector<std::int64_t>(options.fix_nodes().begin(), options.fix_nodes().end()),
            (std::vector<std::int64_t>{3, 5, 8}));
  EXPECT_EQ(std::vector<std::string>(options.fix().begin(), options.fix().end()),
            (std::vector<std::string>{"wall", "2:7"}));
}

TEST(OptionFlags, SwitchesAreOnOrOff) {
  CLI::App app;
  v1::Options options;
  add_options(app, &options);
  app.parse("--active-set off");
  EXPECT_TRUE(options.has_active_set());
  EXPECT_FALSE(options.active_set());
  EXPECT_THROW(app.parse("--active-set maybe"), CLI::ParseError);
}

}  // namespace
}  // namespace varimesh::client
