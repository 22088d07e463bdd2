// The trace that a call is part of.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::server {

/// Returns the trace id of a header "traceparent" (W3C Trace Context, level 1: VERSION-TRACE-PARENT-FLAGS in lowercase
/// hexadecimal digits); empty if the header is none.
inline std::string trace_id_of(std::string_view header) {
  constexpr std::size_t kLength = 55, kTrace = 3, kParent = 36, kFlags = 53;
  const auto is_hex = [](std::string_view text) {
    return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
  };
  // Later versions may have more behind another dash.
  const bool ends = header.size() == kLength || (header.size() > kLength && header[kLength] == '-');
  if (!ends || header[kTrace - 1] != '-' || header[kParent - 1] != '-' || header[kFlags - 1] != '-') return {};
  const std::string_view version = header.substr(0, 2), trace = header.substr(kTrace, 32);
  if (!is_hex(version) || version == "ff" || (version == "00" && header.size() != kLength)) return {};
  if (!is_hex(trace) || !is_hex(header.substr(kParent, 16)) || !is_hex(header.substr(kFlags, 2))) return {};
  if (trace.find_first_not_of('0') == std::string_view::npos) return {};
  return std::string(trace);
}

}  // namespace varimesh::server
