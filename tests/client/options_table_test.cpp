// The flags of an optimisation are those of the message, and set it.
#include "client/command/options_table.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "client/command/names.h"

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

TEST(OptionsTable, SetsTheFieldsThatAreGivenAndNoOthers) {
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

TEST(OptionsTable, NamesTheChoicesWhereAValueIsUnknown) {
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

TEST(Names, SpellEnumsAsTheContractSays) {
  EXPECT_EQ(spelled(v1::ENERGY_LINEAR_ELASTIC), "linear-elastic");
  EXPECT_EQ(spelled(v1::STRAIN_GREEN_LAGRANGE), "green-lagrange");
  EXPECT_EQ(spellings(*v1::Winslow_descriptor()), (std::vector<std::string>{"true", "paper"}));
}

}  // namespace
}  // namespace varimesh::client
