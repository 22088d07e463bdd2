// What a part of the work took, for a trace.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "server/tracing/trace_context.h"

namespace varimesh::server {

using SpanTime = std::chrono::system_clock::time_point;

/// A part of the work that has ended.
struct Span {
  /// Server: it answers a call. Internal: everything else.
  enum class Kind { Internal, Server };
  using Value = std::variant<std::string, std::int64_t>;

  TraceContext context;
  std::string parent;  ///< The id of the span around it. Empty: it is the first one of the trace.
  std::string name;
  Kind kind = Kind::Internal;
  SpanTime begin{}, end{};
  std::vector<std::pair<std::string, Value>> attributes = {};
  std::string error = {};  ///< Empty: it has succeeded.
};

/// Takes spans, from any thread, without waiting. It is empty if the server sends no traces.
using SpanSink = std::function<void(Span)>;

/// A span that has begun. It ends with end(), or when it is destroyed. If nobody wants it, or its trace is not sampled,
/// it only passes its parent on.
class OpenSpan {
 public:
  /// Begins at `begin` below `parent`. `sink` outlives this object.
  OpenSpan(const SpanSink& sink, std::string name, const TraceContext& parent, SpanTime begin,
           Span::Kind kind = Span::Kind::Internal)
      : sink_(sink),
        is_wanted_(sink != nullptr && (parent.trace_id.empty() || parent.is_sampled)),
        span_{is_wanted_ ? child_of(parent) : parent, parent.span_id, std::move(name), kind, begin} {}
  ~OpenSpan() { end(std::chrono::system_clock::now()); }
  OpenSpan(const OpenSpan&) = delete;
  OpenSpan& operator=(const OpenSpan&) = delete;

  /// The place of this span, or that of its parent if it is not recorded.
  const TraceContext& context() const { return span_.context; }
  void set(std::string name, Span::Value value) {
    if (is_wanted_) span_.attributes.emplace_back(std::move(name), std::move(value));
  }
  void fail(std::string why) { span_.error = std::move(why); }
  void end(SpanTime when) {
    if (!std::exchange(is_wanted_, false)) return;
    span_.end = when;
    sink_(std::move(span_));
  }

 private:
  const SpanSink& sink_;
  bool is_wanted_;
  Span span_;
};

}  // namespace varimesh::server
