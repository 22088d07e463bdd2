// How much work a job may do, whatever it asks for.
#pragma once

#include "server/engine/engine.h"

namespace varimesh::server {

struct WorkLimits {
  int iterations = 0;  ///< Iterations of a job, which also bounds its history. 0: no limit.
  double seconds = 0;  ///< Seconds that a job runs. 0: no limit.
};

/// The same engine within these limits: options that ask for more are refused with BadOption, and a job without a time
/// limit has the one of the server.
Engine within(const WorkLimits& limits, Engine engine);

}  // namespace varimesh::server
