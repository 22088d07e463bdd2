// The bar and the lines.
#include "client/command/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "client/command/names.h"

namespace varimesh::client {
namespace {

constexpr auto kBarInterval = std::chrono::milliseconds(50);
constexpr auto kLineInterval = std::chrono::milliseconds(1000);

std::string numbers(const v1::Iteration& iteration) {
  const double rate = iteration.seconds() > 0 ? iteration.number() / iteration.seconds() : 0;
  // Only where some cannot be repaired is it worth saying how many can.
  const bool all = iteration.repairable_elements() == iteration.invalid_elements();
  return fmt::format(
      "{} {:>4}  residual {:.2e}  min Js {:>7.4f}  invalid {}{}  {:.1f} s  {:.3g}/s", spelled(iteration.phase()),
      iteration.number(), iteration.residual(), iteration.min_scaled_jacobian(), iteration.invalid_elements(),
      all ? "" : fmt::format(" ({} repairable)", iteration.repairable_elements()), iteration.seconds(), rate);
}

/// How far the residual has come on its way to the tolerance, on a logarithmic scale.
std::string bar(double first, double now, double tolerance) {
  constexpr int kWidth = 16;
  double done = 0;
  if (now > 0 && first > tolerance && tolerance > 0) done = std::log(first / now) / std::log(first / tolerance);
  if (now <= tolerance) done = 1;
  const int filled = static_cast<int>(std::clamp(done, 0.0, 1.0) * kWidth);
  return '[' + std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(kWidth - filled), '.') + ']';
}

/// "  2 min left"; nothing where it is not known.
std::string in_words(const std::optional<double>& seconds) {
  if (!seconds) return "";
  if (*seconds < 100) return fmt::format("  {:.0f} s left", std::ceil(*seconds));
  if (*seconds < 6000) return fmt::format("  {:.0f} min left", *seconds / 60);
  return fmt::format("  {:.1f} h left", *seconds / 3600);
}

}  // namespace

Progress::Progress(bool quiet, const v1::Options& options)
    : quiet_(quiet),
      terminal_(isatty(STDERR_FILENO) == 1),
      tolerance_(options.has_tolerance() ? options.tolerance() : 1e-6),
      estimate_(options) {}

Progress::~Progress() { clear(); }

void Progress::clear() {
  if (bar_) std::fputs("\r\x1b[K", stderr);
  bar_ = false;
}

void Progress::say(const std::string& line) {
  if (quiet_) return;
  clear();
  std::fprintf(stderr, "%s\n", line.c_str());
}

void Progress::show(const v1::JobEvent& event) {
  if (quiet_) return;
  if (event.has_iteration()) {
    show(event.iteration(), false);
    return;
  }
  if (event.has_log()) say(event.log().text());
  if (!event.has_state_change()) return;
  if (!latest_shown_) show(latest_, true);
  say(spelled(event.state_change().state()));
}

void Progress::show(const v1::Iteration& iteration, bool last) {
  if (first_residual_ == 0) first_residual_ = iteration.residual();
  if (!last) estimate_.add(iteration);
  latest_ = iteration;
  const auto now = std::chrono::steady_clock::now();
  latest_shown_ = last || now - shown_ >= (terminal_ ? kBarInterval : kLineInterval);
  if (!latest_shown_) return;
  shown_ = now;
  const std::string left = last ? "" : in_words(estimate_.seconds_left());
  if (!terminal_) {
    std::fprintf(stderr, "%s\n", (numbers(iteration) + left).c_str());
    return;
  }
  // A line that wraps cannot be drawn over again: without the room, the bar goes, and then the end of the numbers.
  std::string line = bar(first_residual_, iteration.residual(), tolerance_) + " " + numbers(iteration) + left;
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && line.size() >= size.ws_col)
    line = numbers(iteration).substr(0, size.ws_col - 1);
  std::fprintf(stderr, "\r\x1b[K%s", line.c_str());
  std::fflush(stderr);
  bar_ = !last;
  if (last) std::fputc('\n', stderr);
}

}  // namespace varimesh::client
