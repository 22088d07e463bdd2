// How far a job is: one line that changes on a terminal, plain lines in a pipe; always on standard error.
#pragma once

#include <chrono>
#include <string>

#include "client/command/estimate.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

class Progress {
 public:
  /// `quiet` says nothing at all.
  Progress(bool quiet, const v1::Options& options);
  ~Progress();

  void show(const v1::JobEvent& event);
  /// A line of its own, above the bar.
  void say(const std::string& line);

 private:
  void show(const v1::Iteration& iteration, bool last);
  void clear();

  const bool quiet_;
  const bool terminal_;
  const double tolerance_;
  Estimate estimate_;
  double first_residual_ = 0;
  bool bar_ = false;
  std::chrono::steady_clock::time_point shown_{};
  v1::Iteration latest_;
  bool latest_shown_ = true;
};

}  // namespace varimesh::client
