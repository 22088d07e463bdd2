// Counts how calls end.
#pragma once

#include "server/access/reflection_guard.h"
#include "server/metrics/metrics.h"

namespace varimesh::server {

/// Counts every call with the status that the server has sent. `metrics` must outlive the server.
InterceptorFactory call_counter(Metrics& metrics);

}  // namespace varimesh::server
