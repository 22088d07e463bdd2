// A crew: threads that share loops.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <vector>

namespace varimesh {

/// How many threads this process may run at the same time: the processors that the system lets it use, at least 1.
int machine_threads();

/// What a loop does with the indices begin ≤ i < end. It refers to its body, which must outlive it.
class LoopBody {
 public:
  template <class Body>
  explicit LoopBody(const Body& body)
      : body_(&body), call_([](const void* self, std::size_t begin, std::size_t end) {
          (*static_cast<const Body*>(self))(begin, end);
        }) {}
  void operator()(std::size_t begin, std::size_t end) const { call_(body_, begin, end); }

 private:
  const void* body_;
  void (*call_)(const void*, std::size_t, std::size_t);
};

/// The thread that opens a crew works on its loops, and helpers join it. A thread takes the next piece of a loop when
/// it has done the one before, so a loop never waits for a helper that has not begun: if the system runs other programs
/// in a helper's place, the others do its share. A thread without work watches for the next loop for some microseconds
/// and then sleeps. It never yields its turn, because beside busy programs it would get the next one only after
/// theirs. docs/performance.md has the figures.
///
/// A piece may contain a loop, which the same crew shares. Helpers belong to the process: a crew borrows them with its
/// first loop and gives them back when it closes.
class Crew : public std::enable_shared_from_this<Crew> {
 public:
  /// Opens a crew of that many threads for the calling thread, until it is destroyed there. The crew of the thread
  /// before that, if there is one, waits.
  class Opened {
   public:
    explicit Opened(int threads);
    ~Opened();
    Opened(const Opened&) = delete;
    Opened& operator=(const Opened&) = delete;

   private:
    std::shared_ptr<Crew> crew_;
    Crew* const before_;
    const int depth_before_;
  };

  /// The crew that the calling thread works in; null if it works in none.
  static Crew* current();

  /// Calls body(begin, end) for ranges that together make up 0 ≤ i < count, with at least `grain` indices each except
  /// the last, and returns when all have returned. What a range throws is rethrown here, once, and ranges that have not
  /// begun by then are left out. Call it on a thread of the crew.
  void share(std::size_t count, std::size_t grain, const LoopBody& body);

 private:
  friend class Helpers;

  struct Loop {
    std::size_t count, grain;
    const LoopBody& body;
    int threads;
    int depth;                        ///< How many loops lie around it.
    std::atomic<std::size_t> next{};  ///< The first index that nobody has taken.
    std::atomic<int> helpers{};       ///< How many helpers are inside.
    std::exception_ptr failure{};     ///< Guarded by the crew's mutex.

    bool has_more() const { return next.load(std::memory_order_relaxed) < count; }
  };

  explicit Crew(int threads) : threads_(threads) {}

  /// What a helper does until the crew closes.
  void help();
  void work_on(Loop& loop);
  /// Works on a loop around which at least `depth` loops lie, if one is open. False if there is none.
  bool help_with_one(int depth);
  void wait_for_helpers(Loop& loop);
  void close();

  const int threads_;
  std::mutex mutex_;
  int borrowed_ = 0;                        ///< Helpers. Guarded by the mutex, like what follows.
  std::condition_variable opened_changed_;  ///< For helpers without work.
  std::condition_variable left_changed_;    ///< For threads that wait for helpers in their loop.
  std::vector<Loop*> open_;
  int asleep_ = 0;
  bool closed_ = false;
  std::atomic<std::uint32_t> changes_{};  ///< Counts loops that were opened, and the closing.
};

}  // namespace varimesh
