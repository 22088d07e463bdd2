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
