// The spans of an attempt at a job.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "server/jobs/job_store.h"
#include "server/tracing/spans.h"

namespace varimesh::server {

/// Makes a span of the time for which a job has waited, one of its run and, in that, one of each stage after the other:
/// fetching the mesh, reading it, the phases of the optimisation, storing the result. Not thread-safe.
class RunSpans {
 public:
  /// Begins the run. `clock`: for the times of the spans. Everything outlives this object.
  RunSpans(const SpanSink& sink, const Claim& claim, const std::function<TimePoint()>& clock);

  /// The stage before has ended at `since`, and this one has begun, unless it is the same.
  void enter(const std::string& stage, TimePoint since);
  /// The run has ended.
  void end(const Ending& ending);

 private:
  const SpanSink& sink_;
  const std::function<TimePoint()>& clock_;
  OpenSpan run_;
  std::string stage_name_;
  std::optional<OpenSpan> stage_;
};

}  // namespace varimesh::server
