// Conversion between the library's structs and the contract's messages.
#include "server/engine/translate.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

TEST(Translate, PreservesOptions) {
  Options options;
  options.energy = Energy::Distortion;
  options.strain = Strain::Small;
  options.winslow = Winslow::Paper;
  options.method = Method::Newton;
  options.target = Target::Size;
  options.until = Until::Valid;
  options.repair = Repair::Split;
  options.objective = Objective::Worst;
  options.mu = 2;
  options.tolerance = 1e-5;
  options.max_iterations = 0;
  options.threads = 3;
  options.target_field = {Per::Vertex, 1, {4, 5}, {0.5, 0.25}};
  options.fix = {"wall"};
  options.free_nodes = {7};
  options.rings = 9;
  options.active_set = false;
  options.until_js = 0.3;
  options.time_limit = 12;
  const auto back = options_from(to_proto(options));
  ASSERT_TRUE(back) << back.error().sentence;
  EXPECT_EQ(to_proto(*back).SerializeAsString(), to_proto(options).SerializeAsString());
  EXPECT_EQ(back->method, Method::Newton);
  EXPECT_EQ(back->max_iterations, 0);
  EXPECT_EQ(back->target_field.values, options.target_field.values);
  EXPECT_FALSE(back->active_set);
}

TEST(Translate, TakesDefaultsFromAnEmptyMessage) {
  const auto options = options_from(v1::Options());
  ASSERT_TRUE(options);
  EXPECT_EQ(to_proto(*options).SerializeAsString(), to_proto(Options()).SerializeAsString());
}

TEST(Translate, RefusesAValueThatThisServerDoesNotKnow) {
  v1::Options message;
  message.set_repair(static_cast<v1::Repair>(99));
  const auto options = options_from(message);
  ASSERT_FALSE(options);
  EXPECT_EQ(options.error().reason, "BAD_OPTION");
  EXPECT_EQ(options.error().metadata.at("option"), "repair");
}

TEST(Translate, LimitsTheLengthOfLists) {
  QualityReport report;
  report.invalid.resize(kMaxInvalidNamed + 5);
  report.invalid_elements = kMaxInvalidNamed + 5;
  const v1::QualityReport message = to_proto(report);
  EXPECT_EQ(message.invalid_size(), kMaxInvalidNamed);
  EXPECT_EQ(message.invalid_elements(), kMaxInvalidNamed + 5);
}

TEST(Translate, ConvertsMessagesToUtf8) {
  const v1::JobError error = to_proto(Error{Error::Kind::BadInput,
                                            "The group 'Fl\xe4"
                                            "che' is unknown."});
  EXPECT_EQ(error.reason(), "BAD_INPUT");
  EXPECT_EQ(error.message().find('\xe4'), std::string::npos);
  EXPECT_NE(error.message().find("Fl"), std::string::npos);
}

TEST(Translate, KnowsEveryFileFormat) {
  for (int value = v1::MESH_FORMAT_MSH22; v1::MeshFormat_IsValid(value); ++value) {
    const auto format = static_cast<v1::MeshFormat>(value);
    if (format != v1::MESH_FORMAT_PARTS) {
      EXPECT_EQ(to_proto(format_from(format)), format);
    }
  }
}

}  // namespace
}  // namespace varimesh::server
