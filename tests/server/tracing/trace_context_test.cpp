// Places in traces.
#include "server/tracing/trace_context.h"

#include <gtest/gtest.h>

#include "server/tracing/spans.h"

namespace varimesh::server::testing {
namespace {

const std::string kTrace = "4bf92f3577b34da6a3ce929d0e0e4736", kSpan = "00f067aa0ba902b7";
const std::string kHeader = "00-" + kTrace + "-" + kSpan + "-01";

TEST(Trace, IsReadFromATraceparent) {
  const TraceContext read = trace_context(kHeader);
  EXPECT_EQ(read.trace_id, kTrace);
  EXPECT_EQ(read.span_id, kSpan);
  EXPECT_TRUE(read.is_sampled);
  EXPECT_EQ(read.header(), kHeader);
  EXPECT_EQ(trace_context("cc-" + kTrace + "-" + kSpan + "-03-of a later version").trace_id, kTrace);
  EXPECT_FALSE(trace_context("00-" + kTrace + "-" + kSpan + "-fe").is_sampled);
}

TEST(Trace, IsReadFromItsIdAlone) {
  EXPECT_EQ(trace_context(kTrace).trace_id, kTrace);
  EXPECT_EQ(trace_context(kTrace).header(), kTrace);
}

TEST(Trace, IsNotReadFromAnythingElse) {
  for (const std::string& wrong :
       {std::string(), std::string("00"), kHeader.substr(1), kHeader + "0", kHeader + "-more", "ff" + kHeader.substr(2),
        "00-" + std::string(32, '0') + "-" + kSpan + "-01", "00-" + kTrace + "-" + std::string(16, '0') + "-01",
        "00-4BF92F3577B34DA6A3CE929D0E0E4736-" + kSpan + "-01", "00_" + kHeader.substr(3), "0\n-" + kHeader.substr(3),
        kHeader.substr(0, 54) + "g", std::string(32, '0')})
    EXPECT_EQ(trace_context(wrong).trace_id, "") << wrong;
}

TEST(Trace, HasSpansBelowEachOther) {
  const TraceContext root = child_of({}), child = child_of(root);
  EXPECT_EQ(trace_context(root.header()).trace_id, root.trace_id) << "the new ids are well-formed";
  EXPECT_TRUE(root.is_sampled);
  EXPECT_EQ(child.trace_id, root.trace_id);
  EXPECT_NE(child.span_id, root.span_id);
  EXPECT_NE(child_of({}).trace_id, root.trace_id);
}

TEST(OpenSpan, EndsOnceAndIsBelowItsParent) {
  std::vector<Span> ended;
  const SpanSink sink = [&](Span span) { ended.push_back(std::move(span)); };
  const TraceContext parent = trace_context(kHeader);
  {
    OpenSpan span(sink, "run", parent, SpanTime(std::chrono::seconds(1)));
    span.set("attempt", std::int64_t{2});
    span.fail("it broke");
    span.end(SpanTime(std::chrono::seconds(3)));
    span.end(SpanTime(std::chrono::seconds(4)));
  }
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].parent, kSpan);
  EXPECT_EQ(ended[0].context.trace_id, kTrace);
  EXPECT_NE(ended[0].context.span_id, kSpan);
  EXPECT_EQ(ended[0].end, SpanTime(std::chrono::seconds(3)));
  EXPECT_EQ(ended[0].error, "it broke");
}

TEST(OpenSpan, OnlyPassesOnATraceThatNobodyRecords) {
  std::vector<Span> ended;
  const SpanSink sink = [&](Span span) { ended.push_back(std::move(span)); }, nobody;
  const TraceContext unsampled = trace_context("00-" + kTrace + "-" + kSpan + "-00"), sampled = trace_context(kHeader);
  EXPECT_EQ(OpenSpan(sink, "run", unsampled, {}).context().header(), unsampled.header());
  EXPECT_EQ(OpenSpan(nobody, "run", sampled, {}).context().header(), kHeader);
  EXPECT_EQ(OpenSpan(nobody, "run", {}, {}).context().header(), "");
  EXPECT_TRUE(ended.empty());
}

}  // namespace
}  // namespace varimesh::server::testing
