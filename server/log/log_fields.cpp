// The fields of each thread.
#include "server/log/log_fields.h"

#include <utility>

namespace varimesh::server {
namespace {

LogFields& fields_of_thread() {
  thread_local LogFields fields;
  return fields;
}

}  // namespace

LogScope::LogScope(const LogFields& fields) : before_(fields_of_thread()) {
  LogFields& now = fields_of_thread();
  for (const auto field : {&LogFields::job, &LogFields::owner, &LogFields::address, &LogFields::trace_id,
                           &LogFields::audit, &LogFields::outcome})
    if (!(fields.*field).empty()) now.*field = fields.*field;
  if (fields.attempt > 0) now.attempt = fields.attempt;
}

LogScope::~LogScope() { fields_of_thread() = std::move(before_); }

const LogFields& log_fields() { return fields_of_thread(); }

}  // namespace varimesh::server
