// What the lines of the log are about.
#pragma once

#include <string>

namespace varimesh::server {

/// The fields of a line of the log beside its message; empty ones are left out.
struct LogFields {
  std::string job = {};
  int attempt = 0;            ///< 0: none.
  std::string owner = {};     ///< Of the job, or who calls.
  std::string address = {};   ///< From where; without the port.
  std::string trace_id = {};  ///< Of the call that submitted the job, or of the call: 32 hexadecimal digits.
  std::string audit = {};     ///< What somebody did: "submit", "cancel", …
  std::string outcome = {};   ///< "ok", or why it was refused.
};

/// Adds fields to every line that this thread logs, until it is destroyed. Those of a scope inside another one are
/// added to the outer ones.
class LogScope {
 public:
  explicit LogScope(const LogFields& fields);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  LogFields before_;
};

/// The fields of the lines that this thread logs.
const LogFields& log_fields();

}  // namespace varimesh::server
