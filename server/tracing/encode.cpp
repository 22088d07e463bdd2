#include "server/tracing/encode.h"

#include <chrono>
#include <type_traits>

#include "core/base/version.h"
#include "server/tracing/otlp.pb.h"

namespace varimesh::server {
namespace {

std::string bytes_of(const std::string& digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return bytes;
}

std::uint64_t nanoseconds(SpanTime time) {
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count());
}

void add(const Span& span, otlp::Span* to) {
  to->set_trace_id(bytes_of(span.context.trace_id));
  to->set_span_id(bytes_of(span.context.span_id));
  to->set_parent_span_id(bytes_of(span.parent));
  to->set_name(span.name);
  to->set_kind(span.kind == Span::Kind::Server ? otlp::SPAN_KIND_SERVER : otlp::SPAN_KIND_INTERNAL);
  to->set_start_time_unix_nano(nanoseconds(span.begin));
  to->set_end_time_unix_nano(nanoseconds(span.end));
  for (const auto& [key, value] : span.attributes) {
    otlp::Attribute& attribute = *to->add_attributes();
    attribute.set_key(key);
    if (const auto* number = std::get_if<std::int64_t>(&value))
      attribute.mutable_value()->set_int_value(*number);
    else
      attribute.mutable_value()->set_string_value(std::get<std::string>(value));
  }
  if (span.error.empty()) return;
  to->mutable_status()->set_code(otlp::STATUS_CODE_ERROR);
  to->mutable_status()->set_message(span.error);
}

}  // namespace

std::string encode_spans(const std::vector<std::pair<std::string, std::string>>& resource,
                         const std::vector<Span>& spans) {
  otlp::TraceRequest request;
  otlp::ResourceSpans& all = *request.add_resource_spans();
  for (const auto& [key, value] : resource) {
    otlp::Attribute& attribute = *all.mutable_resource()->add_attributes();
    attribute.set_key(key);
    attribute.mutable_value()->set_string_value(value);
  }
  otlp::ScopeSpans& scope = *all.add_scope_spans();
  scope.mutable_scope()->set_name("varimesh");
  scope.mutable_scope()->set_version(std::string(version()));
  for (const Span& span : spans) add(span, scope.add_spans());
  return request.SerializeAsString();
}

std::string rejection_in(const std::string& answer) {
  otlp::TraceResponse response;
  if (!response.ParseFromString(answer) || response.partial_success().rejected_spans() == 0) return {};
  return std::to_string(response.partial_success().rejected_spans()) +
         " refused: " + response.partial_success().error_message();
}

}  // namespace varimesh::server
