#include "client/io/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "client/cli/names.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

constexpr auto kBarInterval = std::chrono::milliseconds(50);
constexpr auto kLineInterval = std::chrono::milliseconds(1000);

/// For example "  12 groups left"; empty if no look for splits has counted them.
template <class Message>
std::string groups_left(const Message& message) {
  if (!message.has_groups_left()) return "";
  return fmt::format("  {} {} left", message.groups_left(), message.groups_left() == 1 ? "group" : "groups");
}

/// How far the work has come: a share of it if its amount is known.
std::string amount(const v1::Work& work, const char* what) {
  if (work.of() <= 0) return fmt::format("{} {}", work.done(), what);
  return fmt::format("{} {:.0f} %", what,
                     100.0 * static_cast<double>(std::min(work.done(), work.of())) / static_cast<double>(work.of()));
}

/// How far the residual has fallen towards the tolerance, on a logarithmic scale, from 0 to 1. It says how far a run
/// has come where nobody can tell its end.
double fallen(double first, double now, double tolerance) {
  if (now <= tolerance) return 1;
  const bool is_known = now > 0 && first > tolerance && tolerance > 0;
  return is_known ? std::log(first / now) / std::log(first / tolerance) : 0;
}

std::string bar(double share) {
  constexpr int kWidth = 10;  // at 80 columns there is room for it beside everything else but the residual
  const int filled = static_cast<int>(std::clamp(share, 0.0, 1.0) * kWidth);
  return '[' + std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(kWidth - filled), '.') + ']';
}

/// Whether the mesh of the iteration is not the one that would be handed out now: cells would go back to where they are
/// certified. What is known of them may be older than the smallest Js.
bool is_of_a_trial(const v1::Iteration& iteration) {
  return iteration.invalid_elements() != iteration.left_elements() ||
         (iteration.left_elements() == 0 && iteration.min_scaled_jacobian() <= 0);
}

/// For example "  2 min left"; empty if the time is not known.
std::string time_left(const std::optional<double>& seconds) {
  if (!seconds) return "";
  if (*seconds < 100) return fmt::format("  {:.0f} s left", std::ceil(*seconds));
  if (*seconds < 6000) return fmt::format("  {:.0f} min left", *seconds / 60);
  return fmt::format("  {:.1f} h left", *seconds / 3600);
}

}  // namespace

std::string iteration_text(const v1::Iteration& iteration, const std::string& bar, const std::string& left,
                           std::size_t width) {
  const std::string head = fmt::format("{} {:>4}", spelled(iteration.phase()), iteration.number());
  const std::string residual = fmt::format("  residual {:.2e}", iteration.residual());
  const std::string quality =
      (is_of_a_trial(iteration) ? std::string(19, ' ')
                                : fmt::format("  min Js <= {:>7.4f}", iteration.min_scaled_jacobian())) +
      fmt::format("  not certified {}", iteration.left_elements());
  const std::string groups = groups_left(iteration), seconds = fmt::format("  {:.1f} s", iteration.seconds());
  const double rate = iteration.seconds() > 0 ? iteration.number() / iteration.seconds() : 0;
  for (const std::string& line :
       {bar + head + residual + quality + groups + seconds + fmt::format("  {:.3g}/s", rate) + left,
        bar + head + residual + quality + groups + seconds + left, bar + head + quality + groups + seconds + left,
        bar + head + quality + seconds + left, head + quality + seconds + left, head + quality + left, head + quality})
    if (line.size() <= width) return line;
  return head.substr(0, width);
}

std::string progress_text(const v1::Work& work, int iteration, const std::string& left) {
  std::string text;
  switch (work.activity()) {
    case v1::Work::ACTIVITY_ASSEMBLY:
      text = fmt::format("newton {:>4}  {}", iteration, amount(work, "assembly"));
      break;
    case v1::Work::ACTIVITY_PRODUCTS:
      text = fmt::format("newton {:>4}  {}", iteration, amount(work, "products"));
      break;
    case v1::Work::ACTIVITY_SWEEP:
      text = fmt::format("sweeps {:>4}  {}", iteration, amount(work, "nodes"));
      break;
    case v1::Work::ACTIVITY_SPLITS:
      text = fmt::format("splits       {}", amount(work, "looks"));
      break;
    default:  // of a newer server
      text = amount(work, "done");
  }
  return text + groups_left(work) + left;
}

Progress::Progress(bool quiet, const v1::Options& options, Follows follows)
    : quiet_(quiet),
      follows_(follows),
      terminal_(isatty(STDERR_FILENO) == 1),
      tolerance_(options.has_tolerance() ? options.tolerance() : 1e-3) {}

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
  if (event.bookmark().has_work()) show(event.bookmark().work());
  if (event.has_log()) print(as_plain_text(event.log().text()));
  if (!event.has_state_change()) return;
  if (!latest_shown_) show(latest_, true);
  if (follows_ == Follows::Job) print(spelled(event.state_change().state()));
}

void Progress::show(const v1::Iteration& iteration, bool last) {
  if (first_residual_ == 0) first_residual_ = iteration.residual();
  if (!last) time_left_.note(iteration, TimeLeft::Clock::now());
  latest_ = iteration;
  latest_shown_ = last || is_due(shown_);
  if (!latest_shown_) return;
  draw([&](const std::string& bar, std::size_t width) {
    return iteration_text(iteration, bar, last ? "" : time_left(time_left_.seconds(TimeLeft::Clock::now())), width);
  });
  if (last && terminal_) std::fputc('\n', stderr);
  if (last) bar_drawn_ = false;
}

void Progress::show(const v1::Work& work) {
  time_left_.note(work, TimeLeft::Clock::now());
  // A short run shows its iterations, and nothing of what is inside them.
  if (!is_due(std::max(began_, shown_))) return;
  draw([&](const std::string& bar, std::size_t width) {
    const std::string left = time_left(time_left_.seconds(TimeLeft::Clock::now()));
    const std::string text = progress_text(work, latest_.number() + 1, left);
    return bar.size() + text.size() <= width ? bar + text : text.substr(0, width);
  });
}

bool Progress::is_due(std::chrono::steady_clock::time_point time) const {
  return std::chrono::steady_clock::now() - time >= (terminal_ ? kBarInterval : kLineInterval);
}

void Progress::draw(const std::function<std::string(const std::string& bar, std::size_t width)>& text) {
  shown_ = std::chrono::steady_clock::now();
  if (!terminal_) {
    std::fprintf(stderr, "%s\n", text("", std::numeric_limits<std::size_t>::max()).c_str());
    return;
  }
  // A line that wraps cannot be drawn again.
  winsize size{};
  const bool is_known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
  const double residual = latest_.number() > 0 ? latest_.residual() : std::numeric_limits<double>::infinity();
  const std::optional<double> share = time_left_.share(TimeLeft::Clock::now());
  const std::string line =
      text(bar(share.value_or(fallen(first_residual_, residual, tolerance_))) + " ", is_known ? size.ws_col - 1U : 79U);
  std::fprintf(stderr, "\r\x1b[K%s", line.c_str());
  std::fflush(stderr);
  bar_drawn_ = true;
}

}  // namespace varimesh::client
