#include "server/isolation/messages.h"

#include "server/engine/option_messages.h"

namespace varimesh::server {

worker::Request message_of(const RunRequest& request) {
  worker::Request message;
  message.set_format(request.format);
  *message.mutable_options() = to_proto(request.options);
  for (const v1::MeshFormat output : request.outputs) message.add_outputs(output);
  if (request.quality) *message.mutable_quality() = *request.quality;
  if (request.geometry) *message.mutable_geometry() = *request.geometry;
  if (request.layers) *message.mutable_layers() = *request.layers;
  message.set_keep_orders(request.keep_orders);
  message.set_device(request.device);
  message.set_why_no_device(request.why_no_device);
  return message;
}

RunRequest request_of(const worker::Request& message) {
  RunRequest request;
  request.format = message.format();
  request.options = *options_from(message.options());
  for (const int format : message.outputs()) request.outputs.push_back(static_cast<v1::MeshFormat>(format));
  if (message.has_quality()) request.quality = message.quality();
  if (message.has_geometry()) request.geometry = message.geometry();
  if (message.has_layers()) request.layers = message.layers();
  request.keep_orders = message.keep_orders();
  request.device = message.device();
  request.why_no_device = message.why_no_device();
  return request;
}

worker::ToWorker answer_of(const Expected<bool>& outcome) {
  worker::ToWorker message;
  worker::Answer& answer = *message.mutable_answer();
  if (outcome) {
    answer.set_yes(*outcome);
  } else {
    answer.mutable_failure()->set_kind(static_cast<int>(outcome.error().kind));
    answer.mutable_failure()->set_sentence(outcome.error().sentence);
  }
  return message;
}

Expected<bool> outcome_of(const worker::Answer& answer) {
  if (!answer.has_failure()) return answer.yes();
  return tl::unexpected(Error{static_cast<Error::Kind>(answer.failure().kind()), answer.failure().sentence()});
}

worker::Steering steering_by(const RunHooks& hooks, int threads, bool full) {
  worker::Steering steering;
  steering.set_threads(hooks.control.threads ? hooks.control.threads() : threads);
  steering.set_stop(hooks.control.stop_asked());
  steering.set_given_up(hooks.given_up && hooks.given_up());
  steering.set_full(full);
  steering.set_watched(hooks.mesh_watched && hooks.mesh_watched());
  return steering;
}

}  // namespace varimesh::server
