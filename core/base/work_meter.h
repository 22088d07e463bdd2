// How far a long piece of work has come, for those who wait for it.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace varimesh {

/// What takes long inside an iteration, or between two.
enum class Activity : std::uint8_t {
  Assembly,  ///< What a Newton step prepares: the gradient and the preconditioner. Counted in cells and rows.
  Products,  ///< Products of the Hessian and a direction. Nobody knows beforehand how many a step takes.
  Sweep,     ///< Visits of free nodes.
  Splits,    ///< Looks for tetrahedra that a split may help.
};

/// How far the present piece of work has come.
struct Work {
  Activity activity = Activity::Assembly;
  std::int64_t done = 0;
  std::int64_t of = 0;            ///< How much there is; 0 if that is not known.
  std::int64_t groups_left = -1;  ///< Groups of tetrahedra that the last look for splits has found; −1 before any look.
  double seconds_left = -1;       ///< Of the run, as an estimate; −1 if nobody can tell.
};

/// What the kernels of the energy (core/kernels/, core/kernels/hessian/) have done in a run.
struct KernelWork {
  double operations = 0;  ///< Floating-point operations, as core/kernels/operations.h counts them.
  double seconds = 0;     ///< Time in loops over kernels, times the threads that share them.
};

/// Counts the work of a run and reports it at most ten times per second. What it has not reported by then is lost. It
/// adds up what the kernels do, which anybody may read at any time.
class WorkMeter {
 public:
  /// Called from any thread that works, one call at a time. Must not block.
  using Report = std::function<void(const Work&)>;
  static constexpr std::chrono::milliseconds kInterval{100};

  explicit WorkMeter(Report report) : report_(std::move(report)) {}

  /// Another piece of work begins. No thread may add to the one before any more.
  void begin(Activity activity, std::int64_t of = 0) {
    activity_ = activity;
    of_ = of;
    done_.store(0, std::memory_order_relaxed);
  }

  /// A look for splits has found this many groups. Every later report says so.
  void found_groups(std::int64_t groups) { groups_left_ = groups; }

  /// Sets in how many seconds the run will end; if negative, nobody can tell. Later reports count down from there.
  void expect_end_in(double seconds) {
    const auto in_ticks = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    end_.store(seconds < 0 ? kNoEnd : (Clock::now().time_since_epoch() + in_ticks).count(), std::memory_order_relaxed);
  }

  /// This much more is done. Several threads may call it at the same time. It costs a reading of the clock.
  void add(std::int64_t amount = 1) {
    done_.fetch_add(amount, std::memory_order_relaxed);
    const Clock::rep now = Clock::now().time_since_epoch().count();
    Clock::rep due = due_.load(std::memory_order_relaxed);
    if (now < due || !due_.compare_exchange_strong(due, now + Clock::duration(kInterval).count())) return;
    const std::unique_lock lock(reporting_, std::try_to_lock);
    // A thread that waited for a processor since it added would report less than others have reported meanwhile.
    if (lock) report_({activity_, done_.load(std::memory_order_relaxed), of_, groups_left_, seconds_left(now)});
  }

  /// The kernels have done this. Several threads may call it at the same time, once for a loop over many cells.
  void add_kernels(const KernelWork& work) {
    operations_.fetch_add(work.operations, std::memory_order_relaxed);
    kernel_seconds_.fetch_add(work.seconds, std::memory_order_relaxed);
  }
  /// All that the kernels have done so far.
  KernelWork kernels() const {
    return {operations_.load(std::memory_order_relaxed), kernel_seconds_.load(std::memory_order_relaxed)};
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr Clock::rep kNoEnd = -1;

  /// As Work::seconds_left, at this time.
  double seconds_left(Clock::rep now) const {
    const Clock::rep end = end_.load(std::memory_order_relaxed);
    return end == kNoEnd ? -1
                         : std::chrono::duration<double>(Clock::duration(std::max<Clock::rep>(0, end - now))).count();
  }

  const Report report_;
  Activity activity_ = Activity::Assembly;
  std::int64_t of_ = 0, groups_left_ = -1;
  std::atomic<std::int64_t> done_ = 0;
  std::atomic<Clock::rep> due_ = 0;       ///< When the next report is due, in ticks of the clock.
  std::atomic<Clock::rep> end_ = kNoEnd;  ///< When the run is expected to end.
  std::mutex reporting_;
  std::atomic<double> operations_ = 0, kernel_seconds_ = 0;
};

}  // namespace varimesh
