// The events of a job over HTTP, as server-sent events.
#pragma once

#include <string>

#include "server/http/exchange.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Answers with what WatchJob delivers: each event as proto3 JSON with its sequence number as its id, and bookmarks
/// without work as comments. The header Last-Event-ID, or else ?after=, says which event was the last that the client
/// has seen. If the server no longer keeps all iterations after it, the watch goes on with those that it keeps.
/// `?minInterval=` is that of WatchJob. A watch that has nothing more to deliver is answered with 204, which
/// ends the attempts of a browser.
void send_events(HttpExchange& exchange, v1::JobService::Stub& jobs, const std::string& job);

}  // namespace varimesh::server
