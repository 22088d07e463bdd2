#include "core/threads/crew.h"

#include <sched.h>

#include <algorithm>
#include <cassert>
#include <deque>
#include <memory>
#include <system_error>
#include <thread>
#include <utility>

namespace varimesh {
namespace {

/// How often a thread without work looks for some before it sleeps: about 20 microseconds. Between two colours of a
/// sweep lie less than that, and to wake a sleeping thread takes about as long.
constexpr int kLooksBeforeSleep = 500;

void pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("isb");
#endif
}

/// Looks for some microseconds whether is() has become true. False if it has not.
template <class Is>
bool becomes_true_soon(const Is& is) {
  for (int i = 0; i < kLooksBeforeSleep; ++i) {
    if (is()) return true;
    pause();
  }
  return false;
}

thread_local Crew* current_crew = nullptr;
thread_local int current_depth = 0;  ///< How many loops the thread is inside of.

}  // namespace

int machine_threads() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  const int known = sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : 0;
  return std::max(1, known > 0 ? known : static_cast<int>(std::thread::hardware_concurrency()));
}

/// The helpers of the process. One is started if there are fewer than the open crews have asked for, and lives as long
/// as the process. A helper that has not come back yet from a crew that has closed counts: the next crew waits for it.
class Helpers {
 public:
  /// Sends a helper to the crew, as soon as one is idle. False if there are too few and the system starts no more.
  static bool send_to(std::shared_ptr<Crew> crew) {
    Helpers& helpers = all();
    const std::scoped_lock lock(helpers.mutex_);
    if (helpers.idle_.empty() && helpers.asked_for_ == helpers.count_) {
      if (!helpers.start(std::move(crew))) return false;
    } else if (helpers.idle_.empty()) {
      helpers.waiting_.push_back(std::move(crew));
    } else {
      Helper* const helper = helpers.idle_.back();
      helpers.idle_.pop_back();
      helper->crew = std::move(crew);
      helper->called.notify_one();
    }
    ++helpers.asked_for_;
    return true;
  }

  /// The crew, which has asked for `count` helpers, has closed.
  static void give_back(const Crew* crew, int count) {
    Helpers& helpers = all();
    const std::scoped_lock lock(helpers.mutex_);
    helpers.asked_for_ -= count;
    std::erase_if(helpers.waiting_, [&](const std::shared_ptr<Crew>& waits) { return waits.get() == crew; });
  }

 private:
  struct Helper {
    std::shared_ptr<Crew> crew;  ///< Guarded by the mutex.
    std::condition_variable called;
  };

  /// Never destroyed: helpers wait on it until the process ends.
  static Helpers& all() {
    static Helpers* const helpers = new Helpers;
    return *helpers;
  }

  bool start(std::shared_ptr<Crew> crew) {
    auto helper = std::make_unique<Helper>();
    helper->crew = std::move(crew);
    try {
      std::thread([this, self = helper.get()] { live(*self); }).detach();
    } catch (const std::system_error&) {
      return false;
    }
    static_cast<void>(helper.release());  // lives as long as its thread
    ++count_;
    return true;
  }

  [[noreturn]] void live(Helper& self) {
    std::unique_lock lock(mutex_);
    for (;;) {
      self.called.wait(lock, [&] { return self.crew != nullptr; });
      std::shared_ptr<Crew> crew = std::exchange(self.crew, nullptr);
      lock.unlock();
      crew->help();
      crew.reset();
      lock.lock();
      if (waiting_.empty()) {
        idle_.push_back(&self);
      } else {
        self.crew = std::move(waiting_.front());
        waiting_.pop_front();
      }
    }
  }

  std::mutex mutex_;
  int count_ = 0;      ///< How many helpers there are.
  int asked_for_ = 0;  ///< How many the open crews have asked for.
  std::vector<Helper*> idle_;
  std::deque<std::shared_ptr<Crew>> waiting_;  ///< One entry for each helper that a crew still waits for.
};

// ===== opening and closing =====

Crew::Opened::Opened(int threads)
    : crew_(new Crew(threads)),
      before_(std::exchange(current_crew, crew_.get())),
      depth_before_(std::exchange(current_depth, 0)) {}

Crew::Opened::~Opened() {
  crew_->close();
  current_crew = before_;
  current_depth = depth_before_;
}

Crew* Crew::current() { return current_crew; }

