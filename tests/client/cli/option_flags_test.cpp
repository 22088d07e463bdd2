#include "client/cli/option_flags.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

TEST(OptionFlags, ThereIsOneForEachOptionOfTheTableAndNoOther) {
  CLI::App app;
  v1::Options options;
  add_options(app, &options);
  for (const OptionInfo& option : option_table()) {
    std::string flag = "--" + std::string(option.name);
    std::replace(flag.begin(), flag.end(), '_', '-');
    const CLI::Option* found = app.get_option_no_throw(flag);
    ASSERT_NE(found, nullptr) << flag;
    EXPECT_TRUE(found->get_description().starts_with(option.help)) << flag;
    const std::string usual = default_text(option);
    const bool says_default = found->get_description().ends_with("default " + usual);
    EXPECT_EQ(says_default, !usual.empty() && usual != "0") << flag;
  }
  EXPECT_EQ(app.get_options().size(), option_table().size() + 1);  // and --help
}

TEST(OptionFlags, ThereIsOneForEachOptionOfAGeometryButTheOrder) {
  CLI::App app;
  v1::Geometry geometry;
  add_geometry_options(app, &geometry, true);
  for (const GeometryOption& option : geometry_option_table())
    EXPECT_EQ(app.get_option_no_throw(flag_of(option)) == nullptr, option.name == "order") << option.name;
  app.parse("--slide coupled --geometry-tolerance 0.5 --snap --slide-on boundary");
  EXPECT_EQ(geometry.slide(), v1::Geometry::SLIDE_COUPLED);
  EXPECT_EQ(geometry.tolerance(), 0.5);
  EXPECT_TRUE(geometry.snap());
  EXPECT_EQ(geometry.slide_on(), v1::Geometry::SLIDE_ON_BOUNDARY);
  EXPECT_EQ(geometry.smooth_angle(), 0);
  EXPECT_FALSE(geometry.has_growth());
}

TEST(OptionFlags, ThereIsOneForEachOptionOfLayers) {
  CLI::App app;
  v1::Layers layers;
  add_layer_options(app, &layers, true);
  for (const LayerOption& option : layer_option_table())
    EXPECT_NE(app.get_option_no_throw(flag_of(option)), nullptr) << option.name;
  app.parse("--wall wing --wall 7 --heights 1e-5,2e-5 --heights 4e-5 --rows 2 --simplices --layer-spacing even");
  EXPECT_EQ(std::vector<std::string>(layers.walls().begin(), layers.walls().end()),
            (std::vector<std::string>{"wing", "7"}));
  EXPECT_EQ(std::vector<double>(layers.heights().begin(), layers.heights().end()),
            (std::vector<double>{1e-5, 2e-5, 4e-5}));
  EXPECT_EQ(layers.rows(), 2);
  EXPECT_TRUE(layers.simplices());
  EXPECT_EQ(layers.spacing(), v1::LAYER_SPACING_EVEN);
  EXPECT_EQ(layers.first(), 0);
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

TEST(OptionFlags, AnOppositeSwitchesOffAndNeitherTakesAValue) {
  for (const auto& [flags, orient] :
       {std::pair{"--orient --rings 1", true}, std::pair{"--keep-orientation", false}, std::pair{"--rings 1", false}}) {
    CLI::App app;
    v1::Options options;
    add_options(app, &options);
    app.parse(flags);
    EXPECT_EQ(options.orient(), orient) << flags;
  }
}

}  // namespace
}  // namespace varimesh::client
