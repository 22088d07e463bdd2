#include "core/ranks/thread_ranks.h"

#include <algorithm>
#include <barrier>
#include <cassert>
#include <thread>

namespace varimesh {
namespace {

/// What the ranks have in common: a list for each, which the others read between two meetings.
struct Meeting {
  explicit Meeting(int count)
      : barrier(count), numbers(at(count)), places(at(count)), bytes(at(count)), messages(at(count)) {}
  static std::size_t at(int rank) { return static_cast<std::size_t>(rank); }

  std::barrier<> barrier;
  std::vector<std::vector<std::int64_t>> numbers;
  std::vector<std::vector<double>> places;
  std::vector<std::vector<Ranks::Bytes>> bytes;  // by sender and receiver
  std::vector<std::span<const Ranks::Message>> messages;
};

class ThreadRank : public Ranks {
 public:
  ThreadRank(Meeting& meeting, int rank) : meeting_(meeting), rank_(rank) {}

  int rank() const override { return rank_; }
  int count() const override { return static_cast<int>(meeting_.numbers.size()); }

  void sum(std::span<std::int64_t> numbers) const override {
    combine(meeting_.numbers, numbers, [](std::int64_t a, std::int64_t b) { return a + b; });
  }
  void largest(std::span<double> numbers) const override {
    combine(meeting_.places, numbers, [](double a, double b) { return std::max(a, b); });
  }
  std::vector<Bytes> exchange(std::vector<Bytes> to) const override {
    if (to.size() > 1) count_meeting();
    for (std::size_t other = 0; other < to.size(); ++other)
      if (other != Meeting::at(rank_)) count_message(to[other].size());
    meeting_.bytes[Meeting::at(rank_)] = std::move(to);
    meeting_.barrier.arrive_and_wait();
    std::vector<Bytes> came;
    for (std::vector<Bytes>& from : meeting_.bytes) came.push_back(std::move(from[Meeting::at(rank_)]));
    meeting_.barrier.arrive_and_wait();
    return came;
  }
  void exchange(std::span<const Message> messages) const override {
    for (const Message& message : messages) count_message(message.out.size());
    meeting_.messages[Meeting::at(rank_)] = messages;
    meeting_.barrier.arrive_and_wait();
    for (const Message& message : messages)
      for (const Message& theirs : meeting_.messages[Meeting::at(message.rank)])
        if (theirs.rank == rank_) {
          assert(theirs.out.size() == message.in.size());
          std::ranges::copy(theirs.out, message.in.begin());
        }
    meeting_.barrier.arrive_and_wait();
  }

 private:
  template <class T, class Combine>
  void combine(std::vector<std::vector<T>>& lists, std::span<T> numbers, const Combine& combine) const {
    if (lists.size() > 1) count_meeting();
    lists[Meeting::at(rank_)].assign(numbers.begin(), numbers.end());
    meeting_.barrier.arrive_and_wait();
    std::ranges::copy(lists.front(), numbers.begin());
    for (std::size_t r = 1; r < lists.size(); ++r)
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = combine(numbers[i], lists[r][i]);
    meeting_.barrier.arrive_and_wait();
  }

  Meeting& meeting_;
  int rank_;
};

}  // namespace

void run_as_ranks(int count, const std::function<void(const Ranks&)>& body) {
  Meeting meeting(count);
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < count; ++rank) threads.emplace_back([&, rank] { body(ThreadRank(meeting, rank)); });
}

}  // namespace varimesh