void Crew::close() {
  const std::scoped_lock lock(mutex_);
  assert(open_.empty());
  closed_ = true;
  changes_.fetch_add(1, std::memory_order_release);
  opened_changed_.notify_all();
  if (borrowed_ > 0) Helpers::give_back(this, borrowed_);
}

// ===== loops =====

void Crew::share(std::size_t count, std::size_t grain, const LoopBody& body) {
  grain = std::max<std::size_t>(1, grain);
  const std::size_t pieces = count / grain + (count % grain != 0);
  if (threads_ == 1 || pieces <= 1) {
    if (count > 0) body(0, count);
    return;
  }
  Loop loop{count, grain, body, threads_, current_depth};
  {
    const std::scoped_lock lock(mutex_);
    const int wanted = static_cast<int>(std::min<std::size_t>(pieces, static_cast<std::size_t>(threads_))) - 1;
    // Without helpers, the threads that there are do the loop.
    while (borrowed_ < wanted && Helpers::send_to(shared_from_this())) ++borrowed_;
    open_.push_back(&loop);
    changes_.fetch_add(1, std::memory_order_release);
    for (int i = std::min(wanted, asleep_); i > 0; --i) opened_changed_.notify_one();
    if (loop.depth > 0) left_changed_.notify_all();  // threads that wait for helpers may help
  }
  work_on(loop);
  {
    const std::scoped_lock lock(mutex_);
    std::erase(open_, &loop);
  }
  wait_for_helpers(loop);
  if (loop.failure) std::rethrow_exception(loop.failure);
}

void Crew::work_on(Loop& loop) {
  const int outside = std::exchange(current_depth, loop.depth + 1);
  const auto shares = 2 * static_cast<std::size_t>(loop.threads);
  std::size_t begin = loop.next.load(std::memory_order_relaxed);
  while (begin < loop.count) {
    const std::size_t left = loop.count - begin;
    const std::size_t size = std::min(left, std::max(loop.grain, left / shares));
    if (!loop.next.compare_exchange_weak(begin, begin + size, std::memory_order_relaxed)) continue;
    try {
      loop.body(begin, begin + size);
    } catch (...) {
      loop.next.store(loop.count, std::memory_order_relaxed);
      const std::scoped_lock lock(mutex_);
      if (!loop.failure) loop.failure = std::current_exception();
    }
    begin = loop.next.load(std::memory_order_relaxed);
  }
  current_depth = outside;
}

bool Crew::help_with_one(int depth) {
  Loop* found = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    // The innermost first: others wait for it.
    for (Loop* loop : open_)
      if (loop->depth >= depth && loop->has_more() && (found == nullptr || loop->depth > found->depth)) found = loop;
    if (found == nullptr) return false;
    found->helpers.fetch_add(1, std::memory_order_relaxed);
  }
  work_on(*found);
  const std::scoped_lock lock(mutex_);
  // The owner destroys the loop once it sees 0, and it may see that before it has the lock.
  if (found->helpers.fetch_sub(1, std::memory_order_release) == 1) left_changed_.notify_all();
  return true;
}

/// Helps with loops inside the loop meanwhile.
void Crew::wait_for_helpers(Loop& loop) {
  const auto is_left = [&] { return loop.helpers.load(std::memory_order_acquire) == 0; };
  for (;;) {
    if (becomes_true_soon(is_left)) break;
    if (help_with_one(loop.depth + 1)) continue;
    std::unique_lock lock(mutex_);
    if (is_left()) break;
    const bool has_inner =
        std::ranges::any_of(open_, [&](const Loop* inner) { return inner->depth > loop.depth && inner->has_more(); });
    if (!has_inner) left_changed_.wait(lock);
  }
}

// ===== helpers =====

void Crew::help() {
  current_crew = this;
  current_depth = 0;
  for (bool closed = false; !closed;) {
    const std::uint32_t seen = changes_.load(std::memory_order_acquire);
    if (help_with_one(0)) continue;
    const auto changed = [&] { return changes_.load(std::memory_order_acquire) != seen; };
    becomes_true_soon(changed);
    std::unique_lock lock(mutex_);
    ++asleep_;
    opened_changed_.wait(lock, [&] { return closed_ || changed(); });
    --asleep_;
    closed = closed_;
  }
  current_crew = nullptr;
}

}  // namespace varimesh
