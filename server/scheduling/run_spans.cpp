#include "server/scheduling/run_spans.h"

namespace varimesh::server {

RunSpans::RunSpans(const SpanSink& sink, const Claim& claim, const std::function<TimePoint()>& clock)
    : sink_(sink), clock_(clock), run_(sink, "run", trace_context(claim.trace), clock()) {
  // Since when a job waits again after an attempt was lost is not known.
  if (claim.attempt == 1) {
    OpenSpan wait(sink, "wait", trace_context(claim.trace), claim.submitted);
    wait.set("varimesh.job", claim.name);
    wait.end(clock());
  }
  run_.set("varimesh.job", claim.name);
  run_.set("varimesh.attempt", std::int64_t{claim.attempt});
}

void RunSpans::enter(const std::string& stage, TimePoint since) {
  if (sink_ == nullptr || stage == stage_name_) return;
  if (stage_) stage_->end(since);
  stage_name_ = stage;
  stage_.emplace(sink_, stage, run_.context(), since);
}

void RunSpans::end(const Ending& ending) {
  if (stage_) stage_->end(clock_());
  run_.set("varimesh.state", v1::JobState_Name(ending.state));
  if (ending.metrics) run_.set("varimesh.iterations", std::int64_t{ending.metrics->iterations()});
  if (ending.error) run_.fail(ending.error->message());
  if (!ending.lost.empty()) run_.fail("the process that ran it " + ending.lost);
  run_.end(clock_());
}

}  // namespace varimesh::server
