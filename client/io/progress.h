// The progress of a job on standard error: a line that is drawn again and again on a terminal, plain lines elsewhere.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "client/io/time_left.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// The work inside the iteration with this number, or between two: for example "newton    1  assembly 25 %". `left`
/// follows, the time that is left.
std::string progress_text(const v1::Work& work, int iteration, const std::string& left = "");

/// An iteration in at most `width` characters: after the bar, the phase, the quality and what else has room, and the
/// time that is left. The count of cells that are not certified belongs to the mesh that would be handed out now. The
/// smallest Js is left out if it belongs to another mesh, a trial. In narrow lines the rate is left out first, then the
/// residual, the groups, the bar and the times.
std::string iteration_text(const v1::Iteration& iteration, const std::string& bar, const std::string& left,
                           std::size_t width);

/// A run of this process has no states that its user knows.
enum class Follows { Run, Job };

/// Prints the events of one job.
class Progress {
 public:
  /// `quiet`: print nothing. `options` are those of the job.
  Progress(bool quiet, const v1::Options& options, Follows follows);
  ~Progress();

  /// Shows a change of state, a message of the server, or, if the last was not shown just before, an iteration or the
  /// work inside one.
  void show(const v1::JobEvent& event);
  /// Prints a message on a line of its own.
  void print(const std::string& message);
  /// Makes room on the terminal for a message of somebody else.
  void clear_bar();

 private:
  void show(const v1::Iteration& iteration, bool last);
  void show(const v1::Work& work);
  /// Whether enough time has passed since `time` to draw or print again.
  bool is_due(std::chrono::steady_clock::time_point time) const;
  /// Draws or prints a text, which is made for the width of the terminal.
  void draw(const std::function<std::string(const std::string& bar, std::size_t width)>& text);

  const bool quiet_;
  const Follows follows_;
  const bool terminal_;     ///< Standard error is a terminal.
  const double tolerance_;  ///< The residual at which the job stops.
  TimeLeft time_left_;
  double first_residual_ = 0;
  bool bar_drawn_ = false;                         ///< The last line on the terminal is the bar.
  std::chrono::steady_clock::time_point shown_{};  ///< When an iteration or work was last shown.
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  v1::Iteration latest_;
  bool latest_shown_ = true;
};

}  // namespace varimesh::client
