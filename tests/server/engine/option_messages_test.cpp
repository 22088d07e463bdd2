// The message of the contract has the fields of the library's table, and options come through it unchanged.
#include "server/engine/option_messages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>

#include "core/options/option_table.h"

namespace varimesh::server {
namespace {

using google::protobuf::FieldDescriptor;

/// "GREEN_LAGRANGE" of STRAIN_GREEN_LAGRANGE, in small letters with dashes.
std::string spelled(const google::protobuf::EnumValueDescriptor& value) {
  // The prefix of all values of a type is that of its first one.
  const std::size_t prefix = value.type()->value(0)->name().size() - std::string_view("UNSPECIFIED").size();
  std::string name = value.name().substr(prefix);
  for (char& c : name) c = c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

TEST(OptionMessages, HaveAFieldForEachOptionAndNoOther) {
  const auto* message = v1::Options::descriptor();
  for (const OptionInfo& option : option_table())
    EXPECT_NE(message->FindFieldByName(std::string(option.name)), nullptr) << option.name;
  for (int i = 0; i < message->field_count(); ++i)
    EXPECT_EQ(std::count_if(option_table().begin(), option_table().end(),
                            [&](const OptionInfo& option) { return option.name == message->field(i)->name(); }),
              1)
        << message->field(i)->name();
}

TEST(OptionMessages, HaveTheWordsOfEachChoiceInTheSameOrder) {
  for (const OptionInfo& option : option_table()) {
    const auto* choice = std::get_if<ChoiceMember>(&option.member);
    if (choice == nullptr) continue;
    const auto* type = v1::Options::descriptor()->FindFieldByName(std::string(option.name))->enum_type();
    ASSERT_EQ(static_cast<std::size_t>(type->value_count()), choice->words.size() + 1) << option.name;
    for (std::size_t i = 0; i < choice->words.size(); ++i)
      EXPECT_EQ(spelled(*type->FindValueByNumber(static_cast<int>(i) + 1)), choice->words[i]) << option.name;
  }
}

TEST(OptionMessages, HaveTheFieldsAndWordsOfAGeometry) {
  const auto* message = v1::Geometry::descriptor();
  for (const GeometryOption& option : geometry_option_table()) {
    const auto* field = message->FindFieldByName(std::string(option.name));
    ASSERT_NE(field, nullptr) << option.name;
    const auto* choice = std::get_if<ChoiceOf<GeometryOptions>>(&option.member);
    if (choice == nullptr) continue;
    ASSERT_EQ(static_cast<std::size_t>(field->enum_type()->value_count()), choice->words.size() + 1) << option.name;
    for (int i = 1; i < field->enum_type()->value_count(); ++i) {
      std::string word(choice->words[static_cast<std::size_t>(i) - 1]);
      for (char& letter : word) letter = testing::internal::ToUpper(letter);
      EXPECT_TRUE(field->enum_type()->FindValueByNumber(i)->name().ends_with(word)) << option.name;
    }
  }
  // Beside the options there is only the digest.
  EXPECT_EQ(static_cast<std::size_t>(message->field_count()), geometry_option_table().size() + 1);
}

TEST(OptionMessages, BringAGeometryThrough) {
  const auto defaults = options_from(v1::Geometry());
  ASSERT_TRUE(defaults);
  EXPECT_EQ(defaults->slide, SlideOn::Auto);
  EXPECT_EQ(defaults->slide_on, GeometrySource::Model);
  v1::Geometry message;
  message.set_slide(v1::Geometry::SLIDE_COUPLED);
  message.set_slide_on(v1::Geometry::SLIDE_ON_BOUNDARY);
  message.set_tolerance(0.25);
  message.set_smooth_angle(5);
  message.set_snap(true);
  message.set_order(3);
  const auto options = options_from(message);
  ASSERT_TRUE(options);
  EXPECT_EQ(options->slide, SlideOn::Coupled);
  EXPECT_TRUE(options->on_boundary());
  EXPECT_EQ(options->tolerance, 0.25);
  EXPECT_EQ(options->smooth_angle, 5);
  EXPECT_TRUE(options->snap);
  EXPECT_EQ(options->order, 3);
  message.set_slide(static_cast<v1::Geometry::Slide>(99));
  EXPECT_EQ(options_from(message).error().metadata.at("option"), "slide");
}

TEST(OptionMessages, HaveTheFieldsOfLayersAndBringThemThrough) {
  const auto* descriptor = v1::Layers::descriptor();
  for (const LayerOption& option : layer_option_table())
    EXPECT_NE(descriptor->FindFieldByName(std::string(option.name)), nullptr) << option.name;
  EXPECT_EQ(static_cast<std::size_t>(descriptor->field_count()), layer_option_table().size());
  const auto defaults = options_from(v1::Layers());
  ASSERT_TRUE(defaults);
  EXPECT_EQ(defaults->rows, 1);
  EXPECT_EQ(defaults->spacing, LayerSpacing::Graded);
  v1::Layers message;
  message.add_walls("wing");
  message.add_walls("7");
  message.set_layers(9);
  message.set_first(0.25);
  message.set_growth(1.5);
  message.add_heights(0.1);
  message.add_heights(0.2);
  message.set_rows(2);
  message.set_spacing(v1::LAYER_SPACING_EVEN);
  message.set_simplices(true);
  const auto options = options_from(message);
  ASSERT_TRUE(options);
  EXPECT_EQ(options->walls, (std::vector<std::string>{"wing", "7"}));
  EXPECT_EQ(options->layers, 9);
  EXPECT_EQ(options->first, 0.25);
  EXPECT_EQ(options->growth, 1.5);
  EXPECT_EQ(options->heights, (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(options->rows, 2);
  EXPECT_EQ(options->spacing, LayerSpacing::Even);
  EXPECT_TRUE(options->simplices);
  message.set_spacing(static_cast<v1::LayerSpacing>(99));
  EXPECT_EQ(options_from(message).error().metadata.at("option"), "spacing");
}

TEST(OptionMessages, LeaveTheDefaultsOfTheLibraryWhereNothingIsSaid) {
  const auto options = options_from(v1::Options());
  ASSERT_TRUE(options);
  const Options defaults;
  EXPECT_EQ(to_proto(*options).SerializeAsString(), to_proto(defaults).SerializeAsString());
  EXPECT_EQ(options->tolerance, defaults.tolerance);
  EXPECT_EQ(options->max_iterations, defaults.max_iterations);
  EXPECT_EQ(options->rings, defaults.rings);
  EXPECT_EQ(options->active_set, defaults.active_set);
}

TEST(OptionMessages, BringEveryOptionThroughUnchanged) {
  Options options;
  for (const OptionInfo& option : option_table()) {
    if (const auto* member = std::get_if<double Options::*>(&option.member)) options.*(*member) = 0.25;
    if (const auto* member = std::get_if<int Options::*>(&option.member)) options.*(*member) = 7;
    if (const auto* member = std::get_if<bool Options::*>(&option.member)) options.*(*member) = false;
    if (const auto* member = std::get_if<ChoiceMember>(&option.member))
      member->set(options, static_cast<int>(member->words.size()) - 1);
    if (const auto* member = std::get_if<std::vector<std::string> Options::*>(&option.member))
      options.*(*member) = {"wall", "3:7"};
    if (const auto* member = std::get_if<std::vector<std::int64_t> Options::*>(&option.member))
      options.*(*member) = {5, std::int64_t{1} << 40};
  }
  options.objective = Objective::Accuracy;  // auto becomes energy if options of the energy are named
  options.target_field = {Per::Vertex, 3, {1, 2}, {.1, .2, .3, .4, .5, .6}};
  const v1::Options message = to_proto(options);
  const auto back = options_from(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(to_proto(*back).SerializeAsString(), message.SerializeAsString());
  for (const OptionInfo& option : option_table()) {
    if (const auto* member = std::get_if<double Options::*>(&option.member)) {
      EXPECT_EQ((*back).*(*member), 0.25) << option.name;
    }
    if (const auto* member = std::get_if<int Options::*>(&option.member)) {
      EXPECT_EQ((*back).*(*member), 7) << option.name;
    }
    if (const auto* member = std::get_if<ChoiceMember>(&option.member)) {
      EXPECT_EQ(member->get(*back), member->get(options)) << option.name;
    }
  }
  EXPECT_FALSE(back->active_set);
  EXPECT_EQ(back->fix, options.fix);
  EXPECT_EQ(back->fix_nodes, options.fix_nodes);
  EXPECT_EQ(back->target_field.values, options.target_field.values);
  EXPECT_EQ(back->target_field.per, Per::Vertex);
}

TEST(OptionMessages, AskForTheEnergyIfAnOptionOfItIsNamed) {
  v1::Options message;
  EXPECT_EQ(options_from(message)->objective, Objective::Auto);
  message.set_until(v1::UNTIL_VALID);
  message.set_min_js(0.3);
  EXPECT_EQ(options_from(message)->objective, Objective::Auto);
  for (const v1::Objective objective : {v1::OBJECTIVE_UNSPECIFIED, v1::OBJECTIVE_AUTO}) {
    v1::Options named;
    named.set_objective(objective);
    named.set_energy(v1::ENERGY_HYPERELASTIC);  // with its default, too
    EXPECT_EQ(options_from(named)->objective, Objective::Energy);
    named.clear_energy();
    named.set_tolerance(1e-3);
    EXPECT_EQ(options_from(named)->objective, Objective::Energy);
    named.clear_tolerance();
    EXPECT_EQ(options_from(named)->objective, Objective::Auto);
  }
  message.set_energy(v1::ENERGY_HYPERELASTIC);
  message.set_objective(v1::OBJECTIVE_ACCURACY);
  EXPECT_EQ(options_from(message)->objective, Objective::Accuracy);
}

TEST(OptionMessages, RefuseAnEnumValueThatThisServerDoesNotKnow) {
  for (const OptionInfo& option : option_table()) {
    if (!std::holds_alternative<ChoiceMember>(option.member)) continue;
    v1::Options message;
    v1::Options::GetReflection()->SetEnumValue(
        &message, v1::Options::descriptor()->FindFieldByName(std::string(option.name)), 99);
    const auto options = options_from(message);
    ASSERT_FALSE(options) << option.name;
    EXPECT_NE(options.error().sentence.find(std::string(option.name)), std::string::npos);
  }
  v1::Options message;
  message.mutable_target_field()->set_per(static_cast<v1::Per>(99));
  const auto options = options_from(message);
  ASSERT_FALSE(options);
  EXPECT_EQ(options.error().reason, "BAD_OPTION");
  EXPECT_EQ(options.error().metadata.at("option"), "target_field.per");
}

}  // namespace
}  // namespace varimesh::server
