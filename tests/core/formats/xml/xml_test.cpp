// How long it takes to walk through XML, and how it is stopped.
#include "core/formats/xml/xml.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/formats/common/file_allowance.h"
#include "tests/core/support/processor_seconds.h"

namespace varimesh::formats {
namespace {

/// Remembers the last element and the longest attribute.
class Visitor : public XmlVisitor {
 public:
  bool begins(const XmlElement& element) override {
    ++elements;
    if (!element.attributes.empty()) longest = std::max(longest, element.attributes[0].second.size());
    return true;
  }
  void ends(std::string_view name, XmlText text) override { last = {std::string(name), text}; }

  int elements = 0;
  std::size_t longest = 0;
  std::pair<std::string, XmlText> last;
};

TEST(Xml, HasTagsAndCommentsOfAnyLengthAndKnowsWhereTextIs) {
  for (const std::size_t size : {std::size_t(1), std::size_t(65'530), std::size_t(200'000), std::size_t(3'000'000)}) {
    const std::string filler(size, 'x');
    const std::string xml = "<?xml version='1.0'?><!--" + filler + "--><a><!--" + filler + "--><b c='" + filler +
                            "'/><?p " + filler + "?><d>" + filler + "</d></a>";
    Visitor visitor;
    walk_xml(xml, visitor, FileAllowance(xml.size()));
    EXPECT_EQ(visitor.elements, 3);
    EXPECT_EQ(visitor.longest, size);
    EXPECT_EQ(visitor.last.first, "a");
    EXPECT_EQ(visitor.last.second.begin, xml.size() - 4);
    const std::string plain = without_comments(xml, "d", FileAllowance(xml.size()));
    EXPECT_EQ(plain.size(), xml.size());
    EXPECT_EQ(plain.find("<!--"), std::string::npos);
  }
}

TEST(Xml, TakesTimeThatGrowsWithTheLengthOfATagAndNotWithItsSquare) {
  const auto time = [](std::size_t size) {
    const std::string filler(size, 'x'), tag = "<a b='" + filler + "'/>", comment = "<!--" + filler + "--><a/>";
    const FileAllowance allowance(size);
    return std::pair(testing::processor_seconds([&] {
                       Visitor visitor;
                       walk_xml(tag, visitor, allowance);
                     }),
                     testing::processor_seconds([&] { without_comments(comment, "b", allowance); }));
  };
  const auto [tag, comment] = time(std::size_t(4) << 20);
  const auto [long_tag, long_comment] = time(std::size_t(32) << 20);
  EXPECT_LT(long_tag, 24 * tag) << "8 times the length; its square takes 64 times as long";
  EXPECT_LT(long_comment, 24 * comment);
}

TEST(Xml, IsNotReadOnIfReadingIsToStop) {
  int looks = 0;
  const StopToken stop([&] { return ++looks > 3; });
  const std::string xml = "<a b='" + std::string(std::size_t(4) << 20, 'x') + "'/>";
  const FileAllowance allowance(xml.size(), &stop);
  Visitor visitor;
  EXPECT_THROW(walk_xml(xml, visitor, allowance), Interrupted);
  EXPECT_EQ(visitor.elements, 0);
  const std::string comment = "<!--" + xml + "-->";
  EXPECT_THROW(without_comments(comment, "b", allowance), Interrupted);
}

}  // namespace
}  // namespace varimesh::formats
