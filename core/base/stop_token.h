// Tells work that is under way to stop: because the caller asks for it, or because its time is over.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>

namespace varimesh {

/// Thrown by StopToken::look(). What was being computed is lost; whoever catches it goes back to a state that is whole.
struct Interrupted {};

/// A wish to stop. The loops that take long look at it between pieces of work, on all threads. Once a look has found
/// the wish, all later ones find it too.
///
/// To look costs a relaxed load. If there is a question or a time limit, it also costs the question or a reading of the
/// clock, some 30 ns. So pieces of work should take a microsecond or more.
///
/// Processes that share work each have a token, and an agreement. What one of them wishes then has no effect until all
/// look together, at the same point of their work. They find the same, so none is left waiting for another.
class StopToken {
 public:
  /// Why to stop.
  enum class Reason : std::uint8_t { None, Asked, TimeLimit };
  /// All processes call it together. Gets why this one is to stop, and returns why all are: the same for each.
  using Agreement = std::function<Reason(Reason mine)>;

  /// Stops never, until it is given a time limit.
  StopToken() = default;
  /// Stops when `asked` returns true. It is called at every look, from several threads at the same time; it may be
  /// empty.
  explicit StopToken(std::function<bool()> asked) : asked_(std::move(asked)) {}

  /// Stops when this many seconds have passed from now, in place of any limit before. No thread may look meanwhile.
  void stop_after(double seconds) {
    constexpr double kFarAway = 1e9;  // about 30 years; the clock's count would overflow at 292
    deadline_ = seconds < kFarAway
                    ? Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds))
                    : Clock::time_point::max();
  }

  /// From now on only a look of all finds a new wish. No thread may look meanwhile.
  void stop_together(Agreement agreement) { agreement_ = std::move(agreement); }

  /// Why to stop, as of the last look.
  Reason reason() const { return reason_.load(std::memory_order_relaxed); }

  /// Why this process is to stop, whether or not others agree. It is no look.
  Reason wish() const {
    if (reason() != Reason::None) return reason();
    if (asked_ && asked_()) return Reason::Asked;
    return deadline_ != Clock::time_point::max() && Clock::now() >= deadline_ ? Reason::TimeLimit : Reason::None;
  }

  /// A look: whether to stop.
  bool stopped() const {
    if (reason() != Reason::None) return true;
    if (agreement_) return false;
    const Reason mine = wish();
    return mine != Reason::None && stop_for(mine);
  }

  /// A look of all processes that have an agreement, which all call it. Without an agreement it is a look.
  bool stopped_together() const {
    if (agreement_ && reason() == Reason::None)
      if (const Reason ours = agreement_(wish()); ours != Reason::None) stop_for(ours);
    return stopped();
  }

  /// A look that throws Interrupted if the work is to stop.
  void look() const {
    if (stopped()) throw Interrupted();
  }
  void look_together() const {
    if (stopped_together()) throw Interrupted();
  }

 private:
  using Clock = std::chrono::steady_clock;

  bool stop_for(Reason reason) const {
    Reason none = Reason::None;
    reason_.compare_exchange_strong(none, reason, std::memory_order_relaxed);
    return true;
  }

  std::function<bool()> asked_;
  Agreement agreement_;
  Clock::time_point deadline_ = Clock::time_point::max();
  mutable std::atomic<Reason> reason_ = Reason::None;
};

/// A look at a token that may be missing.
inline void look(const StopToken* stop) {
  if (stop != nullptr) stop->look();
}

}  // namespace varimesh
