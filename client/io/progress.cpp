#include "client/io/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "client/cli/names.h"

namespace varimesh::client {
namespace {

constexpr auto kBarInterval = std::chrono::milliseconds(50);
constexpr auto kLineInterval = std::chrono::milliseconds(1000);

std::string numbers(const v1::Iteration& iteration) {
  const double rate = iteration.seconds() > 0 ? iteration.number() / iteration.seconds() : 0;
  return fmt::format("{} {:>4}  residual {:.2e}  min Js {:>7.4f}  not certified {}  {:.1f} s  {:.3g}/s",
                     spelled(iteration.phase()), iteration.number(), iteration.residual(),
                     iteration.min_scaled_jacobian(), iteration.left_elements(), iteration.seconds(), rate);
}

/// A bar that shows how far the residual has fallen towards the tolerance, on a logarithmic scale.
std::string bar(double first, double now, double tolerance) {
  constexpr int kWidth = 16;
  double fraction = 0;
  if (now > 0 && first > tolerance && tolerance > 0) fraction = std::log(first / now) / std::log(first / tolerance);
  if (now <= tolerance) fraction = 1;
  const int filled = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * kWidth);
  return '[' + std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(kWidth - filled), '.') + ']';
}

/// For example "  2 min left"; empty if the time is not known.
std::string time_left(const std::optional<double>& seconds) {
  if (!seconds) return "";
  if (*seconds < 100) return fmt::format("  {:.0f} s left", std::ceil(*seconds));
  if (*seconds < 6000) return fmt::format("  {:.0f} min left", *seconds / 60);
  return fmt::format("  {:.1f} h left", *seconds / 3600);
}

}  // namespace

Progress::Progress(bool quiet, const v1::Options& options)
    : quiet_(quiet),
      terminal_(isatty(STDERR_FILENO) == 1),
      tolerance_(options.has_tolerance() ? options.tolerance() : 1e-3),
      remaining_time_(options) {}

Progress::~Progress() { clear_bar(); }

void Progress::clear_bar() {
  if (bar_drawn_) std::fputs("\r\x1b[K", stderr);
  bar_drawn_ = false;
}

void Progress::print(const std::string& message) {
  if (quiet_) return;
  clear_bar();
  std::fprintf(stderr, "%s\n", message.c_str());
}

void Progress::show(const v1::JobEvent& event) {
  if (quiet_) return;
  if (event.has_iteration()) {
    show(event.iteration(), false);
    return;
  }
  if (event.has_log()) print(event.log().text());
  if (!event.has_state_change()) return;
  if (!latest_shown_) show(latest_, true);
  print(spelled(event.state_change().state()));
}

void Progress::show(const v1::Iteration& iteration, bool last) {
  if (first_residual_ == 0) first_residual_ = iteration.residual();
  if (!last) remaining_time_.add(iteration);
  latest_ = iteration;
  const auto now = std::chrono::steady_clock::now();
  latest_shown_ = last || now - shown_ >= (terminal_ ? kBarInterval : kLineInterval);
  if (!latest_shown_) return;
  shown_ = now;
  const std::string left = last ? "" : time_left(remaining_time_.seconds());
  if (!terminal_) {
    std::fprintf(stderr, "%s\n", (numbers(iteration) + left).c_str());
    return;
  }
  // A line that wraps cannot be drawn again. If the terminal is too narrow, the bar is left out, then the end of the
  // numbers.
  std::string line = bar(first_residual_, iteration.residual(), tolerance_) + " " + numbers(iteration) + left;
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && line.size() >= size.ws_col)
    line = numbers(iteration).substr(0, size.ws_col - 1);
  std::fprintf(stderr, "\r\x1b[K%s", line.c_str());
  std::fflush(stderr);
  bar_drawn_ = !last;
  if (last) std::fputc('\n', stderr);
}

}  // namespace varimesh::client
