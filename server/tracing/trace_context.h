// The trace that a call or a job is part of (W3C Trace Context, level 1).
#pragma once

#include <string>
#include <string_view>

namespace varimesh::server {

/// A place in a trace.
struct TraceContext {
  std::string trace_id = {};  ///< 32 hexadecimal digits in lower case. Empty: there is no trace.
  std::string span_id = {};   ///< Of the span at this place: 16 such digits. Empty: it is not known.
  bool is_sampled = false;    ///< Whether the spans of the trace are to be recorded.

  /// The header "traceparent" of this place; the trace id alone if the span is not known.
  std::string header() const;
};

/// Reads a header "traceparent" (VERSION-TRACE-SPAN-FLAGS in lower case), or a trace id alone. There is no trace in
/// anything else.
TraceContext trace_context(std::string_view header);

/// Returns the place of a new span below this one. Without a trace it begins one, which is sampled.
TraceContext child_of(const TraceContext& parent);

}  // namespace varimesh::server
