// The progress of a job on standard error: a line that is drawn again and again on a terminal, plain lines elsewhere.
#pragma once

#include <chrono>
#include <string>

#include "client/io/remaining_time.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// Prints the events of one job.
class Progress {
 public:
  /// `quiet`: print nothing. `options` are those of the job.
  Progress(bool quiet, const v1::Options& options);
  ~Progress();

  /// Shows an iteration, if the last one was not shown just before, a change of state or a message of the server.
  void show(const v1::JobEvent& event);
  /// Prints a message on a line of its own.
  void print(const std::string& message);
  /// Makes room on the terminal for a message of somebody else.
  void clear_bar();

 private:
  void show(const v1::Iteration& iteration, bool last);

  const bool quiet_;
  const bool terminal_;     ///< Standard error is a terminal.
  const double tolerance_;  ///< The residual at which the job stops.
  RemainingTime remaining_time_;
  double first_residual_ = 0;
  bool bar_drawn_ = false;                         ///< The last line on the terminal is the bar.
  std::chrono::steady_clock::time_point shown_{};  ///< When an iteration was last shown.
  v1::Iteration latest_;
  bool latest_shown_ = true;
};

}  // namespace varimesh::client
