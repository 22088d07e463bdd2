// Writes the stream of a watch as text/event-stream (https://html.spec.whatwg.org/multipage/server-sent-events.html).
#include "server/http/events.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "google/rpc/status.pb.h"
#include "server/refusals.h"
#include "server/streams/status.h"

namespace varimesh::server {
namespace {

Answer<std::int64_t> sequence_of(const std::string& what, const std::string& text) {
  std::int64_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (read.ec != std::errc() || read.ptr != text.data() + text.size() || value < 0)
    return bad_request(what + " must be the number of an event, not '" + text + "'.");
  return value;
}

Answer<v1::WatchJobRequest> watch_of(const HttpExchange& exchange, const std::string& job) {
  v1::WatchJobRequest request;
  request.set_name(job);
  const auto fields = exchange.query();
  if (!fields) return tl::unexpected(fields.error());
  for (const auto& [name, value] : *fields) {
    if (name == "after") {
      const auto after = sequence_of("The field after", value);
      if (!after) return tl::unexpected(after.error());
      request.set_after_sequence(*after);
    } else if (name == "minInterval") {
      const std::string json = "{\"minInterval\": \"" + value + "\"}";
      v1::WatchJobRequest parsed;
      if (value.find_first_not_of("0123456789.s") != std::string::npos ||
          !google::protobuf::util::JsonStringToMessage(json, &parsed).ok())
        return bad_request("The field minInterval must be a time such as 0.5s.");
      *request.mutable_min_interval() = parsed.min_interval();
    } else {
      return unknown_field(name, "after and minInterval");
    }
  }
  // A browser that comes again keeps the address, and says in this header how far it has come.
  if (const std::string seen = exchange.header("Last-Event-ID"); !seen.empty()) {
    const auto after = sequence_of("The header Last-Event-ID", seen);
    if (!after) return tl::unexpected(after.error());
    request.set_after_sequence(*after);
  }
  return request;
}

/// An event as lines, or a comment that keeps the connection alive. Empty if it cannot be written.
std::string lines_of(const v1::JobEvent& event) {
  if (event.has_bookmark() && !event.bookmark().has_work()) return ": " + std::to_string(event.sequence()) + "\n\n";
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(event, &json).ok()) return {};
  return "id: " + std::to_string(event.sequence()) + "\ndata: " + json + "\n\n";
}

/// Whether the server has had the event of this number, but keeps not all events after it: some iterations are gone.
bool is_expired(const grpc::Status& status, std::int64_t after) {
  google::rpc::Status full;
  v1::Job job;
  if (status.error_code() != grpc::StatusCode::OUT_OF_RANGE || !full.ParseFromString(status.error_details()))
    return false;
  for (const auto& detail : full.details())
    if (detail.UnpackTo(&job)) return after <= job.last_sequence();
  return false;
}

/// One watch on its way to the client.
class EventStream {
 public:
  EventStream(HttpExchange& exchange, v1::JobService::Stub& jobs) : exchange_(exchange), jobs_(jobs) {}

  /// Sends the events after number `after`, which are among those that the request asks for. Returns how the call
  /// ended.
  grpc::Status send(const v1::WatchJobRequest& request, std::int64_t after) {
    grpc::ClientContext context;
    exchange_.pass_on(context);
    const auto reader = jobs_.WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (is_there_ && reader->Read(&response)) {
      v1::JobEvent& event = *response.mutable_event();
      if (event.sequence() < after || (event.sequence() == after && !event.has_bookmark())) continue;
      event.set_thinned(
          std::min(event.thinned(),
                   event.sequence() - after - (event.has_bookmark() ? 0 : 1)));  // the client has seen the others
      send(lines_of(event));
    }
    if (!is_there_) context.TryCancel();  // the client may come again
    return reader->Finish();
  }

  /// Ends the answer.
  void end(const grpc::Status& status) {
    if (!begun_ && !status.ok()) return exchange_.refuse(status);
    if (!begun_) return exchange_.answer_nothing();
    // Without the last chunk the client knows that the stream was cut, and comes again.
    if (is_there_ && status.ok()) exchange_.send_chunk("");
  }

 private:
  void send(const std::string& lines) {
    if (!std::exchange(begun_, true)) exchange_.begin_events();
    is_there_ = !lines.empty() && exchange_.send_chunk(lines);
  }

  HttpExchange& exchange_;
  v1::JobService::Stub& jobs_;
  bool begun_ = false, is_there_ = true;
};

}  // namespace

void send_events(HttpExchange& exchange, v1::JobService::Stub& jobs, const std::string& job) {
  auto request = watch_of(exchange, job);
  if (!request) return exchange.refuse(status(request.error()));
  const std::int64_t after = request->after_sequence();
  EventStream stream(exchange, jobs);
  grpc::Status ended = stream.send(*request, after);
  if (is_expired(ended, after)) {
    // From the start the server delivers every state and report, and all iterations that it keeps.
    request->set_after_sequence(0);
    ended = stream.send(*request, after);
  }
  stream.end(ended);
}

}  // namespace varimesh::server
