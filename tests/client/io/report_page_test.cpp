#include "client/io/report_page.h"

#include <gtest/gtest.h>

#include "client/cli/names.h"
#include "core/formats/formats.h"

namespace varimesh::client {
namespace {

TEST(ReportPage, AddsTheFormatOfTheInputToFormatsThatAreOnlyWritten) {
  std::size_t only_read = 0;
  for (const formats::FormatInfo& info : formats::all()) {
    if (!info.writable) {  // nobody can ask for it
      ++only_read;
      continue;
    }
    const auto* value = value_of(*v1::MeshFormat_descriptor(), std::string(info.name));
    ASSERT_NE(value, nullptr) << info.name;
    if (info.readable && formats::needs_hdf5(info.format) && !formats::has_hdf5()) continue;
    const std::vector asked{static_cast<v1::MeshFormat>(value->number())};
    std::vector expected = asked;
    if (!info.readable) expected.push_back(v1::MESH_FORMAT_UNSPECIFIED);
    EXPECT_EQ(formats_with_report(asked, "report.html"), expected) << info.name;
    EXPECT_EQ(formats_with_report(asked, ""), asked) << info.name;
  }
  EXPECT_EQ(only_read, 4U) << "Abaqus, Exodus, GMF and ISM";
}

}  // namespace
}  // namespace varimesh::client
