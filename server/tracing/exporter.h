// Sends spans to a collector, by OTLP over HTTP.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "server/tracing/spans.h"

namespace varimesh::server {

struct ExportSettings {
  std::string url;      ///< Of the collector, without /v1/traces.
  std::string headers;  ///< KEY=VALUE,KEY=VALUE: more headers of each request, such as a key. Never logged.
  /// What the collector is told about this server.
  std::vector<std::pair<std::string, std::string>> resource;
  std::function<void(const std::string& line)> log = [](const std::string&) {};
  std::chrono::milliseconds pause{1'000};  ///< Time between two requests, for spans to come together.
  std::size_t most_waiting = 10'000;       ///< Spans beyond are dropped while the collector is away.
};

/// Returns a sink that sends spans from a thread of its own. A request that the collector cannot take now is repeated,
/// with growing pauses. When the last copy of the sink is destroyed, what is left is sent within two seconds or
/// dropped. Errors: BadOption if the address cannot be used, or if this build has no libcurl.
Expected<SpanSink> export_spans(const ExportSettings& settings);

}  // namespace varimesh::server
