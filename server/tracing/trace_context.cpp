// Reads, writes and makes the ids of traces.
#include "server/tracing/trace_context.h"

#include <cstdint>
#include <random>

namespace varimesh::server {
namespace {

constexpr std::size_t kLength = 55, kTrace = 3, kSpan = 36, kFlags = 53, kTraceDigits = 32, kSpanDigits = 16;
constexpr std::string_view kDigits = "0123456789abcdef";

/// Whether a text is an id: hexadecimal digits that are not all 0.
bool is_id(std::string_view text) {
  return text.find_first_not_of(kDigits) == std::string_view::npos &&
         text.find_first_not_of('0') != std::string_view::npos;
}

std::string random_id(std::size_t digits) {
  thread_local std::random_device device;
  std::string id;
  do {
    id.clear();
    for (std::uint32_t bits = 0; id.size() < digits; bits >>= 4) {
      if (id.size() % 8 == 0) bits = device();
      id += kDigits[bits & 15];
    }
  } while (!is_id(id));
  return id;
}

}  // namespace

std::string TraceContext::header() const {
  if (trace_id.empty() || span_id.empty()) return trace_id;
  return "00-" + trace_id + '-' + span_id + (is_sampled ? "-01" : "-00");
}

TraceContext trace_context(std::string_view header) {
  if (header.size() == kTraceDigits && is_id(header)) return {std::string(header), {}, true};
  // Later versions may have more behind another dash.
  const bool ends = header.size() == kLength || (header.size() > kLength && header[kLength] == '-');
  if (!ends || header[kTrace - 1] != '-' || header[kSpan - 1] != '-' || header[kFlags - 1] != '-') return {};
  const auto is_hex = [](std::string_view text) { return text.find_first_not_of(kDigits) == std::string_view::npos; };
  const std::string_view version = header.substr(0, 2), flags = header.substr(kFlags, 2);
  if (!is_hex(version) || version == "ff" || (version == "00" && header.size() != kLength)) return {};
  const std::string_view trace = header.substr(kTrace, kTraceDigits), span = header.substr(kSpan, kSpanDigits);
  if (!is_id(trace) || !is_id(span) || !is_hex(flags)) return {};
  const bool is_sampled = kDigits.find(flags[1]) % 2 == 1;
  return {std::string(trace), std::string(span), is_sampled};
}

TraceContext child_of(const TraceContext& parent) {
  if (parent.trace_id.empty()) return {random_id(kTraceDigits), random_id(kSpanDigits), true};
  return {parent.trace_id, random_id(kSpanDigits), parent.is_sampled};
}

}  // namespace varimesh::server
