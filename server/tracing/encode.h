// Spans as the body of a request to a collector.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/tracing/spans.h"

namespace varimesh::server {

/// Returns the body. `resource`: attributes of the server that sends.
std::string encode_spans(const std::vector<std::pair<std::string, std::string>>& resource,
                         const std::vector<Span>& spans);

/// What a collector has answered to a request that it took: empty if it took all spans, otherwise its reason.
std::string rejection_in(const std::string& answer);

}  // namespace varimesh::server
