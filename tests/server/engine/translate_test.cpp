// Conversion between the library's structs and the contract's messages.
#include "server/engine/translate.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

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

TEST(Translate, SaysForEveryRemedyWhatToDoInTheWordsOfTheContract) {
  const auto* kinds = v1::Remedy::Kind_descriptor();
  WhatIsLeft left;
  for (int i = 0; i + 1 < kinds->value_count(); ++i)
    left.remedies.push_back({static_cast<Remedy::Kind>(i), 2, "it helps.", 3});
  const v1::WhatIsLeft message = to_proto(left);
  for (int i = 0; i < message.remedies_size(); ++i) {
    const v1::Remedy& remedy = message.remedies(i);
    EXPECT_EQ(static_cast<int>(remedy.kind()), kinds->value(i + 1)->number());
    EXPECT_EQ(remedy.elements(), 2);
    EXPECT_EQ(remedy.order(), 3);
    EXPECT_GT(remedy.sentence().size(), std::string(": it helps.").size()) << kinds->value(i + 1)->name();
    EXPECT_TRUE(remedy.sentence().ends_with(": it helps.")) << remedy.sentence();
    EXPECT_EQ(remedy.sentence().find("--"), std::string::npos) << remedy.sentence();
  }
}

TEST(Translate, KnowsEveryFileFormat) {
  for (int value = v1::MESH_FORMAT_MSH22; v1::MeshFormat_IsValid(value); ++value) {
    const auto format = static_cast<v1::MeshFormat>(value);
    if (format != v1::MESH_FORMAT_PARTS && format != v1::MESH_FORMAT_CELL_QUALITY) {
      EXPECT_EQ(to_proto(format_from(format)), format);
    }
  }
}

}  // namespace
}  // namespace varimesh::server
